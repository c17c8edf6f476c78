"""Errors summed over tiles of pictures, and the intervals that drawing the tiles again gives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

_DRAWS = 2000
_TILES_ACROSS = 6  # of the height of a picture: wider than a drop and than most puddles
_FEWEST = 8  # tiles, below which drawing them again tells nothing


@dataclass(frozen=True)
class Estimate:
    """A mean with its interval at 95 %; the ends are NaN where there are too few tiles."""

    value: float
    low: float
    high: float


@dataclass
class TileSums:
    """Sums of errors under some weather, and of the same pixels' errors in the dry, over tiles.

    Errors of neighbouring pixels are alike, so that pixels are far fewer observations than they are. Tiles are drawn, not
    pixels: the interval tells what another street of the same kind might have given, as far as tiles a sixth of the picture
    high know nothing of each other.
    """

    sums: list[NDArray[np.float64]] = field(default_factory=list)

    def add(self, error: NDArray, dry: NDArray, length: NDArray, region: NDArray[np.bool_]) -> None:
        """Add a frame.

        Parameters
        ----------
        error, dry : (H, W) float
            End-point errors in the weather and in the dry [px].
        length : (H, W) float
            Of the true flow [px].
        region : (H, W) bool
            Pixels that count.

        Raises
        ------
        InputError
            If shapes differ.
        """
        if not error.shape == dry.shape == length.shape == region.shape:
            raise InputError("have one shape", got=[a.shape for a in (error, dry, length, region)], key="errors and region")
        side = max(1, -(-error.shape[0] // _TILES_ACROSS))
        rows, columns = np.nonzero(region & np.isfinite(error) & np.isfinite(dry))
        tile = rows // side * (-(-error.shape[1] // side)) + columns // side
        e, d, far = (a[rows, columns].astype(np.float64) for a in (error, dry, length))
        values = (np.ones_like(e), e, d, is_outlier(e, far), is_outlier(d, far))
        sums = np.stack([np.bincount(tile, v) for v in values], axis=1).astype(np.float64)
        self.sums.append(sums[sums[:, 0] > 0])

    @property
    def pixels(self) -> int:
        """How many pixels counted."""
        return round(self._total()[0])

    def epe(self, dry: bool = False) -> float:
        """Return the mean end-point error [px]; NaN without pixels."""
        return _ratio(self._total(), 2 if dry else 1)

    def fl_all(self, dry: bool = False) -> float:
        """Return the share of outliers; NaN without pixels."""
        return _ratio(self._total(), 4 if dry else 3)

    def added(self) -> float:
        """Return the sum of what the weather adds to the errors [px]."""
        total = self._total()
        return float(total[1] - total[2])

    def changes(self, rng: np.random.Generator) -> tuple[Estimate, Estimate]:
        """Return by how much end-point error [px] and share of outliers differ from the dry."""
        tiles = np.concatenate([np.zeros((0, 5)), *self.sums])
        known = np.stack([tiles[:, 0], tiles[:, 1] - tiles[:, 2], tiles[:, 3] - tiles[:, 4]], axis=1)
        total = known.sum(axis=0)
        means = [_ratio(total, i) for i in (1, 2)]
        if len(known) < _FEWEST:
            return Estimate(means[0], np.nan, np.nan), Estimate(means[1], np.nan, np.nan)
        drawn = rng.multinomial(len(known), np.full(len(known), 1 / len(known)), _DRAWS) @ known
        low, high = np.quantile(drawn[:, 1:] / drawn[:, :1], (0.025, 0.975), axis=0)
        first, second = (Estimate(means[i], float(low[i]), float(high[i])) for i in range(2))
        return first, second

    def _total(self) -> NDArray[np.float64]:
        return np.concatenate([np.zeros((1, 5)), *self.sums]).sum(axis=0)


def is_outlier(error: NDArray, length: NDArray) -> NDArray[np.bool_]:
    """Return where an end-point error exceeds both 3 px and 5 % of the true length (KITTI's definition)."""
    return (error > 3) & (error > 0.05 * length)


def _ratio(sums: NDArray[np.float64], column: int) -> float:
    return float(sums[column] / sums[0]) if sums[0] > 0 else float("nan")
