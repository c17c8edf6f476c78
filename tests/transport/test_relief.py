"""Normal and bump maps: the slope they state, and neither black fringes nor light from behind."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scene.simulation import DirectionalLight, EnvironmentLight, Material
from tests.transport.worlds import WHITE, camera, floor, rectangle, world
from transport.kernels.shading import valid_normal
from transport.render import render


def unit(z, phi):
    return (math.sqrt(1 - z * z) * math.cos(phi), math.sqrt(1 - z * z) * math.sin(phi), z)


UNITS = st.builds(unit, st.floats(0.0, 1.0), st.floats(0, 2 * math.pi))


@given(UNITS, UNITS)
def test_a_bent_normal_mirrors_the_viewer_above_the_surface(n, wo):
    got = np.array(valid_normal(n, (0.0, 0.0, 1.0), wo))
    mirrored = 2 * (got @ wo) * got - wo
    assert np.linalg.norm(got) == np.float64(1.0) or abs(np.linalg.norm(got) - 1) < 1e-12
    assert mirrored[2] > 0
    kept = 2 * np.dot(n, wo) * n[2] - wo[2] >= 1e-3
    assert np.allclose(got, n) == kept or np.allclose(got, n, atol=1e-3)


def test_a_bump_map_tilts_the_surface_by_its_slope():
    # A ramp repeats, so the picture looks at its middle only: heights rise by 0.3 along u and fall by 0.2 along v per metre.
    i, j = np.meshgrid(np.arange(64), np.arange(64), indexing="ij")
    heights = (3.0 * (j + 0.5) / 64 * 0.5 - 2.0 * (i + 0.5) / 64 * 0.5).astype(np.float32)
    plane = rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    towards = np.array([0.48, 0.36, 0.8])
    sun = {"sun": DirectionalLight(tuple(-towards), (np.pi,) * 3)}
    material = Material(albedo=WHITE, bump_texture=heights, bump_scale=0.4)
    got = render(world({"plane": (plane, material)}, sun), camera((0, 0, 5), (0, 0, 0), 8, 8, 2), samples=1, max_bounces=1).radiance
    normal = np.array([-0.3, 0.2, 1.0])
    expected = towards @ normal / np.linalg.norm(normal)
    # heights are float32
    np.testing.assert_allclose(got, expected, rtol=1e-5)


def rippled(strength):
    angle = np.linspace(0, 8 * np.pi, 128, endpoint=False)
    n = np.stack([strength * np.cos(angle), 0 * angle, np.ones_like(angle)], -1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    return np.broadcast_to((0.5 * n + 0.5).astype(np.float32), (4, 128, 3))


def test_a_rippled_mirror_at_grazing_has_no_black_fringes():
    sky = {"sky": EnvironmentLight(WHITE)}
    metal = Material("ggx", (0.0, 0.0, 0.0), alpha=0.05, eta=1e9, normal_texture=rippled(1.0))
    view = camera((-6, 0, 0.8), (0, 0, 0), 48, 16, 12)
    plane = rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0))
    picture = render(world({"plane": (plane, metal)}, sky), view, samples=64, max_bounces=1).radiance[..., 0]
    # Every facet mirrors some of the white sky: what is lost is the part of the lobe below the surface, at most about half.
    assert picture.min() > 0.3 and picture.max() < 1.02


def test_no_light_leaks_through_relief_from_below():
    sun = {"sun": DirectionalLight((0.3, 0, 1), (np.pi,) * 3)}
    lit = world({"floor": (floor(8.0), Material(albedo=WHITE, normal_texture=rippled(3.0)))}, sun)
    assert render(lit, camera((-6, 0, 2), (0, 0, 0), 16, 16, 10), samples=4, max_bounces=1).radiance.max() == 0
