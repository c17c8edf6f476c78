"""Reflectance of interfaces against closed forms and quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from materials import fresnel
from materials.foundation.errors import InputError
from materials.kernels import fresnel as kernel

indices = st.floats(1.01, 3.0)
cosines = st.floats(0.0, 1.0)


@given(st.floats(0.3, 3.0))
def test_fresnel_at_normal_incidence_is_the_square_of_the_index_contrast(eta):
    assert kernel.dielectric(1.0, eta) == pytest.approx(((eta - 1) / (eta + 1)) ** 2, abs=1e-15)


@given(st.floats(0.3, 3.0))
def test_at_brewsters_angle_only_one_polarisation_is_reflected(eta):
    cos_brewster = 1 / math.sqrt(1 + eta * eta)
    r_s = (1 - eta * eta) / (1 + eta * eta)
    assert kernel.dielectric(cos_brewster, eta) == pytest.approx(0.5 * r_s * r_s, rel=1e-12, abs=1e-15)


@given(indices)
def test_light_is_wholly_reflected_beyond_the_critical_angle_and_not_before(eta):
    critical = math.sqrt(1 - 1 / eta**2)
    assert kernel.dielectric(critical * (1 - 1e-6), 1 / eta) == 1
    assert kernel.dielectric(critical + 1e-6 * (1 - critical), 1 / eta) < 1


@given(cosines, indices)
def test_reflectance_is_the_same_along_the_ray_in_either_direction(cos_i, eta):
    cos_t = math.sqrt(1 - (1 - cos_i**2) / eta**2)
    # at grazing, rounding of 1e-16 in cos_t becomes 2e-8 in cos_i, and F falls by up to 28 per unit of it (eta = 1.01)
    assert kernel.dielectric(cos_t, 1 / eta) == pytest.approx(kernel.dielectric(cos_i, eta), abs=1e-6)


def test_matching_indices_reflect_nothing():
    assert np.all(fresnel.dielectric(np.linspace(0, 1, 11), 1.0) == 0)


@given(cosines, indices)
def test_a_metal_without_extinction_is_a_dielectric(cos_i, eta):
    assert kernel.conductor(cos_i, eta, 0.0) == pytest.approx(kernel.dielectric(cos_i, eta), abs=1e-12)


@given(cosines, st.floats(0.1, 4), st.floats(0, 8))
def test_a_metal_reflects_as_complex_fresnel_says(cos_i, eta, k):
    n = complex(eta, k)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / n**2)
    r_s, r_p = (cos_i - n * cos_t) / (cos_i + n * cos_t), (n * cos_i - cos_t) / (n * cos_i + cos_t)
    assert kernel.conductor(cos_i, eta, k) == pytest.approx(0.5 * (abs(r_s) ** 2 + abs(r_p) ** 2), abs=1e-9)


def test_schlick_meets_fresnel_at_normal_incidence_and_at_grazing():
    assert np.allclose(fresnel.schlick([0.0, 1.0], 1.5), fresnel.dielectric([0.0, 1.0], 1.5), atol=1e-15)


@pytest.mark.parametrize("eta", [1.0005, 1.05, 1.33, 1.5, 2.0, 3.0])
def test_diffuse_reflectance_is_the_average_of_fresnel_over_the_hemisphere(eta):
    outside, _ = quad(lambda c: 2 * c * kernel.dielectric(c, eta), 0, 1, epsabs=1e-11, limit=200)
    critical = math.sqrt(1 - 1 / eta**2)
    inside, _ = quad(lambda c: 2 * c * kernel.dielectric(c, 1 / eta), critical, 1, epsabs=1e-11, limit=200)
    bound = 1e-8 if eta > 1.001 else 1e-4  # below 1.001 a chord
    assert kernel.diffuse_external(eta) == pytest.approx(outside, abs=bound)
    assert kernel.diffuse_internal(eta) == pytest.approx(inside + critical**2, abs=bound)


@given(st.floats(1.0, 3.0), st.floats(0.0, 5.0))
def test_absorption_dims_internal_reflection_as_the_integral_says(eta, tau):
    critical = math.sqrt(1 - 1 / eta**2)

    def integrand(mu):
        return 2 * mu * math.exp(-2 * tau / mu) * kernel.dielectric(mu, 1 / eta) if mu > 0 else 0.0

    total, _ = quad(integrand, 0, critical, epsabs=1e-9, limit=200)
    rest, _ = quad(integrand, critical, 1, epsabs=1e-9, limit=200)
    assert kernel.diffuse_internal_absorbed(eta, tau) == pytest.approx(total + rest, abs=1e-4)


def test_refusals_name_argument_and_range():
    with pytest.raises(InputError, match=r"cos_i must lie in \[0, 1\], got 1.2 at index 1"):
        fresnel.dielectric([0.5, 1.2], 1.5)
    with pytest.raises(InputError, match=r"eta must lie in \[1, 3\]"):
        fresnel.diffuse_internal(0.7)
    with pytest.raises(InputError, match="k must lie in"):
        fresnel.conductor(0.5, 1.5, -1.0)
