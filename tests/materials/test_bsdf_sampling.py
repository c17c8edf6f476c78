"""Directions are drawn with the density that `pdf` states, and weighted by f |cos| / pdf."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from materials import (
    conductor,
    cook_torrance,
    dielectric,
    disney,
    ggx,
    lambert,
    oren_nayar,
    phong,
    scattering,
    ward,
    water_film,
)
from materials.gloss import Tail
from materials.kernels.kinds import ROUGH_DIELECTRIC

NUM_SAMPLES = 100_000
SIGNIFICANCE = 0.01

SURFACES = {
    "lambert": lambert.surface((0.2, 0.5, 0.8)),
    "ggx": ggx.surface((0.3, 0.3, 0.3), 0.3),
    "ggx without diffuse": ggx.surface((0.0, 0.0, 0.0), 0.15, eta=1.63),
    "ggx brushed": ggx.surface((0.02, 0.02, 0.02), 0.5, alpha_v=0.15),
    "film on matte": water_film.coated((0.5, 0.3, 0.1), thickness=0.1),
    "film on gloss": water_film.coated((0.05, 0.05, 0.05), specular_scale=1.0, eta=2.0, alpha=0.25),
    "rough film on gloss": water_film.coated((0.05, 0.05, 0.05), film_alpha=0.3, specular_scale=1.0, eta=2.0, alpha=0.4),
    "oren_nayar": oren_nayar.surface((0.2, 0.5, 0.8), 0.5),
    "ggx with a tail": ggx.surface((0.02, 0.02, 0.02), 0.15, tail=Tail(1.0, 0.6, 0.4), tint=(1.0, 0.5, 0.2)),
    "phong": phong.surface((0.1, 0.1, 0.1), 0.25, specular_scale=0.5),
    "ward brushed": ward.surface((0.1, 0.1, 0.1), 0.4, alpha_v=0.15, specular_scale=0.5, tail=Tail(0.2, 0.6)),
    "ward of 1992": ward.surface((0.1, 0.1, 0.1), 0.3, specular_scale=0.5, normalisation="original"),
    "cook_torrance": cook_torrance.surface((0.1, 0.1, 0.1), 0.3, eta=3.0),
    "cook_torrance brushed": cook_torrance.surface((0.0, 0.0, 0.0), 0.5, alpha_v=0.15, eta=2.0),
    "brushed gold": conductor.surface(*conductor.METALS["gold"], 0.4, alpha_v=0.2),
    "disney paint": disney.surface(
        (0.1, 0.2, 0.4), disney.Principled(roughness=0.6, anisotropic=0.7, clearcoat=1.0, clearcoat_gloss=0.0)
    ),
    "disney cloth": disney.surface((0.5, 0.2, 0.4), disney.Principled(subsurface=0.5, sheen=1.0, metallic=0.2)),
    "frosted glass": dielectric.surface(1.5, 0.3),
    "brushed water": dielectric.surface(1.33, 0.5, alpha_v=0.2),
}
VIEWS = {"upright": (0.0, 0.0, 1.0), "oblique": (0.48, 0.64, 0.6), "grazing": (0.92, -0.36, 0.155)}
CASES = [(s, v) for s in SURFACES for v in VIEWS] + [("frosted glass", "from inside"), ("brushed water", "from inside")]
VIEWS["from inside"] = (0.36, 0.48, -0.8)
UNIT_VIEWS = {name: np.array(w) / np.linalg.norm(w) for name, w in VIEWS.items()}
PER_TEST = 1 - (1 - SIGNIFICANCE) ** (1 / len(CASES))  # Sidak


def cell_masses(surface, wo, num_cos=24, num_phi=36, density_of=scattering.pdf):
    """Integrate the pdf over each cell of the sphere by Gauss-Legendre."""
    # what is refracted is narrower than the facets' normals by (eta - 1) / eta: there 12 nodes miss 1 % of the mass
    order = 40 if surface.kind == ROUGH_DIELECTRIC else 12
    nodes, weights = np.polynomial.legendre.leggauss(order)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    cos = -1 + 2 * ((np.arange(num_cos)[:, None] + x) / num_cos).ravel()
    phi = 2 * np.pi * ((np.arange(num_phi)[:, None] + x) / num_phi).ravel()
    sin = np.sqrt(1 - cos**2)[:, None]
    wi = np.stack(np.broadcast_arrays(sin * np.cos(phi), sin * np.sin(phi), cos[:, None]), -1)
    density = density_of(surface, wo, wi).reshape(num_cos, order, num_phi, order)
    return np.einsum("iajb,a,b->ij", density, w, w) * (2 / num_cos) * (2 * np.pi / num_phi)


def chi_square_p(wi, masses):
    """Return the p-value of drawn directions against cell masses; what is not drawn is one more cell."""
    num_cos, num_phi = masses.shape
    i = np.minimum(((wi[:, 2] + 1) / 2 * num_cos).astype(int), num_cos - 1)
    j = np.minimum(((np.arctan2(wi[:, 1], wi[:, 0]) / (2 * np.pi)) % 1 * num_phi).astype(int), num_phi - 1)
    counts = np.bincount(i * num_phi + j, minlength=masses.size).astype(float)
    observed = np.append(counts, NUM_SAMPLES - len(wi))
    expected = NUM_SAMPLES * np.append(masses.ravel(), 1 - masses.sum())
    small = expected < 10
    observed = np.append(observed[~small], observed[small].sum())
    expected = np.append(expected[~small], expected[small].sum())
    if expected[-1] < 10:  # pool what is left with the least of the others
        k = np.argmin(expected[:-1])
        observed[k] += observed[-1]
        expected[k] += expected[-1]
        observed, expected = observed[:-1], expected[:-1]
    return chi2.sf(np.sum((observed - expected) ** 2 / expected), len(expected) - 1)


@pytest.mark.parametrize(("name", "view"), CASES)
def test_directions_are_drawn_with_the_density_stated(name, view):
    surface, wo = SURFACES[name], UNIT_VIEWS[view]
    xi = np.random.default_rng(7).random((NUM_SAMPLES, 3))
    drawn = scattering.sample(surface, wo, xi)
    kept = drawn.wi[~drawn.is_delta & (drawn.pdf > 0)]
    assert chi_square_p(kept, cell_masses(surface, wo)) > PER_TEST


def test_a_wrong_cosine_is_caught():
    xi = np.random.default_rng(7).random((NUM_SAMPLES, 2))
    masses = cell_masses(SURFACES["lambert"], UNIT_VIEWS["upright"])
    for power, is_right in ((0.5, True), (0.52, False)):  # r = sqrt(u) is Lambert; a hair off it must be seen
        r, phi = xi[:, 0] ** power, 2 * np.pi * xi[:, 1]
        wi = np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - r * r)], -1)
        assert (chi_square_p(wi, masses) > PER_TEST) == is_right


@pytest.mark.parametrize("name", ["ward brushed", "cook_torrance", "brushed gold"])
def test_a_forgotten_change_of_variables_is_caught(name):
    surface, wo = SURFACES[name], UNIT_VIEWS["oblique"]

    def mutilated(surface, wo, wi):
        # the density of half vectors taken for that of directions: 1 / (4 wo . h) left out, the whole kept at 1
        h = wo + wi
        h /= np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
        return scattering.pdf(surface, wo, wi) * (h @ wo)

    drawn = scattering.sample(surface, wo, np.random.default_rng(7).random((NUM_SAMPLES, 3)))
    kept = drawn.wi[drawn.pdf > 0]
    masses = cell_masses(surface, wo, density_of=mutilated)
    assert chi_square_p(kept, masses * len(kept) / NUM_SAMPLES / masses.sum()) < 1e-6


@pytest.mark.parametrize(("name", "view"), CASES)
def test_weights_are_f_times_cosine_over_the_density(name, view):
    surface, wo = SURFACES[name], UNIT_VIEWS[view]
    drawn = scattering.sample(surface, wo, np.random.default_rng(1).random((2000, 3)))
    good = ~drawn.is_delta & (drawn.pdf > 0)
    wi = drawn.wi[good]
    # directions have rounding of 1e-16, which the slopes of the narrowest lobes amplify: by far less than 1e6
    assert np.allclose(scattering.pdf(surface, wo, wi), drawn.pdf[good], rtol=1e-9)
    f = scattering.evaluate(surface, wo, wi)
    assert np.allclose(f * np.abs(wi[:, 2:]) / drawn.pdf[good, None], drawn.weight[good], rtol=1e-9)
    assert np.all(drawn.weight[~good & ~drawn.is_delta] == 0)


@pytest.mark.parametrize("name", SURFACES)
def test_nothing_is_nan_even_at_the_edges_of_the_variates_and_of_the_hemisphere(name):
    edge = np.array([0.0, 0.5, 1 - 1e-16])
    xi = np.stack(np.meshgrid(edge, edge, edge), -1).reshape(-1, 3)
    for cos in (1.0, 1e-3, 1e-9, -1e-9):
        wo = np.array([np.sqrt(1 - cos * cos), 0.0, cos])
        drawn = scattering.sample(SURFACES[name], wo, xi)
        assert np.all(np.isfinite(drawn.weight)) and np.all(drawn.weight >= 0)
        assert np.all(np.isfinite(drawn.wi)) and np.all(np.isfinite(drawn.pdf))
        f = scattering.evaluate(SURFACES[name], wo, drawn.wi / np.linalg.norm(drawn.wi, axis=-1, keepdims=True))
        assert np.all(np.isfinite(f)) and np.all(f >= 0)
