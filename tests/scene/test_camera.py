from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scene.camera import Camera
from scene.transforms import look_at

POSE = look_at((1.0, -2.0, 1.6), (8.0, 3.0, 0.5))
PINHOLE = Camera("PINHOLE", 160, 120, POSE, fx=150.0, fy=140.0, cx=81.0, cy=58.5)
# Distortion of a wide-angle automotive lens (KITTI's raw colour camera before rectification).
OPENCV = replace(PINHOLE, model="OPENCV", k1=-0.3745, k2=0.2048, p1=0.0011, p2=-0.0017)
ORTHOGRAPHIC = Camera("ORTHOGRAPHIC", 160, 120, POSE, cx=80.0, cy=60.0, pixel_size=0.01)
CAMERAS = [PINHOLE, OPENCV, ORTHOGRAPHIC]


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.model)
@given(st.integers(0, 2**31), st.floats(0.1, 100))
def test_a_point_along_a_pixels_ray_is_seen_by_that_pixel(camera, seed, distance):
    xy = np.random.default_rng(seed).uniform((0, 0), (camera.width, camera.height), (50, 2))
    origins, directions = camera.rays(xy)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1, rtol=0, atol=1e-14)
    seen, depth = camera.project(origins + distance * directions)
    # Newton ends at 1e-14 of the normalised plane; 150 px and the cancellation at 0.1 m of 10 m leave 1e-11 x 150.
    assert np.abs(seen - xy).max() < 1e-8
    assert np.all(depth > 0)


@given(st.integers(0, 2**31))
def test_distortion_is_that_of_opencv(seed):
    camera = OPENCV
    rng = np.random.default_rng(seed)
    points_camera = rng.uniform((-1, -0.7, 2), (1, 0.7, 4), (40, 3))
    points_world = points_camera @ POSE[:3, :3].T + POSE[:3, 3]
    want, _ = cv2.projectPoints(
        points_camera, np.zeros(3), np.zeros(3), camera.K, np.array([camera.k1, camera.k2, camera.p1, camera.p2])
    )
    assert np.allclose(camera.project(points_world)[0], want[:, 0], rtol=0, atol=1e-9)


def test_the_first_pixel_has_its_centre_half_a_pixel_inside():
    assert PINHOLE.pixel_centres()[0].tolist() == [0.5, 0.5]
    assert PINHOLE.pixel_centres()[1].tolist() == [1.5, 0.5]
    assert len(PINHOLE.pixel_centres()) == 160 * 120


def test_the_principal_ray_goes_along_z():
    for camera in CAMERAS:
        _, directions = camera.rays(np.array([[camera.cx, camera.cy]]))
        assert np.allclose(directions[0], POSE[:3, 2], atol=1e-14)


def test_a_point_behind_the_camera_is_nowhere_in_the_image():
    behind = PINHOLE.position - PINHOLE.T_world_camera[:3, 2]
    xy, depth = PINHOLE.project(behind[None])
    assert np.all(np.isnan(xy))
    assert depth[0] == pytest.approx(-1, abs=1e-12)


def test_a_point_far_beside_a_barrel_lens_is_not_folded_into_the_image():
    # r (1 + k1 r^2) falls again beyond r = 1 / sqrt(-3 k1) = 1.05; at r = 1.73 it is back in the middle of the image.
    camera = replace(OPENCV, k1=-0.3, k2=0.0, p1=0.0, p2=0.0, T_world_camera=np.eye(4))
    assert np.all(np.isnan(camera.project(np.array([[1.73, 0.0, 1.0]]))[0]))
    assert np.all(np.isfinite(camera.project(np.array([[1.0, 0.0, 1.0]]))[0]))


def test_a_position_that_no_ray_reaches_has_no_direction():
    camera = replace(OPENCV, k1=-0.3, k2=0.0, p1=0.0, p2=0.0, T_world_camera=np.eye(4))
    outside = camera.cx + camera.fx * 0.9  # the largest distorted radius is 1.054 (1 - 0.3 x 1.11) = 0.703
    assert np.all(np.isnan(camera.rays(np.array([[outside, camera.cy]]))[1]))


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda c: c.model)
def test_fewer_pixels_see_the_same_field_of_view(camera):
    small = camera.scaled_to(80, 60)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0]])
    for a, b in zip(camera.rays(corners * (160, 120)), small.rays(corners * (80, 60)), strict=True):
        assert np.allclose(a, b, rtol=0, atol=1e-12)


def test_moving_a_camera_moves_what_it_sees():
    moved = PINHOLE.moved_to(np.eye(4))
    assert np.array_equal(moved.position, np.zeros(3))
    assert np.allclose(moved.project(np.array([[0.0, 0.0, 5.0]]))[0], [[moved.cx, moved.cy]])
