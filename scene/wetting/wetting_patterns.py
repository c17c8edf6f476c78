"""The two procedural patterns of wetting, as functions of the place in the world: moisture S0 and puddles A0.

Being functions and no bitmaps they never repeat, are the same for every grid, and can be evaluated where a camera looks
closer than the grid's cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from ..noise import octaves_between, spectral_noise_2d, to_unit

# Each pattern draws from its own stream of the scene's seed.
_GRAIN, _STAINS, _BEND_X, _BEND_Y, _PUDDLES = 11, 12, 13, 14, 15


def moisture_pattern(x: ArrayLike, y: ArrayLike, seed: int = 0) -> NDArray[np.float32]:
    """Return S0 of eq 6.3: fine differences of porosity, seepage and drying, in [0, 1].

    It stands for the "moisture" pattern of Substance Designer at scale 8 on 40 m x 40 m that the thesis uses: grain from
    0.6 m down to 0.075 m (1/f^1, bent by some 4 cm so that no lattice shows) on stains of 2.4 m, whose sum is
    mapped by its own distribution, so that every value in [0, 1] is equally frequent (mean 1/2, standard deviation 0.29).

    Parameters
    ----------
    x, y : (...) float
        World positions [m].
    seed : int
        Seed of the scene.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    bent_x = x + 0.04 * spectral_noise_2d(x, y, scale=0.9, exponent=2, octaves=2, seed=_stream(seed, _BEND_X))
    bent_y = y + 0.04 * spectral_noise_2d(x, y, scale=0.9, exponent=2, octaves=2, seed=_stream(seed, _BEND_Y))
    grain = spectral_noise_2d(
        bent_x, bent_y, scale=0.6, exponent=1, octaves=octaves_between(0.6, 0.075), seed=_stream(seed, _GRAIN)
    )
    stains = spectral_noise_2d(x, y, scale=2.4, exponent=2, octaves=2, seed=_stream(seed, _STAINS))
    return ndtr((0.85 * grain + 0.5 * stains) / np.hypot(0.85, 0.5)).astype(np.float32)


def puddle_pattern(
    x: ArrayLike,
    y: ArrayLike,
    seed: int = 0,
    *,
    scale: float = 2.0,
    smallest: float = 0.1,
    exponent: float = 4.0,
    contrast: float = 4.0,
    offset: float = -0.25,
) -> NDArray[np.float32]:
    """Return A0 of eq 6.4: where puddles form, in [0, 1]; above 1/2 on a third of the plane.

    Parameters
    ----------
    x, y : (...) float
        World positions [m].
    seed : int
        Seed of the scene.
    scale, smallest : float
        Largest and smallest size of the pattern [m].
    exponent : float
        beta of 1/f^beta, see `noise`.
    contrast, offset : float
        `A0 = clamp(1/2 + contrast (P - 1/2) + offset)` of noise P with mean 1/2 and standard deviation 0.145.
    """
    octaves = octaves_between(scale, min(smallest, scale))
    P = to_unit(spectral_noise_2d(x, y, scale=scale, exponent=exponent, octaves=octaves, seed=_stream(seed, _PUDDLES)))
    return np.clip(0.5 + contrast * (P - 0.5) + offset, 0, 1).astype(np.float32)


def _stream(seed: int, number: int) -> int:
    """Return the seed of one of a scene's patterns; 64 streams per seed."""
    return int(seed) * 64 + number
