"""Random patterns that repeat without a seam, made by shaping the spectrum of white noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


class Pattern:
    """A tile of noise with zero mean and unit variance, known at any place of the plane.

    Parameters
    ----------
    size : float
        Side of the square tile [m].
    cell : float
        Side of a sample [m].
    finest, coarsest : float
        Wavelengths between which the amplitude spectrum falls as `frequency**-slope`; nothing beyond them [m].
    slope : float
        0 is white within the band, 1 is pink.
    stretch : float
        Elongation along x: 2 makes features twice as long as wide.
    rng : Generator
    """

    def __init__(
        self,
        size: float,
        cell: float,
        finest: float,
        coarsest: float,
        rng: np.random.Generator,
        slope: float = 1.0,
        stretch: float = 1.0,
    ) -> None:
        n = round(size / cell)
        self.cell = size / n
        f = np.fft.fftfreq(n, self.cell)
        k = np.hypot(f[None, : n // 2 + 1] * stretch, f[:, None])
        inside = (k >= 1 / coarsest) & (k <= 1 / finest)
        amplitude = np.where(inside, np.maximum(k, 1e-9) ** -slope, 0.0)
        noise = np.fft.rfft2(rng.standard_normal((n, n)))
        tile = np.fft.irfft2(noise * amplitude, s=(n, n))
        self.tile = (tile / tile.std()).astype(np.float32)

    def at(self, x: Floats, y: Floats) -> NDArray[np.float32]:
        """Return the pattern at world x (columns) and y (rows), nearest sample: (len(y), len(x))."""
        n = len(self.tile)
        col = np.floor(x / self.cell).astype(int) % n
        row = np.floor(y / self.cell).astype(int) % n
        return self.tile[row][:, col]

    def smooth_at(self, x: Floats, y: Floats) -> NDArray[np.float64]:
        """Return the pattern at scattered places, interpolated bilinearly."""
        from scipy.ndimage import map_coordinates

        place = np.stack([np.ravel(y), np.ravel(x)]) / self.cell - 0.5
        return map_coordinates(self.tile.astype(np.float64), place, order=1, mode="grid-wrap").reshape(np.shape(x))


def smoothstep(low: float, high: float, x: Floats) -> Floats:
    """Return 0 below `low`, 1 above `high`, and a cubic between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def slab_joints(x: Floats, y: Floats, width: float, slab: float = 0.5) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return paving slabs laid in running bond.

    Returns
    -------
    joint : (len(y), len(x)) float32
        1 within `width` of a joint, 0 on a slab.
    number : (len(y), len(x)) int64
        A number per slab, for its shade.
    """
    row = np.floor(y / slab).astype(int)
    along_y = np.abs(y / slab - np.round(y / slab)) * slab
    shifted = x[None] / slab + 0.5 * (row % 2)[:, None]
    along_x = np.abs(shifted - np.round(shifted)) * slab
    joint = (along_y < width / 2)[:, None] | (along_x < width / 2)
    return joint.astype(np.float32), np.floor(shifted).astype(int) * 7919 + row[:, None] * 104729
