"""Up is found from the ground or from upright photographs."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scene.sources.gravity import levelled_world, mean_up, spread, turn_to_z, up_from_cameras, up_from_ground
from scene.transforms import look_at

Z = np.array([0.0, 0.0, 1.0])


@given(st.floats(0, np.pi), st.floats(-np.pi, np.pi))
def test_turning_up_to_z_is_a_rotation_that_does_so(tilt: float, azimuth: float) -> None:
    up = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    R = turn_to_z(up)
    # Near the nadir 1 / (1 + cos) amplifies rounding up to the switch at 1e-12: 1e-16 / 1e-6 of length.
    np.testing.assert_allclose(R @ up, Z, atol=1e-6)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(R) > 0


def test_cameras_pitched_by_any_angle_around_an_object_still_tell_the_vertical() -> None:
    # All look down, all from one side: the mean of their up vectors is wrong, their level x axes are not.
    angles = np.linspace(-1.2, 1.2, 9)
    poses = [look_at((3 * np.sin(a), -3 * np.cos(a), 3.0), (0, 0, 0)) for a in angles]
    up = up_from_cameras(np.stack([T[:3, :3] for T in poses]))
    mean = -np.stack([T[:3, 1] for T in poses]).mean(axis=0)
    assert np.arccos(mean @ Z / np.linalg.norm(mean)) > np.deg2rad(30)
    assert np.arccos(up @ Z) < np.deg2rad(2)


def test_cameras_that_all_look_ahead_give_their_own_up() -> None:
    T = look_at((0, 0, 0), (1, 0, 0))
    np.testing.assert_allclose(up_from_cameras(np.stack([T[:3, :3]] * 5)), Z, atol=1e-12)


def test_a_world_that_is_level_within_the_tolerance_keeps_its_axes() -> None:
    T = look_at((0, 0, 0), (1, 0, 0.05))
    np.testing.assert_array_equal(levelled_world(np.stack([T[:3, :3]] * 3)), np.eye(4))
    down = np.diag([1.0, -1.0, -1.0])
    turned = levelled_world(np.stack([down @ T[:3, :3]] * 3))
    np.testing.assert_allclose(turned[:3, :3] @ down @ up_from_cameras(np.stack([T[:3, :3]] * 3)), Z, atol=1e-9)


def test_the_ground_below_a_tilted_scanner_is_found_beside_walls_and_cars() -> None:
    rng = np.random.default_rng(1)
    ground = np.column_stack([rng.uniform(-20, 20, (4000, 2)), -1.7 + rng.normal(0, 0.02, 4000)])
    wall = np.column_stack([rng.uniform(-20, 20, 2000), np.full(2000, 6.0), rng.uniform(-1.7, 8, 2000)])
    car = rng.uniform((4, -3, -1.7), (8, -1, -0.2), (1500, 3))
    tilt = np.deg2rad(4)
    R = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    points = np.concatenate([ground, wall, car]) @ R.T
    up = up_from_ground(points, Z)
    assert up is not None
    # 2 cm of noise over 4000 points and 20 m give 1e-5 rad; the car's lowest 8 cm may pull it, not by a tenth of a degree.
    assert np.arccos(up @ R @ Z) < np.deg2rad(0.1)


def test_without_ground_no_direction_is_made_up() -> None:
    rng = np.random.default_rng(1)
    wall = np.column_stack([rng.uniform(-20, 20, 4000), np.full(4000, 6.0), rng.uniform(-3, 8, 4000)])
    assert up_from_ground(wall, Z) is None
    assert up_from_ground(np.zeros((0, 3)), Z) is None
    assert mean_up([None, None]) is None
    one = mean_up([None, Z])
    assert one is not None
    np.testing.assert_allclose(one, Z)
    assert spread(51) == [0, 12, 25, 38, 50]
    assert spread(2) == [0, 1]
