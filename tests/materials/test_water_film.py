"""A film of water against a brute-force simulation of light bouncing in a slab, written independently."""

from __future__ import annotations

import numpy as np
import pytest

from materials import scattering, water_film
from materials.foundation.errors import InputError


def fresnel_twin(cos_i, eta):
    sin_t = np.sqrt(np.maximum(1 - cos_i**2, 0)) / eta
    cos_t = np.sqrt(np.maximum(1 - sin_t**2, 0))
    r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    r_p = (cos_t - eta * cos_i) / (cos_t + eta * cos_i)
    return np.where(sin_t >= 1, 1.0, 0.5 * (r_s**2 + r_p**2)), cos_t


def slab_albedo(cos_o, albedo, eta, tau, rng, num_photons=200_000):
    """Follow photons one event at a time; return the share that leaves and its standard error."""
    f, cos_in = fresnel_twin(np.array(cos_o), eta)
    left = int(np.sum(rng.random(num_photons) < f))
    inside = num_photons - left
    cos = np.full(inside, cos_in)
    while len(cos):
        cos = cos[rng.random(len(cos)) < np.exp(-tau / cos)]  # down through the water
        cos = cos[rng.random(len(cos)) < albedo]  # the matte base
        cos = np.sqrt(1 - rng.random(len(cos)))
        cos = cos[rng.random(len(cos)) < np.exp(-tau / cos)]  # up through the water
        is_reflected = rng.random(len(cos)) < fresnel_twin(cos, 1 / eta)[0]
        left += int(np.sum(~is_reflected))
        cos = cos[is_reflected]
    share = left / num_photons
    return share, np.sqrt(share * (1 - share) / num_photons)


@pytest.mark.parametrize(
    ("cos_o", "albedo", "eta", "tau"),
    [(1.0, 0.8, 1.33, 0.0), (0.5, 0.8, 1.33, 0.1), (0.2, 0.3, 1.33, 0.5), (0.9, 1.0, 1.5, 0.05), (0.6, 0.95, 1.8, 1.0)],
)
def test_a_film_returns_the_light_that_photons_in_a_slab_do(cos_o, albedo, eta, tau):
    surface = water_film.coated((albedo,) * 3, film_eta=eta, thickness=1.0, sigma_a=(tau, tau, tau))
    share, error = slab_albedo(cos_o, albedo, eta, tau, np.random.default_rng(2))
    wo = (np.sqrt(1 - cos_o**2), 0.0, cos_o)
    drawn = scattering.sample(surface, wo, np.random.default_rng(3).random((200_000, 3)))
    ours = drawn.weight[:, 0]
    spread = np.hypot(error, ours.std() / np.sqrt(len(ours)))
    # 3.3 standard errors: 1 % over the five cases (Sidak); 1e-4 for the table of Fdi
    assert abs(ours.mean() - share) < 3.3 * spread + 1e-4


def test_a_film_darkens_most_where_the_base_is_neither_black_nor_white():
    shares = []
    for albedo in (0.05, 0.3, 0.98):
        drawn = scattering.sample(water_film.coated((albedo,) * 3), (0.0, 0.0, 1.0), np.random.default_rng(0).random((50_000, 3)))
        shares.append(albedo - drawn.weight[~drawn.is_delta].mean() * np.mean(~drawn.is_delta))
    assert shares[1] > shares[0] and shares[1] > shares[2]


def test_deep_water_is_blue_and_thin_water_clear():
    deep = water_film.optical_depth(2.0)
    assert deep[0] > deep[1] > deep[2]
    assert np.all(water_film.optical_depth(0.001) < 3e-4)


def test_water_absorbs_as_tabulated(shared_data):
    rows = np.loadtxt(shared_data / "soil_wet_dry" / "prosail_prospect_d_spectra.txt", comments="#")
    # the leaf model's column is in 1/cm and another compilation: within a quarter of Pope and Fry at these wavelengths
    table = np.interp((610, 550, 465), rows[:, 0], rows[:, 6] * 100)
    assert np.allclose(water_film.SIGMA_A_WATER, table, rtol=0.25, atol=0.005)


def test_a_glossy_base_below_water_gleams_less_than_in_air():
    # index 1.63 against 1.33 reflects a tenth of what it does against air
    wo, wi = (0.3, 0.0, np.sqrt(0.91)), (-0.3, 0.0, np.sqrt(0.91))
    wet = water_film.coated((0.0, 0.0, 0.0), specular_scale=1.0, eta=1.63, alpha=0.3)
    dry = water_film.coated((0.0, 0.0, 0.0), specular_scale=1.0, eta=1.63, alpha=0.3, film_eta=1.0)
    assert 0 < scattering.evaluate(wet, wo, wi)[0] < 0.3 * scattering.evaluate(dry, wo, wi)[0]


def test_refusals_name_argument_and_range():
    with pytest.raises(InputError, match=r"film_eta must lie in \[1, 3\], got 0.9"):
        water_film.coated((0.5, 0.5, 0.5), film_eta=0.9)
    with pytest.raises(InputError, match="albedo must have three channels"):
        water_film.coated((0.5, 0.5))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="thickness must lie in"):
        water_film.optical_depth(-1.0)
    with pytest.raises(InputError, match="wo must have three components"):
        scattering.evaluate(water_film.coated((0.5, 0.5, 0.5)), [0.0, 1.0], [0.0, 0.0, 1.0])
    with pytest.raises(InputError, match="wo must fit the shape of wi"):
        scattering.pdf(water_film.coated((0.5, 0.5, 0.5)), np.tile((0, 0, 1.0), (2, 1)), np.tile((0, 0, 1.0), (3, 1)))
    with pytest.raises(InputError, match=r"xi must lie in \[0, 1\)"):
        scattering.sample(water_film.coated((0.5, 0.5, 0.5)), [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
