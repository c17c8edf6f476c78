"""Where a measurement and its prediction differ, over the angles and conditions it was made at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..locate import FLOOR, Dependence, family_threshold
from .samples import Samples

Floats = NDArray[np.float64]
_FINE, _COARSE, _LEAST = 24, 8, 5


def bins_of(s: Samples) -> dict[str, NDArray[np.int64]]:
    """Return in which bin each sample lies (N,), by the coordinate: of one alone, and of pairs that belong together."""
    out = {name: _quantiles(x, _FINE) for name, x in s.coordinates.items()}
    pairs = [("half angle", "difference angle"), ("incidence angle", "viewing angle")] if s.kind == "directions" else []
    coarse = int(np.clip(np.sqrt(len(s.value) / _LEAST), 1, _COARSE))
    for a, b in pairs:
        out[f"{a} and {b}"] = _quantiles(s.coordinates[a], coarse) * coarse + _quantiles(s.coordinates[b], coarse)
    if s.kind == "directions":
        out["block"] = s.block
    return out


def located(s: Samples, z: Floats) -> NDArray[np.bool_]:
    """Return the values (N, C) whose residual is no noise.

    Means over bins of each coordinate, channel by channel, are held against what noise gives, over all bins, coordinates and
    channels at once (Sidak, which holds however channels and coordinates depend on each other). A bin's mean may be off by
    the same floor as a tile of a picture.
    """
    bins = bins_of(s)
    tests = sum(int(index.max()) + 1 for index in bins.values()) * z.shape[1] + z.size
    threshold = family_threshold(tests)
    out = np.abs(z) > threshold
    for index in bins.values():
        mean, count = binned(z, index)
        sure = (np.abs(mean) > threshold * np.sqrt(1 / np.maximum(count, 1)[:, None] + FLOOR**2)) & (count >= _LEAST)[:, None]
        out |= sure[index]
    return out


def dependences(s: Samples, z: Floats) -> list[Dependence]:
    """Return in which coordinates the residual does not average out, strongest first."""
    out = []
    for name, index in bins_of(s).items():
        if name == "block":
            continue
        mean, count = binned(z, index)
        keep = count >= _LEAST
        if keep.sum() < 2:
            continue
        share = count[keep] / count[keep].sum()
        # The channels of a sample are made in one stroke: they count as one.
        noise = 1 / count[keep] + FLOOR**2
        power = (mean[keep] ** 2).mean(axis=1)
        excess = float((share * (power - 1 / count[keep])).sum())
        dof = int(keep.sum())
        sigmas = ((power / noise).sum() - dof) / np.sqrt(2 * dof)
        out.append(Dependence(name, excess, float(sigmas)))
    if z.shape[1] > 1:
        mean = z.mean(axis=0)
        dof = len(mean)
        noise = 1 / len(z) + FLOOR**2
        sigmas = float(((mean**2 / noise).sum() - dof) / np.sqrt(2 * dof))
        out.append(Dependence("wavelength", float((mean**2 - 1 / len(z)).mean()), sigmas))
    return sorted((d for d in out if d.sigmas > 4 and d.excess > 1e-3), key=lambda d: -d.excess)


def binned(z: Floats, index: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return (mean (K, C), count (K,)) of the values in each bin."""
    count = np.bincount(index).astype(np.float64)
    total = np.stack([np.bincount(index, column, len(count)) for column in z.T], axis=1)
    return total / np.maximum(count, 1)[:, None], count


def _quantiles(x: Floats, n: int) -> NDArray[np.int64]:
    # Fewer where there are few samples: bins that hold less than `_LEAST` would never be looked at.
    n = int(np.clip(len(x) // (2 * _LEAST), 1, n))
    edges = np.unique(np.quantile(x, np.linspace(0, 1, n + 1)[1:-1]))
    return np.searchsorted(edges, x, "right").astype(np.int64)
