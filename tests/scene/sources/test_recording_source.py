"""A path is recognised by the files it holds, or refused with a list of what was looked for."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.points import read_points, write_points
from scene.recording import Frame, Recording, read_recording, write_recording
from scene.sources.recording_source import open_recording, recognised_format


def image(file: Path) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), np.full((12, 16, 3), 100, np.uint8))
    return file


def make_recording(folder: Path, name: str = "recording.json") -> Path:
    frame = Frame(image(folder / "image" / "a.png"), Camera("PINHOLE", 16, 12, np.eye(4), 10.0, 10.0, 8.0, 6.0))
    write_recording(folder / name, Recording((frame,), folder, "one"))
    return folder / name


def touch(*files: Path) -> None:
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()


def test_every_format_is_recognised_by_its_files(tmp_path: Path) -> None:
    make_recording(tmp_path / "recording")
    touch(tmp_path / "raw" / "date" / "calib_cam_to_cam.txt")
    image(tmp_path / "raw" / "date" / "drive" / "image_02" / "data" / "0.png")
    touch(tmp_path / "odometry" / "sequences" / "00" / "calib.txt")
    image(tmp_path / "odometry" / "sequences" / "00" / "image_0" / "0.png")
    touch(
        tmp_path / "nerf" / "transforms.json",
        *(tmp_path / "nerf" / "sparse" / "0" / f"{n}.bin" for n in ("cameras", "images", "points3D")),
    )
    touch(*(tmp_path / "colmap" / "sparse" / "0" / f"{n}.txt" for n in ("cameras", "images", "points3D")))
    for i in range(2):
        image(tmp_path / "colmap" / "images" / f"{i}.png")
        image(tmp_path / "pictures" / f"{i}.png")
    touch(tmp_path / "cloud.ply")
    found = {
        name: recognised_format(tmp_path / name)
        for name in ("recording", "raw", "odometry", "nerf", "colmap", "pictures", "cloud.ply")
    }
    assert found == {
        "recording": "recording",
        "raw": "kitti-raw",
        "odometry": "kitti-odometry",
        "nerf": "nerfstudio",
        "colmap": "colmap",
        "pictures": "images",
        "cloud.ply": "cloud",
    }
    for path in (tmp_path / "raw" / "date", tmp_path / "raw" / "date" / "drive"):
        assert recognised_format(path) == "kitti-raw"
    assert recognised_format(tmp_path / "odometry" / "sequences" / "00") == "kitti-odometry"


def test_an_unknown_folder_lists_what_was_looked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"looked for recording.json.*KITTI raw.*transforms.json.*COLMAP.*images"):
        open_recording(tmp_path)
    with pytest.raises(InputError, match="must exist"):
        open_recording(tmp_path / "nothing")
    (tmp_path / "film.mp4").touch()
    with pytest.raises(InputError, match=r"be a folder, a .json, or a point cloud.*got .mp4"):
        open_recording(tmp_path / "film.mp4")
    with pytest.raises(InputError, match="format must be one of auto, recording"):
        open_recording(tmp_path, format="rosbag")


def test_a_recording_opens_by_file_or_folder_and_says_what_it_is(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = make_recording(tmp_path / "drive", "first.recording.json")
    with caplog.at_level(logging.INFO, "meniscus"):
        assert open_recording(tmp_path / "drive").name == "one"
    assert "recognised as recording" in caplog.text
    assert open_recording(file).name == "one"
    make_recording(tmp_path / "drive", "second.recording.json")
    with pytest.raises(InputError, match=r"one recording, got first.recording.json, second.recording.json"):
        open_recording(tmp_path / "drive")
    data = json.loads(file.read_text())
    data["frames"][0]["camera"]["width"] = 17
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"a.png.*17 x 12, got 16 x 12"):
        open_recording(file)


def test_a_bare_cloud_is_a_recording_without_frames(tmp_path: Path) -> None:
    write_points(tmp_path / "cloud.ply", np.random.default_rng(0).uniform(-5, 5, (50, 3)))
    recording = open_recording(tmp_path / "cloud.ply")
    assert recording.frames == ()
    assert recording.points == tmp_path / "cloud.ply"
    write_recording(tmp_path / "recording.json", recording)
    assert read_recording(tmp_path).points == tmp_path / "cloud.ply"
    np.savez(tmp_path / "empty.npz", points=np.zeros((0, 3)))
    with pytest.raises(InputError, match=r"empty.npz.*empty cloud"):
        open_recording(tmp_path / "empty.npz")


def test_a_cloud_in_map_coordinates_is_moved_near(tmp_path: Path) -> None:
    points = np.array([456123.25, 5428456.5, 110.125]) + np.random.default_rng(0).integers(0, 100, (50, 3)) / 8
    np.savez(tmp_path / "utm.npz", points=points)
    recording = open_recording(tmp_path / "utm.npz", work_folder=tmp_path / "work")
    assert recording.points
    # Eighths of a metre below 1 km are exact in float32.
    np.testing.assert_array_equal(read_points(recording.points), points - [456000, 5428000, 0])
