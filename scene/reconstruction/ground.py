"""Which points are ground: curved streets with kerbs, pavements and slopes, told from all that stands on or spans them.

A grid of lowest heights is grown outwards from below the vehicle's path. A cell joins if its height continues the local
plane of the ground found so far to within a kerb's height; so bridges and roofs overhead, embankment walls and vehicles
stay out, whatever the ground does in the large.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from materials.foundation.errors import InputError

from ..grid import GroundGrid
from ..kernels import ground_growth
from .build_settings import GroundSettings

Floats = NDArray[np.floating]


def split_ground(points_world: Floats, path_world: Floats, settings: GroundSettings | None = None) -> NDArray[np.bool_]:
    """Return which points are ground.

    Parameters
    ----------
    points_world : (N, 3) float
        Static or mixed points, z up [m].
    path_world : (P, 3) float
        Places of the scanner or camera, which drives on the ground; empty if unknown, then the lowest broad level of
        every 20 m tile seeds the ground.

    Returns
    -------
    is_ground : (N,) bool

    Raises
    ------
    InputError
        If there are no points, or no ground lies below the path.
    """
    settings = settings or GroundSettings()
    if len(points_world) == 0:
        raise InputError("hold points", got="none", key="the point cloud")
    points = np.asarray(points_world, dtype=np.float64)
    cell = settings.ground_cell
    grid = GroundGrid.covering(points, cell, margin=cell)
    rows, cols = np.floor(grid.position(points) + 0.5).astype(np.int64).T
    index = rows * grid.cols + cols
    order = np.lexsort((points[:, 2], index))
    start = np.searchsorted(index[order], np.arange(grid.rows * grid.cols + 1))
    z = points[order, 2]
    low = ground_growth.lowest_heights(start, z, 2, 0.15).reshape(grid.shape)
    accepted = _seeds(low, grid, np.asarray(path_world, dtype=np.float64).reshape(-1, 3))
    if not accepted.any():
        raise InputError(
            "show ground below the path",
            got="no level surface there",
            key="the point cloud",
            remedy="Check that z is up and the poses fit the points.",
        )
    above = points[:, 2] - low.ravel()[index]
    tall = np.bincount(index[(above > 0.3) & (above < 1.2)], minlength=low.size)
    # Where more goes on above, a wall, a hedge or a wheel meets the ground.
    is_foot = (tall >= np.maximum(3, 0.2 * np.diff(start))).reshape(grid.shape)
    step, foot_step = settings.ground_step, settings.ground_foot_step
    reach = _reach(grid, path_world)
    ground_growth.grow(
        low, is_foot, accepted, reach, cell, step, foot_step, settings.ground_step_per_metre, settings.ground_slope, 2.0
    )
    slope = _slope(low, accepted, cell)
    # Of something that stands there, only the very foot is ground.
    height = np.where(is_foot, 0.06, step + 0.03) + slope * cell
    return accepted.ravel()[index] & (above >= -settings.ground_below) & (above <= height.ravel()[index])


def _seeds(low: Floats, grid: GroundGrid, path: Floats) -> NDArray[np.bool_]:
    """Mark cells at the commonest low level about each place of the path (or of each tile)."""
    X, Y = grid.centres()
    seeds = np.zeros(grid.shape, bool)
    filled = np.argwhere(np.isfinite(low))
    xy = np.column_stack([X[tuple(filled.T)], Y[tuple(filled.T)]])
    heights = low[tuple(filled.T)]
    if len(path):
        # Places nearer together than 2 m see the same ground.
        kept = path[np.unique(np.floor(path[:, :2] / 2.0).astype(np.int64), axis=0, return_index=True)[1]]
        tree = cKDTree(xy)
        groups = [
            (np.array(members, dtype=np.int64), place[2])
            for place, members in zip(kept, tree.query_ball_point(kept[:, :2], 8.0), strict=True)
        ]
    else:
        _, tile = np.unique(np.floor(xy / 20.0).astype(np.int64), axis=0, return_inverse=True)
        groups = [(np.flatnonzero(tile.ravel() == t), np.inf) for t in range(tile.max() + 1)]
    for members, top in groups:
        # The scanner rides at least 0.3 m above the road and, on any vehicle, below 6 m.
        members = members[(heights[members] < top - 0.3) & (heights[members] > top - 6.0)] if np.isfinite(top) else members
        if len(members) < 10:
            continue
        level = _commonest(heights[members])
        near = members[np.abs(heights[members] - level) < 0.12]
        seeds[tuple(filled[near].T)] = True
    return seeds


def _commonest(heights: Floats, width: float = 0.1) -> float:
    """Return the centre of the fullest bin after smoothing over three; of equal ones the lowest."""
    base = heights.min()
    count = np.bincount(((heights - base) / width).astype(np.int64), minlength=3).astype(float)
    smooth = np.convolve(count, [0.5, 1, 0.5], mode="same")
    return float(base + (np.argmax(smooth) + 0.5) * width)


def _reach(grid: GroundGrid, path: Floats) -> NDArray[np.int64]:
    """Return the widest gap to cross per cell: rings of a scanner lie d^2 / height * pitch apart at distance d."""
    X, Y = grid.centres()
    if len(path) == 0:
        return np.full(grid.shape, 3, np.int64)
    d, _ = cKDTree(np.asarray(path)[:, :2]).query(np.column_stack([X.ravel(), Y.ravel()]))
    gap = np.clip(0.8 + (d / 25.0) ** 2, 0.8, 3.2)
    return np.ceil(gap / grid.cell).astype(np.int64).reshape(grid.shape)


def _slope(low: Floats, accepted: NDArray[np.bool_], cell: float) -> NDArray[np.float64]:
    """Return the steepness of the accepted cells, smoothed over 5 x 5 so that a kerb is not taken for a slope."""
    from scipy.ndimage import uniform_filter

    weight = uniform_filter(accepted.astype(np.float64), 5)
    mean = uniform_filter(np.where(accepted, low, 0.0), 5) / np.maximum(weight, 1e-9)
    mean = np.where(weight > 1e-6, mean, np.nan)
    dy, dx = np.gradient(mean, cell)
    return np.clip(np.nan_to_num(np.hypot(dx, dy)), 0, 0.5)
