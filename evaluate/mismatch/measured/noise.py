"""Noise of measurements that do not state it, from what varies between neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls
from scipy.spatial import cKDTree

from materials.directions import spherical
from materials.measured.half_angles import half_angles

Floats = NDArray[np.float64]
_NEIGHBOURS, _BINS = 12, 12
_MAD = 1.4826


def of_directions(wi: Floats, wo: Floats, value: Floats) -> tuple[Floats, str]:
    """Return sigma (N, C) of a BRDF's samples (N, C), and in words how it was found.

    A plane is fitted to the twelve nearest samples about each one; by what the sample differs from it is noise, or finer
    than the sampling can tell. The median over samples of a level passes highlights over; over levels it is
    sigma² = a² + (b value)². Errors that neighbours share, of the instrument's scale and alignment, are not seen.
    """
    places = _places(wi, wo)
    count = min(_NEIGHBOURS + 1, len(value))
    near = cKDTree(places).query(places, k=count)[1][:, 1:]
    design = np.concatenate([np.ones((*near.shape, 1)), places[near] - places[:, None]], axis=2)
    # Prediction at the place itself: the first row of the pseudo-inverse, a weighted mean of the neighbours.
    rows = np.linalg.pinv(design, rcond=1e-3)[:, 0]
    foreseen = np.einsum("nk,nkc->nc", rows, value[near])
    scale = np.sqrt(1 + (rows**2).sum(axis=1))[:, None]
    a, b = _level(np.abs(value - foreseen) / scale, np.abs(0.5 * (value + foreseen)))
    a = max(a, _clipped_floor(value, near))
    words = (
        f"The measurement states no noise; from how samples differ from their neighbours it was estimated: sigma² = ({a:.3g})² + "
        f"({b:.3g} value)². What varies faster than the samples lie counts as noise; errors that neighbours share do not."
    )
    return np.sqrt(a**2 + (b * value) ** 2), words


def _places(wi: Floats, wo: Floats) -> Floats:
    """Return where pairs of directions lie (N, 4) for a search of neighbours; both sides of the plane of incidence are one."""
    theta_i = np.arccos(np.clip(wi[:, 2], -1, 1))
    azimuth = np.arctan2(wi[:, 0] * wo[:, 1] - wi[:, 1] * wo[:, 0], (wi[:, :2] * wo[:, :2]).sum(axis=1))
    viewed = spherical(np.arccos(np.clip(wo[:, 2], -1, 1)), np.abs(azimuth))[:, :2]
    theta_h, _, _ = half_angles(wi.copy(), wo.copy())
    return np.column_stack([theta_i, viewed, np.sqrt(theta_h)])


def of_pictures(pictures: Floats) -> tuple[float, float, str]:
    """Return (a, b) of sigma² = a² + (b value)² of pictures (H, W, N), NaN where nothing is seen; and how it was found.

    From the corners of 2 x 2 pixels, which slopes and edges along rows and columns cannot be seen in; the median passes
    highlights and outlines over.
    """
    p = pictures
    corner = np.abs(p[1:, 1:] - p[:-1, 1:] - p[1:, :-1] + p[:-1, :-1]) / 2
    level = 0.25 * np.abs(p[1:, 1:] + p[:-1, 1:] + p[1:, :-1] + p[:-1, :-1])
    seen = np.isfinite(corner)
    a, b = _level(corner[seen], level[seen])
    words = (
        f"The photographs state no noise; from the finest differences of pixels it was estimated: sigma² = ({a:.3g})² + "
        f"({b:.3g} value)². Texture counts as noise."
    )
    return a, b, words


def rising_share(sigma: Floats, value: Floats) -> float:
    """Return b >= 0 of sigma² = a² + (b value)², as sigmas (N, C) of values have it."""
    square, x = sigma.ravel() ** 2, value.ravel() ** 2
    (_, b2), _ = nnls(np.stack([1 / square, x / square], axis=1), np.ones(len(x)))
    return float(np.sqrt(b2))


def _clipped_floor(value: Floats, near: NDArray[np.int64]) -> float:
    """Return the level below which an instrument that writes zeros sees nothing: what the positive neighbours of zeros have."""
    zero = value == 0
    if zero.mean() < 0.01:
        return 0.0
    beside = value[near][zero.nonzero()[0], :, zero.nonzero()[1]]
    return float(np.median(beside[beside > 0])) if (beside > 0).any() else 0.0


def of_levels(condition: Floats, value: Floats) -> tuple[Floats, str]:
    """Return sigma (N, C) of records (N, C) under a condition: from records whose condition is next, per wavelength."""
    order = np.argsort(condition, kind="stable")
    if len(order) < 3:
        return np.full(value.shape, 0.05 * max(float(value.mean()), 1e-9)), "Too few records to estimate noise: 5 % is taken."
    step = np.diff(value[order], axis=0) / np.sqrt(2)
    sigma = _MAD * np.median(np.abs(step), axis=0)
    sigma = np.maximum(sigma, 1e-6 * max(float(np.abs(value).max()), 1e-12))
    words = (
        f"The measurement states no noise; from records that follow each other in the condition it was estimated, per wavelength: "
        f"{sigma.min():.3g} to {sigma.max():.3g}. It holds all that differs between such records (sun, place, shadow)."
    )
    return np.broadcast_to(sigma, value.shape).copy(), words


def _level(error: Floats, level: Floats) -> tuple[float, float]:
    """Return (a, b) of sigma² = a² + b² level² from absolute errors (N, C) at levels."""
    error, level = error.ravel(), level.ravel()
    edges = np.quantile(level, np.linspace(0, 1, _BINS + 1))
    index = np.clip(np.searchsorted(edges, level, "right") - 1, 0, _BINS - 1)
    rows = []
    for k in range(_BINS):
        own = index == k
        if own.sum() >= 5:
            rows.append((_MAD * np.median(error[own]), np.sqrt(np.mean(level[own] ** 2))))
    s, v = np.array(rows).T
    # In logarithms, as levels span decades; the floor is where quantised zeros would have none.
    tiny = 1e-3 * float(np.median(level)) + 1e-9 * float(level.max())
    s = np.log(np.maximum(s, tiny))

    def misfit(x: Floats) -> Floats:
        return 0.5 * np.logaddexp(2 * x[0], 2 * x[1] + 2 * np.log(np.maximum(v, tiny))) - s

    found = least_squares(misfit, [s.min(), float(np.median(s - np.log(np.maximum(v, tiny))))], loss="soft_l1", f_scale=0.2)
    return float(np.exp(found.x[0])), float(np.exp(found.x[1]))
