"""The surface behind a field of normals: heights, what they hide from the lights, and what they send to each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import spsolve

from ...kernels import height_field as kernel

Floats = NDArray[np.float64]
_STEEPEST = 5.0


@dataclass(frozen=True)
class Relief:
    """A height field over the pixels of an object.

    Attributes
    ----------
    height : (H, W) float64
        [px], towards the viewer; NaN outside.
    rows, cols : (P,) int
    """

    height: Floats
    rows: NDArray[np.int64]
    cols: NDArray[np.int64]

    def visible(self, lights: Floats, rise: float = 1.0) -> Floats:
        """Return 1 where a light (N, 3) reaches a pixel, 0 where the field stands `rise` pixels in its way (P, N)."""
        return kernel.visible(self.height, self.rows, self.cols, np.ascontiguousarray(lights), rise).astype(np.float64)

    def exchange(self, normal: Floats) -> NDArray[np.float32]:
        """Return which share of what a patch sends out reaches another (P, P)."""
        place = np.column_stack([self.cols, -self.rows, self.height[self.rows, self.cols]]).astype(np.float64)
        return kernel.exchange(place, np.ascontiguousarray(normal))


def integrate(mask: NDArray[np.bool_], normal: Floats) -> Relief:
    """Return the height field whose slopes come nearest to those of normals (P, 3), x right, y up, z to the viewer.

    Where the object has steps, which normals do not tell, the field bends over them.
    """
    rows, cols = np.nonzero(mask)
    index = np.full(mask.shape, -1)
    index[rows, cols] = np.arange(len(rows))
    n = normal / np.maximum(normal[:, 2:], 1 / _STEEPEST)
    right, down = -n[:, 0], n[:, 1]
    entries: list[tuple[NDArray, NDArray]] = []
    slopes = []
    for dr, dc, slope in ((0, 1, right), (1, 0, down)):
        inside = (rows + dr < mask.shape[0]) & (cols + dc < mask.shape[1])
        other = np.where(inside, index[np.minimum(rows + dr, mask.shape[0] - 1), np.minimum(cols + dc, mask.shape[1] - 1)], -1)
        own = np.flatnonzero(other >= 0)
        entries.append((own, other[own]))
        slopes.append(0.5 * (slope[own] + slope[other[own]]))
    here, there = (np.concatenate([e[k] for e in entries]) for k in (0, 1))
    step = np.concatenate(slopes)
    at, one = np.arange(len(step)), np.ones(len(step))
    difference = coo_matrix((np.concatenate([-one, one]), (np.concatenate([at, at]), np.concatenate([here, there]))),
                            shape=(len(step), len(rows))).tocsr()  # fmt: skip
    # Parts that do not hang together, and the height as a whole, are open: they are held at 0, weakly.
    z = spsolve((difference.T @ difference + 1e-6 * identity(len(rows))).tocsc(), difference.T @ step)
    height = np.full(mask.shape, np.nan)
    height[rows, cols] = z
    return Relief(height, rows, cols)
