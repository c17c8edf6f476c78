"""Reflections move as geometry says they do."""

from __future__ import annotations

import numpy as np

from scene.simulation import Material, Shape, Simulation
from scene.transforms import look_at
from tests.transport.worlds import ball, camera, floor, grey, rectangle
from transport.reflected_flow import reflected_flow
from transport.world import World, compile_world

MIRROR = Material("mirror", (1.0, 1.0, 1.0))
VIEW = camera((-6, 1, 2), (0, 0, 0.5), 32, 24, 50)
THEN = VIEW.moved_to(look_at(np.array([-5.8, 1.1, 2.05]), np.array([0.0, 0.05, 0.5])))


def over_mirror(wall_at: float = 3.0) -> World:
    wall = rectangle((wall_at, 30, 40), (0, -60, 0), (0, 0, -40))
    shapes = (Shape("wall", wall, "m", 7), Shape("floor", floor(), "mirror"))
    return compile_world(Simulation(shapes, {"m": grey(0.5), "mirror": MIRROR}))


def test_the_image_in_a_flat_mirror_moves_as_the_mirrored_world_does():
    flow = reflected_flow(over_mirror(), VIEW, THEN).reshape(-1, 2)
    origins, rays = VIEW.rays(VIEW.pixel_centres())
    t = -origins[:, 2] / rays[:, 2]
    p = origins + t[:, None] * rays
    # Rays that go down meet the floor before the wall; mirrored, they rise to the wall at x = 3.
    seen = (rays[:, 2] < 0) & (p[:, 0] < 3)
    further = (3 - p[:, 0]) / rays[:, 0]
    behind = p + further[:, None] * rays
    xy, _ = THEN.project(behind)
    assert seen.sum() > 200
    # Float32 meshes of 60 m seen at 100 pixels per radian from 9 m: 1e-4 px; the search stops at 0.02 px and steps once more.
    np.testing.assert_allclose(flow[seen], (xy - VIEW.pixel_centres())[seen], atol=2e-3)
    assert np.all(np.isnan(flow[~seen & (p[:, 0] > 3.01) & (rays[:, 2] < 0)]))


def test_a_mirrored_thing_that_moves_takes_its_image_along():
    T = np.eye(4)
    T[0, 3] = 0.25
    flow = reflected_flow(over_mirror(), VIEW, VIEW, over_mirror(3.25), {7: T}).reshape(-1, 2)
    origins, rays = VIEW.rays(VIEW.pixel_centres())
    p = origins - (origins[:, 2] / rays[:, 2])[:, None] * rays
    seen = (rays[:, 2] < 0) & (p[:, 0] < 2.5)
    q = p + ((3 - p[:, 0]) / rays[:, 0])[:, None] * rays * (1, 1, -1)
    # The wall moves along its normal: each of its points, mirrored below the floor.
    xy, _ = VIEW.project((q + (0.25, 0, 0)) * (1, 1, -1))
    kept = seen & (xy[:, 0] > 0)
    np.testing.assert_allclose(flow[kept], (xy - VIEW.pixel_centres())[kept], atol=2e-3)


def test_a_matte_floor_shows_no_image():
    world = compile_world(Simulation((Shape("floor", floor(), "m"),), {"m": grey(0.5)}))
    assert np.all(np.isnan(reflected_flow(world, VIEW, THEN)))


def test_nothing_moves_while_all_stand_still_even_in_a_bent_mirror():
    shapes = (Shape("ball", ball(1.0, (0, 0, 1), 5), "mirror"), Shape("floor", floor(), "m"))
    world = compile_world(Simulation(shapes, {"m": grey(0.5), "mirror": MIRROR}))
    flow = reflected_flow(world, VIEW, VIEW)
    found = np.isfinite(flow).all(axis=-1)
    assert found.sum() > 40
    np.testing.assert_allclose(flow[found], 0, atol=1e-9)


def test_the_image_in_a_ball_obeys_the_law_of_reflection_in_the_next_frame():
    centre = np.array([0.0, 0.0, 1.0])
    shapes = (Shape("ball", ball(1.0, centre, 6), "mirror"), Shape("floor", floor(), "m"))
    world = compile_world(Simulation(shapes, {"m": grey(0.5), "mirror": MIRROR}))
    flow = reflected_flow(world, VIEW, THEN).reshape(-1, 2)
    xy = VIEW.pixel_centres()

    def shown(view, at):
        """Return the floor's point that a position shows by way of an exact ball; NaN where none."""
        o, d = view.rays(at)
        b, c = np.sum((o - centre) * d, axis=1), np.sum((o - centre) ** 2, axis=1) - 1
        with np.errstate(invalid="ignore"):
            t = -b - np.sqrt(b * b - c)
        n = o + t[:, None] * d - centre
        w = d - 2 * np.sum(n * d, axis=1)[:, None] * n
        p = centre + n
        far = np.where(w[:, 2] < -0.05, -p[:, 2] / w[:, 2], np.nan)
        return p + far[:, None] * w

    def miss(moved):
        """Return by how many pixels a flow misses the position that shows the same point."""
        before, after, beside = shown(VIEW, xy), shown(THEN, xy + moved), shown(THEN, xy + moved + (0.1, 0))
        return 0.1 * np.linalg.norm(after - before, axis=1) / np.linalg.norm(beside - after, axis=1)

    off = miss(flow)
    assert np.isfinite(off).sum() > 20
    # Facets of 0.02 rad lie within 0.02^2 / 8 of the ball, less than a hundredth of a pixel of 0.03 rad.
    assert np.nanmax(off) < 0.01
    # The flow of the ball's own surface is another one, and would be caught.
    o, d = VIEW.rays(xy)
    b, c = np.sum((o - centre) * d, axis=1), np.sum((o - centre) ** 2, axis=1) - 1
    with np.errstate(invalid="ignore"):
        p = o + (-b - np.sqrt(b * b - c))[:, None] * d
    surface = THEN.project(p)[0] - xy
    assert np.nanmedian(np.where(np.isfinite(off), miss(surface), np.nan)) > 0.03
