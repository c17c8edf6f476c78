"""End-point errors of one flow field in a form that adds up: their distribution, and their means by angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..reflectance_aware import ERROR_EDGES, HeatMap, heat_map

Floats = NDArray[np.floating]

# Intervals of the error, 2.3 % wide each from 0.1 % of a pixel to 100 px: quantiles are as exact.
_EDGES = np.concatenate([[0.0], np.geomspace(1e-3, 100.0, 501), [np.inf]])
ANGLE_EDGES = np.arange(0.0, 91.0, 3.0)
"""Intervals of both angles [degrees]."""


@dataclass(frozen=True)
class FlowErrors:
    """Errors of some flow vectors.

    Attributes
    ----------
    counts : (N,) int64
        Vectors by error.
    total : float
        Sum of the errors [px].
    mirror, view : HeatMap
        By the angle between view and mirror direction, and between view and normal.
    mirror_total, view_total : (A,) float
        Sums of errors by angle [px].
    """

    counts: NDArray[np.int64]
    total: float
    mirror: HeatMap
    view: HeatMap
    mirror_total: NDArray[np.float64]
    view_total: NDArray[np.float64]

    @classmethod
    def of(cls, error: Floats, mirror: Floats, view: Floats) -> FlowErrors:
        """Return the record of errors [px] (N,) with their angles [degrees] (N,); what is not finite does not count."""
        known = np.isfinite(error)
        e = error[known].astype(np.float64)
        counts, _ = np.histogram(e, _EDGES)
        by_mirror, by_view = (heat_map(a[known], error[known], ANGLE_EDGES, ERROR_EDGES) for a in (mirror, view))
        sums = [_sums(a[known], e) for a in (mirror, view)]
        return cls(counts.astype(np.int64), float(e.sum()), by_mirror, by_view, *sums)

    def __add__(self, other: FlowErrors) -> FlowErrors:
        """Return the record of both."""
        return FlowErrors(
            self.counts + other.counts,
            self.total + other.total,
            self.mirror + other.mirror,
            self.view + other.view,
            self.mirror_total + other.mirror_total,
            self.view_total + other.view_total,
        )

    @property
    def pixels(self) -> int:
        """How many vectors."""
        return int(self.counts.sum())

    @property
    def mean(self) -> float:
        """Mean end-point error [px]; NaN without vectors."""
        return self.total / self.pixels if self.pixels else float("nan")

    def quantile(self, share: float) -> float:
        """Return the error that a share of the vectors does not exceed [px], even within an interval; NaN without vectors."""
        if not self.pixels:
            return float("nan")
        risen = np.concatenate([[0], np.cumsum(self.counts)])
        edges = np.append(_EDGES[:-1], _EDGES[-2])  # what lies beyond the last edge is told as that edge
        return float(np.interp(share * self.pixels, risen, edges))


def _sums(angle: Floats, error: NDArray[np.float64]) -> NDArray[np.float64]:
    known = np.isfinite(angle)
    return np.histogram(angle[known], ANGLE_EDGES, weights=error[known])[0]
