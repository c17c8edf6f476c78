from __future__ import annotations

import numpy as np
import pytest

from materials.abrdf import ABRDF, from_grid, pairs
from materials.directions import even_directions, interpolation, solid_angles, spherical
from materials.foundation.errors import InputError

rng = np.random.default_rng(0)


def lambert(num_i: int = 20, num_o: int = 30) -> ABRDF:
    wi, wo = even_directions(num_i), even_directions(num_o)
    return from_grid(wi, wo, np.full((num_i, num_o, 3), 0.25 / np.pi))


def test_even_directions_share_the_cap_evenly():
    d = even_directions(151, 90)
    # Equal areas: the mean of z over the hemisphere is 1/2; the rule is exact for functions linear in z.
    assert np.isclose(d[:, 2].mean(), 0.5) and np.allclose(np.linalg.norm(d, axis=1), 1)


def test_solid_angles_fill_the_hemisphere_and_a_quadrant_has_its_quarter():
    d = spherical(np.full(4, np.radians(60)), np.radians([45, 135, 225, 315]))
    weights = solid_angles(d)
    assert np.isclose(weights.sum(), 2 * np.pi)
    # 40000 points have a spacing of 0.0125 rad; a quadrant's border of length pi moves at most half of that: 0.02 sr
    assert np.allclose(weights, np.pi / 2, atol=0.02)


def test_equal_directions_share_their_cell():
    d = np.array([[0, 0, 1.0], [0, 0, 1.0], [1, 0, 0], [-1, 0, 0]])
    weights = solid_angles(d)
    assert np.isclose(weights.sum(), 2 * np.pi) and weights[0] == weights[1]


def test_weights_integrate_the_albedo_of_a_matte_surface():
    d = even_directions(300, 90)
    a = from_grid(d, d, np.full((300, 300, 3), 0.25 / np.pi))
    albedo = np.sum(a.weight * a.value[:, 0] * a.wo[:, 2] * a.wi[:, 2]) / np.pi
    # Cells are known to about 3 % each, and their errors have both signs
    assert albedo == pytest.approx(0.25, rel=0.01)


def test_normalising_divides_out_the_cosine_and_back():
    a = lambert()
    shaded = a.with_cosine()
    assert not shaded.normalised
    assert np.allclose(shaded.value[:, 1], 0.25 / np.pi * a.wi[:, 2], rtol=1e-6)
    again = shaded.normalise()
    assert again.valid.all() and np.allclose(again.value, a.value, rtol=1e-6)


def test_light_along_the_surface_cannot_be_normalised():
    wi = np.array([[1.0, 0, 0], [0, 0, 1.0], [0.6, 0, 0.8]])
    a = from_grid(wi, wi[1:], np.ones((3, 2, 1)), channels=("R",), normalised=False)
    assert a.normalise().valid.tolist() == [False, False, True, True, True, True]


def test_interpolation_is_exact_for_what_is_linear_in_its_plane():
    known, wanted = even_directions(80), even_directions(33, 60)

    def linear(d):
        return 1 + d[:, :2] @ (0.3, -0.2) / np.sqrt(1 + d[:, 2])

    rule = interpolation(known, wanted)
    assert rule.inside.all() and np.allclose(rule(linear(known)), linear(wanted))


def test_a_grid_resampled_to_its_own_directions_comes_back():
    wi, wo = even_directions(12), even_directions(15)
    value = rng.random((2, 12, 15, 3))
    a = from_grid(wi, wo, value)
    again = a.resample(wi, wo)
    assert again.valid.all() and np.allclose(again.value, a.value, atol=1e-6)


def test_resampling_says_what_lies_outside_and_what_was_not_measured():
    wi = even_directions(40, 60)
    valid = np.ones((40, 40), bool)
    valid[3] = False
    a = from_grid(wi, wi, np.ones((40, 40, 1)), valid, channels=("R",))
    out = a.resample(np.array([[0, 0, 1.0], wi[3], spherical(1.4, 0.0)]), wi[5:6])
    assert out.valid.tolist() == [bool(np.linalg.norm(wi[3] - (0, 0, 1)) > 0.3), False, False] or not out.valid[1:].any()
    assert not out.valid[1] and not out.valid[2]


def test_isotropic_samples_are_resampled_by_their_azimuth_difference():
    def f(wi, wo):
        return 0.1 + 0.05 * (wi * wo).sum(axis=-1, keepdims=True)

    theta, phi = np.meshgrid(np.linspace(0, 1.3, 14), np.linspace(-np.pi, np.pi, 36, endpoint=False))
    wi, wo = pairs(spherical(np.linspace(0, 1.3, 10), 0.0), spherical(theta.ravel(), phi.ravel()))
    n = len(wi)
    value = f(wi, wo).astype(np.float32)
    a = ABRDF(wi, wo, value, np.ones(n, bool), np.ones(n), ("R",), isotropic=True)
    new_i, new_o = spherical(np.array([0.4, 0.9]), np.array([2.0, -1.0])), even_directions(10, 60)
    out = a.resample(new_i, new_o)
    # Linear interpolation of the cosine over steps h = 0.14 rad in three coordinates errs by 3 h²/8 x 0.05 = 4e-4 at most
    assert out.valid.all() and np.allclose(out.value, f(*pairs(new_i, new_o)), atol=4e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda a: {"value": a.value * -1}, "finite and not negative"),
        (lambda a: {"value": a.value * np.nan}, "finite and not negative"),
        (lambda a: {"wi": a.wi * (1, 1, -1)}, "wi's z must lie"),
        (lambda a: {"wo": a.wo * 2}, "wo must have unit length"),
        (lambda a: {"unit": "furlongs"}, "unit must be one of"),
        (lambda a: {"channels": ("R",)}, "value must have shape"),
        (lambda a: {"grid": (7, 7)}, "grid must have 600 pairs"),
    ],
)
def test_what_is_no_measurement_is_refused(change, words):
    from dataclasses import replace

    a = lambert()
    with pytest.raises(InputError, match=words):
        replace(a, **change(a))


def test_scattered_pairs_without_symmetry_cannot_be_resampled():
    a = lambert().select(np.arange(50))
    with pytest.raises(InputError, match="grid of directions or isotropic"):
        a.resample(a.wi[:3], a.wo[:3])
