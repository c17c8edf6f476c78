"""Sweeps find their poses: exactly for a moved copy, closely for real traffic, and the same on every run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.points import write_points
from scene.recording import read_recording
from scene.sources.odometry import lidar_poses
from scene.transforms import invert, transform_points


def street_sweep(rng: np.random.Generator, x: float, yaw: float) -> np.ndarray:
    """Points of a street with house fronts that have niches, seen from 1.7 m above its ground at x, turned by yaw."""
    ground = np.column_stack([rng.uniform(-30, 60, (9000, 2)) * (1, 0.2), np.full(9000, -1.7)])
    u, z = rng.uniform(-30, 60, 9000), rng.uniform(-1.7, 6, 9000)
    niche = np.where(np.sin(u * 0.9) + np.sin(u * 0.37) > 0.6, 1.5, 0.0)
    fronts = np.column_stack([u, np.where(rng.random(9000) < 0.5, 7 + niche, -7 - niche), z])
    post_u = rng.choice([-11.0, 3.0, 14.0, 31.0, 47.0], 1500)
    posts = np.column_stack([post_u + rng.normal(0, 0.05, 1500), 5 + rng.normal(0, 0.05, 1500), rng.uniform(-1.7, 4, 1500)])
    world = np.concatenate([ground, fronts, posts]) + rng.normal(0, 0.01, (19500, 3))
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[0, 3] = x
    return transform_points(invert(T), world)


def test_a_street_moved_by_metres_is_found_from_standstill_and_on_every_run(tmp_path: Path) -> None:
    # The same points each time, so that nothing but the motion differs.
    truth = [(0.0, 0.0), (6.0, 0.04)]
    files = []
    for i, (x, yaw) in enumerate(truth):
        files.append(tmp_path / f"{i}.npz")
        write_points(files[-1], street_sweep(np.random.default_rng(2), x, yaw))
    poses = lidar_poses(files, tmp_path / "work")
    x, yaw = truth[1]
    # The voxels cut the moved points elsewhere: their centroids scatter by up to 0.25 m / sqrt(12) = 7 cm, and of the
    # points that fix x (posts, edges of niches) there are a few hundred: 0.07 / sqrt(200) = 5 mm, three times that here.
    np.testing.assert_allclose(poses[1][:3, 3], [x, 0, 0], atol=0.015)
    assert abs(np.arctan2(poses[1][1, 0], poses[1][0, 0]) - yaw) < 1e-3
    before = (tmp_path / "work" / "lidar_poses.json").read_bytes()
    np.testing.assert_array_equal(lidar_poses(files, tmp_path / "work"), poses)
    np.testing.assert_array_equal(lidar_poses(files), poses)
    assert (tmp_path / "work" / "lidar_poses.json").read_bytes() == before


def test_sweeps_seven_metres_apart_meet_the_verified_poses(shared_data: Path) -> None:
    frames = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json").frames[:3]
    sweeps = [frame.points for frame in frames if frame.points]
    poses = lidar_poses([sweep.file for sweep in sweeps])
    for sweep, T in zip(sweeps, poses, strict=True):
        error = invert(invert(sweeps[0].T_world_points) @ sweep.T_world_points) @ T
        # The given poses are verified to 0.2 px of disparity; at 15 m that is 8 mm sideways and 12 cm of depth.
        assert np.linalg.norm(error[:3, 3]) < 0.05
        assert np.linalg.norm(error[:3, :3] - np.eye(3)) < 2e-3


def test_a_sweep_of_too_few_points_is_refused(tmp_path: Path) -> None:
    write_points(tmp_path / "0.bin", np.ones((10, 4)) * 5)
    with pytest.raises(InputError, match=r"0.bin.*at least 500 points"):
        lidar_poses([tmp_path / "0.bin", tmp_path / "0.bin"])
