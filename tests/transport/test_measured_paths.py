"""Measured and fitted reflectance under the path tracer: any lights, any number of bounces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.simulation import DirectionalLight, EnvironmentLight, Material, SphereLight
from tests.materials.test_tabulated import bilinear, fitted, measured
from tests.transport.worlds import ball, camera, floor, grey, mean_and_error, rectangle, world
from transport.measured import render_measured
from transport.render import render

SUN = DirectionalLight((0.4, -0.3, -1.0), (2.0, 1.0, 0.5))
MATERIALS = {"fitted": fitted("ct"), "btf": measured()}


def look(name: str) -> Material:
    return Material("measured", measured=MATERIALS[name])


@pytest.mark.parametrize("name", MATERIALS)
def test_one_bounce_of_sunlight_is_what_the_look_up_draws(name):
    # u, v over a ball: a chart without a seam where the camera looks
    globe = ball(subdivisions=3)
    globe = replace(globe, uv=(globe.vertices[:, :2] * 1.7).astype(np.float32))
    # so narrow a view through each pixel that its square is its centre
    view = camera((0.5, -1.0, 6.0), (0, 0, 0), 24, 24, 16.0)
    plain = render_measured(globe, MATERIALS[name], view, [SUN])
    traced = np.zeros_like(plain)
    lit = world({"globe": (globe, look(name))}, {"sun": SUN})
    for row in range(2, 24, 5):
        for col in range(2, 24, 5):
            centre = replace(view, width=1, height=1, fx=1e7, fy=1e7, cx=0.5 - (col + 0.5 - 12) / view.fx * 1e7, cy=0.0)
            centre = replace(centre, cy=0.5 - (row + 0.5 - 12) / view.fy * 1e7)
            traced[row, col] = render(lit, centre, samples=1, max_bounces=1).radiance[0, 0]
    got, want = traced[2::5, 2::5], plain[2::5, 2::5]
    assert (want.sum(axis=-1) > 0).mean() > 0.5
    # tangents turn by float32's rounding of u and v, and the steepest lobe changes by a tenth per degree
    np.testing.assert_allclose(got, want, rtol=2e-3, atol=1e-4 * want.max())


@pytest.mark.parametrize("name", MATERIALS)
def test_under_an_even_sky_the_radiance_is_the_albedo(name):
    """Light and BSDF are both drawn from, and weighted: either alone would do, half of each would show."""
    wo = np.array([0.6, 0.3, 1.5])
    wo /= np.linalg.norm(wo)
    place = np.array([0.3, 0.8])
    ground = floor()
    corner = (place - 200 * np.array([0.5, 0.5])).astype(np.float32)  # u, v at the origin, where the camera looks
    ground = replace(ground, uv=(ground.uv * 200 + corner).astype(np.float32))
    lit = world({"floor": (ground, look(name))}, {"sky": EnvironmentLight((1.0, 1.0, 1.0))})
    mean, error = mean_and_error(render(lit, camera(50 * wo, (0, 0, 0), 16, 16, 1e-4), samples=256, max_bounces=1))
    nodes, weights = np.polynomial.legendre.leggauss(200)
    z, phi = 0.5 * (nodes + 1), 2 * np.pi * (np.arange(400) + 0.5) / 400
    s = np.sqrt(1 - z**2)[:, None]
    wi = np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), z[:, None]), axis=-1).reshape(-1, 3)
    value = bilinear(MATERIALS[name], np.broadcast_to(place, (len(wi), 2)), wi, np.broadcast_to(wo, wi.shape))
    albedo = np.einsum("a,abc->c", 0.5 * weights, value.reshape(200, 400, 3)) * 2 * np.pi / 400
    # 6 z-tests at 1 % together are 3.1 sigma
    assert (np.abs(mean - albedo) < 3.3 * error).all() and (error < 0.01 * albedo).all()


def test_matte_textures_send_light_on_as_lambert_does():
    """A corner of two walls under a lamp and a sky, six bounces: fitted matte paint and the formula agree."""
    none = fitted("ward")
    paint = replace(none, diffuse=np.full((4, 3), 0.7), specular=np.zeros((4, 2, 3)), frame=np.tile(np.eye(3), (4, 1, 1)))
    walls = {"floor": rectangle((0, 0, 0), (2, 0, 0), (0, 2, 0)), "wall": rectangle((0, 0, 0), (0, 2, 0), (0, 0, 2))}
    lights = {"lamp": SphereLight((1.2, 1.0, 1.5), 0.1, (0.5, 1.0, 2.0)), "sky": EnvironmentLight((0.2, 0.1, 0.1))}
    view = camera((3.0, -1.0, 2.5), (0.3, 1.0, 0.3), 24, 24, 12.0)
    images = []
    for material in (Material("measured", measured=paint), grey(0.7)):
        images.append(render(world({n: (m, material) for n, m in walls.items()}, lights), view, samples=64, max_bounces=6))
    (a, ea), (b, eb) = (
        (i.radiance.mean(axis=(0, 1), dtype=float), np.sqrt(i.variance.sum(axis=(0, 1), dtype=float)) / 24**2) for i in images
    )
    # 3 z-tests at 1 % together; variances are upper estimates
    assert (np.abs(a - b) < 2.9 * np.hypot(ea, eb)).all() and (ea < 0.01 * a).all()


def test_worlds_may_mix_measurements_with_formulas_and_with_each_other():
    eye = np.array([0.6, 0.3, 1.5]) * 40
    shapes = {"a": (floor(), grey(0.5)), "b": (floor(z=-1.0), look("btf")), "c": (floor(z=-2.0), look("fitted"))}
    for name, (mesh, material) in shapes.items():
        alone = world({name: (mesh, material)}, {"sun": SUN})
        rest = {n: (replace(m, vertices=m.vertices - np.float32(50)), other) for n, (m, other) in shapes.items() if n != name}
        both = world({**rest, name: (mesh, material)}, {"sun": SUN})
        view = camera(eye, (0, 0, 0), 4, 4, 1.0)
        a, b = (render(w, view, samples=2, max_bounces=1).radiance for w in (alone, both))
        assert np.allclose(a, b, rtol=1e-6) and a.min() > 0


def test_a_measurements_colour_is_its_reflectance_factor_and_all_of_its_light_counts_as_matte():
    ground = floor()
    ground = replace(ground, uv=(ground.uv * 0 + np.array([0.25, 0.25])).astype(np.float32))
    # dp/du is none there, so that any tangent serves: matte paint, which knows no azimuth
    matte = replace(fitted(), diffuse=np.full((4, 3), 0.3), specular=np.zeros((4, 2, 3)), frame=np.tile(np.eye(3), (4, 1, 1)))
    lit = world({"floor": (ground, Material("measured", measured=matte))}, {"sun": SUN})
    picture = render(lit, camera((0, 0, 5), (0, 0, 0), 4, 4), samples=1, max_bounces=1)
    assert np.allclose(picture.albedo, 0.3, rtol=1e-6) and (picture.specular == 0).all()
    assert np.allclose(picture.diffuse, picture.radiance)


def test_measurements_that_cannot_be_traced_are_refused_by_name():
    with pytest.raises(InputError, match=r"materials\.floor.measured must be given"):
        world({"floor": (floor(), Material("measured"))}, {})
    holes = replace(fitted(), mask=np.array([[True, False], [True, True]]))
    with pytest.raises(InputError, match=r"materials\.floor.measured must be known everywhere"):
        world({"floor": (floor(), Material("measured", measured=holes))}, {})
    lit = world({"floor": (floor(), look("fitted"))}, {"sun": SUN})
    with pytest.raises(InputError, match="specular_only must be False in a world with measured materials"):
        render(lit, camera((0, 0, 5), (0, 0, 0)), specular_only=True)
