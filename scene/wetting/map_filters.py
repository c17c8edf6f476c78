"""Filters of top-view maps that know where a map was measured: local planes, weighted blur, smooth filling of holes."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ..kernels import terrain as kernel

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class LocalPlane:
    """The plane that fits a map best around each cell, under Gaussian weights.

    Attributes
    ----------
    level : (rows, cols) float32
        Its height above the cell's centre, in the map's unit; NaN where nothing was measured nearby.
    slope_x, slope_y : (rows, cols) float32
        Its rise per metre along x and y.
    """

    level: NDArray[np.float32]
    slope_x: NDArray[np.float32]
    slope_y: NDArray[np.float32]


def gaussian_taps(sigma_cells: float) -> NDArray[np.float64]:
    """Return the weights of a Gaussian over cells, cut at 4 sigma, summing to 1.

    Each is the integral over its cell, so that a sigma far below the cell tends to no filter at all.
    """
    radius = max(int(np.ceil(4 * sigma_cells)), 1)
    edges = np.arange(-radius, radius + 2) - 0.5
    taps = np.diff(ndtr(edges / max(sigma_cells, 1e-6)))
    taps = (taps + taps[::-1]) / 2
    return taps / taps.sum()


def fit_local_plane(values: Floats, weight: Floats, sigma: float, cell: float) -> LocalPlane:
    """Fit a plane around each cell, with Gaussian weights times the weight of each cell.

    Where all cells are measured the level is the plain Gaussian blur. Near the edge of what was measured a blur would be
    biased by any slope (by 0.8 sigma times the slope); a plane is not. This is normalised convolution of first order
    (Knutsson and Westin, CVPR 1993).

    Parameters
    ----------
    values, weight : (rows, cols) float
        The map, and how far each cell was measured, 0 to 1.
    sigma : float
        Standard deviation of the Gaussian [m].
    cell : float
        Size of a cell [m].
    """
    g0 = gaussian_taps(sigma / cell)
    t = np.arange(len(g0)) - len(g0) // 2
    taps = (g0, g0 * t, g0 * t * t)
    # Heights about their mean keep single precision below a micrometre of error.
    total = float(weight.sum(dtype=np.float64))
    mean = float((weight * values).sum(dtype=np.float64) / total) if total > 0 else 0.0
    moments = _moments(weight.astype(np.float32), taps, ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)))
    loads = _moments((weight * (values - mean)).astype(np.float32), taps, ((0, 0), (1, 0), (0, 1)))
    level, slope_x, slope_y = (np.empty(values.shape, np.float32) for _ in range(3))
    variance = float((g0 * t * t).sum())
    kernel.local_plane(moments, loads, 0.01 * variance + 1e-9, level, slope_x, slope_y)
    return LocalPlane(level + np.float32(mean), slope_x / np.float32(cell), slope_y / np.float32(cell))


def wide_slopes(
    values: Floats, weight: Floats, sigma: float, cell: float, origin: tuple[int, int] = (0, 0)
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the slopes of `fit_local_plane` for a sigma of many cells, fitted on blocks of cells and interpolated between.

    A block is at most an eighth of sigma wide, which blurs the Gaussian by less than 0.1 % of its width and costs sigma^2
    less time.

    Parameters
    ----------
    values, weight, sigma, cell
        As in `fit_local_plane`.
    origin : (row, col)
        Index of the first cell in the world. Blocks lie on multiples of their size there, so that another extent of the map
        gives the same slopes.

    Returns
    -------
    slope_x, slope_y : (rows, cols) float32
        Rise per metre along x and y; 0 where nothing was measured nearby.
    """
    rows, cols = values.shape
    f = max(int(sigma / (8 * cell)), 1)
    top, left = origin[0] % f, origin[1] % f
    pads = ((top, -(top + rows) % f), (left, -(left + cols) % f))
    w = np.pad(weight, pads).astype(np.float64)
    v = np.pad(values, pads) * w
    blocks = [x.reshape(x.shape[0] // f, f, -1, f).sum(axis=(1, 3)) for x in (w, v)]
    plane = fit_local_plane(blocks[1] / np.maximum(blocks[0], 1e-9), blocks[0] / f**2, sigma, f * cell)
    slopes = []
    for slope in (plane.slope_x, plane.slope_y):
        # Between the centres of the blocks, as OpenCV aligns them; beyond the outermost they are held.
        fine = cv2.resize(np.nan_to_num(slope), (w.shape[1], w.shape[0]), interpolation=cv2.INTER_LINEAR)
        slopes.append(np.ascontiguousarray(fine[top : top + rows, left : left + cols]))
    return slopes[0], slopes[1]


def blur(values: Floats, weight: Floats, sigma: float, cell: float) -> NDArray[np.float32]:
    """Return the Gaussian mean of the measured cells around each; NaN where there are none, the values where sigma is 0."""
    if sigma <= 0:
        return values.astype(np.float32)
    g = gaussian_taps(sigma / cell)
    sums = [_moments((weight * v).astype(np.float32), (g,), ((0, 0),))[0] for v in (np.ones_like(values), values)]
    return np.where(sums[0] > 1e-4, sums[1] / np.maximum(sums[0], 1e-4), np.nan).astype(np.float32)


def fill_holes(values: Floats, known: NDArray[np.bool_], sweeps: int = 30) -> NDArray[np.float32]:
    """Return the map with unknown cells filled by a membrane stretched over the known ones.

    Coarse to fine: each level starts from the one of half the resolution and is relaxed, so that wide holes are smooth.
    """
    values = np.where(known, values, 0).astype(np.float64)
    if known.all() or not known.any():
        return values.astype(np.float32)
    if min(values.shape) > 1:
        rows, cols = values.shape
        padded = ((0, rows % 2), (0, cols % 2))
        v, k = np.pad(values, padded), np.pad(known.astype(np.float64), padded)
        count = k.reshape(len(k) // 2, 2, -1, 2).sum(axis=(1, 3))
        coarse = v.reshape(len(v) // 2, 2, -1, 2).sum(axis=(1, 3)) / np.maximum(count, 1)
        coarse = fill_holes(coarse, count > 0, sweeps)
        start = np.repeat(np.repeat(coarse, 2, axis=0), 2, axis=1)[:rows, :cols]
    else:
        start = np.full(values.shape, values[known].mean())
    filled = np.where(known, values, start)
    kernel.relax(filled, known, sweeps)
    return filled.astype(np.float32)


def _moments(source: NDArray[np.float32], taps: tuple[NDArray, ...], orders: tuple[tuple[int, int], ...]) -> NDArray[np.float32]:
    """Return the map filtered along x by `taps[p]` and along y by `taps[q]` for each order (p, q)."""
    out = np.empty((len(orders), *source.shape), np.float32)
    row = np.empty_like(source)
    for p in sorted({p for p, _ in orders}):
        kernel.correlate_rows(source, taps[p], row)
        for n, (px, q) in enumerate(orders):
            if px == p:
                kernel.correlate_columns(row, taps[q], out[n])
    return out
