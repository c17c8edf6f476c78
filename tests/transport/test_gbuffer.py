"""What each pixel sees, and where it goes: exact on shapes that can be computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.simulation import EnvironmentLight, Film, Material, Shape, Simulation
from scene.transforms import invert, transform_points
from tests.transport.worlds import ball, camera, floor, grey, rectangle, world
from transport.gbuffer import flow_between, gbuffer
from transport.render import render
from transport.world import compile_camera, compile_world

VIEW = camera((-6, 1, 2), (0, 0, 0), 40, 30, 50)


def test_depth_position_and_normal_of_a_floor_are_those_of_the_plane():
    seen = gbuffer(world({"floor": (floor(), grey(0.5))}, {}), VIEW)
    origins, rays = VIEW.rays(VIEW.pixel_centres())
    down = rays[:, 2] < -1e-3
    t = np.where(down, -origins[:, 2] / rays[:, 2], np.inf)
    hit = (seen.shape == 0).ravel()
    assert np.all(hit == (down & (np.abs(origins + np.where(down, t, 0)[:, None] * rays)[:, :2].max(axis=1) < 100)))
    np.testing.assert_allclose(seen.distance.ravel()[hit], t[hit], rtol=1e-5)
    np.testing.assert_allclose(seen.position.reshape(-1, 3)[hit], (origins + t[:, None] * rays)[hit], atol=1e-4, rtol=1e-5)
    np.testing.assert_allclose(seen.depth.ravel()[hit], (t * (rays @ VIEW.T_world_camera[:3, 2]))[hit], rtol=1e-5)
    np.testing.assert_allclose(seen.normal.reshape(-1, 3)[hit], np.tile([0, 0, 1.0], (hit.sum(), 1)), atol=1e-6)
    missed = ~hit
    assert np.all(np.isinf(seen.depth.ravel()[missed])) and np.all(seen.face.ravel()[missed] == -1)
    assert np.all(np.isnan(seen.position.reshape(-1, 3)[missed])) and np.all(seen.normal.reshape(-1, 3)[missed] == 0)


def test_texture_coordinates_run_along_the_edges():
    wall = rectangle((0, 2, 3), (0, -4, 0), (0, 0, -3))
    seen = gbuffer(world({"wall": (wall, grey(0.5))}, {}), camera((-5, 0, 1.5), (0, 0, 1.5), 40, 30, 60))
    hit = seen.face >= 0
    assert 100 < hit.sum() < hit.size
    y, z = seen.position[hit][:, 1], seen.position[hit][:, 2]
    np.testing.assert_allclose(seen.uv[hit], np.stack([(2 - y) / 4, (3 - z) / 3], axis=1), atol=1e-6)
    # The first row is at the top of the picture, the first column at its left.
    rows, cols = np.nonzero(hit)
    assert seen.uv[hit][rows.argmin(), 1] < 0.1 and seen.uv[hit][cols.argmin(), 0] < 0.1


def test_normals_of_a_ball_point_away_from_its_centre_and_to_the_viewer():
    mesh = ball(1.0, (0, 0, 1), subdivisions=5)
    for eye in ((-6, 1, 2), (0.1, 0.2, 0.9)):  # from outside, and from inside
        view = camera(eye, (0.5, 0, 1), 30, 30, 15)
        seen = gbuffer(world({"ball": (mesh, grey(0.5))}, {}), view)
        hit = seen.face >= 0
        radial = seen.position[hit] - (0, 0, 1)
        radial /= np.linalg.norm(radial, axis=1, keepdims=True)
        side = -1 if np.linalg.norm(np.subtract(eye, (0, 0, 1))) < 1 else 1
        # Interpolation over facets of 0.04 rad: off by second order, 0.04^2.
        np.testing.assert_allclose(seen.normal[hit], side * radial, atol=2e-3)


def moving_world(T):
    board = rectangle((0, 1, 1.5), (0, -2, 0), (0, 0, -1.5))
    at = transform_points(T, board.vertices.astype(float)).astype(np.float32)
    shapes = (Shape("board", replace(board, vertices=at), "m", 3), Shape("floor", floor(), "m"))
    return compile_world(Simulation(shapes, {"m": grey(0.5)}))


def rigid(angle, t):
    T = np.eye(4)
    T[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    T[:3, 3] = t
    return T


def test_flow_of_a_moving_camera_and_a_moving_thing_is_that_of_their_points():
    T = rigid(0.1, (-0.3, 0.2, 0.05))
    now = moving_world(np.eye(4))
    step = rigid(0.02, (0.4, 0.05, 0.03))
    then_view = VIEW.moved_to(step @ VIEW.T_world_camera)
    seen = gbuffer(now, VIEW)
    flow = flow_between(seen, VIEW, then_view, {3: T})
    assert set(np.unique(seen.instance)) == {0, 3}
    # By hand, from the plane that each ray meets and not from the tracer's own position.
    origins, rays = VIEW.rays(VIEW.pixel_centres())
    on_board = (seen.instance == 3).ravel()
    on_floor = (seen.face >= 0).ravel() & ~on_board
    for mask, axis, motion in ((on_board, 0, T), (on_floor, 2, np.eye(4))):
        o, d = origins[mask], rays[mask]
        p = transform_points(motion, o - d * (o[:, axis] / d[:, axis])[:, None])
        q = transform_points(invert(then_view.T_world_camera), p)
        xy = q[:, :2] / q[:, 2:] * (VIEW.fx, VIEW.fy) + (VIEW.cx, VIEW.cy)
        np.testing.assert_allclose(flow.reshape(-1, 2)[mask], xy - VIEW.pixel_centres()[mask], atol=1e-3)


def test_the_moved_thing_is_found_where_the_flow_says():
    T = rigid(0.05, (-0.2, 0.3, 0.0))
    seen, then = gbuffer(moving_world(np.eye(4)), VIEW), gbuffer(moving_world(T), VIEW)
    flow = flow_between(seen, VIEW, VIEW, {3: T})
    rows, cols = np.nonzero(seen.instance == 3)
    end = (np.stack([cols, rows], axis=1) + 0.5 + flow[rows, cols]).astype(int)
    inside = (end >= 0).all(axis=1) & (end < (VIEW.width, VIEW.height)).all(axis=1)
    # All but those that end within a pixel of the board's edge.
    assert np.mean(then.instance[end[inside, 1], end[inside, 0]] == 3) > 0.9


def test_nothing_moves_in_a_still_scene_and_the_sky_only_turns():
    now = moving_world(np.eye(4))
    seen = gbuffer(now, VIEW)
    np.testing.assert_allclose(flow_between(seen, VIEW, VIEW, {}), 0, atol=1e-3)
    sky = seen.face < 0
    assert sky.any()
    shifted = VIEW.moved_to(rigid(0, (5, 3, 1)) @ VIEW.T_world_camera)
    np.testing.assert_allclose(flow_between(seen, VIEW, shifted, {})[sky], 0, atol=1e-3)


def test_a_parallel_camera_sees_a_plan():
    T = np.eye(4)
    T[:3, :3] = np.diag([1.0, -1.0, -1.0])
    T[:3, 3] = (1.0, 2.0, 10.0)
    view = Camera("ORTHOGRAPHIC", 8, 6, T, cx=4, cy=3, pixel_size=0.5)
    seen = gbuffer(world({"floor": (floor(), grey(0.5))}, {}), view)
    np.testing.assert_allclose(seen.depth, 10, rtol=1e-6)
    np.testing.assert_allclose(seen.position[0, 0], (1 - 1.75, 2 + 1.25, 0), atol=1e-5)


def test_a_kept_tree_gives_the_picture_of_a_fresh_one():
    board, ground = rectangle((0, 1, 1.5), (0, -2, 0), (0, 0, -1.5)), floor()
    other = rectangle((1, 1, 2.5), (0, -2, 0), (0, 0, -1.5))
    materials = {"m": grey(0.5)}
    first = compile_world(Simulation((Shape("floor", ground, "m"), Shape("board", board, "m")), materials))
    cases = {
        "the same, and something that moves": (Shape("floor", ground, "m"), Shape("board", board, "m"), Shape("o", other, "m", 1)),
        "fewer shapes": (Shape("floor", ground, "m"),),
        "another mesh": (Shape("floor", ground, "m"), Shape("board", other, "m")),
    }
    for name, shapes in cases.items():
        simulation = Simulation(shapes, materials)
        kept, fresh = gbuffer(compile_world(simulation, first), VIEW), gbuffer(compile_world(simulation), VIEW)
        np.testing.assert_array_equal(kept.face, fresh.face, err_msg=name)
    again = compile_world(Simulation(cases["the same, and something that moves"], materials), first)
    assert again.scenes[0] is first.scenes[0]


def bad_mesh(**changes):
    return replace(floor(), **changes)


BROKEN = np.array([[0, 0, np.nan]] * 4, np.float32)
BAD_TEXTURE = np.array([[0.5, np.nan]], np.float32)


@pytest.mark.parametrize(
    ("mesh", "material", "words"),
    [
        (floor(), None, "material of shape thing must name one of other"),
        (bad_mesh(faces=np.zeros((0, 3), np.uint32)), grey(0.5), "mesh of shape thing must have triangles"),
        (bad_mesh(vertices=BROKEN), grey(0.5), "vertices of shape thing must be finite"),
        (bad_mesh(normals=BROKEN), grey(0.5), "normals of shape thing must be finite"),
        (bad_mesh(uv=BROKEN[:, :2] + np.nan), grey(0.5), "uv of shape thing must be finite"),
        (bad_mesh(uv=np.zeros((3, 2), np.float32)), grey(0.5), "uv of shape thing must have a row per vertex, 4"),
        (bad_mesh(faces=np.array([[0, 1, 4]], np.uint32)), grey(0.5), "vertex indices of shape thing must lie below 4, got 4"),
        (floor(), Material(albedo=(np.nan, 0, 0)), "materials.thing.albedo must lie in \\[0, 1\\], got nan"),
        (floor(), Material("ggx", alpha=-0.1), "materials.thing.alpha must lie in"),
        (floor(), Material(film=Film(1.5)), "materials.thing.film.coverage must lie in"),
        (floor(), Material(albedo_texture=BAD_TEXTURE), "materials.thing.albedo_texture must be finite"),
        (floor(), Material(film=Film(BAD_TEXTURE)), "materials.thing.film.coverage must lie in"),
        (floor(), Material("mirror", film=Film(1.0)), "materials.thing.film must be None unless"),
        (floor(), Material("lambert", film=Film(1.0, eta=0.9)), "materials.thing.film.eta must lie in"),
    ],
)
def test_impossible_worlds_are_refused(mesh, material, words):
    materials = {"other": grey(0.1)} | ({"thing": material} if material else {})
    with pytest.raises(InputError, match=words):
        compile_world(Simulation((Shape("thing", mesh, "thing"),), materials))


def test_an_empty_world_and_a_bent_camera_are_refused():
    with pytest.raises(InputError, match=r"simulation\.shapes must hold at least one shape"):
        compile_world(Simulation((), {}))
    bent = Camera("OPENCV", 8, 8, np.eye(4), 8, 8, 4, 4, k1=0.1)
    with pytest.raises(InputError, match="Undistort the images first"):
        compile_camera(bent)
    lit = world({"floor": (floor(), grey(0.5))}, {"sky": EnvironmentLight((1, 1, 1))})
    with pytest.raises(InputError, match=r"samples must lie in \[1"):
        render(lit, VIEW, samples=0)
    with pytest.raises(InputError, match=r"max_bounces must lie in \[0"):
        render(lit, VIEW, max_bounces=-1)


def test_one_sample_claims_no_certainty_and_a_negative_clamp_is_refused():
    lit = world({"floor": (floor(), grey(0.5))}, {"sky": EnvironmentLight((1, 1, 1))})
    once = render(lit, VIEW, samples=1)
    seen = once.radiance > 0
    assert seen.any() and np.all(once.variance[seen] > 0)
    with pytest.raises(InputError, match=r"clamp must lie in \(0, inf\]"):
        render(lit, VIEW, samples=1, clamp=-1.0)
