"""Seeded gradient noise fixed in the world, and 1/f^beta sums of it.

What 1/f^beta means here: the *power* (variance) of each octave is proportional to 1 / f^beta, so that amplitudes fall by
`2**(beta / 2)` from octave to octave. This is the thesis's own reading: it describes its 1/f^4 Perlin noise as one that
"decreases by a factor of 4 with each subsequent octave" (ch. 5.4.1). Equivalently the spectral density is proportional
to f^-(beta + 1) along a line, f^-(beta + 2) over a plane and f^-(beta + 3) in a volume, between the largest scale and the
smallest.

References
----------
K. Perlin, "Improving noise", SIGGRAPH 2002. G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom number
generators", OOPSLA 2014 (the hash).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError

from .kernels import noise as kernel

# Of [0, 1] noise: chosen so that eq 6.4's contrast (x 4) and offset (- 0.25) leave a third of the plane above 0.5:
# the threshold 0.5 + 0.25 / 4 lies 0.4307 standard deviations above the mean, where a Gaussian's upper tail is 1/3.
UNIT_SIGMA = 0.25 / 4 / 0.4307


def spectral_noise_2d(
    x: ArrayLike, y: ArrayLike, *, scale: float = 1.0, exponent: float = 2.0, octaves: int = 1, seed: int = 0
) -> NDArray[np.float32]:
    """Return a sum of octaves of gradient noise with mean 0 and variance 1.

    Parameters
    ----------
    x, y : (...) float
        World positions [m]; any extent, also negative.
    scale : float
        Lattice of the largest octave [m]: features are about this far apart.
    exponent : float
        beta of 1/f^beta, see the module's text; 0 gives all octaves the same power.
    octaves : int
        How many; each has half the scale of the one before.
    seed : int
        Another seed is an independent pattern.

    Returns
    -------
    noise : (...) float32
        Bit-identical for any number of threads and any split of the positions into arrays. Nearly Gaussian from three
        octaves on; a single octave is bounded by 3.3.

    Raises
    ------
    InputError
        If `scale` or `octaves` is not positive.

    Examples
    --------
    >>> spectral_noise_2d(0.3, 0.7, seed=1) == spectral_noise_2d([5.0, 0.3], [1.0, 0.7], seed=1)[1]
    np.True_
    """
    octaves = _check(scale, octaves)
    x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
    out = np.empty(x.size, np.float32)
    kernel.spectral_2d_many(x.ravel(), y.ravel(), float(scale), float(exponent), octaves, seed_bits(seed), out)
    return out.reshape(x.shape)


def spectral_noise_3d(
    x: ArrayLike, y: ArrayLike, z: ArrayLike, *, scale: float = 1.0, exponent: float = 2.0, octaves: int = 1, seed: int = 0
) -> NDArray[np.float32]:
    """As `spectral_noise_2d`, in a volume (eq 6.6: `scale=0.5, exponent=3`)."""
    octaves = _check(scale, octaves)
    x, y, z = np.broadcast_arrays(*(np.asarray(a, np.float64) for a in (x, y, z)))
    out = np.empty(x.size, np.float32)
    kernel.spectral_3d_many(x.ravel(), y.ravel(), z.ravel(), float(scale), float(exponent), octaves, seed_bits(seed), out)
    return out.reshape(x.shape)


def to_unit(noise: NDArray, sigma: float = UNIT_SIGMA) -> NDArray[np.float32]:
    """Map noise of mean 0 and variance 1 into [0, 1]: mean 0.5, standard deviation `sigma`, clamped.

    With the default of 0.145 the ends lie 3.4 standard deviations out: less than 0.1 % of a Gaussian is clamped.
    """
    return np.clip(0.5 + sigma * noise, 0, 1).astype(np.float32)


def octaves_between(largest: float, smallest: float) -> int:
    """Return how many octaves lie between two scales, both included: 2 m to 0.125 m are five."""
    check_range("largest / smallest", largest / smallest, "[1, inf)")
    return int(np.floor(np.log2(largest / smallest) + 1e-9)) + 1


def seed_bits(seed: int) -> np.uint64:
    """Return a seed as the kernels want it; any integer is allowed, and neighbours give unrelated patterns."""
    with np.errstate(over="ignore"):
        return np.uint64(kernel.mix(np.uint64((int(seed) * 0x9E3779B97F4A7C15 + 0x632BE59BD9B4E019) & 0xFFFFFFFFFFFFFFFF)))


def _check(scale: float, octaves: int) -> int:
    check_range("scale", scale, "(0, inf)")
    if int(octaves) != octaves or octaves < 1:
        raise InputError("be a whole number of at least 1", got=octaves, key="octaves")
    return int(octaves)
