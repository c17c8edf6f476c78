"""Textured pairs whose motion is exact: a sum of waves, evaluated where each pixel came from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def texture(x: NDArray, y: NDArray, seed: int = 0) -> NDArray[np.float64]:
    """Return 0 to 255: 60 plane waves of 4 to 60 px, power falling with frequency as in natural pictures."""
    rng = np.random.default_rng(seed)
    total = np.zeros(np.broadcast(x, y).shape)
    for _ in range(60):
        wavelength = np.exp(rng.uniform(np.log(4), np.log(60)))
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        k = 2 * np.pi / wavelength
        total += wavelength**0.5 * np.sin(k * (np.cos(angle) * x + np.sin(angle) * y) + phase)
    return 127.5 + 110 * np.clip(total / 80, -1, 1)


def moved_pair(A: NDArray, b: NDArray, height: int = 96, width: int = 128) -> tuple[NDArray, NDArray, NDArray]:
    """Return two 8-bit pictures and the true flow (H, W, 2) of the motion p -> c + A (p - c) + b about the centre c.

    The second picture shows at p' what the first shows at the place that p' came from.
    """
    y, x = np.mgrid[:height, :width].astype(float)
    c = np.array([(width - 1) / 2, (height - 1) / 2])
    p = np.stack([x, y], axis=-1) - c
    back = (p - b) @ np.linalg.inv(A).T + c
    first, second = texture(x, y), texture(back[..., 0], back[..., 1])
    return np.rint(first).astype(np.uint8), np.rint(second).astype(np.uint8), p @ A.T + b - p


def rotation(degrees: float) -> NDArray[np.float64]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])
