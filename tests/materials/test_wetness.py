"""Wet ground: darker, smoother, nearer to water, and level where water stands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from materials import wetness
from materials.foundation.errors import InputError

shares = st.floats(0, 1)
models = st.sampled_from(["lagarde", "lekner_dorf", "twomey", "thesis"])
UP = np.array([0.0, 0.0, 1.0])


def test_pores_are_full_at_half_the_level_and_water_stands_above():
    w_sat, w_acc = wetness.water_levels(np.array([0.0, 0.25, 0.5, 0.75, 1.0]))
    assert np.array_equal(w_sat, [0, 0.5, 1, 1, 1])
    assert np.array_equal(w_acc, [0, 0, 0, 0.5, 1])


def test_porous_ground_darkens_more_than_dense_ground_unlike_the_printed_equation():
    assert wetness.porosity_attenuation(0.0) == 1 and wetness.porosity_attenuation(1.0) == pytest.approx(0.2)
    assert wetness.porosity_attenuation(0.7) < wetness.porosity_attenuation(0.3)
    assert wetness.porosity_attenuation(0.7, model="thesis") > wetness.porosity_attenuation(0.3, model="thesis")


def test_the_printed_equation_takes_the_index_below_that_of_air_and_ours_does_not():
    printed, _ = wetness.saturate(1.63, 0.8, 0.2, 1.0, model="thesis")
    assert printed == pytest.approx(1.63 * 0.6) and printed < 1
    eta, _ = wetness.saturate(1.63, 0.8, 0.2, 1.0)
    assert eta == pytest.approx(1.33 + 0.3 * 0.6)


@given(st.floats(1.33, 2.5), shares, st.floats(0.2, 1), shares)
def test_saturated_ground_lies_between_dry_ground_and_water(eta, roughness, rho, w):
    wet_eta, wet_roughness = wetness.saturate(eta, roughness, rho, w)
    assert 1.33 - 1e-12 <= wet_eta <= eta + 1e-12
    assert rho * roughness - 1e-12 <= wet_roughness <= roughness


@given(st.floats(1.1, 2.5), shares, st.floats(0.2, 1))
def test_dry_ground_stays_as_it_is_to_the_bit(eta, roughness, rho):
    wet_eta, wet_roughness = wetness.saturate(eta, roughness, rho, 0.0)
    assert wet_eta == eta and wet_roughness == roughness
    tilted = np.array([np.sin(0.3), 0.1, np.cos(0.3)]) / np.sqrt(1.01)
    e, r, n = wetness.accumulate(eta, roughness, tilted, 0.0)
    assert (e, r) == (eta, roughness) and np.array_equal(n, tilted)


def test_standing_water_is_nearly_smooth_level_and_of_waters_index():
    tilted = np.array([np.sin(0.3), 0.0, np.cos(0.3)])
    eta, roughness, normal = wetness.accumulate(1.6, 0.8, tilted, 1.0)
    assert eta == pytest.approx(1.6 + 0.95 * (1.33 - 1.6)) and roughness == pytest.approx(0.05 * 0.8)
    assert np.arccos(normal[2]) < 0.06 * 0.3
    assert np.linalg.norm(normal) == pytest.approx(1)
    assert np.allclose(wetness.accumulate(1.6, 0.8, tilted, 1.0, strength=1.0)[2], UP)


def test_accumulation_works_on_maps():
    n = np.broadcast_to(UP, (4, 5, 3)).astype(np.float32)
    eta, roughness, normal = wetness.accumulate(np.full((4, 5), 1.5), np.full((4, 5), 0.7), n, np.full((4, 5), 0.5))
    assert eta.shape == roughness.shape == (4, 5) and normal.shape == (4, 5, 3)


@given(models, shares, shares, shares, shares)
def test_wet_ground_is_never_brighter_never_black_and_darker_the_wetter(model, albedo, porosity, w0, w1):
    less, more = (wetness.diffuse_attenuation(albedo, w, porosity, model) for w in sorted((w0, w1)))
    assert 0 < more <= less <= 1
    assert wetness.diffuse_attenuation(albedo, 0.0, porosity, model) == 1


@pytest.mark.parametrize("model", ["lekner_dorf", "twomey"])
@pytest.mark.parametrize("eta", [1.4, 1.5, 1.63, 2.0])
def test_a_brighter_base_stays_brighter_when_wet(model, eta):
    albedo = np.linspace(0, 1, 101)
    factor = wetness.diffuse_attenuation(albedo, 1.0, 0.5, model, eta=eta)
    assert np.all(np.diff(factor) > -1e-9) and np.all(np.diff(factor * albedo) > 0)
    assert factor[-1] == pytest.approx(1)  # white absorbs nothing, however often light returns


def test_dark_sand_darkens_more_than_dark_rock():
    # as the thesis reports of the two models, 2.5.2
    dark = np.array([0.05, 0.1, 0.2])
    sand = wetness.diffuse_attenuation(dark, 1.0, 0.5, "twomey", eta=1.5)
    rock = wetness.diffuse_attenuation(dark, 1.0, 0.5, "lekner_dorf", eta=1.5)
    assert np.all(sand < rock)


def test_medium_albedos_lose_most():
    albedo = np.array([0.02, 0.35, 0.95])
    for model in ("lekner_dorf", "twomey"):
        loss = albedo * (1 - wetness.diffuse_attenuation(albedo, 1.0, 0.5, model))
        assert loss[1] > loss[0] and loss[1] > loss[2]


def test_black_rock_is_dimmed_by_the_closed_form():
    # at albedo 0, where one return decides: (1 - p)(2 - r) with r = T(rock under water) / T(rock in air)
    from scipy.integrate import quad

    from materials.kernels.fresnel import dielectric

    through = {n: 1 - quad(lambda c, n=n: 2 * c * dielectric(c, n), 0, 1)[0] for n in (1.33, 1.63, 1.63 / 1.33)}
    p = 1 - through[1.33] / 1.33**2
    expected = (1 - p) * (2 - through[1.63 / 1.33] / through[1.63])
    assert wetness.diffuse_attenuation(0.0, 1.0, 0.5, "lekner_dorf") == pytest.approx(expected, abs=1e-7)


def test_clear_spheres_of_water_turn_light_as_mie_theory_has_it():
    # geometric optics of water drops: g = 0.884 with diffraction, (1 + g_ray) / 2; so g_ray = 0.77
    assert (1 + wetness._grain_cosine(1.333)) / 2 == pytest.approx(0.884, abs=0.003)


def test_maps_of_saturation_apply_to_all_channels():
    w = np.linspace(0, 1, 12).reshape(3, 4)
    factor = wetness.diffuse_attenuation(np.full((3, 4, 3), 0.2), w, 0.6)
    assert factor.shape == (3, 4, 3)
    assert np.allclose(factor[..., 1], 1 - 0.48 * w)


def test_single_precision_stays_single():
    factor = wetness.diffuse_attenuation(np.full((2, 3), 0.2, np.float32), np.ones(2, np.float32), 0.6, "twomey")
    assert factor.dtype == np.float32


def test_wetting_measured_soil_darkens_it_between_the_models(shared_data):
    rows = np.genfromtxt(shared_data / "soil_wet_dry" / "karly_soilmoisture_dataset.csv", delimiter=",", skip_header=1)
    moisture, reflectance = rows[:, 2], rows[:, 4:]
    dry = reflectance[moisture <= np.quantile(moisture, 0.1)].mean(0)
    wet = reflectance[moisture >= np.quantile(moisture, 0.9)].mean(0)
    full = wetness.diffuse_attenuation(dry, 1.0, 0.7, "twomey", eta=1.544)
    # the driest decile is at 26 % moisture already, so full wetting is the lower bound of what was measured
    assert np.all(wet / dry > full) and np.all(wet / dry < 1)


def test_refusals_name_argument_and_range():
    with pytest.raises(InputError, match=r"level must lie in \[0, 1\], got 1.5"):
        wetness.water_levels(1.5)
    with pytest.raises(InputError, match="model must be one of lagarde, lekner_dorf, twomey, thesis"):
        wetness.diffuse_attenuation(0.2, 1.0, 0.5, "soggy")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"eta must lie in \(1.33, 3\]"):
        wetness.diffuse_attenuation(0.2, 1.0, 0.5, "twomey", eta=1.2)
    with pytest.raises(InputError, match="normal must have unit length"):
        wetness.accumulate(1.5, 0.5, [0.0, 0.0, 0.5], 0.5)
    with pytest.raises(InputError, match="porosity must lie in"):
        wetness.porosity_attenuation(-0.1)
