"""Extinction of spray and mist at a point: exponential in height above the ground (eq 6.6), wakes of vehicles, times noise."""

import math

import numpy as np
from numba import njit, prange

from materials.kernels.lean import lean

from .noise import spectral_3d
from .wakes import wake_bound, wake_density


@lean(error_model="numpy")
def ground_height(ground, frame, x, y):
    """Return the height of the ground map (rows, cols) at a place, bilinear, clamped; `frame` is (x_min, y_min, cell)."""
    rows, cols = ground.shape
    v = min(max((y - frame[1]) / frame[2] - 0.5, 0.0), rows - 1.0)
    u = min(max((x - frame[0]) / frame[2] - 0.5, 0.0), cols - 1.0)
    r, c = int(v), int(u)
    r1, c1 = min(r + 1, rows - 1), min(c + 1, cols - 1)
    v, u = v - r, u - c
    near = ground[r, c] * (1.0 - u) + ground[r, c1] * u
    far = ground[r1, c] * (1.0 - u) + ground[r1, c1] * u
    return near * (1.0 - v) + far * v


@lean(error_model="numpy")
def unevenness(p, noise, seed):
    """Return P of eq 6.6 at a point: mean 1, within [0, 2]; `noise` is (scale, exponent, octaves, contrast).

    Cut off at both ends alike: as the noise is as often above 0 as below, the mean remains 1.
    """
    if noise[3] == 0.0:
        return 1.0
    n = spectral_3d(p[0], p[1], p[2], noise[0], noise[1], int(noise[2]), seed)
    return min(max(1.0 + noise[3] * n, 0.0), 2.0)


@lean(error_model="numpy")
def extinction(p, sigma, ground, frame, scale_height, wakes, noise, seed):
    """Return P (sigma exp(-d / scale height) + wakes) at a point [1/m]; below the ground d is 0."""
    d = max(p[2] - ground_height(ground, frame, p[0], p[1]), 0.0)
    mean = sigma * math.exp(-d / scale_height) + wake_density(wakes, p[0], p[1], d)
    # Where there is nothing, the noise, which costs the most, need not be known.
    return mean * unevenness(p, noise, seed) if mean > 0.0 else 0.0


@njit(cache=True, parallel=True)
def extinction_many(points, sigma, ground, frame, scale_height, wakes, noise, seed, out):
    """Loop over `extinction`; points (N, 3), out (N,)."""
    for i in prange(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        out[i] = extinction(p, sigma, ground, frame, scale_height, wakes, noise, seed)


@njit(cache=True, parallel=True, error_model="numpy")
def upper_bounds(ground, frame, scale_height, sigma, wakes, largest, low, size, out):
    """Fill (nz, ny, nx) with the largest extinction that cells of a box may hold; `low` its corner, `size` (x, y, z) of a cell.

    `largest` is the most that the noise makes of its mean.
    """
    nz, ny, nx = out.shape
    rows, cols = ground.shape
    for j in prange(ny):
        # All nodes that are interpolated into the cell; rounding may put a point a hair outside of it.
        v0 = (low[1] + j * size[1] - frame[1]) / frame[2] - 0.5
        r0, r1 = math.floor(v0 - 1e-3), math.ceil(v0 + size[1] / frame[2] + 1e-3)
        for i in range(nx):
            u0 = (low[0] + i * size[0] - frame[0]) / frame[2] - 0.5
            c0, c1 = math.floor(u0 - 1e-3), math.ceil(u0 + size[0] / frame[2] + 1e-3)
            top = -math.inf
            for r in range(min(max(r0, 0), rows - 1), min(max(r1, 0), rows - 1) + 1):
                for c in range(min(max(c0, 0), cols - 1), min(max(c1, 0), cols - 1) + 1):
                    top = max(top, ground[r, c])
            for k in range(nz):
                d = max(low[2] + k * size[2] - top, 0.0)
                x, y = low[0] + i * size[0], low[1] + j * size[1]
                e = 1e-3 * frame[2]
                mean = sigma * math.exp(-d / scale_height)
                mean += wake_bound(wakes, x - e, x + size[0] + e, y - e, y + size[1] + e, max(d - e, 0.0))
                # The share on top covers what float32 rounds off.
                out[k, j, i] = np.float32(1.00001 * largest * mean)
