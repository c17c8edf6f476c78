from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.images import read_image
from scene.recording import read_recording, select_frames, write_recording

POSE = [[1, 0, 0, 0.5], [0, 0, 1, -0.8], [0, -1, 0, 0.3], [0, 0, 0, 1]]
CAMERA = {"model": "PINHOLE", "width": 160, "height": 120, "fx": 210.0, "fy": 211.0, "cx": 80.0, "cy": 60.0, "T_world_camera": POSE}
FULL: dict[str, Any] = {
    "format": "recording/1",
    "length_unit": "m",
    "name": "drive",
    "points": "cloud.ply",
    "noise": {"read_sigma": 0.0015, "shot_gain": 0.0004},
    "frames": [
        {
            "image": "images/0.png",
            "response": "srgb",
            "exposure": 2.0,
            "lights": ["led0"],
            "camera": CAMERA,
            "points": {"file": "sweep.npz", "T_world_points": POSE},
            "masks": {"file": "mask.png", "default_class": "vehicle", "classes": {"3": "pedestrian"}},
            "stereo": {"image": "right.png", "camera": CAMERA},
            "disparity": {"file": "disparity.png", "scale": 256.0, "baseline": 0.5},
            "segmentation": "classes.png",
            "flow": "flow.flo",
            "depth": {"file": "depth.png", "scale": 256.0},
            "boxes": {"file": "boxes.json", "T_world_boxes": POSE},
        },
        {"image": "images/1.png", "camera": {**CAMERA, "model": "OPENCV", "k1": -0.3, "k2": 0.1, "p1": 0.001, "p2": 0.002}},
        {
            "image": "images/2.png",
            "camera": {"model": "ORTHOGRAPHIC", "width": 4, "height": 3, "pixel_size": 0.01, "T_world_camera": POSE},
        },
    ],
}
FILES = (
    "images/0.png",
    "images/1.png",
    "images/2.png",
    "cloud.ply",
    "sweep.npz",
    "mask.png",
    "right.png",
    "disparity.png",
    "classes.png",
    "flow.flo",
    "depth.png",
    "boxes.json",
)


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "images").mkdir()
    for name in FILES:
        (tmp_path / name).touch()
    return tmp_path


def written(folder: Path, *changes: tuple[tuple[Any, ...], Any]) -> Path:
    """Write the full example with some values replaced, given by their path."""
    value = json.loads(json.dumps(FULL))  # unlike deepcopy this parts the cameras, which the example shares
    for path, new in changes:
        place: Any = value
        for step in path[:-1]:
            place = place[step]
        if new is None:
            del place[path[-1]]
        else:
            place[path[-1]] = new
    (folder / "recording.json").write_text(json.dumps(value))
    return folder / "recording.json"


def test_everything_that_a_recording_can_say_is_read(folder):
    recording = read_recording(written(folder))
    first, second, third = recording.frames
    assert (recording.name, recording.root, recording.points) == ("drive", folder.resolve(), (folder / "cloud.ply").resolve())
    assert recording.noise is not None and recording.noise.read_sigma == 0.0015
    assert (first.name, first.exposure, first.lights, first.response) == ("0", 2.0, ("led0",), "srgb")
    assert first.camera.fy == 211.0 and np.allclose(first.camera.T_world_camera, POSE)
    assert first.points is not None and first.masks is not None and first.stereo is not None and first.disparity is not None
    assert first.masks.classes == {3: "pedestrian"}
    assert first.disparity.baseline == 0.5
    assert first.flow == (folder / "flow.flo").resolve()
    assert first.depth is not None and first.depth.scale == 256.0
    assert first.boxes is not None and np.allclose(first.boxes.T_world_boxes, POSE)
    assert (second.camera.model, second.camera.k1, second.exposure, second.lights) == ("OPENCV", -0.3, 1.0, None)
    assert (third.camera.pixel_size, third.camera.cx, third.camera.cy) == (0.01, 2.0, 1.5)  # the centre by default


def test_a_recording_written_and_read_again_is_the_same(folder):
    recording = read_recording(written(folder))
    write_recording(folder / "again.json", recording)
    again = read_recording(folder / "again.json")
    write_recording(folder / "third.json", again)
    assert (folder / "again.json").read_bytes() == (folder / "third.json").read_bytes()
    assert again.frames[0].masks == recording.frames[0].masks
    assert (again.frames[0].flow, again.frames[0].depth) == (recording.frames[0].flow, recording.frames[0].depth)
    assert np.array_equal(again.frames[1].camera.T_world_camera, recording.frames[1].camera.T_world_camera)


def test_a_folder_stands_for_its_recording(folder):
    written(folder)
    assert len(read_recording(folder).frames) == 3


def test_lengths_in_millimetres_become_metres(folder):
    recording = read_recording(written(folder, (("length_unit",), "mm")))
    assert np.allclose(recording.frames[0].camera.position, np.array([0.5, -0.8, 0.3]) / 1000)
    assert recording.frames[2].camera.pixel_size == pytest.approx(1e-5)
    assert recording.frames[0].disparity is not None and recording.frames[0].disparity.baseline == pytest.approx(5e-4)
    assert recording.frames[0].camera.fx == 210.0  # pixels stay pixels
    assert recording.frames[0].depth is not None and recording.frames[0].depth.scale == pytest.approx(256_000)
    assert recording.frames[0].boxes is not None and recording.frames[0].boxes.unit == 0.001


def test_a_cloud_is_in_the_unit_of_its_recording_and_written_so_again(folder):
    recording = read_recording(written(folder, (("length_unit",), "cm")))
    assert recording.points_unit == 0.01
    write_recording(folder / "again.json", recording)
    again = read_recording(folder / "again.json")
    assert again.points_unit == 0.01
    # Dividing by the unit and multiplying again rounds once each.
    assert np.allclose(again.frames[0].camera.position, recording.frames[0].camera.position, rtol=4e-16, atol=0)


def test_frames_can_be_selected(folder):
    assert [f.name for f in select_frames(read_recording(written(folder)), [2, 0]).frames] == ["2", "0"]


@pytest.mark.parametrize(
    ("path", "new", "words"),
    [
        (("frmes",), [], r"recording\.json: frmes must be a known key\. Check its spelling\. See docs/formats\.md"),
        (("frames", 1, "camera", "fxx"), 1.0, r"frames\[1\]\.camera\.fxx must be a known key"),
        (("frames", 0, "image"), None, r"frames\[0\]\.image must be given"),
        (("frames", 0, "camera", "width"), "wide", r"frames\[0\]\.camera\.width must be int, got str"),
        (
            ("frames", 0, "camera", "model"),
            "FISHEYE",
            r"frames\[0\]\.camera\.model must be a word that the format knows, got 'FISHEYE'",
        ),
        (("format",), "recording/2", "format must be recording/1"),
        (("frames", 0, "exposure"), -1.0, r"frames\[0\]\.exposure must lie in .*, got -1"),
        (("frames", 0, "camera", "width"), 0, r"frames\[0\]\.camera\.width must lie in \[1, 65535\], got 0"),
        (("frames", 0, "camera", "fx"), None, r"frames\[0\]\.camera\.fx must be given and positive for a PINHOLE camera"),
        (("frames", 2, "camera", "pixel_size"), None, r"frames\[2\]\.camera\.pixel_size must be given and positive"),
        (("frames", 0, "camera", "T_world_camera", 0, 0), 2.0, r"frames\[0\]\.camera\.T_world_camera must be a rigid pose"),
        (
            ("frames", 0, "points", "T_world_points"),
            [[1, 0], [0, 1]],
            r"frames\[0\]\.points\.T_world_points must be a 4 x 4 matrix",
        ),
        (
            ("frames", 0, "image"),
            "../secret.png",
            r"frames\[0\]\.image must be a path below the folder of the JSON, got \.\./secret",
        ),
        (("frames", 0, "image"), "/etc/passwd", r"frames\[0\]\.image must be a path below the folder"),
        (("frames", 0, "image"), "images/9.png", r"frames\[0\]\.image must name a file that exists, got images/9\.png"),
        (("points",), "none.ply", "points must name a file that exists"),
        (("frames", 0, "masks", "classes"), {"car": "vehicle"}, r"frames\[0\]\.masks\.classes must have instance numbers as keys"),
        (("frames", 0, "disparity", "scale"), 0.0, r"frames\[0\]\.disparity\.scale must be positive"),
        (("frames", 0, "depth", "scale"), -1.0, r"frames\[0\]\.depth\.scale must be positive"),
        (("frames", 0, "flow"), "none.flo", r"frames\[0\]\.flow must name a file that exists"),
        (("frames", 0, "boxes", "T_world_boxes", 1, 1), 9.0, r"frames\[0\]\.boxes\.T_world_boxes must be a rigid pose"),
        (("noise", "read_sigma"), -1.0, r"noise\.read_sigma must be at least 0"),
    ],
)
def test_a_recording_that_breaks_the_format_is_refused_by_its_key(folder, path, new, words):
    with pytest.raises(InputError, match=words) as caught:
        read_recording(written(folder, (path, new)))
    assert "recording.json" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "words"), [(b'{"format": ', "must be JSON"), (b"\xff\xfe", "must be JSON"), (None, "must exist")]
)
def test_what_is_no_json_is_refused(tmp_path, content, words):
    if content is not None:
        (tmp_path / "recording.json").write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_recording(tmp_path)


def test_a_file_outside_the_folder_cannot_be_written_into_a_recording(folder, tmp_path_factory):
    recording = read_recording(written(folder))
    with pytest.raises(InputError, match="every file of a recording must lie below"):
        write_recording(tmp_path_factory.mktemp("elsewhere") / "recording.json", recording)


def test_a_real_drive_is_read(shared_data):
    recording = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json")
    assert len(recording.frames) == 6
    image, encoding = read_image(recording.frames[0].image, recording.frames[0].response)
    camera = recording.frames[0].camera
    assert image.shape == (camera.height, camera.width, 3)
    assert encoding.dtype == "uint8"
    # Its description says that the car drives 34.6 m.
    places = np.array([frame.camera.position for frame in recording.frames])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() == pytest.approx(34.6, abs=0.5)


def test_all_practice_recordings_are_read(shared_data):
    files = sorted((shared_data / "sealed-practice").glob("*/recording.json"))
    assert len(files) >= 10
    for file in files:
        assert read_recording(file).frames
