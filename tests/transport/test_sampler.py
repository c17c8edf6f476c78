"""Sample points are evenly spread, independent where they must be, and the same every time."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy.stats import chi2

from transport.kernels.sampler import draw1, draw2, hash2


@njit
def points(stream, first, count, dimension):
    out = np.empty((count, 2))
    for i in range(count):
        out[i, 0], out[i, 1] = draw2(stream, first + i, dimension)
    return out


@njit
def numbers(stream, count, dimension):
    out = np.empty(count)
    for i in range(count):
        out[i] = draw1(stream, i, dimension)
    return out


@njit
def streams(count, seed):
    out = np.empty(count, np.uint32)
    for i in range(count):
        out[i] = hash2(np.uint32(i), np.uint32(seed))
    return out


@pytest.mark.parametrize("dimension", [0, 2, 7, 35])
@pytest.mark.parametrize("bits", [1, 4, 6, 8])
def test_every_block_of_a_power_of_two_fills_every_elementary_interval_once(dimension, bits):
    # The definition of a (0, 2)-sequence in base 2, for the first block and a later one.
    n = 1 << bits
    for first in (0, 3 * n):
        xy = points(np.uint32(12345), first, n, dimension)
        for a in range(bits + 1):
            cell = (xy[:, 0] * (1 << a)).astype(int) * (1 << (bits - a)) + (xy[:, 1] * (1 << (bits - a))).astype(int)
            assert len(set(cell)) == n


def test_numbers_of_one_dimension_are_evenly_spread_too():
    x = numbers(np.uint32(99), 256, 3)
    assert sorted((x * 256).astype(int)) == list(range(256))


def test_points_lie_in_the_half_open_square():
    xy = np.concatenate([points(np.uint32(s), 0, 4096, 0) for s in range(16)])
    assert xy.min() >= 0 and xy.max() < 1


def p_of_independence(x, y, bins=8):
    table = np.histogram2d(x, y, bins=bins, range=[[0, 1], [0, 1]])[0]
    expected = len(x) / bins**2
    return chi2.sf(((table - expected) ** 2 / expected).sum(), bins**2 - 1)


def test_dimensions_and_pixels_are_independent():
    # One sample per stream: within a stream, stratification makes points more even than chi-square expects.
    n = 20_000
    s = streams(n, 0)
    other = streams(n, 1)
    draws = {k: np.array([points(t, 5, 1, k)[0] for t in s]) for k in (0, 1, 2)}
    alone = np.array([points(t, 5, 1, 0)[0] for t in other])
    lobe = np.array([numbers(t, 6, 3)[5] for t in s])
    p = {
        "x and y": p_of_independence(*draws[0].T),
        "pixel and first direction": p_of_independence(draws[0][:, 0], draws[1][:, 0]),
        "pixel and first direction, crossed": p_of_independence(draws[0][:, 0], draws[1][:, 1]),
        "neighbouring dimensions": p_of_independence(draws[1][:, 1], draws[2][:, 1]),
        "direction and lobe": p_of_independence(draws[2][:, 0], lobe),
        "neighbouring pixels": p_of_independence(draws[0][:-1, 0], draws[0][1:, 0]),
        "seeds": p_of_independence(draws[0][:, 0], alone[:, 0]),
    }
    assert min(p.values()) > 0.01 / len(p), p


def test_dimensions_of_one_pixel_are_paired_in_shuffled_order():
    # All 256 samples of each of 100 pixels: a pairing that followed the index would put the points on few diagonals.
    x = np.concatenate([points(t, 0, 256, 0)[:, 0] for t in streams(100, 4)])
    y = np.concatenate([points(t, 0, 256, 9)[:, 1] for t in streams(100, 4)])
    # Both margins are exactly even, which takes 2 (bins - 1) degrees of freedom away; the pairing itself must be random.
    table = np.histogram2d(x, y, bins=8, range=[[0, 1], [0, 1]])[0]
    expected = len(x) / 64
    assert chi2.sf(((table - expected) ** 2 / expected).sum(), 49) > 0.01


def test_no_two_pixels_of_an_image_share_a_stream():
    assert len(set(streams(200_000, 7))) == 200_000


def test_the_same_seed_gives_the_same_bits_for_ever():
    # Written down once, as 32-bit integers: a change of these values changes every picture, and must be meant.
    pairs = points(hash2(np.uint32(0), np.uint32(0)), 0, 2, 0) * 2**32
    assert pairs.tolist() == [[1582238446, 938140984], [2896878882, 3247733567]]
    assert (numbers(hash2(np.uint32(41), np.uint32(7)), 2, 3) * 2**32).tolist() == [3985574385, 1208579163]


def test_the_integral_of_a_smooth_function_converges_faster_than_with_independent_samples():
    def error(n):
        means = []
        for t in streams(64, 3):
            x, y = points(t, 0, n, 4).T
            means.append(np.mean(np.exp(x) * np.cos(y)))
        return np.sqrt(np.mean((np.array(means) - (np.e - 1) * np.sin(1)) ** 2))

    # Owen-scrambled (0, 2)-sequences reach n^-3/2 up to logarithms; n^-1/2 would be a factor of 8 from 16 to 1024.
    assert error(16) / error(1024) > 100
