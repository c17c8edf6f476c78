"""Random numbers that depend only on (seed, pixel, sample, dimension): threads cannot change the picture.

Two-dimensional Sobol points with hash-based Owen scrambling and index shuffling, padded to any number of dimensions:
B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; permutation constants by N. Vegdahl (2021).
Second Sobol dimension by the Pascal matrix, A. Ahmed, "An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant,
and Compact", EGSR 2024.
"""

import numpy as np
from numba import njit

_TO_UNIT = 2.0**-32


@njit(cache=True)
def hash2(a, b):
    """Mix two 32-bit words into one (the finaliser of MurmurHash3 on their combination)."""
    x = np.uint32(np.uint32(a) ^ np.uint32(np.uint32(b) * np.uint32(0x9E3779B9) + np.uint32(0x85EBCA6B)))
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x85EBCA6B))
    x = np.uint32(x ^ (x >> np.uint32(13)))
    x = np.uint32(x * np.uint32(0xC2B2AE35))
    return np.uint32(x ^ (x >> np.uint32(16)))


@njit(cache=True)
def _reverse_bits(x):
    x = np.uint32((x >> np.uint32(16)) | (x << np.uint32(16)))
    x = np.uint32(((x & np.uint32(0xFF00FF00)) >> np.uint32(8)) | ((x & np.uint32(0x00FF00FF)) << np.uint32(8)))
    x = np.uint32(((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4)) | ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)))
    x = np.uint32(((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2)) | ((x & np.uint32(0x33333333)) << np.uint32(2)))
    return np.uint32(((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1)) | ((x & np.uint32(0x55555555)) << np.uint32(1)))


@njit(cache=True)
def _permute(x, seed):
    """Owen-scramble a number whose bits are reversed: each bit is flipped by a hash of the bits below it."""
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x3D20ADEA)))
    x = np.uint32(x + seed)
    x = np.uint32(x * np.uint32((seed >> np.uint32(16)) | np.uint32(1)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x05526C56)))
    return np.uint32(x ^ np.uint32(x * np.uint32(0x53A22864)))


@njit(cache=True)
def _pascal(x):
    """Multiply the bits of x by the Pascal matrix modulo 2: the second Sobol dimension, bits reversed."""
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x ^ ((x & np.uint32(0xFF00FF00)) >> np.uint32(8)))
    x = np.uint32(x ^ ((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4)))
    x = np.uint32(x ^ ((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2)))
    return np.uint32(x ^ ((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1)))


@njit(cache=True)
def draw2(stream, index, dimension):
    """Return a point in [0, 1)² of sample `index`; `stream` is the hash of pixel and seed.

    Each `dimension` (a pair) is an Owen-scrambled (0, 2)-sequence of its own, in shuffled order.
    """
    seed = hash2(stream, np.uint32(dimension))
    i = _reverse_bits(_permute(_reverse_bits(np.uint32(index)), seed))
    x = _reverse_bits(_permute(i, hash2(seed, np.uint32(1))))
    y = _reverse_bits(_permute(_pascal(i), hash2(seed, np.uint32(2))))
    return x * _TO_UNIT, y * _TO_UNIT


@njit(cache=True)
def draw1(stream, index, dimension):
    """Return a number in [0, 1) of sample `index`, independent of the pairs of `draw2` of other dimensions."""
    seed = hash2(stream, np.uint32(dimension))
    i = _reverse_bits(_permute(_reverse_bits(np.uint32(index)), seed))
    return _reverse_bits(_permute(i, hash2(seed, np.uint32(1)))) * _TO_UNIT
