"""Media for the tracer: fog in a box or everywhere, thinning with height, of any density on a grid, or spray over a ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from materials.foundation.checks import check_finite, check_range, check_shape, check_unit
from materials.foundation.errors import InputError
from materials.phase import droplets, henyey_greenstein
from scene.kernels.wakes import COLUMNS
from scene.simulation import Material, Medium
from scene.wetting.spray import Spray

from .kernels import media as kernel
from .kernels.bodies import BodyArrays
from .kernels.media import MediumArrays

__all__ = ["BodyArrays", "MediumArrays", "both_or_none", "compile_bodies", "compile_medium", "compile_spray", "transmittance"]

# Cells of the grid of bounds per axis, at most: walking costs per cell, loose bounds cost per tentative collision.
_MAJORANT_CELLS = 16


def compile_medium(medium: Medium) -> MediumArrays:
    """Return a medium as the kernels take it.

    Raises
    ------
    InputError
        If a number is out of range, the box is turned inside out, or a density has no box to fill, or stands beside a
        scale height.
    """
    check_range("medium.sigma_t", medium.sigma_t, "[0, inf)")
    check_range("medium.albedo", medium.albedo, "[0, 1]")
    if medium.scale_height is not None:
        check_range("medium.scale_height", medium.scale_height, "(0, inf)")
    low, high = medium.bounds or ((-np.inf,) * 3, (np.inf,) * 3)
    if not all(a < b for a, b in zip(low, high, strict=True)):
        raise InputError("be the lower and the upper corner of a box", got=medium.bounds, key="medium.bounds")
    density, majorant = np.zeros((1, 1, 1), np.float32), np.zeros((1, 1, 1), np.float32)
    kind = kernel.EVEN if medium.scale_height is None else kernel.HEIGHT
    if medium.density is not None:
        if medium.bounds is None or medium.scale_height is not None:
            raise InputError("have bounds, and no scale_height", key="a medium with a density")
        kind = kernel.GRID
        check_shape("medium.density", medium.density, (None, None, None))
        check_range("medium.density", medium.density, "[0, inf)")
        check_finite("medium.density", medium.density)
        density = np.ascontiguousarray(medium.density, np.float32)
        majorant = _upper_bounds(density) * np.float32(medium.sigma_t)
    phase = henyey_greenstein(medium.g) if medium.droplet_diameter_um is None else droplets(medium.droplet_diameter_um)
    return MediumArrays(
        kind,
        float(medium.sigma_t),
        np.array(medium.albedo, np.float64),
        np.array(phase, np.float64),
        np.array(low, np.float64),
        np.array(high, np.float64),
        1.0 if medium.scale_height is None else float(medium.scale_height),
        float(medium.base_z),
        density,
        majorant,
        np.zeros((1, 1), np.float32),
        np.array([0.0, 0.0, 1.0]),
        np.array([1.0, 0.0, 1.0, 0.0]),
        np.uint64(0),
        np.zeros((0, COLUMNS)),
        np.full(3, np.inf),
        np.full(3, -np.inf),
    )


def compile_bodies(materials: dict[str, Material]) -> BodyArrays | None:
    """Return what fills the bodies, a row per material, or None if nothing does.

    Raises
    ------
    InputError
        If a body is not of glass, or its medium has bounds or is not even.
    """
    if all(m.interior is None for m in materials.values()):
        return None
    n = len(materials)
    bodies = BodyArrays(np.zeros(n), np.zeros((n, 3)), np.zeros((n, 4)), np.zeros(n, np.bool_))
    for i, (name, m) in enumerate(materials.items()):
        if m.interior is None:
            continue
        if m.model not in ("dielectric", "rough_dielectric"):
            remedy = "Use dielectric, with eta 1 for a body without a surface."
            raise InputError(
                "be dielectric or rough_dielectric to have an interior", got=m.model, key=f"materials.{name}", remedy=remedy
            )
        filling = compile_medium(m.interior)
        if filling.kind != kernel.EVEN or m.interior.bounds is not None:
            raise InputError("be even and without bounds", got=m.interior, key=f"materials.{name}.interior")
        bodies.sigma_t[i], bodies.albedo[i], bodies.phase[i] = filling.sigma_t, filling.albedo, filling.phase
        bodies.matched[i] = m.model == "dielectric" and m.eta == 1.0 and filling.sigma_t > 0
    return bodies


def both_or_none(
    medium: MediumArrays | None, bodies: BodyArrays | None, num_materials: int
) -> tuple[MediumArrays, BodyArrays] | tuple[None, None]:
    """Return medium and bodies, the missing one empty; None for both if there is neither."""
    if medium is None and bodies is None:
        return None, None
    n = num_materials
    empty = BodyArrays(np.zeros(n), np.zeros((n, 3)), np.zeros((n, 4)), np.zeros(n, np.bool_))
    return medium or compile_medium(Medium(0.0)), bodies or empty


def compile_spray(spray: Spray) -> MediumArrays:
    """Return spray and mist over a ground as the kernels take them.

    Examples
    --------
    Give it to a world that has been compiled: `dataclasses.replace(world, medium=compile_spray(spray))`.
    """
    low, high = spray.box()
    settings = spray.settings
    return MediumArrays(
        kernel.SPRAY,
        spray.sigma,
        np.full(3, settings.albedo),
        np.array(droplets(settings.droplet_diameter_um), np.float64),
        low,
        high,
        settings.scale_height,
        0.0,
        np.zeros((1, 1, 1), np.float32),
        spray.upper_bounds(),
        spray.ground,
        spray.frame,
        spray.noise,
        spray.seed_bits,
        spray.wakes,
        *spray.wake_box(),
    )


def transmittance(
    medium: MediumArrays, origins: ArrayLike, directions: ArrayLike, distances: ArrayLike, samples: int = 1, seed: int = 0
) -> NDArray[np.float64]:
    """Return the share of light that gets along straight lines.

    Parameters
    ----------
    medium : MediumArrays
        From `compile_medium`.
    origins, directions : (N, 3) float
        Starts [m] and unit vectors.
    distances : (N,) float
        How far [m]; infinity is allowed.
    samples : int
        Estimates per line, where there is no closed form.
    seed : int

    Returns
    -------
    transmittance : (N,) float64
        In [0, 1]; a single tracked estimate may exceed 1, its mean does not.

    Examples
    --------
    >>> fog = compile_medium(Medium(0.1))
    >>> round(float(transmittance(fog, [[0, 0, 0]], [[1, 0, 0]], [10.0])[0]), 4)
    0.3679
    """
    o, d = np.ascontiguousarray(origins, np.float64), np.ascontiguousarray(directions, np.float64)
    far = np.minimum(np.asarray(distances, np.float64), kernel.FAR)
    check_shape("origins", o, (None, 3))
    check_shape("directions", d, (len(o), 3))
    check_unit("directions", d)
    check_range("distances", far, "[0, inf)")
    check_shape("distances", far, (len(o),))
    check_range("samples", samples, "[1, 1073741824]")
    out = np.empty(len(o))
    kernel.transmittance_many(medium, o, d, far, samples, seed & 0xFFFFFFFF, out)
    return out


def _upper_bounds(density: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest density in each cell of a coarser grid over the same box, what is interpolated into it included."""
    bound = maximum_filter(density, size=3, mode="nearest")
    for axis, count in enumerate(density.shape):
        cells = min(count, _MAJORANT_CELLS)
        # A cell of the coarse grid may begin and end within cells of the fine one: both belong to it.
        first = np.arange(cells) * count // cells
        last = -(-np.arange(1, cells + 1) * count // cells)
        parts = [bound.take(range(a, b), axis=axis).max(axis=axis, keepdims=True) for a, b in zip(first, last, strict=True)]
        bound = np.concatenate(parts, axis=axis)
    return np.ascontiguousarray(bound)
