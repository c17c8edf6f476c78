"""Media against Beer and Lambert, quadrature, the furnace, and each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm
from scipy.stats import t as student

from materials.foundation.errors import InputError
from scene.grid import GroundGrid
from scene.simulation import EnvironmentLight, Material, Medium, PointLight, Shape, Simulation, SphereLight
from scene.wetting.spray import spray_over
from scene.wetting.spray_settings import SpraySettings
from scene.wetting.wakes import MovingVehicle, wakes_of
from tests.transport.worlds import WHITE, camera, floor, grey, mean_and_error, rectangle
from transport.media import compile_medium, compile_spray, transmittance
from transport.render import render
from transport.render_layers import label_layers
from transport.world import compile_world

# The 40 z-tests of this file share 1 % (Sidak).
Z = norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / 40)))
SKY = {"sky": EnvironmentLight(WHITE)}
BOX = ((-2.0, -2.0, -2.0), (2.0, 2.0, 2.0))
AHEAD = camera((0, -6, 0), (0, 0, 0), 8, 8, 0.1)
# Something must stand in a world; this stands out of the way.
FAR_AWAY = Shape("speck", rectangle((1e4, 0, 0), (1, 0, 0), (0, 1, 0)), "black")


def air(medium, lights, *shapes, **materials):
    """Compile a world of a medium, lights and shapes."""
    black = {"black": Material("lambert", (0.0, 0.0, 0.0))}
    return compile_world(Simulation((FAR_AWAY, *shapes), black | materials, lights, medium=medium))


def assert_equals(rendering, expected, bias=0.0):
    mean, error = mean_and_error(rendering)
    np.testing.assert_array_less(np.abs(mean - expected), Z * error + bias + 1e-6 * np.abs(expected))


def fog_of(density):
    """Return a medium of sigma_t 0.5 in the box with a density (a number: even, on a grid)."""
    values = np.full((5, 4, 3), density, np.float32) if np.ndim(density) == 0 else density
    return Medium(0.5, bounds=BOX, density=values)


def test_even_fog_lets_through_what_beer_and_lambert_say():
    o, d = np.array([[0.0, -6, 0], [0, 0, 0], [0, -6, 3]]), np.array([[0.0, 1, 0]] * 3)
    everywhere = transmittance(compile_medium(Medium(0.3)), o, d, [2.0, 5.0, math.inf])
    np.testing.assert_allclose(everywhere, [math.exp(-0.6), math.exp(-1.5), 0.0], rtol=1e-14)
    boxed = transmittance(compile_medium(Medium(0.3, bounds=BOX)), o, d, [5.0, math.inf, math.inf])
    np.testing.assert_allclose(boxed, [math.exp(-0.3), math.exp(-0.6), 1.0], rtol=1e-14)


@pytest.mark.parametrize("slope", [-0.8, -1e-9, 0.0, 1e-12, 0.3, 1.0])
def test_height_fog_lets_through_what_quadrature_says(slope):
    fog = compile_medium(Medium(0.2, scale_height=1.5, base_z=0.5))
    d = np.array([[math.sqrt(1 - slope * slope), 0.0, slope]])
    depth, _ = quad(lambda t: 0.2 * math.exp(-(2.0 + t * slope - 0.5) / 1.5), 0, 7, epsabs=1e-13)
    np.testing.assert_allclose(transmittance(fog, [[0, 0, 2.0]], d, [7.0]), math.exp(-depth), rtol=1e-9)


def test_ratio_tracking_finds_the_transmittance_of_an_uneven_grid():
    rng = np.random.default_rng(3)
    density = rng.random((7, 6, 5)).astype(np.float32) ** 2 * 3
    fog = compile_medium(fog_of(density))
    directions = rng.standard_normal((4, 3)) * (1, 1, 0.5)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts = -5 * directions + rng.uniform(-1, 1, (4, 3))
    t = (np.arange(20_000) + 0.5) / 20_000 * 10
    for o, d in zip(starts, directions, strict=True):
        p = o + t[:, None] * d
        inside = np.all(np.abs(p) < 2, axis=1)
        # trilinear between the centres of the cells, by hand
        xyz = np.clip((p + 2) / 4 * (5, 6, 7) - 0.5, 0, (4, 5, 6))
        low = np.minimum(xyz.astype(int), (3, 4, 5))
        w = xyz - low
        value = np.zeros(len(t))
        for corner in np.ndindex(2, 2, 2):
            i = low + corner
            value += np.prod(np.where(corner, w, 1 - w), axis=1) * density[i[:, 2], i[:, 1], i[:, 0]]
        exact = math.exp(-0.5 * np.sum(value * inside) * 10 / 20_000)
        # 64 estimates of 1024 draws, each of its own stream, give mean and error
        many = transmittance(fog, np.tile(o, (64, 1)), np.tile(d, (64, 1)), np.full(64, 10.0), samples=1024)
        assert abs(many.mean() - exact) < Z * many.std(ddof=1) / 8 + 1e-4


def test_a_glowing_wall_behind_fog_keeps_the_share_that_is_let_through():
    wall = Shape("wall", rectangle((-9, 4, -9), (18, 0, 0), (0, 0, 18)), "glow")
    glow = Material("emission", emission=(3.0, 2.0, 1.0))
    for medium in (Medium(0.5, (0, 0, 0), bounds=BOX), replace(fog_of(1.0), albedo=(0, 0, 0))):
        seen = render(air(medium, {}, wall, glow=glow), AHEAD, samples=1024)
        assert_equals(seen, np.array([3.0, 2.0, 1.0]) * math.exp(-2.0))


def single_scattering(medium, lamp, start, end):
    """Return the light of a lamp of 1 W/sr that comes once scattered along the y axis, by quadrature."""
    lamp = np.asarray(lamp)

    def along(y):
        p = np.array([0, y, 0])
        r = np.linalg.norm(lamp - p)
        cos = (lamp - p)[1] / r
        g = medium.g
        f = (1 - g * g) / (4 * math.pi * (1 + g * g - 2 * g * cos) ** 1.5)
        return medium.sigma_t * math.exp(-medium.sigma_t * (y - start + r)) * f / r**2

    return quad(along, start, end, epsabs=1e-12, points=[lamp[1]], limit=200)[0]


@pytest.mark.parametrize("g", [0.0, 0.7, -0.4])
def test_fog_around_a_lamp_glows_as_the_integral_of_single_scattering_says(g):
    medium = Medium(0.4, (0.9, 0.5, 0.1), g)
    lit = air(medium, {"lamp": PointLight((1.0, 0.5, 0.0), WHITE)})
    expected = single_scattering(medium, (1.0, 0.5, 0.0), -6.0, 30.0) * np.array([0.9, 0.5, 0.1])
    assert_equals(render(lit, AHEAD, samples=1024, max_bounces=1), expected)


@pytest.mark.parametrize("aside", [0.02, 0.3])
@pytest.mark.parametrize("scale_height", [None, 2.0])
def test_the_glow_close_to_a_lamp_has_hardly_any_noise(aside, scale_height):
    medium = Medium(0.4, (0.9, 0.5, 0.1), 0.5, scale_height=scale_height)
    lit = air(medium, {"lamp": PointLight((aside, 0.5, 0.0), WHITE)})
    expected = single_scattering(medium, (aside, 0.5, 0.0), -6.0, 30.0) * np.array([0.9, 0.5, 0.1])
    seen = render(lit, camera((0, -6, 0), (0, 0, 0), 8, 8, 1e-3), samples=64, max_bounces=1)
    # Distances drawn by extinction alone are off by a fifth here: they rarely come near the lamp, whose 1 / r^2 is not bounded.
    np.testing.assert_allclose(seen.radiance.mean(axis=(0, 1)), expected, rtol=2e-3)


def test_places_drawn_by_angle_and_by_collisions_alone_give_the_same_light():
    # The lamps stand outside, so both have little noise; a grid draws by collisions alone.
    lights = {"a": PointLight((0.5, 0.6, 3.0), (2.0, 1.0, 0.5)), "b": PointLight((-3.0, 0.0, 0.0), WHITE)}
    means = []
    for medium in (Medium(0.9, (0.8, 0.9, 1.0), 0.4, BOX), replace(fog_of(1.0), sigma_t=0.9, albedo=(0.8, 0.9, 1.0), g=0.4)):
        lit = air(medium, lights, Shape("ground", floor(8, -1.0), "grey"), grey=Material("lambert", (0.5, 0.5, 0.5)))
        view = camera((0, -6, 1), (0, 0, 0), 12, 12, 30)
        runs = [
            render(lit, view, samples=64, seed=s + 100 * len(means), max_bounces=6).radiance.mean(axis=(0, 1)) for s in range(12)
        ]
        means.append(np.array(runs, np.float64))
    a, b = means
    z = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 12)
    # The errors come from 12 runs each: Student's t with 22 degrees of freedom.
    assert np.abs(z).max() < student.isf(0.5 * (1 - (1 - 0.01 / 40) ** (1 / 3)), 22)


def test_what_the_air_scatters_before_a_surface_is_a_layer_of_its_own():
    wall = Shape("wall", rectangle((-9, 2, -9), (18, 0, 0), (0, 0, 18)), "black")
    lit = air(Medium(0.3, WHITE, 0.2), {"lamp": PointLight((0.5, 0.5, 0.5), WHITE)}, wall)
    seen = render(lit, AHEAD, samples=32, max_bounces=3)
    np.testing.assert_allclose(seen.scattered, seen.radiance, rtol=1e-5)
    assert seen.radiance.min() > 0 and np.abs(seen.diffuse).max() < 1e-5 * seen.radiance.max() and not seen.seen.any()


def test_a_small_glowing_ball_lights_the_fog_like_a_point():
    lamps = {"lamp": SphereLight((1.0, 0.5, 0.0), 0.02, WHITE)}
    medium = Medium(0.4, WHITE, 0.3)
    # Light starts at its surface, a radius nearer.
    expected = single_scattering(medium, (1.0, 0.5, 0.0), -6.0, 30.0) * math.exp(0.4 * 0.02)
    assert_equals(render(air(medium, lamps), AHEAD, samples=1024, max_bounces=1), expected, bias=1e-3 * expected)


@pytest.mark.parametrize(
    "medium",
    [
        Medium(0.5, WHITE, 0.6, BOX),
        replace(fog_of(np.random.default_rng(0).random((4, 4, 4)).astype(np.float32)), g=-0.3),
        Medium(0.4, bounds=BOX, scale_height=1.0),
        Medium(0.5, bounds=BOX, droplet_diameter_um=10.0),
    ],
    ids=["even", "grid", "height", "droplets"],
)
def test_fog_that_absorbs_nothing_cannot_be_seen_in_an_even_sky(medium):
    view = camera((-3, -3, -1.5), (0, 0, 0), 12, 12, 20)
    assert_equals(render(air(medium, SKY), view, samples=64, max_bounces=256), 1.0)


def test_white_ground_below_white_fog_cannot_be_seen_in_an_even_sky():
    ground = Shape("ground", floor(), "white")
    lit = air(Medium(0.3, WHITE, 0.5, scale_height=1.0), SKY, ground, white=Material("lambert", WHITE))
    assert_equals(render(lit, camera((0, -6, 2), (0, 0, 0), 12, 12, 20), samples=64, max_bounces=512), 1.0)


def test_tracking_an_even_grid_gives_the_picture_of_even_fog():
    sky = np.full((8, 16, 3), 0.2, np.float32)
    sky[2, 3] = 20.0
    lights = {"sky": EnvironmentLight(panorama=sky), "lamp": PointLight((0.5, 0.5, 1.0), (2.0, 1.0, 0.5))}
    ground = Shape("ground", floor(8, -1.0), "grey")
    pictures = []
    for medium in (Medium(0.5, (0.8, 0.9, 1.0), 0.4, BOX), replace(fog_of(1.0), albedo=(0.8, 0.9, 1.0), g=0.4)):
        lit = air(medium, lights, ground, grey=Material("lambert", (0.5, 0.5, 0.5)))
        pictures.append(render(lit, camera((0, -6, 1), (0, 0, 0), 12, 12, 30), samples=256, seed=len(pictures)))
    a, b = pictures
    z = (a.radiance - b.radiance) / np.sqrt(a.variance + b.variance)
    # 432 pixel values and channels share the level; the stated variances are upper estimates
    assert np.abs(z).max() < norm.isf(0.5 * (1 - (1 - 0.01 / 40) ** (1 / z.size)))
    assert a.radiance.mean() == pytest.approx(b.radiance.mean(), rel=0.02)


def test_fog_does_not_depend_on_the_number_of_threads(thread_counts):
    lit = air(replace(fog_of(1.0), g=0.4), SKY)
    pictures = []
    for threads in thread_counts:
        numba.set_num_threads(threads)
        pictures.append(render(lit, camera((0, -6, 1), (0, 0, 0), 20, 20, 30), samples=4).radiance)
    np.testing.assert_array_equal(*pictures)


def test_spray_lets_through_what_the_integral_of_eq_6_6_says():
    grid = GroundGrid(-10.0, -10.0, 0.5, 40, 120)
    height = (0.05 * grid.centres()[0] + 0.2 * np.sin(grid.centres()[1])).astype(np.float32)
    o, d = np.array([-8.0, 0.0, 1.1]), np.array([0.99, 0.1, 0.0])
    d /= np.linalg.norm(d)
    t = (np.arange(60_000) + 0.5) / 60_000 * 60
    for contrast in (0.0, 0.5):
        spray = spray_over(height, grid, 1.0, SpraySettings(contrast=contrast, margin=20), seed=3)
        exact = math.exp(-np.mean(spray.extinction(o + t[:, None] * d)) * 60)
        many = transmittance(compile_spray(spray), np.tile(o, (64, 1)), np.tile(d, (64, 1)), np.full(64, 60.0), samples=256)
        assert abs(many.mean() - exact) < Z * many.std(ddof=1) / 8


@pytest.mark.parametrize("m", [0.0, 1.0])
def test_a_wake_lets_through_what_the_line_integral_says(m):
    grid = GroundGrid(-30.0, -10.0, 0.5, 40, 80)
    car = MovingVehicle("1", np.array([0.0, 0.0]), np.array([25.0, 5.0]), np.array([4.3, 1.8, 1.5]))
    spray = spray_over(np.zeros(grid.shape, np.float32), grid, m, SpraySettings(margin=5), 3, wakes_of(car, 0.001))
    # Along the wake, and across it close behind the tyres.
    for o, d in (((-16.0, -3.0, 1.2), (0.98, 0.16, -0.04)), ((-2.0, -5.0, 0.4), (0.02, 1.0, 0.0))):
        o, d = np.array(o), np.array(d) / np.linalg.norm(d)
        t = (np.arange(60_000) + 0.5) / 60_000 * 15
        exact = math.exp(-np.mean(spray.extinction(o + t[:, None] * d)) * 15)
        many = transmittance(compile_spray(spray), np.tile(o, (64, 1)), np.tile(d, (64, 1)), np.full(64, 15.0), samples=256)
        assert exact < 0.8
        assert abs(many.mean() - exact) < Z * many.std(ddof=1) / 8


def test_white_ground_below_spray_cannot_be_seen_in_an_even_sky():
    ground = Shape("ground", floor(400), "white")
    spray = spray_over(np.zeros((40, 40), np.float32), GroundGrid(-10, -10, 0.5, 40, 40), 1.0, SpraySettings(view_distance=5))
    lit = replace(air(None, SKY, ground, white=Material("lambert", WHITE)), medium=compile_spray(spray))
    assert_equals(render(lit, camera((0, -6, 1), (0, 0, 1), 12, 12, 20), samples=64, max_bounces=512), 1.0)


@pytest.mark.parametrize(
    ("medium", "words"),
    [
        (Medium(-1.0), r"medium\.sigma_t must lie in \[0, inf\), got -1"),
        (Medium(1.0, (1.0, 2.0, 1.0)), r"medium\.albedo must lie in \[0, 1\], got 2 at index 1"),
        (Medium(1.0, g=1.0), r"g must lie in \(-1, 1\)"),
        (Medium(1.0, scale_height=0.0), r"medium\.scale_height must lie in \(0, inf\)"),
        (Medium(1.0, bounds=((0, 0, 0), (1, 0, 1))), r"medium\.bounds must be the lower and the upper corner"),
        (Medium(1.0, density=np.ones((2, 2, 2), np.float32)), "a medium with a density must have bounds"),
        (Medium(1.0, bounds=BOX, density=-np.ones((2, 2, 2), np.float32)), r"medium\.density must lie in \[0, inf\)"),
    ],
)
def test_a_medium_that_cannot_be_is_refused(medium, words):
    with pytest.raises(InputError, match=words):
        compile_medium(medium)


def test_layers_of_a_picture_in_fog_are_what_got_through_and_what_was_scattered():
    # A matte wall that fills the view, behind 2 m of fog, lit by the sky behind the camera alone.
    wall = rectangle((5.0, 40.0, 40.0), (0, -80, 0), (0, 0, -80))
    simulation = Simulation(
        (Shape("wall", wall, "m"),), {"m": grey(0.5)}, {"sky": EnvironmentLight(WHITE)}, medium=Medium(0.2, bounds=BOX)
    )
    lit, view = compile_world(simulation), camera((0, 0, 0), (1, 0, 0), 8, 6, 10)
    labels = label_layers(lit, view)
    distance = np.linalg.norm((view.pixel_centres() - (4, 3)) / view.fx, axis=1)
    expected = np.exp(-0.2 * 2 * np.sqrt(1 + distance**2)).reshape(6, 8)
    np.testing.assert_allclose(labels["transmittance.Y"], expected, rtol=1e-4)
    picture = render(lit, view, samples=64)
    assert picture.scattered.min() > 0 and picture.specular.max() == 0 and picture.seen.max() == 0
    np.testing.assert_allclose(picture.scattered + picture.diffuse, picture.radiance, rtol=1e-6)
    # Paths that particles stop say nothing of the wall: its albedo is whole.
    np.testing.assert_allclose(picture.albedo, 0.5, rtol=1e-6)
    np.testing.assert_allclose(picture.normal[..., 0], -1, rtol=1e-6)
