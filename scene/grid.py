"""A metric top-view grid over the ground: which cell a world point lies in, and maps sampled on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class GroundGrid:
    """Square cells seen from above.

    Cell (row, col) has its centre at world x = x_min + (col + 0.5) * cell, y = y_min + (row + 0.5) * cell, so rows run
    along +y and columns along +x.

    Attributes
    ----------
    x_min, y_min : float
        World position of the grid's corner [m].
    cell : float
        Size of a cell [m].
    rows, cols : int
        Number of cells along y and x.
    """

    x_min: float
    y_min: float
    cell: float
    rows: int
    cols: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.rows, self.cols

    @classmethod
    def covering(cls, points_world: Floats, cell: float, margin: float = 0.0) -> GroundGrid:
        """Return the smallest grid over points (N, 2+), its corner on a multiple of `cell` so that grids line up."""
        low = np.floor((points_world[:, :2].min(axis=0) - margin) / cell) * cell
        high = points_world[:, :2].max(axis=0) + margin
        cols, rows = np.maximum(np.ceil((high - low) / cell - 1e-9).astype(int), 1)
        return cls(float(low[0]), float(low[1]), cell, int(rows), int(cols))

    def centres(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return world x and y (rows, cols) of the cells' centres [m]."""
        x: NDArray[np.float64] = self.x_min + (np.arange(self.cols, dtype=np.float64) + 0.5) * self.cell
        y: NDArray[np.float64] = self.y_min + (np.arange(self.rows, dtype=np.float64) + 0.5) * self.cell
        X, Y = np.meshgrid(x, y)
        return X, Y

    def position(self, points_world: Floats) -> NDArray[np.float64]:
        """Return fractional (row, col) (N, 2) of world points; cell (0, 0) has its centre at (0, 0)."""
        points_world = np.asarray(points_world, dtype=np.float64)
        row = (points_world[:, 1] - self.y_min) / self.cell - 0.5
        col = (points_world[:, 0] - self.x_min) / self.cell - 0.5
        return np.column_stack([row, col])

    def sample(self, values: NDArray, points_world: Floats) -> NDArray[np.float64]:
        """Return a map (rows, cols) at world points (N, 2+), bilinear, clamped at the border."""
        from scipy.ndimage import map_coordinates

        return map_coordinates(values.astype(np.float64), self.position(points_world).T, order=1, mode="nearest")
