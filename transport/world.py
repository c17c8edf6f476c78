"""A world ready for rays: meshes, materials and lights gathered into the arrays of the kernels, and Embree's trees.

What stands still is compiled once; what moves is compiled per frame and joined to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from materials.foundation.checks import check_finite, check_range, check_shape
from materials.foundation.errors import InputError
from materials.kernels import bsdf
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import DirectionalLight, EnvironmentLight, Film, Light, Material, PointLight, Shape, Simulation

from .embree import EmbreeScene
from .kernels import arrays as a

_KINDS = {
    "lambert": bsdf.LAMBERT,
    "ggx": bsdf.GGX,
    "coated": bsdf.COATED,
    "mirror": bsdf.MIRROR,
    "dielectric": bsdf.DIELECTRIC,
    "rough_dielectric": bsdf.ROUGH_DIELECTRIC,
    "emission": bsdf.EMISSION,
}
_TEXTURES = {
    a.ALBEDO_TEXTURE: "albedo_texture",
    a.ALPHA_TEXTURE: "alpha_texture",
    a.NORMAL_TEXTURE: "normal_texture",
    a.OPACITY_TEXTURE: "opacity_texture",
}
_RANGES = {
    "albedo": "[0, 1]",
    "albedo_scale": "[0, inf)",
    "eta": "(0, inf)",
    "alpha": "[0, inf)",
    "specular_scale": "[0, inf)",
    "emission": "[0, inf)",
}
# Beyond these the series of bounces inside a film and the tables of its rough surface have no meaning.
_FILM_RANGES = {"coverage": "[0, 1]", "thickness": "[0, inf)", "eta": "[1, 3]", "alpha": "[0, 1]", "sigma_a": "[0, inf)"}
# What water can lie on: glass, mirrors and lamps have no diffuse base for a film to darken.
_FILM_BASES = ("lambert", "ggx", "coated")


@dataclass(frozen=True)
class World:
    """A compiled simulation.

    Attributes
    ----------
    arrays, lights
        What the kernels take.
    shapes : tuple of Shape
        In the order of `arrays.face_shape`.
    scenes : tuple of EmbreeScene
        Kept alive as long as the world: the kernels hold bare handles.
    """

    arrays: a.WorldArrays
    lights: a.LightArrays
    shapes: tuple[Shape, ...]
    scenes: tuple[EmbreeScene, ...]


def compile_world(simulation: Simulation, reuse: World | None = None) -> World:
    """Compile a simulation for the tracer.

    Parameters
    ----------
    simulation : Simulation
        Shapes with `instance` 0 are static, all others move.
    reuse : World, optional
        An earlier frame of the same drive: if its static meshes are the same objects, their tree is kept.

    Raises
    ------
    InputError
        If a shape names an unknown material, has no triangles, or a value is not finite.
    """
    static = [s for s in simulation.shapes if s.instance == 0]
    moving = [s for s in simulation.shapes if s.instance != 0]
    if not static:
        static, moving = moving, []
    if not static:
        raise InputError("hold at least one shape", key="simulation.shapes")
    shapes = (*static, *moving)
    for shape in shapes:
        if shape.material not in simulation.materials:
            raise InputError(
                f"name one of {', '.join(simulation.materials)}", got=shape.material, key=f"material of shape {shape.name}"
            )
        if shape.mesh.num_faces == 0:
            raise InputError("have triangles", key=f"mesh of shape {shape.name}")
        _check_mesh(shape)
    vertices, faces, normals, uv, face_shape = _geometry(shapes)
    num_static = sum(s.mesh.num_faces for s in static)
    # A tree with more in it than is static now would report faces that this world does not have.
    kept = reuse is not None and reuse.arrays.num_static_faces == num_static and len(reuse.shapes) >= len(static)
    kept = kept and all(old.mesh is new.mesh for old, new in zip(reuse.shapes, static, strict=False))  # type: ignore[union-attr]
    tree = reuse.scenes[0] if kept and reuse is not None else EmbreeScene(vertices, faces[:num_static], 0)
    moving_tree = EmbreeScene(vertices, faces[num_static:], 1) if moving else None
    scenes = (tree,) if moving_tree is None else (tree, moving_tree)
    names = list(simulation.materials)
    kinds, values, slots, texels, info = _materials(simulation.materials)
    arrays = a.WorldArrays(
        static_scene=tree.handle,
        dynamic_scene=0 if moving_tree is None else moving_tree.handle,
        num_static_faces=num_static,
        has_cutouts=bool(np.any(slots[:, a.OPACITY_TEXTURE] >= 0)),
        vertices=vertices,
        faces=faces,
        normals=normals,
        uv=uv,
        face_shape=face_shape,
        shape_material=np.array([names.index(s.material) for s in shapes], np.int32),
        material_kind=kinds,
        material_values=values,
        material_textures=slots,
        texels=texels,
        texture_info=info,
    )
    return World(arrays, compile_lights(simulation.lights), shapes, scenes)


def with_lights(world: World, lights: dict[str, Light]) -> World:
    """Return the same geometry under other lights."""
    return replace(world, lights=compile_lights(lights))


def compile_lights(lights: dict[str, Light]) -> a.LightArrays:
    """Gather lights into arrays; there can be one environment.

    Raises
    ------
    InputError
        If there are two environments, a direction has no length, or a radiance is negative or not finite.
    """
    suns, points, panorama = [], [], np.zeros((0, 1, 3), np.float32)
    for name, light in lights.items():
        if isinstance(light, DirectionalLight):
            suns.append(_sun(light, name))
        elif isinstance(light, PointLight):
            check_finite(f"lights.{name}.position", light.position)
            _check_brightness(f"lights.{name}.intensity", light.intensity)
            points.append([*light.position, *light.intensity])
        else:
            if len(panorama):
                raise InputError("be the only environment", key=f"lights.{name}")
            panorama = _panorama(light, name)
    row_cdf, col_cdf = _distribution(panorama)
    return a.LightArrays(
        np.array(suns, np.float64).reshape(-1, 8), np.array(points, np.float64).reshape(-1, 6), panorama, row_cdf, col_cdf
    )


def compile_camera(camera: Camera) -> a.CameraArrays:
    """Turn a camera into the affine form of the kernels.

    Raises
    ------
    InputError
        If its lens distorts: the rays of this tracer are those of a pinhole or of parallel projection.
    """
    if camera.model == "OPENCV" and any((camera.k1, camera.k2, camera.p1, camera.p2)):
        raise InputError(
            "be PINHOLE or ORTHOGRAPHIC", got="OPENCV with distortion", key="camera", remedy="Undistort the images first."
        )
    R = camera.T_world_camera[:3, :3]
    origin = camera.position.copy()
    if camera.model == "ORTHOGRAPHIC":
        assert camera.pixel_size is not None
        step_x, step_y = R[:, 0] * camera.pixel_size, R[:, 1] * camera.pixel_size
        corner = origin - camera.cx * step_x - camera.cy * step_y
    else:
        step_x, step_y = R[:, 0] / camera.fx, R[:, 1] / camera.fy
        corner = R[:, 2] - camera.cx * step_x - camera.cy * step_y
    kind = camera.model == "ORTHOGRAPHIC"
    return a.CameraArrays(camera.width, camera.height, kind, origin, corner, step_x.copy(), step_y.copy(), R[:, 2].copy())


def _check_mesh(shape: Shape) -> None:
    mesh = shape.mesh
    for name, values in (("vertices", mesh.vertices), ("normals", mesh.normals), ("uv", mesh.uv)):
        if values is not None and not np.all(np.isfinite(values)):
            raise InputError("be finite", got="NaN or infinity", key=f"{name} of shape {shape.name}")
        if values is not None and len(values) != len(mesh.vertices):
            raise InputError(f"have a row per vertex, {len(mesh.vertices)}", got=len(values), key=f"{name} of shape {shape.name}")
    # The kernels trust indices: one out of range would read other memory.
    if mesh.faces.max() >= len(mesh.vertices):
        raise InputError(f"lie below {len(mesh.vertices)}", got=mesh.faces.max(), key=f"vertex indices of shape {shape.name}")


def _geometry(shapes: tuple[Shape, ...]) -> tuple[NDArray, ...]:
    meshes = [_completed(s.mesh) for s in shapes]
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    return (
        np.concatenate([m.vertices for m in meshes]).astype(np.float32),
        np.concatenate([m.faces + np.uint32(o) for m, o in zip(meshes, offsets, strict=True)]).astype(np.uint32),
        np.concatenate([m.normals for m in meshes]).astype(np.float32),  # type: ignore[misc]
        np.concatenate([m.uv for m in meshes]).astype(np.float32),  # type: ignore[misc]
        np.repeat(np.arange(len(shapes), dtype=np.int32), [m.num_faces for m in meshes]),
    )


def _completed(mesh: Mesh) -> Mesh:
    mesh = mesh if mesh.normals is not None else mesh.with_smooth_normals()
    return mesh if mesh.uv is not None else replace(mesh, uv=np.zeros((len(mesh.vertices), 2), np.float32))


def _materials(materials: dict[str, Material]) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    kinds = np.zeros(len(materials), np.int64)
    values = np.zeros((len(materials), a.NUM_VALUES), np.float64)
    slots = np.full((len(materials), a.NUM_TEXTURES), -1, np.int32)
    store = _TextureStore()
    for i, (name, m) in enumerate(materials.items()):
        for key, interval in _RANGES.items():
            check_range(f"materials.{name}.{key}", getattr(m, key), interval)
        kinds[i] = _KINDS[m.model]
        # A coat is smooth unless a texture says otherwise; `Material.alpha` is the width of other models.
        alpha = 0.0 if m.model == "coated" else m.alpha
        base = m.albedo if m.albedo_texture is None else (1.0, 1.0, 1.0)
        values[i, a.ALBEDO : a.ALBEDO + 3] = np.asarray(base) * m.albedo_scale
        values[i, a.SPECULAR_SCALE], values[i, a.ETA] = m.specular_scale, m.eta
        values[i, a.ALPHA_U] = values[i, a.ALPHA_V] = alpha if m.alpha_texture is None else 1.0
        if m.model == "ggx" and m.alpha_u is not None and m.alpha_v is not None:
            for key in ("alpha_u", "alpha_v"):
                check_range(f"materials.{name}.{key}", getattr(m, key), "[0, inf)")
            values[i, a.ALPHA_U], values[i, a.ALPHA_V] = m.alpha_u, m.alpha_v
        values[i, a.EMISSION : a.EMISSION + 3] = m.emission
        for slot, kind in _TEXTURES.items():
            slots[i, slot] = store.add(getattr(m, kind), f"materials.{name}.{kind}")
        if m.film is not None:
            if m.model not in _FILM_BASES:
                raise InputError(
                    f"be None unless the model is one of {', '.join(_FILM_BASES)}", got=m.model, key=f"materials.{name}.film"
                )
            for key, interval in _FILM_RANGES.items():
                check_range(f"materials.{name}.film.{key}", getattr(m.film, key), interval)
            _film(m.film, values[i], slots[i], store, f"materials.{name}.film")
        if not np.all(np.isfinite(values[i])):
            raise InputError("be finite", got="NaN or infinity", key=f"materials.{name}")
    return kinds, values, slots, *store.arrays()


def _film(film: Film, values: NDArray, slots: NDArray, store: _TextureStore, key: str) -> None:
    for kind, column, slot in (
        ("coverage", a.FILM_COVERAGE, a.COVERAGE_TEXTURE),
        ("thickness", a.FILM_THICKNESS, a.THICKNESS_TEXTURE),
    ):
        given = getattr(film, kind)
        is_texture = isinstance(given, np.ndarray)
        values[column] = 1.0 if is_texture else given
        slots[slot] = store.add(given, f"{key}.{kind}") if is_texture else -1
    values[a.FILM_ETA], values[a.FILM_ALPHA], values[a.FILM_LEVEL] = film.eta, film.alpha, film.level
    values[a.FILM_SIGMA_A : a.FILM_SIGMA_A + 3] = film.sigma_a


class _TextureStore:
    """Textures one after the other; the same array is stored once."""

    def __init__(self) -> None:
        self._textures: list[NDArray] = []
        self._index: dict[int, int] = {}

    def add(self, texture: NDArray | None, key: str) -> int:
        if texture is None:
            return -1
        if id(texture) not in self._index:
            if not np.all(np.isfinite(texture)):
                raise InputError("be finite", got="NaN or infinity", key=key)
            self._index[id(texture)] = len(self._textures)
            self._textures.append(texture)
        return self._index[id(texture)]

    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        if not self._textures:
            return np.zeros(1, np.float32), np.zeros((1, 4), np.int64)
        sizes = [t.size for t in self._textures]
        offsets = np.cumsum([0, *sizes[:-1]])
        info = [(o, t.shape[1], t.shape[0], 1 if t.ndim == 2 else t.shape[2]) for o, t in zip(offsets, self._textures, strict=True)]
        return np.concatenate([t.astype(np.float32).ravel() for t in self._textures]), np.array(info, np.int64)


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
