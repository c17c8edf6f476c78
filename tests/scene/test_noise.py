import numba
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.noise import UNIT_SIGMA, octaves_between, spectral_noise_2d, spectral_noise_3d, to_unit
from scene.wetting.wetting_patterns import moisture_pattern, puddle_pattern


def grid(n, cell):
    x = (np.arange(n) + 0.5) * cell
    return np.meshgrid(x, x)


def test_gradient_noise_vanishes_on_its_lattice_and_is_smooth_between():
    from scene.kernels.noise import gradient_2d, gradient_3d

    seed = np.uint64(5)
    for i in range(-3, 4):
        assert gradient_2d(float(i), 2.0 - i, seed) == 0
        assert gradient_3d(float(i), 2.0 - i, 1.0, seed) == 0
    # Twice differentiable: across a lattice line, both one-sided slopes agree to the order of the step.
    h = 1e-6
    left = (gradient_2d(2.0, 0.3, seed) - gradient_2d(2.0 - h, 0.3, seed)) / h
    right = (gradient_2d(2.0 + h, 0.3, seed) - gradient_2d(2.0, 0.3, seed)) / h
    assert abs(left - right) < 1e-4


@pytest.mark.parametrize(("exponent", "octaves"), [(2.0, 1), (4.0, 4), (0.0, 3)])
def test_noise_has_mean_zero_and_variance_one_over_space(exponent, octaves):
    x, y = grid(512, 0.25)  # 128 x 128 lattice cells of the largest octave
    n = spectral_noise_2d(x, y, exponent=exponent, octaves=octaves, seed=3).astype(np.float64)
    # About one independent value per lattice cell: 16384 of them, so a standard error of 1/128 for the mean and of
    # sqrt(2)/128 for the variance of a Gaussian; four of each.
    assert abs(n.mean()) < 4 / 128
    assert abs(n.var() - 1) < 4 * np.sqrt(2) / 128


def test_noise_in_a_volume_has_mean_zero_and_variance_one():
    x = (np.arange(96) + 0.5) / 4
    n = spectral_noise_3d(*np.meshgrid(x, x, x), exponent=3, octaves=2, seed=9).astype(np.float64)
    cells = 24**3
    assert abs(n.mean()) < 4 / np.sqrt(cells)
    assert abs(n.var() - 1) < 4 * np.sqrt(2 / cells)


@pytest.mark.parametrize("exponent", [3.0, 4.0])
def test_octave_power_falls_as_one_over_f_to_the_exponent(exponent):
    # Six octaves, from 8 m to 0.25 m, on 64 m x 64 m at 6.25 cm. A window keeps the leakage of the steep spectrum from the
    # borders low; bands are one octave of |f| wide.
    n, cell = 1024, 0.0625
    x, y = grid(n, cell)
    values = spectral_noise_2d(x, y, scale=8.0, exponent=exponent, octaves=6, seed=2).astype(np.float64)
    window = np.hanning(n)
    power = np.abs(np.fft.fft2(values * window[:, None] * window)) ** 2
    f = np.hypot(np.fft.fftfreq(n, cell)[:, None], np.fft.fftfreq(n, cell))
    bands = np.array([power[(f >= 2.0**k / 8) & (f < 2.0 ** (k + 1) / 8)].sum() for k in range(1, 5)])
    slope = np.polyfit(np.arange(4), np.log2(bands), 1)[0]
    # Self-similar: inner bands follow the exponent but for their chance. The band of k = 1 holds 8 x 8 x 4 lattice cells
    # of its octave, the power of each with a relative standard deviation of sqrt(2), enlarged by (35/18) for each axis of
    # the window: 1.44 * sqrt(2) * 1.94 / 16 = 0.25 octaves, halved at each finer band; the weights of the fit are
    # -0.3, -0.1, 0.1, 0.3, giving a standard error of 0.08. Three of them.
    assert abs(slope + exponent) < 0.25


def test_noise_does_not_depend_on_threads_or_on_the_extent_of_the_array(thread_counts):
    x, y = grid(100, 0.13)
    whole = spectral_noise_2d(x - 5, y, scale=2, exponent=4, octaves=4, seed=1)
    part = spectral_noise_2d(x[20:50, 30:] - 5, y[20:50, 30:], scale=2, exponent=4, octaves=4, seed=1)
    assert np.array_equal(whole[20:50, 30:], part)
    for threads in thread_counts:
        numba.set_num_threads(threads)
        assert np.array_equal(whole, spectral_noise_2d(x - 5, y, scale=2, exponent=4, octaves=4, seed=1))


def test_neighbouring_seeds_are_unrelated():
    x, y = grid(256, 0.5)
    a, b = (spectral_noise_2d(x, y, seed=s).ravel() for s in (0, 1))
    # 128 x 128 cells: correlation has a standard error of 1/128.
    assert abs(np.corrcoef(a, b)[0, 1]) < 4 / 128


def test_puddles_cover_a_third_of_the_plane():
    x, y = grid(1000, 0.2)  # 100 x 100 cells of 2 m
    A0 = puddle_pattern(x, y, seed=4)
    assert A0.min() == 0 and A0.max() == 1
    # A binomial share of 1/3 among 10^4 cells has a standard error of 0.0047; that a sum of Perlin octaves is not exactly
    # Gaussian shifts the share by about 0.01 (kurtosis below 3).
    assert abs((A0 > 0.5).mean() - 1 / 3) < 0.01 + 3 * 0.0047


def test_every_moisture_is_about_equally_frequent():
    x, y = grid(800, 0.1)
    S0 = moisture_pattern(x, y, seed=4)
    assert S0.min() >= 0 and S0.max() <= 1
    # Stains of 2.4 m: 33 x 33 of them; their share of the variance (26 %) moves the mean by 0.29 * 0.5 / 33 = 0.005.
    assert abs(S0.mean() - 0.5) < 3 * 0.006
    assert np.histogram(S0, 10, (0, 1))[0].min() > 0.05 * S0.size


def test_noise_of_the_unit_interval_has_the_stated_statistics():
    x, y = grid(512, 0.5)
    P = to_unit(spectral_noise_2d(x, y, scale=2, exponent=4, octaves=5, seed=8))
    assert P.min() >= 0 and P.max() <= 1
    assert abs(P.mean() - 0.5) < 4 * UNIT_SIGMA / 128
    assert abs(P.std() - UNIT_SIGMA) < 4 * UNIT_SIGMA / (128 * np.sqrt(2))


def test_octaves_are_counted_with_both_ends():
    assert octaves_between(2, 2) == 1
    assert octaves_between(2, 0.125) == 5
    assert octaves_between(2, 0.1) == 5


def test_a_scale_of_zero_is_refused():
    with pytest.raises(InputError, match=r"scale must lie in \(0, inf\), got 0"):
        spectral_noise_2d(0.0, 0.0, scale=0)
    with pytest.raises(InputError, match="octaves must be a whole number"):
        spectral_noise_2d(0.0, 0.0, octaves=0)
