"""No surface makes light, clear ones lose none, and light may travel either way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from materials import conductor, cook_torrance, dielectric, disney, ggx, lambert, oren_nayar, phong, scattering, ward, water_film
from materials.kernels import albedo, bsdf, fresnel, rough_film

WHITE = (1.0, 1.0, 1.0)
CLEAR = (0.0, 0.0, 0.0)
OPAQUE = {
    "lambert": lambert.surface((0.2, 0.5, 0.8)),
    "ggx": ggx.surface((0.3, 0.2, 0.1), 0.3, alpha_v=0.6),
    "oren_nayar": oren_nayar.surface((0.2, 0.5, 0.8), 0.5),
    "phong": phong.surface((0.3, 0.2, 0.1), 0.3, specular_scale=0.5),
    "ward": ward.surface((0.3, 0.2, 0.1), 0.3, alpha_v=0.6, specular_scale=0.5),
    "cook_torrance": cook_torrance.surface((0.3, 0.2, 0.1), 0.3, alpha_v=0.6, eta=1.9),
    "conductor": conductor.surface(*conductor.METALS["copper"], 0.3, alpha_v=0.1),
    "disney": disney.surface((0.5, 0.2, 0.1), disney.Principled(anisotropic=0.5, clearcoat=0.5, sheen=0.3, metallic=0.3)),
    "film": water_film.coated((0.5, 0.3, 0.1), thickness=0.3, specular_scale=1.0, eta=1.9, alpha=0.4),
    "rough film": water_film.coated((0.5, 0.3, 0.1), film_alpha=0.4, thickness=0.3, specular_scale=1.0, eta=1.9),
}


@st.composite
def directions(draw, least=0.01):
    z, phi = draw(st.floats(least, 1)), draw(st.floats(0, 2 * math.pi))
    r = math.sqrt(1 - z * z)
    return (r * math.cos(phi), r * math.sin(phi), z)


def mean_weight(surface, cos_o, num_samples=40_000, seed=5):
    """Return the directional albedo by sampling, and its standard error."""
    wo = (math.sqrt(1 - cos_o**2), 0.0, cos_o)
    drawn = scattering.sample(surface, wo, np.random.default_rng(seed).random((num_samples, 3)))
    return drawn, drawn.weight.mean(0), drawn.weight.std(0) / math.sqrt(num_samples)


def smooth_film_albedo(surface, cos_o):
    """Return F + int f cos over the hemisphere by quadrature, f being the same around the normal."""
    x, w = np.polynomial.legendre.leggauss(400)
    q = 0.5 * (x + 1)
    cos = q * q  # F has a root at grazing
    wi = np.stack([np.sqrt(1 - cos**2), np.zeros_like(cos), cos], -1)
    wo = (math.sqrt(1 - cos_o**2), 0.0, cos_o)
    f = scattering.evaluate(surface, wo, wi)[:, 0]
    return fresnel.dielectric(cos_o, surface.film_eta) + 2 * math.pi * np.sum(f * cos * w * 0.5 * 2 * q)


@pytest.mark.parametrize("film_eta", [1.0, 1.05, 1.33, 1.5, 2.5])
@pytest.mark.parametrize("cos_o", [1.0, 0.5, 0.1, 0.01])
def test_a_white_base_below_a_clear_film_reflects_all_light(film_eta, cos_o):
    # what is left is the quadrature's: it halves its error with twice the nodes
    assert smooth_film_albedo(water_film.coated(WHITE, film_eta=film_eta), cos_o) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("cos_o", [1.0, 0.5, 0.1])
def test_sampling_a_white_base_below_a_clear_film_loses_no_light(cos_o):
    _, mean, error = mean_weight(water_film.coated(WHITE), cos_o)
    assert np.all(np.abs(mean - 1) < 4 * error + 1e-12)


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.4, 1.0])
@pytest.mark.parametrize("cos_o", [1.0, 0.7, 0.3, 0.1])
def test_a_white_base_below_a_rough_clear_film_reflects_all_light_within_the_tables_error(alpha, cos_o):
    _, mean, error = mean_weight(water_film.coated(WHITE, film_alpha=alpha), cos_o)
    assert np.all(np.abs(mean - 1) < 4 * error + 0.02)


@pytest.mark.parametrize("eta", [1.1, 1.33, 1.5, 2.4])
@pytest.mark.parametrize("alpha", [0.02, 0.15, 0.5])
@pytest.mark.parametrize("cos_o", [0.9, 0.4, 0.1])
def test_the_table_of_rough_reflectance_is_the_integral_of_the_lobe(eta, alpha, cos_o):
    gloss = water_film.coated(CLEAR, film_eta=eta, film_alpha=alpha)  # black base: only the film's own lobe
    _, mean, error = mean_weight(gloss, cos_o)
    assert rough_film.reflectance(cos_o, eta, alpha) == pytest.approx(mean[0], abs=0.02 + 4 * error[0])


@pytest.mark.parametrize("alpha", [0.05, 0.3, 0.7, 1.0])
@pytest.mark.parametrize("cos_o", [1.0, 0.5, 0.05])
def test_mirror_facets_make_no_light_and_sampling_integrates_their_lobe(alpha, cos_o):
    mirror_facets = ggx.surface(CLEAR, alpha, eta=1e9)  # Schlick's F is 1
    drawn, mean, error = mean_weight(mirror_facets, cos_o)
    assert drawn.weight.max() <= 1 + 1e-9  # each weight is G2 / G1
    assert mean[0] <= 1
    # the same integral without sampling; nodes of theta crowd at the mirror direction's azimuth and at the pole
    x, w = np.polynomial.legendre.leggauss(500)
    theta, phi = 0.25 * math.pi * (x + 1), math.pi * (0.5 * (x + 1)) ** 2
    w_phi = 2 * math.pi * 0.5 * (x + 1) * 0.5 * w
    t, p = np.meshgrid(theta, phi, indexing="ij")
    wi = np.stack([-np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1)
    f = scattering.evaluate(mirror_facets, (math.sqrt(1 - cos_o**2), 0.0, cos_o), wi)[..., 0]
    integral = 2 * (w * 0.25 * math.pi * np.sin(theta) * np.cos(theta)) @ f @ w_phi
    assert mean[0] == pytest.approx(integral, abs=4 * error[0] + 1e-3)


@pytest.mark.parametrize("alpha", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("cos_o", [1.0, 0.4, -0.4, -0.9])
def test_glass_passes_or_reflects_all_light_but_for_compression(alpha, cos_o):
    drawn, *_ = mean_weight(dielectric.surface(1.5, alpha), cos_o)
    passed = np.sign(drawn.wi[:, 2]) != np.sign(cos_o)
    compression = 1 / 1.5**2 if cos_o > 0 else 1.5**2
    energy = drawn.weight[:, 0] / np.where(passed, compression, 1)
    assert energy.max() <= 1 + 1e-9
    if alpha == 0:
        assert np.allclose(energy, 1, rtol=1e-12)
    else:
        assert energy.mean() > 1 - alpha  # what is scattered twice is lost


@pytest.mark.parametrize("cos_o", [1.0, 0.6, 0.2])
def test_smooth_glass_reflects_as_often_as_fresnel_says(cos_o):
    n = 40_000
    drawn, *_ = mean_weight(dielectric.surface(1.5), cos_o, n)
    f = fresnel.dielectric(cos_o, 1.5)
    assert np.sum(drawn.wi[:, 2] > 0) == pytest.approx(n * f, abs=4 * math.sqrt(n * f * (1 - f)))


def test_a_mirror_reflects_its_albedo_and_an_emitter_nothing():
    _, mean, _ = mean_weight(lambert.mirror((0.9, 0.8, 0.7)), 0.3, 10)
    assert np.allclose(mean, (0.9, 0.8, 0.7))
    _, mean, _ = mean_weight(lambert.emitter(), 0.3, 10)
    assert np.all(mean == 0)
    assert bsdf.is_specular(lambert.mirror()) and not bsdf.is_specular(lambert.emitter())


@given(directions(), directions(), st.sampled_from(sorted(OPAQUE)))
def test_reflection_is_reciprocal(wo, wi, name):
    there, back = bsdf.evaluate(OPAQUE[name], wo, wi), bsdf.evaluate(OPAQUE[name], wi, wo)
    assert np.allclose(there, back, rtol=1e-9, atol=1e-15)
    assert min(there) >= 0


@given(directions(), directions(), st.floats(1.05, 2.0), st.floats(0.1, 1.0))
def test_transmission_is_reciprocal_but_for_the_index_squared(wo, wi, eta, alpha):
    glass = dielectric.surface(eta, alpha)
    below = (wi[0], wi[1], -wi[2])
    # Veach (1997), eq. 5.14: f(i -> o) / n_o^2 is symmetric; wo is outside, where n = 1
    there, back = bsdf.evaluate(glass, wo, below)[0], bsdf.evaluate(glass, below, wo)[0]
    assert there == pytest.approx(back / eta**2, rel=1e-9, abs=1e-12)


def ggx_twin(wo, wi, albedo, alpha, eta, scale):
    """The `ggx` kind in plain NumPy, from tangents, isotropic."""
    h = (wo + wi) / np.linalg.norm(wo + wi)
    tan2 = lambda w: 1 / w[2] ** 2 - 1  # noqa: E731
    d = alpha**2 / (np.pi * h[2] ** 4 * (alpha**2 + tan2(h)) ** 2)
    lam = lambda w: 0.5 * (np.sqrt(1 + alpha**2 * tan2(w)) - 1)  # noqa: E731
    f0 = ((eta - 1) / (eta + 1)) ** 2
    fr = f0 + (1 - f0) * (1 - wo @ h) ** 5
    return np.asarray(albedo) / np.pi + scale * d * fr / (1 + lam(wo) + lam(wi)) / (4 * wo[2] * wi[2])


@given(directions(0.02), directions(0.02), st.floats(0.05, 1.0), st.floats(1.2, 2.5))
def test_the_compiled_gloss_is_the_textbook_formula(wo, wi, alpha, eta):
    surface = ggx.surface((0.1, 0.2, 0.3), alpha, eta=eta, specular_scale=0.7)
    twin = ggx_twin(np.array(wo), np.array(wi), (0.1, 0.2, 0.3), alpha, eta, 0.7)
    assert np.allclose(bsdf.evaluate(surface, wo, wi), twin, rtol=1e-6)


@pytest.mark.parametrize("name", OPAQUE)
def test_opaque_surfaces_are_black_from_below(name):
    up, down = (0.6, 0.0, 0.8), (0.6, 0.0, -0.8)
    for wo, wi in ((up, down), (down, up), (down, down)):
        assert bsdf.evaluate(OPAQUE[name], wo, wi) == CLEAR
        assert bsdf.pdf(OPAQUE[name], wo, wi) == 0


def white(alpha, alpha_v=None):
    """A metal that absorbs nothing: k = 100 reflects all but 4 / k**2."""
    return conductor.surface((0.01,) * 3, (100.0,) * 3, alpha, alpha_v=alpha_v)


# Lobes of the widths of OPAQUE that reflect all they meet.
WHITE_LOBES = {
    "ggx": white(0.3, 0.6),
    "phong": phong.surface(CLEAR, 0.3, specular_scale=1.0),
    "ward": ward.surface(CLEAR, 0.3, alpha_v=0.6, specular_scale=1.0),
    "cook_torrance": white(0.3, 0.6),
    "conductor": white(0.3, 0.1),
    "disney": disney.surface(WHITE, disney.Principled(anisotropic=0.5, metallic=1.0)),
    "film": white(0.4),
    "rough film": white(0.4),
}


@pytest.mark.parametrize("name", OPAQUE)
@pytest.mark.parametrize("cos_o", [1.0, 0.5, 0.2])
def test_the_quick_albedo_is_off_by_no_more_than_its_lobe_loses(name, cos_o):
    _, mean, error = mean_weight(OPAQUE[name], cos_o)
    # It takes a lobe for lossless; a white one of the same width says how much is lost to masking and below the horizon,
    # and a lobe with Fresnel's factor loses a part of that. Without a lobe only the sampling's noise is left.
    loss = 1 - mean_weight(WHITE_LOBES[name], cos_o)[1].mean() if name in WHITE_LOBES else 0.0
    assert np.all(np.abs(np.array(albedo.albedo(OPAQUE[name], cos_o)) - mean) <= loss + 4 * error + 1e-9)
