"""Sweeps carry the stated noise; flow, masks and depth are those of the moving world."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from scene.depth_files import read_depth
from scene.flow_files import read_flow
from scene.images import read_exr, read_raw
from scene.recording import Noise, read_recording
from scene.street import Street
from scene.street.drive import AHEAD, CLASSES
from scene.street.lidar import LidarSettings, sweep
from scene.street.measurements import moving_boxes, write_measurements, write_street_recording
from scene.street.rays import RayScene
from scene.street.truth import FrameTruth, frame_truth, ray_scene
from scene.transforms import invert, transform_points

SPARSE = LidarSettings(rings=32, step_deg=1.0)


@pytest.fixture(scope="module")
def scenes(small_street: Street) -> tuple[RayScene, RayScene]:
    first = ray_scene(small_street, 0)
    return first, ray_scene(small_street, 1, first)


@pytest.fixture(scope="module")
def truth(small_street: Street, scenes: tuple[RayScene, RayScene]) -> FrameTruth:
    return frame_truth(small_street, 0, *scenes)


def test_lidar_ranges_scatter_by_one_centimetre(small_street: Street, scenes: tuple[RayScene, RayScene]):
    T = small_street.scanner_poses[0]
    noisy = sweep(scenes[0], T, np.random.default_rng(5), SPARSE)
    exact = sweep(scenes[0], T, np.random.default_rng(5), replace(SPARSE, range_sigma=0.0))
    error = np.linalg.norm(noisy.points, axis=1).astype(np.float64) - np.linalg.norm(exact.points, axis=1)
    n = len(error)
    assert n > 5000
    statistic = np.sum((error / 0.01) ** 2)
    low, high = chi2.ppf([0.001, 0.999], n)
    assert low < statistic < high
    # Along the ray only: directions are exact.
    cosine = (
        np.einsum("nc,nc->n", noisy.points, exact.points)
        / np.linalg.norm(noisy.points, axis=1)
        / np.linalg.norm(exact.points, axis=1)
    )
    np.testing.assert_allclose(cosine, 1.0, atol=1e-5)


def test_the_same_seed_gives_the_same_sweep(small_street: Street, scenes: tuple[RayScene, RayScene]):
    a, b = (sweep(scenes[0], small_street.scanner_poses[0], np.random.default_rng(5), SPARSE) for _ in range(2))
    np.testing.assert_array_equal(a.points, b.points)


def test_the_scanner_sees_moving_things_and_the_road(small_street: Street, scenes: tuple[RayScene, RayScene]):
    turn = sweep(scenes[0], small_street.scanner_poses[0], np.random.default_rng(0))
    assert set(np.unique(turn.instance)) >= {0, AHEAD}
    world = transform_points(small_street.scanner_poses[0], turn.points.astype(np.float64))
    on_road = (np.abs(world[:, 1] + 1.75) < 1) & (np.abs(world[:, 0]) < 15) & (turn.instance == 0)
    height = small_street.relief.height(world[on_road, 0], world[on_road, 1])
    # Range noise of 1 cm seen at a slant is at most 1 cm of height; the coarse mesh of the test adds its own.
    assert np.median(np.abs(world[on_road, 2] - height)) < 0.01


def test_flow_of_the_static_world_is_the_difference_of_two_projections(small_street: Street, truth: FrameTruth):
    camera, following = small_street.cameras[:2]
    still = (truth.instance == 0) & np.isfinite(truth.depth)
    xy = camera.pixel_centres().reshape(*truth.depth.shape, 2)
    # Back from depth to the world by the intrinsics alone, on to the next camera by its projection.
    z = truth.depth[still].astype(np.float64)
    p = np.column_stack([(xy[still] - (camera.cx, camera.cy)) / (camera.fx, camera.fy) * z[:, None], z])
    projected, _ = following.project(transform_points(camera.T_world_camera, p))
    # float32 depth: a relative 6e-8 of at most some 100 px of flow.
    np.testing.assert_allclose(truth.flow[still], projected - xy[still], atol=1e-3)


def test_flow_of_a_moving_car_adds_its_own_motion(small_street: Street, truth: FrameTruth):
    camera, following = small_street.cameras[:2]
    on_car = truth.instance == AHEAD
    assert on_car.sum() > 50
    xy = camera.pixel_centres().reshape(*truth.depth.shape, 2)
    z = truth.depth[on_car].astype(np.float64)
    p = np.column_stack([(xy[on_car] - (camera.cx, camera.cy)) / (camera.fx, camera.fy) * z[:, None], z])
    T = small_street.poses[1][AHEAD] @ invert(small_street.poses[0][AHEAD])
    moved, _ = following.project(transform_points(T @ camera.T_world_camera, p))
    np.testing.assert_allclose(truth.flow[on_car], moved - xy[on_car], atol=1e-3)
    # It differs from the flow of a parked car at the same place.
    parked, _ = following.project(transform_points(camera.T_world_camera, p))
    assert np.abs(moved - parked).max() > 0.1


def test_nothing_flows_where_neither_camera_nor_world_moves(small_street: Street, scenes: tuple[RayScene, RayScene]):
    halted = replace(
        small_street,
        cameras=(small_street.cameras[0],) * 2,
        poses=(small_street.poses[0],) * 2,
        settings=replace(small_street.settings, frames=2),
    )
    still = frame_truth(halted, 0, scenes[0], scenes[0])
    assert still.flow is not None and still.visible is not None
    # A point's projection returns to its pixel within float32 rays: 1e-7 of at most 160 px.
    assert np.abs(still.flow).max() < 1e-3
    # The nearest surface is seen again: only edges within rounding may hide their own neighbours.
    assert still.visible.mean() > 0.995


def test_masks_cover_exactly_what_moves_against_the_static_world(small_street: Street, scenes: tuple[RayScene, RayScene]):
    halted = replace(small_street, cameras=(small_street.cameras[0],) * 3)
    moving = frame_truth(halted, 0, *scenes)
    assert moving.flow is not None
    speed = np.hypot(moving.flow[..., 0], moving.flow[..., 1])
    assert (speed[moving.instance == 0] < 1e-3).all()
    assert np.median(speed[moving.instance == AHEAD]) > 0.02


def test_what_leaves_the_image_is_not_visible(small_street: Street, truth: FrameTruth):
    assert truth.flow is not None and truth.visible is not None
    arrival = small_street.cameras[0].pixel_centres().reshape(*truth.depth.shape, 2) + truth.flow
    camera = small_street.cameras[1]
    outside = (arrival[..., 0] < 0) | (arrival[..., 0] > camera.width) | (arrival[..., 1] < 0) | (arrival[..., 1] > camera.height)
    assert outside.any() and not truth.visible[outside].any()
    assert truth.visible.mean() > 0.6


def test_a_written_recording_reads_back_whole(small_street: Street, truth: FrameTruth, tmp_path: Path):
    write_measurements(small_street, tmp_path, SPARSE)
    for frame in range(small_street.settings.frames):
        (tmp_path / "images").mkdir(exist_ok=True)
        (tmp_path / "images" / f"{frame:04d}.png").write_bytes(b"")
    write_street_recording(small_street, tmp_path, Noise(0.002, 0.0001))
    recording = read_recording(tmp_path)
    assert len(recording.frames) == 3
    first = recording.frames[0]
    assert first.masks is not None and first.masks.classes == CLASSES
    np.testing.assert_array_equal(read_raw(first.masks.file), truth.instance)
    np.testing.assert_allclose(first.camera.T_world_camera, small_street.cameras[0].T_world_camera, atol=1e-12)
    assert first.points is not None
    with np.load(first.points.file) as data:
        assert data["points"].shape[1] == 3 and len(data["points"]) > 1000
    np.testing.assert_array_equal(read_exr(tmp_path / "truth" / "depth" / "0000.exr")["depth.Z"], truth.depth)
    stored = read_flow(tmp_path / "truth" / "flow" / "0000.npy")
    np.testing.assert_array_equal(stored.flow[stored.valid], truth.flow[stored.valid])
    np.testing.assert_array_equal(stored.valid, np.isfinite(truth.flow).all(axis=-1))
    assert not (tmp_path / "truth" / "flow" / "0002.npy").exists()
    assert first.flow is not None and recording.frames[2].flow is None
    np.testing.assert_array_equal(read_flow(first.flow).flow, stored.flow)
    assert first.depth is not None and np.array_equal(np.isfinite(read_depth(first.depth.file)), np.isfinite(truth.depth))


def test_boxes_enclose_what_moves_and_nothing_more(small_street: Street, truth: FrameTruth):
    boxes = {box.track: box for box in moving_boxes(small_street, 0)}
    assert {box.kind for box in boxes.values()} == {"vehicle", "pedestrian"} and all(box.moving for box in boxes.values())
    camera = small_street.cameras[0]
    origins, rays = camera.rays(camera.pixel_centres())
    along = truth.depth.ravel() / (rays @ camera.T_world_camera[:3, 2])
    for instance in np.unique(truth.instance[truth.instance > 0]):
        seen = truth.instance.ravel() == instance
        box = boxes[str(instance)]
        points = origins[seen] + along[seen, None] * rays[seen]
        # float32 depths at 30 m: 2 micrometres; a soles' lowest edge may lie on the box's own face.
        assert box.moved_by(lifted(1e-4)).contains(points, 1e-3).all() or box.moved_by(lifted(-1e-4)).contains(points, 1e-3).all()
        on = np.concatenate([s.mesh.vertices for s in small_street.moving_shapes(0) if s.instance == instance])
        local = transform_points(invert(box.T_boxes_object), on.astype(np.float64))
        np.testing.assert_allclose(np.ptp(local, axis=0), box.size, atol=1e-4)


def lifted(height: float) -> np.ndarray:
    T = np.eye(4)
    T[2, 3] = height
    return T
