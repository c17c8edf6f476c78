"""How noisy a recording is, if it does not say so, beside pictures that were simulated of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scene.images import Encoding
from scene.recording import Noise

from ..case import Floats, fitted_noise, noise_levels


def noise_of_pair(recorded: Floats, simulated: Floats, valid: NDArray[np.bool_], encodings: tuple[Encoding, ...] = ()) -> Noise:
    """Estimate `read_sigma` and `shot_gain` from the finest differences of the recording, and of what the simulation leaves.

    Texture speaks in the first, a displaced simulation in the second, both upwards: at each level of brightness the lower
    one is taken. Below what rounding to integers does nothing is believed.

    Parameters
    ----------
    encodings : of the files of both
    """
    rows = noise_levels(recorded, recorded, valid)
    if not len(rows):
        return fitted_noise(rows, 1e-3)
    rest = noise_levels(recorded, recorded - simulated, valid)
    rows[:, 1] = np.minimum(rows[:, 1], rest[:, 1])
    rounding = sum(rounding_variance(rows[:, 0], e) for e in encodings)
    rows[:, 1] = np.maximum(rows[:, 1], rounding)
    return fitted_noise(rows)


def rounding_variance(level: NDArray[np.float64], encoding: Encoding) -> NDArray[np.float64]:
    """Return what rounding to integers adds to the variance of linear values."""
    if encoding.dtype not in ("uint8", "uint16"):
        return np.zeros_like(level)
    step = 1 / (255 if encoding.dtype == "uint8" else 65535)
    slope = np.ones_like(level)
    if encoding.response == "srgb":
        code = np.clip(level, 0.0031308, 1) ** (1 / 2.4) * 1.055 - 0.055
        slope = 2.4 / 1.055 * ((code + 0.055) / 1.055) ** 1.4
    return (slope * step) ** 2 / 12
