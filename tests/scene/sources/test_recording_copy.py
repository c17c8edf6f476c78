"""A copied recording stands on its own, byte for byte; a picture that does not fit is named before work starts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.boxes import Box, write_boxes
from scene.camera import Camera
from scene.flow_files import write_flow
from scene.points import write_points
from scene.recording import BoxesFile, DepthFile, DisparityFile, Frame, MaskFile, PointsFile, Recording, StereoFile
from scene.sources.recording_copy import check_recording, copy_recording, unique_names

WIDTH, HEIGHT = 24, 16
POSE = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])


def picture(file: Path, width: int = WIDTH, height: int = HEIGHT, channels: int = 3) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    shape = (height, width, 3) if channels == 3 else (height, width)
    cv2.imwrite(str(file), np.random.default_rng(len(str(file))).integers(0, 255, shape, dtype=np.uint8))
    return file


def flow_file(file: Path, width: int = WIDTH) -> Path:
    write_flow(file, np.zeros((HEIGHT, width, 2), np.float32))
    return file


def box_file(file: Path) -> Path:
    write_boxes(file, (Box("1", "Car", np.eye(4), np.ones(3)),))
    return file


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    camera = Camera("PINHOLE", WIDTH, HEIGHT, np.eye(4), 20.0, 20.0, 12.0, 8.0)
    root = tmp_path / "drive"
    write_points(root / "sweep.bin", np.ones((600, 4)))
    frames = []
    for side in ("left", "right"):
        frames.append(
            Frame(
                picture(root / side / "0001.png"),
                camera,
                points=PointsFile(root / "sweep.bin", np.eye(4)),
                masks=MaskFile(picture(root / "masks" / f"{side}.png", channels=1), "pedestrian", {3: "vehicle"}),
                stereo=StereoFile(picture(root / "second" / f"{side}.png"), camera),
                disparity=DisparityFile(picture(root / "disparity" / f"{side}.png", channels=1), 256.0, 0.5),
                segmentation=picture(root / "classes" / f"{side}.png", channels=1),
                flow=flow_file(root / "flow" / f"{side}.flo"),
                depth=DepthFile(picture(root / "depth" / f"{side}.png", channels=1), 256.0),
                boxes=BoxesFile(box_file(root / "boxes" / f"{side}.json"), POSE),
            )
        )
    return Recording(tuple(frames), root, "drive", root / "sweep.bin")


def test_a_copy_holds_the_same_bytes_below_one_folder(recording: Recording, tmp_path: Path) -> None:
    check_recording(recording)
    copy = copy_recording(recording, tmp_path / "scene" / "recording")
    assert [f.name for f in copy.frames] == ["left_0001", "right_0001"]
    for old, new in zip(recording.frames, copy.frames, strict=True):
        assert old.masks
        assert new.masks
        assert old.stereo
        assert new.stereo
        assert old.disparity
        assert new.disparity
        assert old.segmentation
        assert new.segmentation
        assert old.flow
        assert new.flow
        assert old.depth
        assert new.depth
        assert old.boxes
        assert new.boxes
        pairs = [(old.image, new.image), (old.masks.file, new.masks.file), (old.stereo.image, new.stereo.image)]
        pairs += [(old.disparity.file, new.disparity.file), (old.segmentation, new.segmentation)]
        pairs += [(old.flow, new.flow), (old.depth.file, new.depth.file), (old.boxes.file, new.boxes.file)]
        for a, b in pairs:
            assert a.read_bytes() == b.read_bytes()
            assert b.is_relative_to(tmp_path / "scene" / "recording")
        assert new.points is None
        assert (new.masks.default_class, new.masks.classes) == ("pedestrian", {3: "vehicle"})
        np.testing.assert_array_equal(new.camera.T_world_camera, old.camera.T_world_camera)
        np.testing.assert_array_equal(new.boxes.T_world_boxes, POSE)
        assert new.depth.scale == 256.0


def test_a_second_copy_replaces_the_first_and_a_failed_one_leaves_it(recording: Recording, tmp_path: Path) -> None:
    folder = tmp_path / "copy"
    copy_recording(recording, folder)
    copy = copy_recording(replace(recording, frames=recording.frames[:1]), folder)
    assert len(copy.frames) == 1
    assert len(list((folder / "image").iterdir())) == 1
    recording.frames[1].image.unlink()
    with pytest.raises(InputError, match="must exist"):
        copy_recording(recording, folder)
    assert len(list((folder / "image").iterdir())) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy", "drive"]


def test_names_stay_unique_even_where_prefixes_collide(recording: Recording) -> None:
    frame = recording.frames[0]
    images = ["a/b_1.png", "b/1.png", "c/1.png", "b/1.jpg"]
    frames = tuple(replace(frame, image=Path(name)) for name in images)
    names = unique_names(replace(recording, frames=frames))
    assert names[0] == "b_1"
    assert len(set(names)) == 4


def test_a_cloud_without_pictures_keeps_its_points(recording: Recording, tmp_path: Path) -> None:
    copy = copy_recording(replace(recording, frames=()), tmp_path / "copy")
    assert copy.frames == ()
    assert copy.points is not None
    assert copy.points.read_bytes() == (recording.root / "sweep.bin").read_bytes()


@pytest.mark.parametrize("kind", ["image", "masks", "stereo", "disparity", "segmentation", "depth"])
def test_a_picture_of_another_size_is_named_with_both_sizes(recording: Recording, kind: str) -> None:
    value = getattr(recording.frames[1], kind)
    file = value if isinstance(value, Path) else getattr(value, "file", None) or value.image
    picture(file, WIDTH + 1, HEIGHT, channels=3 if kind in ("image", "stereo") else 1)
    with pytest.raises(InputError, match=rf"{file.name}.*24 x 16, got 25 x 16"):
        check_recording(recording)


def test_a_flow_of_another_size_is_named_with_both_sizes(recording: Recording) -> None:
    assert recording.frames[1].flow
    flow_file(recording.frames[1].flow, WIDTH + 1)
    with pytest.raises(InputError, match=r"right.flo: the flow .*24 x 16, got 25 x 16"):
        check_recording(recording)


@pytest.mark.parametrize("kind", ["flow", "depth", "disparity"])
def test_truth_of_straight_pictures_beside_bent_ones_is_refused(recording: Recording, kind: str) -> None:
    names = ("stereo", "disparity", "flow", "depth")
    bent = replace(recording.frames[0].camera, model="OPENCV", k1=-0.1)
    frame = replace(recording.frames[0], camera=bent, **{name: None for name in names if name != kind})
    with pytest.raises(InputError, match=rf"frames\[0\].camera.model must be PINHOLE where there is {kind}, which"):
        check_recording(replace(recording, frames=(frame,)))


def test_boxes_that_break_their_format_are_named_before_work_starts(recording: Recording) -> None:
    assert recording.frames[1].boxes
    recording.frames[1].boxes.file.write_text("{}")
    with pytest.raises(InputError, match=r"right.json: format must be given"):
        check_recording(recording)


def test_a_truncated_picture_is_refused(recording: Recording) -> None:
    file = recording.frames[1].image
    file.write_bytes(file.read_bytes()[:-30])
    with pytest.raises(InputError, match=r"0001.png.*whole PNG"):
        check_recording(recording)


def test_a_mask_must_hold_ids_not_colours(recording: Recording) -> None:
    assert recording.frames[0].masks
    picture(recording.frames[0].masks.file)
    with pytest.raises(InputError, match="mask must have one channel, got 3"):
        check_recording(recording)
