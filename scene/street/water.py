"""Where the water truly is in the street after a shower: hydrology on the true height field.

This is the yardstick for the augmentation and shares no formula with its water map. A shower of `w` times 2.5 mm
falls, `w` times 20 mm/h at its end:

- the first 0.4 mm are held by pores and texture (initial abstraction); pores fill as 1 - exp(-rain / 0.4 mm);
- the excess runs down the true relief (priority flood, Barnes et al. 2014) into hollows, which fill as Linsley, Kohler
  and Paulhus (1949) have it, and out through the gully grates and the ends of the street;
- on its way it is a sheet whose depth is that of Manning's formula for wide flow, h = (n q / sqrt(S))^(3/5);
- a sheet shallower than the stones of the surface covers only what lies lower: the share is the bearing curve of the
  texture (Abbott and Firestone 1933), here that of normally distributed heights.

Only the ground is wet, as in the augmentation: cars, facades, trees and people stay dry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, grey_dilation
from scipy.special import ndtr

from ..grid import GroundGrid
from ..kernels import runoff
from . import layout as at
from .relief import Relief

Floats = NDArray[np.floating]

SHOWER = 2.5e-3
ABSTRACTION = 0.4e-3
_INTENSITY = 20e-3 / 3600
_MANNING_N = 0.013
_CELL = 0.04
# Height of the stones of asphalt above the valleys between them: median and standard deviation [m]; slabs are finer.
ASPHALT_TEXTURE = (0.45e-3, 0.20e-3)
SLAB_TEXTURE = (0.30e-3, 0.15e-3)


@dataclass(frozen=True)
class Water:
    """Water on the ground after the shower.

    Attributes
    ----------
    grid : GroundGrid
    level : (rows, cols) float64
        World z of standing water, -inf where none stands [m].
    standing : (rows, cols) float32
        Its depth [m].
    sheet : (rows, cols) float32
        Depth of running water above the valleys of the texture [m].
    saturation : float
        Share of the pores that is filled.
    """

    grid: GroundGrid
    level: NDArray[np.float64]
    standing: NDArray[np.float32]
    sheet: NDArray[np.float32]
    saturation: float

    def coverage(self, x: Floats, y: Floats, texture: tuple[float, float]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return share of the area below water and its mean thickness [m] on the lines x, y: (len(y), len(x))."""
        X, Y = np.meshgrid(x, y)
        points = np.column_stack([X.ravel(), Y.ravel()])
        standing = self.grid.sample(self.standing, points).reshape(X.shape)
        sheet = self.grid.sample(self.sheet, points).reshape(X.shape)
        median, spread = texture
        # Standing depth counts from the mean plane, the sheet from the valleys.
        covered = np.where(standing > 0, ndtr(standing / spread), ndtr((sheet - median) / spread))
        return covered.astype(np.float32), (standing + sheet).astype(np.float32)

    def surface(self, x: Floats, y: Floats, z: Floats) -> NDArray[np.float64]:
        """Return the heights z (len(y), len(x)) of the ground with standing water filled in, exactly level."""
        # Each hollow's level is carried two cells past its shore, so that the shore is cut by the ground, not by cells.
        level = grey_dilation(np.where(np.isfinite(self.level), self.level, -1e3), size=(5, 5))
        row = np.floor((y - self.grid.y_min) / self.grid.cell).astype(int)
        col = np.floor((x - self.grid.x_min) / self.grid.cell).astype(int)
        inside = ((row >= 0) & (row < self.grid.rows))[:, None] & ((col >= 0) & (col < self.grid.cols))[None]
        here = level[np.clip(row, 0, self.grid.rows - 1)][:, np.clip(col, 0, self.grid.cols - 1)]
        return np.where(inside, np.maximum(z, here), z)


class Hydrology:
    """What does not depend on the amount of rain: the flooded relief and its catchments."""

    def __init__(self, relief: Relief) -> None:
        rows = int((at.WALL_LEFT - at.WALL_RIGHT) / _CELL)
        cols = int((at.X_END - at.X_BACK) / _CELL)
        self.grid = GroundGrid(at.X_BACK, at.WALL_RIGHT, _CELL, rows, cols)
        X, Y = self.grid.centres()
        self.z = relief.height(X, Y)
        outlet = np.zeros(self.grid.shape, bool)
        outlet[:, [0, -1]] = True
        for gully_x, edge in at.GULLIES:
            inward = -np.sign(edge)
            outlet |= (
                (np.abs(X - gully_x) < at.GULLY_SIZE[0] / 2)
                & ((Y - edge) * inward > 0.03)
                & ((Y - edge) * inward < at.GULLY_SIZE[1])
            )
        self.filled, parent, self.hollow, order, self.num_hollows = runoff.priority_flood(self.z, outlet)
        area = runoff.catchment(parent, order)
        self.area = area
        self._unit_flow = self._flow(parent, area)

    def after(self, w: float) -> Water:
        """Return the water after a shower of strength w in [0, 1]."""
        rain = SHOWER * w
        excess = max(rain - ABSTRACTION, 0.0)
        levels = runoff.hollow_levels(self.z, self.filled, self.hollow, self.area, self.num_hollows, excess, _CELL)
        level = np.where(self.hollow > 0, levels[self.hollow], -np.inf)
        depth = np.maximum(level - self.z, 0.0)
        # Less than half a millimetre is no puddle but the texture's own store, counted above.
        stands = depth > 0.5e-3
        sheet = (w**0.6) * self._unit_flow + 0.12e-3 * (1 - np.exp(-rain / ABSTRACTION))
        return Water(
            self.grid,
            np.where(stands, level, -np.inf),
            np.where(stands, depth, 0.0).astype(np.float32),
            sheet.astype(np.float32),
            float(1 - np.exp(-rain / ABSTRACTION)),
        )

    def _flow(self, parent: NDArray[np.int64], area: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth of the running sheet at full strength [m]."""
        cols = self.grid.cols
        index = np.arange(len(parent))
        step = np.hypot(index // cols - parent // cols, index % cols - parent % cols) * _CELL
        drop = self.filled.ravel() - self.filled.ravel()[parent]
        slope = np.divide(drop, step, out=np.zeros_like(drop), where=step > 0).reshape(self.grid.shape)
        slope = np.maximum(gaussian_filter(slope, 0.2 / _CELL), 0.002)
        # Eight directions gather flow into single cells; a real sheet spreads over a foot or so.
        q = gaussian_filter(_INTENSITY * _CELL * area.reshape(self.grid.shape), 0.15 / _CELL)
        return (_MANNING_N * q / np.sqrt(slope)) ** 0.6
