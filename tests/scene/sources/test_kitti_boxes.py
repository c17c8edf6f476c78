"""KITTI's boxes stand where its own readme says: on their lower faces, turned about the vertical."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.boxes import read_boxes
from scene.points import read_points
from scene.sources.kitti_boxes import read_object_labels, read_tracklets
from scene.sources.kitti_object import open_kitti_object
from scene.transforms import transform_points

POSES = "".join(
    f"<item><tx>{x}</tx><ty>-2</ty><tz>-1.7</tz><rx>0</rx><ry>0</ry><rz>0.5</rz><state>2</state></item>" for x in (10, 11.5)
)
CAR = (
    "<item><objectType>Car</objectType><h>1.5</h><w>1.8</w><l>4.2</l><first_frame>3</first_frame>"
    f"<poses><count>2</count><item_version>2</item_version>{POSES}</poses><finished>1</finished></item>"
)
LABEL = "Car 0.00 0 1.85 387.63 181.54 423.81 203.12 1.6 1.8 4.0 1.0 1.7 20.0 {}"


def tracklets(folder: Path, items: str = CAR) -> Path:
    file = folder / "tracklet_labels.xml"
    head = '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?><!DOCTYPE boost_serialization>'
    counts = "<count>1</count><item_version>1</item_version>"
    file.write_text(f"{head}<boost_serialization><tracklets>{counts}{items}</tracklets></boost_serialization>")
    return file


def test_a_tracklet_is_a_box_per_image_from_its_first_on(tmp_path):
    boxes = read_tracklets(tracklets(tmp_path))
    assert sorted(boxes) == [3, 4]
    (box,) = boxes[4]
    assert (box.track, box.category, box.kind) == ("0", "Car", "vehicle")
    np.testing.assert_allclose(box.T_boxes_object[:3, 3], [11.5, -2, -1.7 + 0.75])
    np.testing.assert_allclose(box.T_boxes_object[:3, 0], [np.cos(0.5), np.sin(0.5), 0])
    np.testing.assert_allclose(box.size, [4.2, 1.8, 1.5])


@pytest.mark.parametrize(
    ("items", "words"),
    [
        (CAR.replace("<h>1.5</h>", ""), r"tracklets.item\[0\].h must be given"),
        (CAR.replace("<l>4.2</l>", "<l>long</l>"), r"item\[0\].l must be a number, got long"),
        (CAR.replace("<w>1.8</w>", "<w>0</w>"), r"item\[0\].h, w, l must be positive"),
        (CAR.replace("<tx>11.5</tx>", "<tx>nan</tx>"), r"item\[0\].poses.item\[1\].tx must be finite"),
        ("<item>", "tracklet_labels.xml: it must be XML"),
    ],
)
def test_a_broken_tracklet_is_named_by_its_place(tmp_path, items, words):
    with pytest.raises(InputError, match=words):
        read_tracklets(tracklets(tmp_path, items))


@pytest.mark.parametrize(("turn", "ahead"), [(0.0, (1, 0, 0)), (-np.pi / 2, (0, 0, 1))])
def test_a_label_turns_its_length_from_x_towards_the_camera(tmp_path, turn, ahead):
    (tmp_path / "a.txt").write_text(LABEL.format(turn) + "\nDontCare -1 -1 -10 5 5 9 9 -1 -1 -1 -1000 -1000 -1000 -10\n")
    (box,) = read_object_labels(tmp_path / "a.txt")
    np.testing.assert_allclose(box.T_boxes_object[:3, 0], ahead, atol=1e-12)
    np.testing.assert_allclose(box.T_boxes_object[:3, 2], [0, -1, 0], atol=1e-12)
    assert np.linalg.det(box.T_boxes_object[:3, :3]) == pytest.approx(1)
    # Camera y is down: the centre lies half a height above the lower face.
    np.testing.assert_allclose(box.T_boxes_object[:3, 3], [1, 1.7 - 0.8, 20])


@pytest.mark.parametrize(
    ("line", "words"),
    [("Car 0 0 0", "line 1 must have 15 words"), (LABEL.format("left"), "line 1 must have numbers"),
     (LABEL.format(0).replace(" 1.8 ", " -1 "), "line 1 must have a positive size")],
)  # fmt: skip
def test_a_broken_label_is_named_by_its_line(tmp_path, line, words):
    (tmp_path / "a.txt").write_text(line)
    with pytest.raises(InputError, match=words):
        read_object_labels(tmp_path / "a.txt")


@pytest.mark.parametrize(("name", "counts"), [("000000", [376]), ("000001", [70, 9, 18]), ("000002", [1351, 67])])
def test_real_labels_hold_the_points_that_their_description_counts(shared_data, tmp_path, name, counts):
    recording = open_kitti_object(shared_data / "kitti_object" / "image_2" / f"{name}.png", tmp_path)
    (frame,) = recording.frames
    assert frame.boxes is not None and frame.points is not None
    points = read_points(frame.points.file)[:, :3].astype(np.float64)
    world = transform_points(frame.points.T_world_points, points)
    boxes = [box.moved_by(frame.boxes.T_world_boxes) for box in read_boxes(frame.boxes.file)]
    assert [int(box.contains(world).sum()) for box in boxes] == counts


def test_frames_of_the_object_benchmark_are_opened_one_by_one(shared_data, tmp_path):
    with pytest.raises(InputError, match=r"must hold one frame, got 3 images.*name one, as .*000000.png"):
        open_kitti_object(shared_data / "kitti_object", tmp_path)
