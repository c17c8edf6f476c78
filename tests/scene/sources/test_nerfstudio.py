"""transforms.json becomes a recording with our camera axes, level as the format promises."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.points import read_points_far, write_points
from scene.sources.nerfstudio import open_nerfstudio
from scene.transforms import look_at

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


def make_folder(root: Path, turn: np.ndarray | None = None) -> dict[str, Any]:
    """Write three photographs that look at the origin, and the JSON that says so."""
    (root / "images").mkdir(parents=True)
    frames = []
    for i, angle in enumerate((0.0, 0.5, 1.0)):
        pose = (np.eye(4) if turn is None else turn) @ look_at((4 * np.cos(angle), 4 * np.sin(angle), 2.0), (0, 0, 0))
        frames.append({"file_path": f"images/{i}.png", "transform_matrix": (pose @ FLIP).tolist()})
        cv2.imwrite(str(root / "images" / f"{i}.png"), np.full((30, 40, 3), 80, np.uint8))
    frames.append({"file_path": "images/lost.png", "transform_matrix": np.eye(4).tolist()})
    write_points(root / "cloud.ply", np.array([[0, 0, 0], [0.5, 0, 0.25]]) if turn is None else np.zeros((1, 3)))
    data = {"fl_x": 50.0, "w": 40, "h": 30, "k1": 0.01, "ply_file_path": "cloud.ply", "frames": frames}
    (root / "transforms.json").write_text(json.dumps(data))
    return data


def test_what_the_cameras_look_at_lies_ahead_in_the_middle(tmp_path: Path) -> None:
    make_folder(tmp_path / "capture")
    recording = open_nerfstudio(tmp_path / "capture", tmp_path / "work")
    assert [f.name for f in recording.frames] == ["0", "1", "2"]
    for frame in recording.frames:
        xy, depth = frame.camera.project(np.zeros((1, 3)))
        np.testing.assert_allclose(xy[0], [20, 15], atol=1e-9)
        np.testing.assert_allclose(depth, np.sqrt(20), atol=1e-9)
        assert (frame.camera.model, frame.camera.fy) == ("OPENCV", 50.0)
    assert recording.points
    np.testing.assert_allclose(read_points_far(recording.points), [[0, 0, 0], [0.5, 0, 0.25]])


def test_a_world_that_lies_on_its_side_is_turned(tmp_path: Path) -> None:
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    make_folder(tmp_path / "capture", turn)
    recording = open_nerfstudio(tmp_path / "capture" / "transforms.json", tmp_path / "work")
    # Three cameras over 57 degrees: their level axes fix the vertical to about 0.1 of the pull of the mean (0.01 weight).
    np.testing.assert_allclose([f.camera.position[2] for f in recording.frames], 2.0, atol=0.3)


def test_the_synthetic_scenes_leave_out_suffix_size_and_focal_length(tmp_path: Path) -> None:
    data = make_folder(tmp_path)
    for frame in data["frames"]:
        frame["file_path"] = frame["file_path"].removesuffix(".png")
    slim = {"camera_angle_x": 2 * np.arctan(0.4), "frames": data["frames"], "ply_file_path": "cloud.ply"}
    (tmp_path / "transforms.json").write_text(json.dumps(slim))
    camera = open_nerfstudio(tmp_path, tmp_path / "work").frames[0].camera
    assert (camera.width, camera.height, camera.model) == (40, 30, "PINHOLE")
    assert camera.fx == pytest.approx(50)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frames": []}, "frames must be a list of frames"),
        ({"fl_x": "wide"}, r"frames\[0\].fl_x must be a number, got wide"),
        ({"fl_x": -5}, "must be positive"),
        ({"camera_model": "OPENCV_FISHEYE"}, "camera_model must be one of"),
        ({"k3": 0.2}, "must be 0"),
        ({"w": 41}, "41 x 30, got 40 x 30"),
        ({"ply_file_path": "none.ply"}, "none.ply.*must exist"),
        ({"frames": [{"file_path": "images/lost.png"}]}, "name images that exist"),
        ({"frames": [{"file_path": "images/0.png"}]}, "transform_matrix must be given"),
        ({"frames": [{"file_path": "images/0.png", "transform_matrix": np.zeros((4, 4)).tolist()}]}, "last row"),
        ({"frames": [{"transform_matrix": np.eye(4).tolist()}]}, "file_path must be a path"),
    ],
)
def test_bad_files_are_refused_by_key(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    data = make_folder(tmp_path) | change
    (tmp_path / "transforms.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=words):
        open_nerfstudio(tmp_path, tmp_path / "work")


def test_what_is_no_json_is_refused(tmp_path: Path) -> None:
    (tmp_path / "transforms.json").write_text('{"frames": [')
    with pytest.raises(InputError, match=r"transforms.json.*must be JSON"):
        open_nerfstudio(tmp_path, tmp_path / "work")
