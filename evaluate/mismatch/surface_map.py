"""Maps on surfaces: what all frames together say about each place of a shape, gathered in bins of its texture coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, label, map_coordinates

from .case import Case, Floats
from .effect import Context

BINS = 128


def pieces_of(case: Case, shape: int) -> NDArray[np.int64]:
    """Return the pieces of a shape that fill at least half of their pixel."""
    return np.flatnonzero((case.pieces.shape == shape) & (case.pieces.weight >= 0.5))


def bins(case: Case, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the bin of each piece, row by row of the texture."""
    uv = case.pieces.uv[rows] % 1.0
    index = np.minimum((uv * BINS).astype(np.int64), BINS - 1)
    return index[:, 1] * BINS + index[:, 0]


def gathered(values: NDArray, index: NDArray[np.int64], blur: float = 1.0) -> NDArray[np.float64]:
    """Return sums of values (N, C) per bin (C, BINS, BINS), blurred; texture coordinates repeat."""
    out = np.stack([np.bincount(index, v, BINS * BINS).reshape(BINS, BINS) for v in values.T]).astype(np.float64)
    return np.stack([gaussian_filter(o, blur, mode="wrap") for o in out]) if blur > 0 else out


def looked_up(field: NDArray, uv: Floats) -> Floats:
    """Return a map (BINS, BINS) at texture coordinates (N, 2), bilinear, repeating."""
    at = (uv[:, ::-1].T % 1.0) * BINS - 0.5
    return map_coordinates(field, at, order=1, mode="grid-wrap").astype(np.float32)


def ratio_map(case: Case, shape: int, c: Context) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return by which share (3, BINS, BINS) recording and prediction differ at each place of a shape, and how surely.

    The second is in standard deviations of noise, over all channels. The best factor of a bin is
    sum w I (R - L) / sum w I².
    """
    rows = pieces_of(case, shape)
    pixel = case.pieces.pixel[rows]
    L = c.picture.reshape(-1, 3)[pixel]
    r = c.residual.reshape(-1, 3)[pixel]
    w = c.weight.reshape(-1, 3)[pixel]
    index = bins(case, rows)
    top, bottom = gathered(w * L * r, index), gathered(w * L * L, index)
    noise = np.sqrt(np.maximum(gathered(w * L * L, index, 0.0), 0))
    ratio = np.where(bottom > 1e-9, top / np.maximum(bottom, 1e-9), 0.0)
    # A blurred sum over bins of like weight: blur by 1 bin averages 4 pi bins.
    surely = ratio.mean(axis=0) * np.sqrt(gaussian_filter((noise**2).sum(axis=0), 1.0, mode="wrap") * 4 * np.pi)
    return ratio, surely


def region(case: Case, shape: int, c: Context, least: float = 0.03, sigmas: float = 6.0) -> tuple[Floats, int] | None:
    """Return the place of a shape where it is darker or brighter than predicted, as a soft mask of its pieces (N,).

    With it comes the sign: -1 where it is darker. The mask is the map of the ratio over its peak, cut at 0 and 1, in the
    connected parts where it is beyond half of it. None if no part is surely (`sigmas`) and notably (`least`) off, or
    most of the shape is.
    """
    ratio, surely = ratio_map(case, shape, c)
    mean = ratio.mean(axis=0)
    seen = surely != 0
    if not seen.any():
        return None
    mean = mean - np.median(mean[seen])
    smooth = gaussian_filter(mean, 1.0, mode="wrap")
    strong = (np.abs(surely) > sigmas) & seen
    if strong.sum() < 6:
        return None
    best: list[tuple[float, NDArray[np.float64], int]] = []
    for sign in (-1, 1):
        values = sign * smooth
        peak = float(np.quantile(values[strong], 0.95)) if strong.any() else 0.0
        if peak < least:
            continue
        parts, count = label(values > 0.5 * peak)
        if count == 0:
            continue
        area = np.bincount(parts.ravel(), minlength=count + 1)[1:]
        keep = 1 + np.flatnonzero(area >= max(6, 0.2 * area.max()))
        inside = np.isin(parts, keep)
        if inside.sum() > 0.6 * seen.sum():
            continue
        level = float(np.median(values[inside & (values > 0.75 * peak)]))
        soft = np.clip(sign * mean / max(level, 1e-6), 0, 1) * (gaussian_filter(inside.astype(float), 1.5, mode="wrap") > 0.08)
        power = float((soft * surely**2).sum())
        if not best or power > best[0][0]:
            best = [(power, soft, sign)]
    if not best:
        return None
    mask = np.zeros(len(case.pieces), np.float32)
    rows = np.flatnonzero(case.pieces.shape == shape)
    mask[rows] = looked_up(best[0][1], case.pieces.uv[rows])
    return mask, best[0][2]


def refined_mask(case: Case, shape: int, mask: Floats, c: Context, derivative: Floats) -> Floats:
    """Return a region's mask (N,) after a Gauss-Newton step of each bin, within 2 bins of where it was.

    Parameters
    ----------
    derivative : (F, H, W, 3) float32
        Of the picture by the mask.
    """
    rows = pieces_of(case, shape)
    pixel = case.pieces.pixel[rows]
    d, r, w = (v.reshape(-1, 3)[pixel] for v in (derivative, c.residual, c.weight))
    index = bins(case, rows)
    sums = np.stack([(w * d * r).sum(axis=1), (w * d * d).sum(axis=1), mask[rows], np.ones(len(rows))], axis=1)
    top, bottom, total, count = gathered(sums, index, 0.5)
    # Half a unit of the mask is likely before the data have spoken.
    old = total / np.maximum(count, 1e-9)
    new = np.clip(old + top / (bottom + 4.0), 0, 1)
    near = gaussian_filter((old > 0.25).astype(float), 2.0, mode="wrap") > 0.02
    own = np.flatnonzero(case.pieces.shape == shape)
    out = np.zeros_like(mask)
    out[own] = looked_up(np.where(near, new, 0), case.pieces.uv[own])
    return out
