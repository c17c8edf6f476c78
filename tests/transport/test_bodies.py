"""Media inside bodies: behind glass, and behind surfaces that are none to light."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from materials.foundation.errors import InputError
from scene.mesh import Mesh
from scene.simulation import EnvironmentLight, Material, Medium, PointLight, Shape, Simulation
from tests.transport.worlds import WHITE, ball, camera, floor, grey, mean_and_error, rectangle
from transport.render import render
from transport.world import compile_world

# The 20 z-tests of this file share 1 % (Sidak).
Z = norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / 20)))
SKY = {"sky": EnvironmentLight(WHITE)}
VIEW = camera((0, -6, 1), (0, 0, 0), 12, 12, 30)


def box(low: float = -1.0, high: float = 1.0) -> Mesh:
    """Return a cube with flat faces that look outwards."""
    s = high - low
    sides = [
        rectangle((low, low, low), (0, s, 0), (s, 0, 0)),
        rectangle((low, low, high), (s, 0, 0), (0, s, 0)),
        rectangle((low, low, low), (s, 0, 0), (0, 0, s)),
        rectangle((low, high, low), (0, 0, s), (s, 0, 0)),
        rectangle((low, low, low), (0, 0, s), (0, s, 0)),
        rectangle((high, low, low), (0, s, 0), (0, 0, s)),
    ]
    vertices = np.concatenate([m.vertices for m in sides])
    faces = np.concatenate([m.faces + np.uint32(4 * i) for i, m in enumerate(sides)])
    return Mesh(vertices, faces, np.concatenate([m.normals for m in sides]), np.concatenate([m.uv for m in sides]))


def made(body: Material, mesh: Mesh, lights, medium=None, **more: tuple[Mesh, Material]):
    shapes = (Shape("body", mesh, "body"), *(Shape(n, m, n) for n, (m, _) in more.items()))
    return compile_world(Simulation(shapes, {"body": body} | {n: m for n, (_, m) in more.items()}, lights, medium=medium))


def matched(sigma_t: float, albedo=WHITE, g: float = 0.0) -> Material:
    return Material("dielectric", eta=1.0, interior=Medium(sigma_t, albedo, g))


def assert_equals(rendering, expected, bias=0.0):
    mean, error = mean_and_error(rendering)
    np.testing.assert_array_less(np.abs(mean - expected), Z * error + bias + 1e-6 * np.abs(expected))


@pytest.mark.parametrize("eta", [1.0, 1.33, 1.5])
def test_a_body_that_absorbs_nothing_cannot_be_seen_in_an_even_sky(eta):
    milk = Material("dielectric", eta=eta, interior=Medium(2.0, WHITE, 0.3))
    assert_equals(render(made(milk, ball(), SKY), VIEW, samples=64, max_bounces=1000), 1.0)


def test_rough_glass_around_milk_sends_back_no_more_than_it_gets():
    milk = Material("rough_dielectric", eta=1.4, alpha=0.2, interior=Medium(1.0, WHITE))
    mean, error = mean_and_error(render(made(milk, ball(), SKY), VIEW, samples=64, max_bounces=1000))
    # A rough interface drops what bounces between its own facets.
    assert np.all(mean < 1 + Z * error) and np.all(mean > 0.9)


def test_a_dark_body_lets_through_what_beer_and_lambert_say_of_its_thickness():
    wall = (rectangle((-9, 4, -9), (18, 0, 0), (0, 0, 18)), Material("emission", emission=(3.0, 2.0, 1.0)))
    straight = camera((0, -6, 0), (0, 0, 0), 8, 8, 0.1)
    seen = render(made(matched(0.7, (0, 0, 0)), box(), {}, wall=wall), straight, samples=1024)
    assert_equals(seen, np.array([3.0, 2.0, 1.0]) * math.exp(-1.4))
    # Glass takes its share at both faces, however often light goes to and fro between them.
    glass = Material("dielectric", eta=1.5, interior=Medium(0.7, (0, 0, 0)))
    r, T = 0.04, math.exp(-1.4)
    seen = render(made(glass, box(), {}, wall=wall), straight, samples=4096, max_bounces=32)
    assert_equals(seen, np.array([3.0, 2.0, 1.0]) * (1 - r) ** 2 * T / (1 - (r * T) ** 2), bias=1e-4)


def test_a_body_without_a_surface_is_a_medium_with_bounds():
    sky = np.full((8, 16, 3), 0.2, np.float32)
    sky[2, 3] = 20.0
    lights = {"sky": EnvironmentLight(panorama=sky), "lamp": PointLight((0.5, 0.5, 1.8), (2.0, 1.0, 0.5))}
    ground = (floor(8, -1.5), grey(0.5))
    fog = Medium(0.8, (0.8, 0.9, 1.0), 0.4)
    body = made(matched(fog.sigma_t, fog.albedo, fog.g), box(), lights, ground=ground)
    speck = rectangle((1e4, 0, 0), (1, 0, 0), (0, 1, 0))
    bounds = ((-1.0,) * 3, (1.0,) * 3)
    bounded = made(grey(0.0), speck, lights, Medium(fog.sigma_t, fog.albedo, fog.g, bounds), ground=ground)
    a, b = (render(w, VIEW, samples=256, seed=i) for i, w in enumerate((body, bounded)))
    z = (a.radiance - b.radiance) / np.sqrt(a.variance + b.variance + 1e-12)
    assert np.abs(z).max() < norm.isf(0.5 * (1 - (1 - 0.01 / 20) ** (1 / z.size)))
    assert a.radiance.mean() == pytest.approx(b.radiance.mean(), rel=0.02)


def test_bodies_stand_in_fog_and_both_together_cannot_be_seen():
    fog = Medium(0.3, WHITE, 0.5, ((-3,) * 3, (3,) * 3))
    for eta in (1.0, 1.4):
        milk = Material("dielectric", eta=eta, interior=Medium(1.5, WHITE, -0.2))
        assert_equals(render(made(milk, ball(), SKY, fog), VIEW, samples=64, max_bounces=1000), 1.0)


def test_interiors_that_cannot_be_are_refused():
    for material, words in (
        (Material("lambert", interior=Medium(1.0)), "materials.body must be dielectric or rough_dielectric"),
        (Material("dielectric", interior=Medium(1.0, scale_height=1.0)), "interior must be even and without bounds"),
        (Material("dielectric", interior=Medium(-1.0)), "sigma_t must lie in"),
    ):
        with pytest.raises(InputError, match=words):
            made(material, ball(), SKY)
