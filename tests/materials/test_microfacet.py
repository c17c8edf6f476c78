"""The GGX distribution against its defining integrals and a twin in plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from materials import microfacet
from materials.foundation.errors import InputError

WIDTHS = [(0.1, 0.1), (0.3, 0.3), (0.6, 0.2), (1.0, 1.0)]


def hemisphere(num_cos=300, num_phi=120):
    """Return directions and solid angles; nodes crowd towards the pole, where narrow lobes are."""
    nodes, weights = np.polynomial.legendre.leggauss(num_cos)
    x, w = 0.5 * (nodes + 1), 0.5 * weights
    theta = 0.5 * np.pi * x**2
    dcos = np.sin(theta) * np.pi * x * w
    phi = (np.arange(num_phi) + 0.5) / num_phi * 2 * np.pi
    sin, cos = np.sin(theta)[:, None], np.cos(theta)[:, None]
    directions = np.stack(np.broadcast_arrays(sin * np.cos(phi), sin * np.sin(phi), cos), -1)
    return directions.reshape(-1, 3), np.repeat(dcos, num_phi) * 2 * np.pi / num_phi


def d_in_angles(h, alpha_u, alpha_v):
    """Walter's D with tangents instead of components, anisotropic after Burley."""
    cos2 = h[..., 2] ** 2
    tan2 = (1 - cos2) / cos2
    phi = np.arctan2(h[..., 1], h[..., 0])
    e = (np.cos(phi) / alpha_u) ** 2 + (np.sin(phi) / alpha_v) ** 2
    return 1 / (np.pi * alpha_u * alpha_v * cos2**2 * (1 + tan2 * e) ** 2)


@pytest.mark.parametrize("alpha", WIDTHS)
def test_microfacets_project_onto_the_whole_surface(alpha):
    h, solid_angle = hemisphere()
    assert np.sum(microfacet.ggx_d(h, *alpha) * h[:, 2] * solid_angle) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("alpha", WIDTHS)
@pytest.mark.parametrize("theta", [0.0, 0.8, 1.4])
def test_the_facets_that_a_viewer_sees_fill_the_view(alpha, theta):
    h, solid_angle = hemisphere()
    wo = np.array([np.sin(theta) * 0.8, np.sin(theta) * 0.6, np.cos(theta)])
    facing = np.maximum(h @ wo, 0)
    # the kink where facets turn away costs the quadrature some of its order
    seen = np.sum(facing * microfacet.ggx_d(h, *alpha) * solid_angle) * microfacet.smith_g1(wo, *alpha)
    assert seen == pytest.approx(wo[2], abs=2e-4)
    assert np.sum(microfacet.pdf_visible(wo, h, *alpha) * solid_angle) == pytest.approx(1, abs=2e-4 / wo[2])


@pytest.mark.parametrize("alpha", WIDTHS)
def test_the_density_is_that_of_the_formula_in_angles(alpha):
    h, _ = hemisphere(40, 24)
    assert np.allclose(microfacet.ggx_d(h, *alpha), d_in_angles(h, *alpha), rtol=1e-9)


def test_shadowing_is_symmetric_and_no_more_than_either_alone():
    rng = np.random.default_rng(3)
    w = rng.normal(size=(2, 200, 3))
    w[..., 2] = np.abs(w[..., 2])
    wo, wi = w / np.linalg.norm(w, axis=-1, keepdims=True)
    both = microfacet.smith_g2(wo, wi, 0.5, 0.2)
    assert np.allclose(both, microfacet.smith_g2(wi, wo, 0.5, 0.2), rtol=1e-14)
    assert np.all(both <= np.minimum(microfacet.smith_g1(wo, 0.5, 0.2), microfacet.smith_g1(wi, 0.5, 0.2)))
    assert np.all(both >= microfacet.smith_g1(wo, 0.5, 0.2) * microfacet.smith_g1(wi, 0.5, 0.2))


def test_sampled_normals_face_the_viewer():
    xi = np.random.default_rng(0).random((1000, 2))
    wo = np.array([np.sqrt(1 - 0.05**2), 0.0, 0.05])
    h = microfacet.sample_visible(wo, xi, 0.4)
    assert np.all(h @ wo >= 0) and np.all(h[:, 2] >= 0)
    assert np.allclose(np.linalg.norm(h, axis=1), 1)


def test_refusals_name_argument_and_remedy():
    with pytest.raises(InputError, match=r"h must have unit length.* Normalise it first"):
        microfacet.ggx_d([0.0, 0.0, 2.0], 0.5)
    with pytest.raises(InputError, match=r"alpha_u must lie in \(0, 1\]"):
        microfacet.ggx_d([0.0, 0.0, 1.0], 0.0)
    with pytest.raises(InputError, match="wo"):
        microfacet.sample_visible([0.0, 0.0, -1.0], [0.5, 0.5], 0.3)
