"""Lights as the kernels take them: rows of numbers, a panorama, and the tables it is sampled by."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from materials.foundation.checks import check_finite, check_range, check_shape
from materials.foundation.errors import InputError
from scene.simulation import DirectionalLight, EnvironmentLight, Light, PointLight

from .kernels import arrays as a


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
