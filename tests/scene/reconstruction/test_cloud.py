from __future__ import annotations

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.points import write_points
from scene.reconstruction import dynamics
from scene.reconstruction.build_settings import CloudSettings
from scene.reconstruction.cloud import Cloud, accumulate, moved, path_of, read_cloud, strays, thin, world_offset, write_cloud
from scene.recording import Frame, MaskFile, PointsFile, Recording, read_recording
from scene.transforms import look_at

from ..synthetic_street import box_points, ring_points, street_height


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> tuple[Recording, np.ndarray]:
    """Six sweeps of a street; a car stands at the right, another drives ahead and is nowhere twice."""
    tmp_path = tmp_path_factory.mktemp("drive")
    frames, moving = [], []
    for index in range(6):
        rng = np.random.default_rng(index)
        x = 6.0 * index
        z = street_height(np.array([x]), np.array([0.0]))[0]
        parked = box_points(np.random.default_rng(50), (14.0, -2.9, 0.5 + 0.8), (4.2, 1.7, 1.5), 1500)
        centre = (x + 11.0, 2.0, 0.04 * (x + 11) + 0.8)
        car = box_points(rng, centre, (4.2, 1.7, 1.5), 1500)
        ego = box_points(rng, (x, 0, z + 1.0), (4.0, 1.6, 1.4), 300)
        seen = np.concatenate([_unhidden(ring_points(rng, x), car, (x, 0.0, z + 1.7)), parked, car, ego])
        T = np.eye(4)
        T[:3, 3] = (x, 0, z + 1.7)
        file = tmp_path / f"{index}.npz"
        np.savez(file, points=(seen - T[:3, 3]).astype(np.float32))
        pose = look_at(T[:3, 3], T[:3, 3] + (10, 0, -0.5))
        camera = Camera("PINHOLE", 64, 32, pose, 40, 40, 32, 16)
        frames.append(Frame(tmp_path / f"{index}.png", camera, points=PointsFile(file, T)))
        moving.append(car)
    return Recording(tuple(frames), tmp_path, "street"), np.concatenate(moving)


@pytest.fixture(scope="module")
def cloud(drive) -> Cloud:
    return accumulate(drive[0], CloudSettings(stereo=False))


def _unhidden(ground: np.ndarray, car: np.ndarray, origin) -> np.ndarray:
    """Drop ground points in the shadow of a car, seen from the scanner."""
    low, high = car.min(axis=0), car.max(axis=0)
    towards = ground - origin
    with np.errstate(divide="ignore"):
        near, far = np.sort([(low - origin) / towards, (high - origin) / towards], axis=0)
    return ground[~((near.max(axis=1) < np.minimum(far.min(axis=1), 1.0)) & (far.min(axis=1) > 0))]


def near_any(points: np.ndarray, others: np.ndarray, radius: float) -> np.ndarray:
    from scipy.spatial import cKDTree

    return cKDTree(others).query(points)[0] < radius


def test_a_car_that_drives_ahead_vanishes_and_a_parked_one_stays(drive, cloud):
    _, moving = drive
    left = cloud.points_world[~cloud.is_ground]
    # Only the last places of the car, which no later sweep saw free, may keep points.
    early = moving[moving[:, 0] < 30]
    on_car = near_any(early[early[:, 2] > street_height(early[:, 0], early[:, 1]) + 0.5], left, 0.1)
    assert on_car.mean() < 0.05
    parked = box_points(np.random.default_rng(50), (14.0, -2.9, 1.3), (4.2, 1.7, 1.5), 1500)
    assert near_any(parked[parked[:, 2] > 0.9], left, 0.15).mean() > 0.9


def test_the_vehicle_itself_is_not_in_the_cloud(cloud):
    points = cloud.points_world.astype(float)
    on_path = (np.abs(points[:, 1]) < 0.7) & (points[:, 0] > 0) & (points[:, 0] < 28)
    above = points[:, 2] - street_height(points[:, 0], points[:, 1])
    assert not (on_path & (above > 0.3)).any()
    assert cloud.counts["ego vehicle removed"] >= 6 * 250


def test_points_in_a_mask_go_and_those_far_behind_it_stay(tmp_path):
    mask = np.zeros((32, 64), np.uint8)
    mask[10:22, 20:44] = 7
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    camera = Camera("PINHOLE", 64, 32, look_at((0, 0, 1.5), (10, 0, 1.5)), 40, 40, 32, 16)
    frame = Frame(tmp_path / "a.png", camera, masks=MaskFile(tmp_path / "mask.png"))
    points = np.array([[10, 0, 1.5], [10.4, 0.5, 1.6], [40, 0, 1.5], [10, 8.0, 1.5], [-5, 0, 1.5]])
    assert dynamics.on_masked_objects(points, frame).tolist() == [True, True, False, False, False]


def test_a_mask_of_another_size_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "mask.png"), np.zeros((10, 10), np.uint8))
    camera = Camera("PINHOLE", 64, 32, np.eye(4), 40, 40, 32, 16)
    frame = Frame(tmp_path / "a.png", camera, masks=MaskFile(tmp_path / "mask.png"))
    with pytest.raises(InputError, match=r"mask\.png: it must have the camera's size 64 x 32, got 10 x 10"):
        dynamics.instance_mask(frame)


def test_a_beam_that_passes_a_point_votes_for_free_space():
    rng = np.random.default_rng(0)
    wall = np.column_stack([np.full(20000, 20.0), rng.uniform(-4, 4, 20000), rng.uniform(-2, 2, 20000)])
    points = np.array([[10.0, 0, 0], [20.0, 0, 0], [30.0, 0, 0], [-10.0, 0, 0]])
    through, agree = dynamics.free_space_votes(points, np.full(4, -1), [(wall.astype(np.float32), np.eye(4))] * 2)
    assert through.tolist() == [2, 0, 0, 0]
    assert agree.tolist() == [0, 2, 0, 0]


def test_ground_between_two_rings_is_not_called_free():
    rng = np.random.default_rng(1)
    sweep = ring_points(rng, 0.0) - (0, 0, street_height(np.zeros(1), np.zeros(1))[0] + 1.7)
    ground = ring_points(rng, 3.0) - (0, 0, street_height(np.zeros(1), np.zeros(1))[0] + 1.7)
    ground = ground[np.linalg.norm(ground, axis=1) < 25]
    through, _ = dynamics.free_space_votes(ground, np.full(len(ground), -1), [(sweep.astype(np.float32), np.eye(4))])
    # Kerbs hide what lies behind them from one place and not from the other, by a few beams.
    assert (through > 0).mean() < 0.01


def test_what_stands_on_the_driven_path_has_moved():
    path = np.array([[0.0, 0, 1.7], [10, 0, 1.7]])
    points = np.array([[5.0, 0.3, 0.8], [5, 3, 0.8], [5, 0, 6.0], [-6, 0, 0.8], [30, 0, 0.8]])
    assert dynamics.on_driven_path(points, path).tolist() == [True, False, False, True, False]


def test_thinning_keeps_one_mean_point_per_voxel_and_larger_voxels_far_away():
    rng = np.random.default_rng(0)
    path = np.zeros((1, 3))
    points = np.concatenate([rng.uniform((2, 0, 0), (3, 1, 0.001), (5000, 3)), rng.uniform((40, 0, 0), (41, 1, 0.001), (5000, 3))])
    sensors = np.zeros_like(points)
    thinned, _, _ = thin(points, sensors, np.zeros(len(points), np.uint8), path, CloudSettings(voxel=0.05, voxel_range=8.0))
    near, far = (thinned[:, 0] < 10).sum(), (thinned[:, 0] > 10).sum()
    assert 390 <= near <= 441  # a square metre at 5 cm, borders included
    assert far <= 16  # 40 m is past two doublings of 8 m: 5 cm x 2^3 = 40 cm


def test_strays_are_found_and_a_dense_wall_is_not():
    rng = np.random.default_rng(0)
    wall = np.column_stack([np.full(4000, 10.0), rng.uniform(-2, 2, 4000), rng.uniform(0, 2, 4000)])
    points = np.concatenate([wall, [[5.0, 0, 6.0]]])
    found = strays(points, np.zeros_like(points), np.zeros(len(points), np.uint8))
    assert found[-1]
    assert not found[:-1].any()


def test_map_coordinates_are_brought_near_the_origin(drive):
    recording, _ = drive
    far = moved(recording, np.array([458_000.0, 5_428_000.0, 115.0]))
    offset = world_offset(far)
    assert np.abs(path_of(moved(far, offset))).max() < 100
    assert not world_offset(recording).any()


def test_a_cloud_comes_back_from_its_file(cloud, tmp_path):
    write_cloud(tmp_path / "cloud.npz", cloud)
    again = read_cloud(tmp_path / "cloud.npz")
    assert np.array_equal(again.points_world, cloud.points_world)
    assert again.counts == cloud.counts


def test_a_recording_without_points_is_refused(tmp_path):
    camera = Camera("PINHOLE", 64, 32, np.eye(4), 40, 40, 32, 16)
    with pytest.raises(InputError, match="hold points"):
        accumulate(Recording((Frame(tmp_path / "a.png", camera),), tmp_path))


def test_sweeps_of_the_real_drive_lose_the_masked_vehicles(shared_data):
    recording = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json")
    cloud = accumulate(recording, CloudSettings(stereo=False, voxel=0.1))
    assert cloud.counts["on masked objects removed"] > 3000
    points = cloud.points_world[~cloud.is_ground].astype(float)
    road = (np.abs(points[:, 1]) < 0.8) & (points[:, 0] > 0) & (points[:, 0] < 34)
    # The lane that was driven is free of everything that once drove there.
    assert not (road & (points[:, 2] < 0.2)).any()


def test_low_blobs_of_stereo_alone_leave_the_road_and_a_kerbstone_that_was_scanned_stays(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    road = np.column_stack([rng.uniform(0, 24, 60000), rng.uniform(-6, 6, 60000), np.zeros(60000)])

    def box(x: float, y: float, low: float, high: float, count: int) -> np.ndarray:
        return rng.uniform((x, y, low), (x + 1, y + 1, high), (count, 3))

    blob, stone, wall = box(9, 0, 0.19, 0.22, 400), box(15, 0, 0.19, 0.22, 400), box(12, 4, 0.0, 2.0, 9000)
    seen = np.concatenate([road, blob, wall])
    monkeypatch.setattr("scene.reconstruction.cloud._stereo", lambda *_: (seen, np.broadcast_to((0.0, 0, 1.6), seen.shape)))
    write_points(tmp_path / "given.npz", stone)
    cameras = [Camera("PINHOLE", 64, 24, look_at((x, 0, 1.6), (x + 9, 0, 1.5)), 40, 40, 32, 12) for x in (0.0, 9.0, 18.0)]
    frames = tuple(Frame(tmp_path / "a.png", camera) for camera in cameras)
    cloud = accumulate(Recording(frames, tmp_path, points=tmp_path / "given.npz"))
    assert cloud.counts["low stereo matches removed"] > 0
    things = cloud.points_world[~cloud.is_ground]
    raised = things[things[:, 1] < 2, 0]
    assert len(raised) > 50 and raised.min() > 14.9
