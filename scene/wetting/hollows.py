"""Where the ground holds water: closed depressions of the height map, filled to their spill levels.

The thesis finds low places by a difference of Gaussians (eq 6.2), which knows one scale at a time and takes a kerb's foot
for a hollow. What holds water is a depression that has no way out: the priority flood of Barnes, Lehman and Mulla (2014)
finds all of them at all scales.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..grid import GroundGrid
from ..kernels.runoff import priority_flood
from .map_filters import blur

# Ripples that a scanner's rings leave are narrower than this (sigma) and would hold water by the hundred.
_SMOOTH = 0.1


def hollow_maps(height: NDArray[np.float32], coverage: NDArray[np.float32], grid: GroundGrid) -> dict[str, NDArray[np.float32]]:
    """Return how deep water can stand, and how deep it gets in the same hollow.

    Parameters
    ----------
    height : (rows, cols) float32
        Ground height [m].
    coverage : (rows, cols) float32
        1 where it was measured; water runs off at the edge of what was.
    grid : GroundGrid

    Returns
    -------
    maps : dict
        `hollow` (rows, cols) float32, depth below the spill level [m], 0 outside of hollows; `hollow_deepest`, the
        greatest depth in the same hollow [m].
    """
    smooth = np.nan_to_num(blur(height, coverage, _SMOOTH, grid.cell)).astype(np.float64)
    covered = coverage > 0
    inner = np.zeros_like(covered)
    inner[1:-1, 1:-1] = covered[1:-1, 1:-1] & covered[:-2, 1:-1] & covered[2:, 1:-1] & covered[1:-1, :-2] & covered[1:-1, 2:]
    filled, _, label, _, count = priority_flood(smooth, ~inner)
    depth = np.where(covered, filled - smooth, 0.0)
    label = np.where(depth > 0, label.reshape(depth.shape), 0)
    deepest = np.zeros(count + 1)
    np.maximum.at(deepest, label.ravel(), depth.ravel())
    deepest[0] = 0.0
    return {"hollow": depth.astype(np.float32), "hollow_deepest": deepest[label].astype(np.float32)}
