"""Gradient noise on an endless hashed lattice (Perlin 1985, 2002) and its sums over octaves.

Every value depends on its position and the seed alone, so neither the extent of an array nor the number of threads can
change it. Plain scalar functions, so that other kernels (a medium's tracking loop) can call them too.
"""

import numpy as np
from numba import njit, prange

_PRIMES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
_SHIFT = np.int64(2**62)
# A table of directions costs a tenth of sin and cos; 256 of them cannot be told from a continuum.
_ANGLES = 2 * np.pi * (np.arange(256) + 0.5) / 256
_COS, _SIN = np.cos(_ANGLES), np.sin(_ANGLES)
# The golden angle and its multiples, by which octaves are turned.
_TURN_COS, _TURN_SIN = np.cos(2.399963229728653 * (np.arange(16) + 0.5)), np.sin(2.399963229728653 * (np.arange(16) + 0.5))
# Mean square over a cell with quintic fade f: (2 B)^d A / B, where B and A are the integrals of (1 - f)^2 and x^2 (1 - f)^2.
# The gradients have unit length and all directions.
_A, _B = 535.0 / 18018.0, 181.0 / 462.0
VARIANCE_2D = 4 * _A * _B
VARIANCE_3D = 8 * _A * _B * _B


@njit(cache=True)
def mix(h):
    """Return a 64-bit hash of a 64-bit number (the finaliser of SplitMix64, Steele et al. 2014)."""
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return h ^ (h >> np.uint64(31))


@njit(cache=True)
def lattice(i, j, k, seed):
    """Return the hash of a lattice point; `seed` is a uint64."""
    # Moved by 2^62, since only the compiler, and not NumPy, wraps negative numbers into unsigned ones.
    h = mix(seed + np.uint64(i + _SHIFT) * _PRIMES[0])
    h = mix(h + np.uint64(j + _SHIFT) * _PRIMES[1])
    return mix(h + np.uint64(k + _SHIFT) * _PRIMES[2])


@njit(cache=True)
def fade(t):
    """Return the quintic of Perlin (2002): first and second derivative vanish at 0 and 1."""
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@njit(cache=True)
def _dot2(i, j, x, y, seed):
    h = lattice(i, j, np.int64(0), seed) >> np.uint64(56)
    return _COS[h] * x + _SIN[h] * y


@njit(cache=True)
def _dot3(h, x, y, z):
    """Return the product of (x, y, z) with the gradient that a hash stands for."""
    azimuth = h >> np.uint64(56)
    # Equal steps in z are equal areas on the sphere (Archimedes).
    cz = (np.float64((h >> np.uint64(40)) & np.uint64(0xFFFF)) + 0.5) / 32768.0 - 1.0
    r = np.sqrt(1.0 - cz * cz)
    return r * (_COS[azimuth] * x + _SIN[azimuth] * y) + cz * z


@njit(cache=True)
def gradient_2d(x, y, seed):
    """Return gradient noise of unit variance at one point, in units of the lattice."""
    i, j = np.int64(np.floor(x)), np.int64(np.floor(y))
    x, y = x - i, y - j
    u, v = fade(x), fade(y)
    a = (1 - u) * _dot2(i, j, x, y, seed) + u * _dot2(i + 1, j, x - 1, y, seed)
    b = (1 - u) * _dot2(i, j + 1, x, y - 1, seed) + u * _dot2(i + 1, j + 1, x - 1, y - 1, seed)
    return ((1 - v) * a + v * b) / np.sqrt(VARIANCE_2D)


@njit(cache=True)
def gradient_3d(x, y, z, seed):
    """Return gradient noise of unit variance at one point, in units of the lattice."""
    i, j, k = np.int64(np.floor(x)), np.int64(np.floor(y)), np.int64(np.floor(z))
    x, y, z = x - i, y - j, z - k
    u, v, w = fade(x), fade(y), fade(z)
    total = 0.0
    # `lattice` mixes i, then j, then k: what its corners share is mixed once, 14 times in place of 24.
    for di in range(2):
        hi = mix(seed + np.uint64(i + di + _SHIFT) * _PRIMES[0])
        wx = u if di == 1 else 1 - u
        for dj in range(2):
            hj = mix(hi + np.uint64(j + dj + _SHIFT) * _PRIMES[1])
            wy = v if dj == 1 else 1 - v
            a = _dot3(mix(hj + np.uint64(k + _SHIFT) * _PRIMES[2]), x - di, y - dj, z)
            b = _dot3(mix(hj + np.uint64(k + 1 + _SHIFT) * _PRIMES[2]), x - di, y - dj, z - 1)
            total += wx * wy * ((1 - w) * a + w * b)
    return total / np.sqrt(VARIANCE_3D)


@njit(cache=True)
def spectral_2d(x, y, scale, exponent, octaves, seed):
    """Return a sum of octaves of unit variance at one point [m]; `scale` is the largest lattice [m]."""
    total, power = 0.0, 0.0
    amplitude, frequency = 1.0, 1.0 / scale
    for octave in range(octaves):
        s = mix(seed + np.uint64(octave + 1))
        # Gradient noise is 0 on its lattice: each octave is turned by the golden angle and moved, or the zeros would
        # line up and show as a grid.
        c, d = np.cos(2.399963229728653 * (octave + 0.5)), np.sin(2.399963229728653 * (octave + 0.5))
        px, py = (c * x - d * y) * frequency, (d * x + c * y) * frequency
        offset_x, offset_y = _fraction(s >> np.uint64(40)), _fraction((s >> np.uint64(16)) & np.uint64(0xFFFFFF))
        total += amplitude * gradient_2d(px + offset_x, py + offset_y, s)
        power += amplitude * amplitude
        amplitude *= 2.0 ** (-0.5 * exponent)
        frequency *= 2.0
    return total / np.sqrt(power)


@njit(cache=True)
def spectral_3d(x, y, z, scale, exponent, octaves, seed):
    """As `spectral_2d`, in a volume; turned about all axes by the same angle."""
    total, power = 0.0, 0.0
    amplitude, frequency, falling = 1.0, 1.0 / scale, 2.0 ** (-0.5 * exponent)
    for octave in range(octaves):
        s = mix(seed + np.uint64(octave + 1))
        c, d = _TURN_COS[octave % 16], _TURN_SIN[octave % 16]
        px, py = c * x - d * y, d * x + c * y
        py, pz = c * py - d * z, d * py + c * z
        px, pz = c * px - d * pz, d * px + c * pz
        ox, oy = _fraction(s >> np.uint64(40)), _fraction((s >> np.uint64(16)) & np.uint64(0xFFFFFF))
        total += amplitude * gradient_3d(px * frequency + ox, py * frequency + oy, pz * frequency + ox + oy, s)
        power += amplitude * amplitude
        amplitude *= falling
        frequency *= 2.0
    return total / np.sqrt(power)


@njit(cache=True)
def _fraction(bits):
    """Return 24 bits as a number in [0, 1)."""
    return np.float64(bits) / 16777216.0


@njit(cache=True, parallel=True)
def spectral_2d_many(x, y, scale, exponent, octaves, seed, out):
    for n in prange(len(x)):
        out[n] = spectral_2d(x[n], y[n], scale, exponent, octaves, seed)


@njit(cache=True, parallel=True)
def spectral_3d_many(x, y, z, scale, exponent, octaves, seed, out):
    for n in prange(len(x)):
        out[n] = spectral_3d(x[n], y[n], z[n], scale, exponent, octaves, seed)
