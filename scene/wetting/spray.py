"""Where spray and mist are: the density of thesis 6.3.4 (eq 6.6), fixed in the world, and the wakes of vehicles in it.

    M(x, y, z) = m / 50 m * P(x, y, z) * exp(-d / 1 m)

is the extinction [1/m], so that 50 m is the mean free path of light at the ground for m = 1, and 150 m at 1.1 m above it.
`d` is the height above the ground map below the point; on a slope s it exceeds the distance from the surface by a factor
sqrt(1 + s^2), 0.1 % on a street. P is gradient noise whose mean is 1 exactly (the thesis leaves it open). It modulates wakes
(`scene.wetting.wakes`), too, which add to M and move with their vehicles.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from materials.foundation.checks import check_finite, check_range, check_shape

from ..grid import GroundGrid
from ..kernels import spray as kernel
from ..kernels.wakes import COLUMNS
from ..noise import seed_bits
from .spray_settings import SpraySettings
from .wakes import box_of

# Mist does not follow the ground's texture: a map of this cell suffices, and stays in the cache [m].
_CELL = 0.5
# Cells of the upper bounds [m]: a shot of light crosses few, and they are tight. Wakes are narrow, and alone in a small box.
_BOUND_CELL, _BOUND_HEIGHT = 8.0, 1.0
_WAKE_CELL_IN_MIST, _WAKE_CELL, _WAKE_HEIGHT = 4.0, 1.0, 0.5


@dataclass(frozen=True)
class Spray:
    """Spray and mist over a ground.

    Attributes
    ----------
    ground : (rows, cols) float32
        Height of the ground [m].
    grid : GroundGrid
        Where its cells lie.
    m : float
        Amount, 0 to 1.
    settings : SpraySettings
    seed : int
        Of the noise.
    wakes : (K, COLUMNS) float64
        Spray behind tyres, from `wakes.wakes_of`; by default none.
    """

    ground: NDArray[np.float32]
    grid: GroundGrid
    m: float
    settings: SpraySettings = SpraySettings()
    seed: int = 0
    wakes: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, COLUMNS)))

    @property
    def sigma(self) -> float:
        """Mean extinction at the ground [1/m]."""
        return self.m / self.settings.view_distance

    @property
    def frame(self) -> NDArray[np.float64]:
        """Corner and cell of the ground map, as the kernels take them."""
        return np.array([self.grid.x_min, self.grid.y_min, self.grid.cell])

    @property
    def noise(self) -> NDArray[np.float64]:
        """Scale, exponent, octaves and contrast, as the kernels take them."""
        s = self.settings
        return np.array([s.noise_scale, s.noise_exponent, s.octaves, s.contrast])

    @property
    def seed_bits(self) -> np.uint64:
        return seed_bits(self.seed)

    def extinction(self, points_world: ArrayLike) -> NDArray[np.float64]:
        """Return M of eq 6.6, and what wakes add to it, at points (N, 3) [1/m]."""
        p = np.ascontiguousarray(points_world, np.float64)
        check_shape("points_world", p, (None, 3))
        out = np.empty(len(p))
        scale_height = self.settings.scale_height
        kernel.extinction_many(p, self.sigma, self.ground, self.frame, scale_height, self.wakes, self.noise, self.seed_bits, out)
        return out

    def box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the corners of the box that holds all spray and mist that count [m]."""
        if self.m == 0 and len(self.wakes):
            return self.wake_box()
        g, s = self.grid, self.settings
        low = np.array([g.x_min - s.margin, g.y_min - s.margin, float(self.ground.min())])
        far = (g.x_min + g.cols * g.cell + s.margin, g.y_min + g.rows * g.cell + s.margin)
        high = np.array([*far, float(self.ground.max()) + s.ceiling * s.scale_height])
        wake_low, wake_high = self.wake_box()
        return np.minimum(low, wake_low), np.maximum(high, wake_high)

    def wake_box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the corners of the box that holds all wakes [m]; high below low without any."""
        return box_of(self.wakes, float(self.ground.min()), float(self.ground.max()))

    def upper_bounds(self) -> NDArray[np.float32]:
        """Return bounds (nz, ny, nx) of the extinction in even cells of the box [1/m]."""
        low, high = self.box()
        s = self.settings
        wanted = np.array([_BOUND_CELL, _BOUND_CELL, _BOUND_HEIGHT * s.scale_height])
        if len(self.wakes):
            cell = _WAKE_CELL_IN_MIST if self.m > 0 else _WAKE_CELL
            wanted = np.array([cell, cell, min(_WAKE_HEIGHT, wanted[2])])
        count = np.clip(np.ceil((high - low) / wanted), 1, 256).astype(int)
        out = np.empty(count[::-1], np.float32)
        largest = 2.0 if s.contrast > 0 else 1.0
        field = (self.ground, self.frame, s.scale_height, self.sigma, self.wakes, largest)
        kernel.upper_bounds(*field, low, (high - low) / count, out)
        return out


def spray_over(
    height: NDArray[np.float32],
    grid: GroundGrid,
    m: float,
    settings: SpraySettings = SpraySettings(),
    seed: int = 0,
    wakes: NDArray[np.float64] | None = None,
) -> Spray:
    """Return the spray and mist over a height map.

    Parameters
    ----------
    height : (rows, cols) float32
        Of the ground [m], as `terrain.ground_maps` makes it; averaged to cells of about 0.5 m.
    grid : GroundGrid
        Where its cells lie.
    m : float
        Amount of spray and mist, from 0 (none) to 1.
    settings : SpraySettings
    seed : int
        Another seed is other noise.
    wakes : (K, COLUMNS) float64, optional
        Spray behind tyres, from `wakes.wakes_of`.

    Raises
    ------
    InputError
        If `m` is outside [0, 1], or the map has another shape than the grid or is not finite.

    Examples
    --------
    >>> level = spray_over(np.zeros((8, 8), np.float32), GroundGrid(0, 0, 1.0, 8, 8), 1.0, SpraySettings(contrast=0))
    >>> (1 / level.extinction([[4, 4, 0], [4, 4, 1.1]])).round()
    array([ 50., 150.])
    """
    check_range("m", m, "[0, 1]")
    check_shape("height", height, grid.shape)
    check_finite("height", height)
    n = max(1, round(_CELL / grid.cell))
    # Whole blocks only: the border is clamped outwards anyway.
    n = min(n, grid.rows, grid.cols)
    rows, cols = grid.rows // n, grid.cols // n
    coarse = height[: rows * n, : cols * n].reshape(rows, n, cols, n).mean(axis=(1, 3), dtype=np.float64)
    return Spray(
        np.ascontiguousarray(coarse, np.float32),
        GroundGrid(grid.x_min, grid.y_min, grid.cell * n, rows, cols),
        float(m),
        settings,
        seed,
        np.zeros((0, COLUMNS)) if wakes is None else np.ascontiguousarray(wakes, np.float64),
    )
