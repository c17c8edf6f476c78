"""Phase functions: normalised, sampled as stated, with the mean cosine that their formulas promise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2

from materials import phase
from materials.foundation.errors import InputError

NUM_SAMPLES = 100_000
CASES = {
    "isotropic": phase.henyey_greenstein(0.0),
    "forward": phase.henyey_greenstein(0.8),
    "backward": phase.henyey_greenstein(-0.5),
    "almost isotropic": phase.henyey_greenstein(2e-5),
    "fog": phase.droplets(5.0),
    "mist": phase.droplets(12.0),
    "drizzle": phase.droplets(50.0),
}
PER_TEST = 1 - (1 - 0.01) ** (1 / (3 * len(CASES)))  # Sidak, over all cells' and means' tests below


NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def integral(p, of=lambda c: np.ones_like(c), low=-1.0, high=1.0):
    """Integrate over the sphere between two cosines, on nodes that crowd towards 1 where the peak is."""
    x, w = NODES, WEIGHTS
    # c = 1 - v^8: a peak of width 1e-4 in 1 - c spans a third of v
    v0, v1 = ((1 - c) ** 0.125 for c in (high, low))
    v = 0.5 * (v1 - v0) * x + 0.5 * (v1 + v0)
    c = np.clip(1 - v**8, -1, 1)
    return 2 * np.pi * np.sum(0.5 * (v1 - v0) * w * 8 * v**7 * phase.evaluate(p, c) * of(c))


@pytest.mark.parametrize("name", CASES)
def test_a_collision_sends_light_somewhere_with_certainty(name):
    assert integral(CASES[name]) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_the_mean_cosine_is_that_of_the_density(name):
    assert phase.mean_cosine(CASES[name]) == pytest.approx(integral(CASES[name], lambda c: c), abs=1e-9)


def test_the_mean_cosine_of_henyey_and_greenstein_is_g():
    for g in (-0.9, 0.0, 0.3, 0.99):
        assert phase.mean_cosine(phase.henyey_greenstein(g)) == g


def drawn_cosines(p, d, seed=3):
    xi = np.random.default_rng(seed).random((NUM_SAMPLES, 2))
    return phase.sample(p, d, xi)


def p_value(p, w, d):
    """Chi-square of drawn directions over 40 cells of cosine, times 8 azimuths."""
    # Where Henyey-Greenstein of the same mean has its quantiles; the cells' masses are integrals of the density under test.
    u, g = np.linspace(0, 1, 41)[1:-1], phase.mean_cosine(p)
    edges = 2 * u - 1 if abs(g) < 1e-3 else (1 + g * g - ((1 - g * g) / (1 - g + 2 * g * u)) ** 2) / (2 * g)
    ends = np.concatenate([[-1.0], edges, [1.0]])
    masses = np.array([integral(p, low=a, high=b) for a, b in pairwise(ends)])
    t = np.cross(d, (0.6, 0.0, 0.8))
    t /= np.linalg.norm(t)
    azimuth = np.arctan2(w @ np.cross(d, t), w @ t) / (2 * np.pi) % 1
    cell = np.searchsorted(edges, w @ d) * 8 + np.minimum((azimuth * 8).astype(int), 7)
    counts = np.bincount(cell, minlength=320)
    expected = len(w) * np.repeat(masses, 8) / 8
    assert expected.min() > 10
    return chi2.sf(np.sum((counts - expected) ** 2 / expected), 319)


DIRECTION = np.array([0.36, -0.48, 0.8])


@pytest.mark.parametrize("name", CASES)
def test_directions_are_drawn_with_the_density_stated(name):
    w = drawn_cosines(CASES[name], DIRECTION)
    assert np.allclose(np.linalg.norm(w, axis=1), 1, atol=1e-12)
    assert p_value(CASES[name], w, DIRECTION) > PER_TEST


def test_a_wrong_mean_cosine_is_caught():
    w = drawn_cosines(phase.henyey_greenstein(0.8), DIRECTION)
    assert p_value(phase.henyey_greenstein(0.79), w, DIRECTION) < PER_TEST
    w = drawn_cosines(phase.droplets(12.0)._replace(alpha_draine=10.0), DIRECTION)
    assert p_value(phase.droplets(12.0), w, DIRECTION) < PER_TEST


@pytest.mark.parametrize("name", CASES)
def test_the_extreme_variates_give_finite_directions(name):
    edge = np.array([0.0, 1e-300, 0.5, np.nextafter(1.0, 0.0)])
    xi = np.stack(np.meshgrid(edge, edge), -1).reshape(-1, 2)
    for d in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0)):
        w = phase.sample(CASES[name], d, xi)
        assert np.allclose(np.linalg.norm(w, axis=1), 1, atol=1e-12)
    assert np.all(np.isfinite(phase.evaluate(CASES[name], [-1.0, 1.0])))


def test_larger_droplets_scatter_more_forward():
    g = [phase.mean_cosine(phase.droplets(d)) for d in (5, 8, 12, 20, 50)]
    assert np.all(np.diff(g) > 0)
    # Mie's asymmetry of cloud droplets in the visible is 0.85 to 0.87 (the fit leaves out part of the diffraction peak)
    assert g[0] > 0.80 and g[-1] < 0.90


def test_what_is_no_phase_function_is_refused():
    with pytest.raises(InputError, match=r"g must lie in \(-1, 1\), got 1"):
        phase.henyey_greenstein(1.0)
    with pytest.raises(InputError, match=r"diameter_um must lie in \[5, 50\], got 2"):
        phase.droplets(2.0)
    with pytest.raises(InputError, match=r"cos_theta must lie in \[-1, 1\], got 1\.5"):
        phase.evaluate(phase.henyey_greenstein(0.1), 1.5)
    with pytest.raises(InputError, match=r"xi must lie in \[0, 1\), got 1"):
        phase.sample(phase.henyey_greenstein(0.1), (0, 0, 1), [[1.0, 0.0]])
    with pytest.raises(InputError, match="direction must have unit length, got 2"):
        phase.sample(phase.henyey_greenstein(0.1), (0, 0, 2), [[0.5, 0.0]])
