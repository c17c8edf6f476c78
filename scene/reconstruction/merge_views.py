"""Robust colours of world points from many pictures, in bounded memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import projection as kernel

_SLOTS = 8  # best answers kept per point: enough for a median, and 128 MB for a million points
_SPREAD = 0.25  # answers whose luminance is within a quarter of the median's are averaged


class MergedColours:
    """The best answers per point, whatever the number of frames, and their robust mean.

    The mean is the average of what agrees with the weighted median by luminance: a reflection, a passing shadow or an
    occluder's colour that fewer than half of the (weighted) frames show leaves no trace.
    """

    def __init__(self, num_points: int) -> None:
        self._kept = np.zeros((num_points, _SLOTS, 3), np.float32)
        self._quality = np.zeros((num_points, _SLOTS), np.float32)

    def add(self, colour: NDArray[np.float32], quality: NDArray[np.float32], dark: float = 0.0) -> None:
        """Add one frame's colours (N, 3) and their quality (N,), 0 for unseen; those below `dark` are hardly trusted."""
        if dark > 0:
            quality = np.where(colour.max(axis=1) < dark, 0.1 * quality, quality)
        kernel.keep_best(colour, quality.astype(np.float32), self._kept, self._quality)

    def result(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return colours (N, 3), 0 where unseen, and the sum of the qualities behind them (N,)."""
        colour = np.zeros((len(self._kept), 3), np.float32)
        weight = np.zeros(len(self._kept), np.float32)
        kernel.merge(self._kept, self._quality, _SPREAD, colour, weight)
        return colour, weight
