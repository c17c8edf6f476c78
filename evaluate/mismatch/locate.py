"""Where recording and prediction differ: residuals in units of noise, gathered over scales, and what they depend on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.stats import norm

from .case import Case, Floats
from .warp import first_piece

_SCALES = (3, 7, 15)
_FAMILY = 0.01
# What the mean of a tile may be off by without being called a mismatch, in standard deviations of a pixel's noise: two
# right renderers differ by as much (their own noise, outlines, textures between texels).
FLOOR = 0.12


@dataclass(frozen=True)
class Dependence:
    """How much of a residual stands still in some coordinates.

    Attributes
    ----------
    name : str
        "image radius", "frame", "depth", ….
    excess : float
        Variance of the mean residual over bins, beyond what noise gives, in units of the noise of a pixel.
    sigmas : float
        How surely it is not noise, after a correction for the number of coordinates looked at.
    """

    name: str
    excess: float
    sigmas: float


def family_threshold(tests: float) -> float:
    """Return beyond how many standard deviations one of so many tests may go in 1 % of all nulls (Sidak)."""
    return float(norm.isf(0.5 * (1 - (1 - _FAMILY) ** (1 / max(tests, 1)))))


def located(case: Case, z: Floats, white: float) -> NDArray[np.bool_]:
    """Return where the residual is no noise (F, H, W).

    Averages over 3, 7 and 15 pixels (and all channels, by their squares) are held against what noise gives; a pixel
    counts where its own average is beyond the threshold for all pixels of all frames and scales together (Sidak), which
    holds under any correlation between neighbours that independent noise and averaging bring about.
    """
    out = np.zeros(case.valid.shape, bool)
    valid = case.valid.astype(np.float32)
    tests = 3 * len(_SCALES) * case.valid.sum()
    threshold = family_threshold(tests)
    for scale in _SCALES:
        count = uniform_filter(valid, (0, scale, scale)) * scale**2
        for c in range(3):
            mean = uniform_filter(z[..., c] * valid, (0, scale, scale)) * scale**2 / np.maximum(count, 1)
            sigma = np.sqrt(white**2 / np.maximum(count, 1) + FLOOR**2 + case.shared_variance)
            out |= (np.abs(mean) > threshold * sigma) & (count > 0.5 * scale**2)
    return out & case.valid


def structure(case: Case, z: Floats, white: float) -> float:
    """Return how much of a residual's power is structure, in units of a pixel's noise variance; noise alone gives about 0.

    Over tiles of 4 x 4 pixels the mean of noise has 1/16 of its variance; structure keeps its own.
    """
    k = 4
    height, width = (n // k * k for n in case.size)
    v = case.valid[:, :height, :width].reshape(case.num_frames, height // k, k, width // k, k)
    full = v.all(axis=(2, 4))
    if not full.any():
        return 0.0
    t = z[:, :height, :width].reshape(case.num_frames, height // k, k, width // k, k, 3).mean(axis=(2, 4))
    return float((t[full] ** 2).mean() - white**2 / k**2)


def largest_tile(case: Case, z: Floats, white: float) -> float:
    """Return the largest mean residual of a tile over what noise and the floor give: above about 5.5 it is no noise."""
    worst = 0.0
    for k in (4, 8, 16):
        height, width = (n // k * k for n in case.size)
        t = z[:, :height, :width].reshape(case.num_frames, height // k, k, width // k, k, 3).mean(axis=(2, 4))
        v = case.valid[:, :height, :width].reshape(case.num_frames, height // k, k, width // k, k).all(axis=(2, 4))
        if v.any():
            worst = max(worst, float(np.abs(t[v]).max() / np.sqrt(white**2 / k**2 + FLOOR**2 + case.shared_variance)))
    return worst


def dependences(case: Case, z: Floats, picture: Floats, white: float) -> list[Dependence]:
    """Return in which coordinates the residual does not average out, strongest first."""
    frames, (height, width) = case.num_frames, case.size
    rows, cols = np.mgrid[:height, :width]
    camera = case.cameras[0]
    radius = np.hypot(cols + 0.5 - camera.cx, rows + 0.5 - camera.cy)
    k = first_piece(case)
    p = case.pieces
    depth = np.where(p.shape[k] >= 0, p.distance[k], np.inf).reshape(case.valid.shape)
    bins: dict[str, NDArray] = {
        "image radius": np.broadcast_to((radius / radius.max() * 12).astype(int), case.valid.shape),
        "place on the sensor": np.broadcast_to(rows // 8 * 1000 + cols // 8, case.valid.shape),
        "image row": np.broadcast_to(rows, case.valid.shape),
        "image column": np.broadcast_to(cols, case.valid.shape),
        "frame": np.broadcast_to(np.arange(frames)[:, None, None], case.valid.shape),
        "frame and row": np.arange(frames)[:, None, None] * 10000 + rows[None],
        "lamp": np.broadcast_to(case.lit[:, None, None], case.valid.shape),
        "radiance": _quantiles(picture.mean(axis=3), 24),
        "depth": _quantiles(depth, 16),
        "shape": p.shape[k].reshape(case.valid.shape),
        "place on the surface": _places(case, k),
        "half vector": _quantiles(_mirror_cosine(case, k), 24),
    }
    out = []
    each = z.mean(axis=3)
    for name, index in bins.items():
        _, index = np.unique(index[case.valid], return_inverse=True)
        count = np.bincount(index)
        mean = np.bincount(index, each[case.valid]) / np.maximum(count, 1)
        ok = count >= 30
        if ok.sum() < 2:
            continue
        # Neighbouring pixels of a real residual are alike: at most every ninth counts.
        noise = white**2 / 3 / count[ok] + FLOOR**2 / np.maximum(count[ok] / 9, 1)
        share = count[ok] / count[ok].sum()
        excess = float((share * (mean[ok] ** 2 - white**2 / 3 / count[ok])).sum())
        statistic = float((mean[ok] ** 2 / noise).sum())
        dof = int(ok.sum())
        sigmas = (statistic - dof) / np.sqrt(2 * dof)
        out.append(Dependence(name, excess, float(sigmas)))
    return sorted((d for d in out if d.sigmas > 4 and d.excess > 1e-3), key=lambda d: -d.excess)


def _quantiles(values: NDArray, n: int) -> NDArray[np.int64]:
    finite = np.isfinite(values)
    if not finite.any():
        return np.zeros(values.shape, np.int64)
    edges = np.unique(np.quantile(values[finite], np.linspace(0, 1, n + 1)[1:-1]))
    return np.where(finite, np.searchsorted(edges, np.where(finite, values, 0)), n + 1)


def _places(case: Case, k: NDArray[np.int64]) -> NDArray[np.int64]:
    p = case.pieces
    uv = np.clip((p.uv[k] % 1.0 * 24).astype(np.int64), 0, 23)
    return ((p.shape[k] + 1) * 10000 + uv[:, 1] * 100 + uv[:, 0]).reshape(case.valid.shape)


def _mirror_cosine(case: Case, k: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the cosine between normal and half vector of each pixel's first lamp; NaN without one."""
    p = case.pieces
    frame = np.repeat(np.arange(case.num_frames), case.size[0] * case.size[1])
    lamp = case.slots[frame, 0]
    place = case.lamps[lamp] if len(case.lamps) else np.zeros((len(frame), 7))
    to = np.where((place[:, :1] == 1.0), place[:, 1:4] - p.position[k], place[:, 1:4])
    to = to / np.maximum(np.linalg.norm(to, axis=1, keepdims=True), 1e-9)
    h = to + p.view[k]
    h = h / np.maximum(np.linalg.norm(h, axis=1, keepdims=True), 1e-9)
    cosine = (h * p.normal[k]).sum(axis=1)
    cosine[(lamp < 0) | (p.shape[k] < 0)] = np.nan
    return cosine.reshape(case.valid.shape)
