"""Lamps with an extent: spheres, rectangles and glowing meshes, against closed forms and against other strategies."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.simulation import DirectionalLight, Material, PointLight, RectangleLight, SphereLight
from tests.transport.single_strategy import by_lights
from tests.transport.worlds import WHITE, ball, camera, floor, grey, mean_and_error, rectangle, world
from transport.render import render
from transport.world import compile_camera, with_lights

# The 40 z-tests of this file share 1 % (Sidak).
Z = norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / 40)))
DOWN = camera((0, 0, 5), (0, 0, 0), 12, 12, 0.01)


def assert_equal(rendering, expected, bias=0.0):
    mean, error = mean_and_error(rendering)
    np.testing.assert_array_less(np.abs(mean - expected), Z * error + bias + 1e-6 * np.abs(expected))


@pytest.mark.parametrize(("position", "radius"), [((0, 0, 2), 0.5), ((1.5, -1, 1), 0.8), ((0, 3, 1.001), 1.0), ((40, 0, 30), 0.1)])
def test_a_glowing_ball_lights_a_floor_like_its_projection_on_the_sphere_of_directions(position, radius):
    lamp = {"lamp": SphereLight(position, radius, (3.0, 2.0, 1.0))}
    view = replace_view(position)
    rendering = render(world({"floor": (floor(), grey(0.5))}, lamp), view, samples=64, max_bounces=1)
    # A ball above the horizon: E = L pi (r / d)^2 cos, with L = I / (pi r^2) = I cos / d^2, whatever its radius.
    d2 = float(np.sum(np.square(position)))
    expected = 0.5 / np.pi * np.array([3.0, 2.0, 1.0]) / d2 * (position[2] / math.sqrt(d2))
    assert_equal(rendering, expected, bias=1e-4 * expected)  # the view is 1 mm wide


def replace_view(lamp):
    """Return a view of the origin in which the lamp does not stand."""
    eye = np.array([-lamp[0] - 2.0, -lamp[1] + 0.2, 4.0])
    return camera(eye, (0, 0, 0), 12, 12, 0.01)


def test_a_glowing_ball_is_seen_at_its_radiance_and_casts_a_shadow():
    lights = {"lamp": SphereLight((0, 0, 2), 0.5, WHITE), "sun": DirectionalLight((0, 0, -1), (np.pi,) * 3)}
    lit = world({"floor": (floor(), grey(1.0))}, lights)
    seen = render(lit, camera((0, -5, 2), (0, 0, 2), 8, 8, 1), samples=4, max_bounces=1).radiance
    np.testing.assert_allclose(seen, 1 / (np.pi * 0.25), rtol=1e-6)
    view = camera((2, 0, 3), (0, 0, 0), 8, 8, 0.1)
    below, _ = mean_and_error(render(lit, view, samples=64, max_bounces=1))
    beside, _ = mean_and_error(render(lit, camera((2, 0, 3), (1, 0, 0), 8, 8, 0.1), samples=64, max_bounces=1))
    # Straight below the sun is hidden: what is left is the lamp, I / d^2 / pi
    assert below[0] == pytest.approx(1 / 4 / np.pi, rel=0.02)
    assert beside[0] == pytest.approx(1 + 1 / 5 * 2 / math.sqrt(5) / np.pi, rel=0.02)


def test_a_mirror_shows_a_glowing_ball():
    lit = world({"floor": (floor(), Material("mirror", (0.5, 0.5, 0.5)))}, {"lamp": SphereLight((3, 0, 3), 0.5, WHITE)})
    view = camera((-3, 0, 3), (0, 0, 0), 8, 8, 1)
    np.testing.assert_allclose(render(lit, view, samples=2).radiance, 0.5 / (np.pi * 0.25), rtol=1e-6)


def corner_form_factor(a, b, c):
    """Return the form factor from a small patch to a parallel rectangle a x b at height c, one corner above the patch."""
    x, y = a / c, b / c
    p, q = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    return (x / p * math.atan(y / p) + y / q * math.atan(x / q)) / (2 * math.pi)


def test_a_rectangle_of_light_follows_its_form_factor_and_is_black_from_behind():
    lamp = {"lamp": RectangleLight((0, 0, 1.5), (0, 1, 0), (2, 0, 0), (4.0, 2.0, 1.0))}  # u x v points down
    lit = world({"floor": (floor(), grey(0.5))}, lamp)
    view = camera((-1, -1, 3), (0, 0, 0), 12, 12, 0.01)
    assert_equal(
        render(lit, view, samples=64, max_bounces=1), 0.5 * corner_form_factor(2, 1, 1.5) * np.array([4.0, 2.0, 1.0]), 1e-4
    )
    up = camera((1, 0.5, 0.5), (1, 0.5, 1.5), 4, 4, 1)
    np.testing.assert_allclose(render(lit, up, samples=1).radiance, np.broadcast_to((4.0, 2.0, 1.0), (4, 4, 3)))
    assert render(lit, camera((1, 0.5, 3), (1, 0.5, 1.5), 4, 4, 1), samples=1).radiance.max() == 0


def bright_corner(material):
    """Return lamps of unequal power about a floor: a ball, a small and a large rectangle, and a textured glowing mesh."""
    glow = np.zeros((4, 4, 3), np.float32)
    glow[:2, :2], glow[2:, 1:] = (5, 1, 0), (0, 2, 4)
    shapes = {
        "floor": (floor(), material),
        "screen": (rectangle((-2, 1.5, 0.2), (4, 0, 0), (0, 0, 2)), Material("emission", emission=WHITE, emission_texture=glow)),
        "block": (ball(0.3, (0.5, 0.3, 0.3), 1), grey(0.0)),
    }
    lights = {
        "ball": SphereLight((1, -0.5, 1), 0.3, (2.0, 2.0, 3.0)),
        "small": RectangleLight((-1, -0.5, 1), (0, 0.1, 0), (0.1, 0, 0), (50.0, 40.0, 30.0)),
        "large": RectangleLight((-2, -2, 3), (0, 4, 0), (4, 0, 0), (0.5, 0.5, 0.5)),
    }
    return world(shapes, lights)


LOOK = camera((-3, -3, 2), (0, 0, 0), 16, 16, 20)
MATERIALS = {
    "matte": grey(0.6),
    "glossy": Material("ggx", (0.1, 0.1, 0.1), alpha=0.15, specular_scale=3.0),
    "brushed": Material("cook_torrance", (0.2, 0.1, 0.1), alpha=0.4, alpha_v=0.4, eta=2.0),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_paths_lamps_and_both_together_agree_on_direct_light(name):
    lit = bright_corner(MATERIALS[name])
    both = render(lit, LOOK, samples=256, max_bounces=1)
    # Without a table of lamps the tracer finds them by the surface alone, with full weight.
    blind = replace(lit, lights=lit.lights._replace(emitter_total=0.0))
    surface = render(blind, LOOK, samples=1024, max_bounces=1, seed=1)
    total = np.zeros((LOOK.height, LOOK.width, 3))
    by_lights(lit.arrays, lit.lights, compile_camera(LOOK), 256, total)
    # Pixels differ, so each strategy's error is taken from its own stated variance, an upper estimate for Sobol samples.
    hidden = first_lamp(lit)
    error = lambda r: np.sqrt(r.variance[~hidden].astype(float).sum(axis=0)) / (~hidden).sum()  # noqa: E731
    mean = lambda x: x[~hidden].astype(float).mean(axis=0)  # noqa: E731
    np.testing.assert_array_less(np.abs(mean(both.radiance) - mean(surface.radiance)), Z * np.hypot(error(both), error(surface)))
    # The twin has no Sobol numbers, but no estimate of its spread either: it is at most that of the other single strategy.
    lamps = mean(total / 256)
    np.testing.assert_array_less(np.abs(mean(both.radiance) - lamps), Z * np.hypot(error(both), 2 * error(surface)))


def first_lamp(lit):
    """Return where the camera sees no reflecting surface: there is nothing to compare."""
    from transport.gbuffer import gbuffer

    seen = gbuffer(lit, LOOK)
    floor_index = [s.name for s in lit.shapes].index("floor")
    edge = seen.shape != floor_index
    # a pixel next to another shape may see it too
    for axis in (0, 1):
        edge = edge | np.roll(edge, 1, axis) | np.roll(edge, -1, axis)
    return edge


@pytest.mark.parametrize("max_bounces", [2, 5])
def test_paths_alone_and_paths_with_lamps_agree_over_bounces(max_bounces):
    lit = bright_corner(MATERIALS["glossy"])
    both = render(lit, LOOK, samples=256, max_bounces=max_bounces)
    blind = replace(lit, lights=lit.lights._replace(emitter_total=0.0))
    surface = render(blind, LOOK, samples=1024, max_bounces=max_bounces, seed=1)
    error = np.sqrt((both.variance + surface.variance).astype(float).mean(axis=(0, 1)) / (16 * 16))
    np.testing.assert_array_less(np.abs((both.radiance - surface.radiance).astype(float).mean(axis=(0, 1))), Z * error)


def test_a_ball_lit_from_its_centre_glows_evenly():
    # Every bounce returns a of the light to all of the wall alike: L = I / (pi R^2) a / (1 - a).
    inside = world({"ball": (ball(2.0, subdivisions=5), grey(0.5))}, {"lamp": PointLight((0, 0, 0), (4.0, 4.0, 4.0))})
    view = Camera("PINHOLE", 16, 16, np.eye(4), 8, 8, 8, 8)
    rendering = render(inside, view, samples=256, max_bounces=40)
    # The facets lie up to half their sagitta inside the ball, R (1 - cos(edge / 2R)) = 2e-4 R: twice that in 1 / R^2.
    assert_equal(rendering, 4 / (np.pi * 4) * 0.5 / 0.5, bias=4e-4 / np.pi * 2)


def test_one_sided_surfaces_are_black_from_behind():
    sky = {"sun": DirectionalLight((0, 0, 1), (np.pi,) * 3)}
    for one_sided, expected in ((False, 0.5), (True, 0.0)):
        lit = world({"floor": (floor(), Material(albedo=(0.5,) * 3, one_sided=one_sided))}, sky)
        below = render(lit, camera((0, 0, -3), (0, 0, 0), 4, 4), samples=1, max_bounces=1).radiance
        np.testing.assert_allclose(below, expected, rtol=1e-5)


def test_lamps_stay_when_other_lights_change():
    lit = bright_corner(grey(0.5))
    changed = with_lights(lit, {"ball": SphereLight((0, 0, 1), 0.1, WHITE)})
    assert len(changed.arrays.spheres) == 1 and len(lit.arrays.spheres) == 1
    assert len(changed.lights.emitters) == len(lit.lights.emitters)
    assert len(with_lights(lit, {}).lights.emitters) == len(lit.lights.emitters) - 1
    with pytest.raises(InputError, match="must be in the simulation when it is compiled"):
        with_lights(lit, {"r": RectangleLight((0, 0, 0), (1, 0, 0), (0, 1, 0), WHITE)})


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (SphereLight((0, 0, 1), 0.0, WHITE), r"lights.lamp.radius must lie in \(0, inf\)"),
        (SphereLight((0, 0, 1), 1.0, (-1.0, 0.0, 0.0)), "lights.lamp.intensity must be finite and not negative"),
        (SphereLight((0, 0, 1), 1.0, (0.0, 0.0, 0.0)), "lights.lamp.intensity must be positive"),
        (RectangleLight((0, 0, 1), (1, 0, 0), (2, 0, 0), WHITE), "lights.lamp.edge_u must span an area"),
        (RectangleLight((0, 0, 1), (1, 0, 0), (0, 1, 0), (-1.0, 0.0, 0.0)), "materials.lamp.emission must lie in"),
    ],
)
def test_lamps_without_meaning_are_refused(light, words):
    with pytest.raises(InputError, match=words):
        world({"floor": (floor(), grey(0.5))}, {"lamp": light})
