"""A sequence of KITTI odometry becomes a recording in a world with z up."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.sources.kitti_odometry import open_kitti_odometry

WIDTH, HEIGHT = 124, 37
P0 = "P0: 70.0 0 60.0 0 0 70.0 18.0 0 0 0 1 0"
P1 = "P1: 70.0 0 60.0 -37.8 0 70.0 18.0 0 0 0 1 0"


def make_sequence(root: Path, num_frames: int = 3, poses: bool = True) -> Path:
    """Write a sequence that drives ahead and climbs (camera y is down)."""
    folder = root / "sequences" / "05"
    for name in ("image_0", "image_1"):
        (folder / name).mkdir(parents=True)
        for i in range(num_frames):
            cv2.imwrite(str(folder / name / f"{i:06d}.png"), np.full((HEIGHT, WIDTH), 128, np.uint8))
    (folder / "calib.txt").write_text(f"{P0}\n{P1}\nTr: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27\n")
    if poses:
        (root / "poses").mkdir()
        lines = [f"1 0 0 0 0 1 0 {-0.1 * i} 0 0 1 {0.8 * i}" for i in range(num_frames)]
        (root / "poses" / "05.txt").write_text("\n".join(lines) + "\n")
    return folder


def test_ahead_becomes_x_and_up_becomes_z(tmp_path: Path) -> None:
    # Blank pictures have no ground to level by, so the first camera is taken to be level.
    make_sequence(tmp_path)
    recording = open_kitti_odometry(tmp_path, tmp_path / "work")
    np.testing.assert_allclose(recording.frames[2].camera.position, [1.6, 0, 0.2], atol=1e-12)
    np.testing.assert_allclose(recording.frames[0].camera.T_world_camera[:3, 2], [1, 0, 0], atol=1e-12)
    frame = recording.frames[1]
    assert frame.stereo
    # The right camera stands to the right: at -y, 37.8 / 70 away.
    np.testing.assert_allclose(frame.stereo.camera.position - frame.camera.position, [0, -0.54, 0], atol=1e-12)
    assert (frame.camera.cx, frame.camera.cy) == (60.5, 18.5)


def test_a_sequence_is_opened_by_its_own_folder_as_well(tmp_path: Path) -> None:
    folder = make_sequence(tmp_path)
    assert len(open_kitti_odometry(folder, tmp_path / "work").frames) == 3
    # A part of a sequence: poses by the number of the image.
    (folder / "image_0" / "000000.png").unlink()
    recording = open_kitti_odometry(folder, tmp_path / "work")
    np.testing.assert_allclose(recording.frames[0].camera.position, [0.8, 0, 0.1], atol=1e-12)


def test_missing_or_wrong_poses_are_refused(tmp_path: Path) -> None:
    folder = make_sequence(tmp_path)
    file = tmp_path / "poses" / "05.txt"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(lines[:2]))
    with pytest.raises(InputError, match="one line per image, 3, got 2"):
        open_kitti_odometry(folder, tmp_path / "work")
    file.write_text("\n".join([lines[0], "2 0 0 0 0 1 0 0 0 0 1 0", lines[2]]))
    with pytest.raises(InputError, match=r"05.txt: line 2 must be a rigid pose"):
        open_kitti_odometry(folder, tmp_path / "work")
    file.write_text("\n".join([lines[0], "1 0 0", lines[2]]))
    with pytest.raises(InputError, match="line 2 must hold 12 numbers, got 3"):
        open_kitti_odometry(folder, tmp_path / "work")
    file.unlink()
    with pytest.raises(InputError, match="have poses"):
        open_kitti_odometry(folder, tmp_path / "work")
    with pytest.raises(InputError, match=r"hold calib.txt"):
        open_kitti_odometry(tmp_path / "poses", tmp_path / "work")


def test_a_real_street_is_level_and_the_drive_ahead(shared_data: Path, tmp_path: Path) -> None:
    source = shared_data / "kitti_odometry_stereo"
    folder = tmp_path / "sequences" / "00"
    for name in ("image_0", "image_1"):
        (folder / name).mkdir(parents=True)
        for i in (0, 10):
            shutil.copy(source / "sequences" / "00" / name / f"{i:06d}.png", folder / name)
    shutil.copy(source / "sequences" / "00" / "calib.txt", folder)
    (tmp_path / "poses").mkdir()
    shutil.copy(source / "poses" / "00.txt", tmp_path / "poses")
    recording = open_kitti_odometry(tmp_path, tmp_path / "work")
    step = recording.frames[1].camera.position - recording.frames[0].camera.position
    poses = np.loadtxt(source / "poses" / "00.txt").reshape(-1, 3, 4)
    assert np.linalg.norm(step) == pytest.approx(np.linalg.norm(poses[10, :, 3] - poses[0, :, 3]), abs=1e-6)
    # A street of a town: less than 3 degrees of slope against its own ground.
    assert abs(step[2]) < np.sin(np.deg2rad(3)) * np.linalg.norm(step)
    assert step[0] > 0.99 * np.linalg.norm(step)
