"""How surely one model is better than another, judged on blocks of data that neither was fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Error of a prediction that the values of a block have in common, in standard deviations of noise.
_SHARED = 0.06


def surely(
    gain: NDArray[np.float64], square: NDArray[np.float64], size: NDArray[np.float64], block: NDArray, white: float
) -> tuple[float, float]:
    """Return (the whole gain, how many standard errors it is).

    Where an effect shows in few blocks, its gain differs between them without being uncertain. What it may be wrong by is
    put together of what noise does to a gain, 4 sum of squared changes; of an error of a share of the noise that all
    values of a block have in common; and of the losses of blocks that got worse, which speak against it.

    Parameters
    ----------
    gain : (F,) float
        Held-out chi-square of the model before less that of the model after, per frame or group.
    square, size : (F,) float
        Sums of the squared and of the absolute change of the prediction, in units of noise.
    block : (F,) int
        To which block each belongs.
    white : float
        Standard deviation of what is noise in the residual.
    """
    variance = 0.0
    for b in np.unique(block):
        own = block == b
        shared, loss = 2 * _SHARED * size[own].sum(), min(gain[own].sum(), 0.0)
        variance += 4 * white**2 * square[own].sum() + shared**2 + loss**2
    return float(gain.sum()), float(gain.sum() / np.sqrt(max(variance, 1e-12)))
