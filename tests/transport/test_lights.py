"""Lights are sampled with the density that they state, and bring the irradiance that they promise."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit
from scipy.stats import chi2

from materials.foundation.errors import InputError
from scene.simulation import DirectionalLight, EnvironmentLight, PointLight
from transport.kernels.lights import environment_pdf, environment_radiance, sample_environment, sample_sun, sun_pdf
from transport.world import compile_lights


@njit
def draw(panorama, rows, cols, xi):
    w, p, again = np.empty((len(xi), 3)), np.empty(len(xi)), np.empty(len(xi))
    for i in range(len(xi)):
        w[i, 0], w[i, 1], w[i, 2], p[i] = sample_environment(panorama, rows, cols, xi[i, 0], xi[i, 1])
        again[i] = environment_pdf(panorama, rows, cols, w[i, 0], w[i, 1], w[i, 2])
    return w, p, again


@njit
def densities(panorama, rows, cols, w):
    out = np.empty(len(w))
    for i in range(len(w)):
        out[i] = environment_pdf(panorama, rows, cols, w[i, 0], w[i, 1], w[i, 2])
    return out


@njit
def radiances(panorama, w):
    out = np.empty((len(w), 3))
    for i in range(len(w)):
        out[i, 0], out[i, 1], out[i, 2] = environment_radiance(panorama, w[i, 0], w[i, 1], w[i, 2])
    return out


@njit
def sun_points(suns, xi):
    w, e, p = np.empty((len(xi), 3)), np.empty((len(xi), 3)), np.empty(len(xi))
    for i in range(len(xi)):
        w[i, 0], w[i, 1], w[i, 2], e[i, 0], e[i, 1], e[i, 2] = sample_sun(suns, 0, xi[i, 0], xi[i, 1])
        p[i] = sun_pdf(suns, 0, w[i, 0], w[i, 1], w[i, 2])
    return w, e, p


def patchy_sky():
    sky = np.random.default_rng(2).random((12, 24, 3)).astype(np.float32) ** 4
    sky[2, 20] = 40.0
    sky[8:, :] = 0.0
    return sky


def lights(panorama):
    return compile_lights({"sky": EnvironmentLight(panorama=panorama)})


def direction(row, col, height, width):
    theta, phi = np.pi * row / height, (col / width - 0.5) * 2 * np.pi
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def test_directions_of_the_sky_are_drawn_with_their_stated_density():
    arrays = lights(patchy_sky())
    n = 200_000
    w, p, again = draw(arrays.panorama, arrays.row_cdf, arrays.col_cdf, np.random.default_rng(3).random((n, 2)))
    np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1, atol=1e-12)
    # On the border between two texels rounding may look up the neighbour's density; that happens to few in 10^5.
    assert np.mean(np.abs(again / p - 1) > 1e-9) < 1e-4
    # Cells of one texel have a constant density, so their mass is exact.
    rows, cols = 12, 24
    centre = direction(*np.meshgrid(np.arange(rows) + 0.5, np.arange(cols) + 0.5, indexing="ij"), rows, cols).reshape(-1, 3)
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    solid_angle = np.repeat((edges[:-1] - edges[1:]) * 2 * np.pi / cols, cols)
    mass = densities(arrays.panorama, arrays.row_cdf, arrays.col_cdf, centre) * solid_angle
    assert abs(mass.sum() - 1) < 1e-12
    row = np.minimum((np.arccos(w[:, 2]) / np.pi * rows).astype(int), rows - 1)
    col = np.minimum(((np.arctan2(w[:, 1], w[:, 0]) / (2 * np.pi) + 0.5) * cols).astype(int), cols - 1)
    counts = np.bincount(row * cols + col, minlength=rows * cols)
    small = mass * n < 10
    observed = np.append(counts[~small], counts[small].sum())
    expected = np.append(mass[~small], mass[small].sum()) * n
    assert chi2.sf(((observed - expected) ** 2 / np.maximum(expected, 1e-9)).sum(), len(expected) - 1) > 0.01


def test_wherever_the_sky_shines_it_can_be_drawn():
    arrays = lights(patchy_sky())
    w = np.random.default_rng(5).normal(size=(20_000, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    shines = radiances(arrays.panorama, w).max(axis=1) > 0
    assert np.all(densities(arrays.panorama, arrays.row_cdf, arrays.col_cdf, w)[shines] > 0)


def test_a_panorama_answers_at_its_texel_centres_and_wraps_at_the_back():
    sky = patchy_sky()
    arrays = lights(sky)
    row, col = np.meshgrid(np.arange(12) + 0.5, np.arange(24) + 0.5, indexing="ij")
    got = radiances(arrays.panorama, direction(row, col, 12, 24).reshape(-1, 3)).reshape(12, 24, 3)
    np.testing.assert_allclose(got, sky, rtol=1e-5, atol=1e-5)
    seam = radiances(arrays.panorama, np.array([direction(2.5, 24 - 1e-9, 12, 24), direction(2.5, 1e-9, 12, 24)]))
    np.testing.assert_allclose(seam, np.tile(0.5 * (sky[2, 0] + sky[2, -1]), (2, 1)), rtol=1e-5)


def test_the_columns_of_a_panorama_run_from_minus_pi_through_the_x_axis_to_pi():
    sky = np.zeros((16, 32, 3), np.float32)
    sky[0:2], sky[-2:] = (0, 0, 7), (7, 7, 0)
    sky[7:9, 15:17], sky[7:9, 23:25] = (7, 0, 0), (0, 7, 0)
    arrays = lights(sky)
    got = radiances(arrays.panorama, np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0, 0, -1.0], [-1.0, 0, 0]]))
    np.testing.assert_allclose(got, [[7, 0, 0], [0, 7, 0], [0, 0, 7], [7, 7, 0], [0, 0, 0]], atol=1e-5)


@pytest.mark.parametrize("radius", [0.00465, 0.1, 1.2])
def test_the_sun_is_a_disc_of_its_solid_angle_that_brings_its_irradiance(radius):
    towards = np.array([0.48, -0.6, 0.64])
    suns = compile_lights({"sun": DirectionalLight(tuple(-2 * towards), (3.0, 2.0, 1.0), radius)}).suns
    w, e, p = sun_points(suns, np.random.default_rng(1).random((50_000, 2)))
    solid_angle = 2 * np.pi * (1 - np.cos(radius))
    # 1 - cos loses digits to cancellation for a small disc: 1e-16 / 1e-5.
    np.testing.assert_allclose(p[p > 0], 1 / solid_angle, rtol=1e-9)
    assert np.mean(p == 0) < 1e-4  # the rim, by rounding
    cos = w @ towards
    assert np.arccos(np.clip(cos, -1, 1)).max() <= radius * (1 + 1e-6)
    # Uniform over the solid angle: cos is uniform between cos(radius) and 1.
    share = (1 - cos) / (1 - np.cos(radius))
    counts = np.histogram(share, bins=20, range=(0, 1 + 1e-9))[0]
    assert chi2.sf(((counts - 2500) ** 2 / 2500).sum(), 19) > 0.01
    # Irradiance on a plane that faces it: the mean of (radiance / density) times the cosine.
    received = e * cos[:, None]
    spread = received.std(axis=0) / np.sqrt(len(cos))
    assert np.all(np.abs(received.mean(axis=0) - (3, 2, 1)) < 4 * spread)


def test_a_sun_without_extent_shines_from_one_direction_and_is_met_by_no_ray():
    suns = compile_lights({"sun": DirectionalLight((0, 0, -3), (1.0, 1.0, 1.0))}).suns
    w, _, p = sun_points(suns, np.random.default_rng(1).random((10, 2)))
    assert np.allclose(w, (0, 0, 1)) and np.all(p == 0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"sun": DirectionalLight((0, 0, 0), (1, 1, 1))}, "lights.sun.direction must have a length"),
        ({"a": EnvironmentLight((1, 1, 1)), "b": EnvironmentLight((1, 1, 1))}, "lights.b must be the only environment"),
        ({"sky": EnvironmentLight(panorama=np.full((4, 8, 3), np.nan, np.float32))}, "lights.sky.panorama must be finite"),
        ({"sky": EnvironmentLight(panorama=np.full((4, 8, 3), -1, np.float32))}, "not negative"),
        ({"sky": EnvironmentLight((-1, 1, 1))}, "lights.sky.radiance must be finite and not negative"),
        ({"sun": DirectionalLight((0, 0, -1), (np.nan, 1, 1))}, "lights.sun.irradiance must be finite and not negative"),
        ({"sun": DirectionalLight((0, 0, -1), (1, 1, 1), -0.1)}, "lights.sun.angular_radius must lie in"),
        ({"lamp": PointLight((0, 0, 0), (-1, 1, 1))}, "lights.lamp.intensity must be finite and not negative"),
        ({"lamp": PointLight((0, np.inf, 0), (1, 1, 1))}, "lights.lamp.position must be finite"),
        ({"sky": EnvironmentLight(panorama=np.ones((4, 8), np.float32))}, "lights.sky.panorama must have shape"),
    ],
)
def test_impossible_lights_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        compile_lights(given)
