"""Lights as the kernels take them: rows of numbers, a panorama, and the tables it is sampled by."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from materials.foundation.checks import check_finite, check_range, check_shape
from materials.foundation.errors import InputError
from materials.kernels import kinds
from scene.simulation import DirectionalLight, EnvironmentLight, Light, PointLight, SphereLight

from .kernels import arrays as a


def compile_lights(lights: dict[str, Light], world: a.WorldArrays | None = None) -> a.LightArrays:
    """Gather lights into arrays; there can be one environment.

    Parameters
    ----------
    lights : dict of Light
        Rectangles are geometry: `compile_world` has made shapes of them, here they are passed over.
    world : WorldArrays, optional
        Whose glowing triangles are lamps too.

    Raises
    ------
    InputError
        If there are two environments, a direction has no length, a sphere no radius, or a radiance is negative or not
        finite.
    """
    suns, points, spheres, panorama = [], [], [], np.zeros((0, 1, 3), np.float32)
    for name, light in lights.items():
        if isinstance(light, DirectionalLight):
            suns.append(_sun(light, name))
        elif isinstance(light, PointLight):
            check_finite(f"lights.{name}.position", light.position)
            _check_brightness(f"lights.{name}.intensity", light.intensity)
            points.append([*light.position, *light.intensity])
        elif isinstance(light, SphereLight):
            spheres.append(_sphere(light, name))
        elif isinstance(light, EnvironmentLight):
            if len(panorama):
                raise InputError("be the only environment", key=f"lights.{name}")
            panorama = _panorama(light, name)
    row_cdf, col_cdf = _distribution(panorama)
    # What is black is no lamp: it would be an interval without width in the table.
    rows = [np.array(spheres, np.float64).reshape(-1, a.NUM_EMITTER_VALUES)]
    weights = [4 * np.pi * rows[0][:, a.EMITTER_RADIUS] ** 2 * rows[0][:, a.EMITTER_RADIANCE :][:, :3].mean(axis=1)]
    if world is not None:
        triangles, power = _glowing_triangles(world)
        rows.append(triangles)
        weights.append(power)
    cdf = np.concatenate([[0.0], np.cumsum(np.concatenate(weights))])
    total = float(cdf[-1])
    return a.LightArrays(
        np.array(suns, np.float64).reshape(-1, 8),
        np.array(points, np.float64).reshape(-1, 6),
        panorama,
        row_cdf,
        col_cdf,
        np.concatenate(rows),
        cdf / total if total > 0 else cdf,
        total,
        np.zeros(1, np.float32) if world is None else world.texels,
        np.zeros((1, 4), np.int64) if world is None else world.texture_info,
    )


def sphere_table(lights: a.LightArrays) -> NDArray[np.float64]:
    """Return centre and radius (n, 4) of the glowing spheres, which rays must be able to meet."""
    spheres = lights.emitters[lights.emitters[:, a.EMITTER_KIND] == a.SPHERE]
    return np.ascontiguousarray(spheres[:, [a.EMITTER_CORNER, a.EMITTER_CORNER + 1, a.EMITTER_CORNER + 2, a.EMITTER_RADIUS]])


def _sphere(light: SphereLight, name: str) -> list[float]:
    check_finite(f"lights.{name}.position", light.position)
    check_range(f"lights.{name}.radius", light.radius, "(0, inf)")
    _check_brightness(f"lights.{name}.intensity", light.intensity)
    if not any(light.intensity):
        raise InputError("be positive in a channel", got=light.intensity, key=f"lights.{name}.intensity", remedy="Leave it out.")
    row = [0.0] * a.NUM_EMITTER_VALUES
    row[a.EMITTER_KIND], row[a.EMITTER_RADIUS], row[a.EMITTER_TEXTURE] = a.SPHERE, light.radius, -1.0
    row[a.EMITTER_CORNER : a.EMITTER_CORNER + 3] = light.position
    # Seen from afar it is a disc of area pi r^2.
    row[a.EMITTER_RADIANCE : a.EMITTER_RADIANCE + 3] = [i / (np.pi * light.radius**2) for i in light.intensity]
    return row


def _glowing_triangles(world: a.WorldArrays) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rows of `LightArrays.emitters` and their weights, area times mean radiance."""
    glows = (world.material_kind == kinds.EMISSION) & (world.material_values[:, a.EMISSION_MEAN] > 0)
    material = world.shape_material[world.face_shape]
    faces = np.flatnonzero(glows[material])
    corners = world.faces[faces]
    p = world.vertices[corners].astype(np.float64)
    uv = world.uv[corners].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    values = world.material_values[material[faces]]
    weight = 0.5 * np.linalg.norm(np.cross(e1, e2), axis=1) * values[:, a.EMISSION_MEAN]
    rows = np.zeros((len(faces), a.NUM_EMITTER_VALUES))
    rows[:, a.EMITTER_KIND] = a.TRIANGLE
    for column, block in (
        (a.EMITTER_CORNER, p[:, 0]),
        (a.EMITTER_EDGE1, e1),
        (a.EMITTER_EDGE2, e2),
        (a.EMITTER_RADIANCE, values[:, a.EMISSION : a.EMISSION + 3]),
        (a.EMITTER_UV, np.concatenate([uv[:, 0], uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]], axis=1)),
    ):
        rows[:, column : column + block.shape[1]] = block
    rows[:, a.EMITTER_TEXTURE] = world.material_textures[material[faces], a.EMISSION_TEXTURE]
    rows[:, a.EMITTER_ONE_SIDED] = values[:, a.ONE_SIDED]
    # Triangles without area cannot be found.
    kept = weight > 0
    return rows[kept], weight[kept]


def _sun(light: DirectionalLight, name: str) -> list[float]:
    direction = -np.asarray(light.direction, np.float64)
    length = np.linalg.norm(direction)
    if not length > 0:
        raise InputError("have a length", got=light.direction, key=f"lights.{name}.direction")
    _check_brightness(f"lights.{name}.irradiance", light.irradiance)
    check_range(f"lights.{name}.angular_radius", light.angular_radius, "[0, 1.5]")
    cos = float(np.cos(light.angular_radius))
    solid_angle = 2 * np.pi * (1 - cos)
    # A disc of radiance L gives a plane that faces it L pi sin^2, and carries L times its solid angle.
    power = np.asarray(light.irradiance, np.float64) * 2 / (1 + cos)
    return [*(direction / length), *power, cos, solid_angle]


def _panorama(light: EnvironmentLight, name: str) -> NDArray[np.float32]:
    panorama = light.panorama
    if panorama is None:
        _check_brightness(f"lights.{name}.radiance", light.radiance)
        if not any(light.radiance):
            return np.zeros((0, 1, 3), np.float32)
        panorama = np.broadcast_to(np.array(light.radiance, np.float32), (8, 16, 3))
    check_shape(f"lights.{name}.panorama", panorama, (None, None, None))
    panorama = np.ascontiguousarray(panorama[..., :3], np.float32)
    _check_brightness(f"lights.{name}.panorama", panorama)
    return panorama


def _check_brightness(key: str, value: ArrayLike) -> None:
    values = np.asarray(value, np.float64)
    if not np.all(np.isfinite(values)) or values.min() < 0:
        raise InputError("be finite and not negative", got=values.min(), key=key)


def _distribution(panorama: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return cumulative distributions over rows, and over the columns of each row, by brightness and solid angle."""
    height = len(panorama)
    if height == 0:
        return np.zeros(1), np.zeros((0, 2))
    # Look-up is bilinear: a texel must not have density 0 if its neighbour shines into it.
    bright = maximum_filter(panorama.mean(axis=2, dtype=np.float64), size=3, mode=("nearest", "wrap"))
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    weights = (bright + 1e-3 * bright.mean() + 1e-30) * (edges[:-1] - edges[1:])[:, None]
    rows = np.concatenate([[0.0], np.cumsum(weights.sum(axis=1))])
    cols = np.concatenate([np.zeros((height, 1)), np.cumsum(weights, axis=1)], axis=1)
    return rows / rows[-1], cols / cols[:, -1:]
