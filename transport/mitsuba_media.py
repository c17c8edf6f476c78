"""A medium of simulation/1 in Mitsuba's terms: a cube without a surface that holds it; and what is inside bodies."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.simulation import Medium

# Mitsuba has no medium that thins with height but one on a grid: linear between so many heights.
_HEIGHTS = 512


def medium(mitsuba: ModuleType, m: Medium, eye: NDArray[np.float64]) -> tuple[dict[str, Any], Any | None]:
    """Return the cube of a medium, and the medium itself if the eye is within it (Mitsuba's camera must be told).

    Raises
    ------
    InputError
        If it has no bounds, or scatters as droplets do.
    """
    if m.bounds is None or m.droplet_diameter_um is not None:
        got = "droplets" if m.droplet_diameter_um is not None else "no bounds"
        raise InputError("have bounds and a g to be exported", got=got, key="medium")
    low, high = np.array(m.bounds, float)
    filling = _filling(mitsuba, m, low, high)
    t = mitsuba.ScalarTransform4f
    to_world = t().translate(((low + high) / 2).tolist()) @ t().scale(((high - low) / 2).tolist())
    cube = {"type": "cube", "to_world": to_world, "bsdf": {"type": "null"}, "interior": filling}
    inside = bool(np.all(eye > low) and np.all(eye < high))
    return cube, filling if inside else None


def interior(mitsuba: ModuleType, m: Medium) -> Any:
    """Return the even medium inside a body."""
    return _filling(mitsuba, m, np.zeros(3), np.ones(3))


def _filling(mitsuba: ModuleType, m: Medium, low: NDArray, high: NDArray) -> Any:
    albedo = {"type": "rgb", "value": [float(a) for a in m.albedo]}
    entry: dict[str, Any] = {"phase": {"type": "hg", "g": float(m.g)}, "albedo": {"type": "constvolume", "value": albedo}}
    if m.scale_height is None and m.density is None:
        return mitsuba.load_dict(entry | {"type": "homogeneous", "sigma_t": float(m.sigma_t)})
    if m.density is not None:
        # The values of both stand at the centres of cells.
        grid = m.density[..., None] * m.sigma_t
    else:
        # Values at the centres of so many layers.
        z = low[2] + (np.arange(_HEIGHTS) + 0.5) / _HEIGHTS * (high[2] - low[2])
        grid = np.broadcast_to((m.sigma_t * np.exp(-(z - m.base_z) / m.scale_height))[:, None, None, None], (_HEIGHTS, 2, 2, 1))
    t = mitsuba.ScalarTransform4f
    volume = {
        "type": "gridvolume",
        "grid": mitsuba.VolumeGrid(np.ascontiguousarray(grid, np.float32)),
        "to_world": t().translate(low.tolist()) @ t().scale((high - low).tolist()),
        "wrap_mode": "clamp",
    }
    return mitsuba.load_dict(entry | {"type": "heterogeneous", "sigma_t": volume})
