"""A box says what lies in it, in any frame and unit; a file that does not fit the format is named with its key."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.boxes import Box, read_boxes, upright_pose, write_boxes

CAR = {"track": 7, "class": "Car", "centre": [10, 2, 0.8], "size": [4, 1.8, 1.6], "yaw": 0.5}


def written(folder: Path, *boxes: dict) -> Path:
    file = folder / "boxes.json"
    file.write_text(json.dumps({"format": "boxes/1", "boxes": boxes}))
    return file


def test_a_box_holds_what_is_in_it_and_the_ground_below_it_is_not(tmp_path):
    (box,) = read_boxes(written(tmp_path, CAR))
    ahead = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    inside = box.T_boxes_object[:3, 3] + 1.99 * ahead
    assert box.contains(np.array([inside, inside + 0.05 * ahead, inside - (0, 0, 0.81)])).tolist() == [True, False, False]
    # A margin widens it to the sides and upwards, but the road stays.
    assert box.contains(np.array([inside + 0.05 * ahead, inside - (0, 0, 0.81)]), margin=0.1).tolist() == [True, False]


def test_corners_span_the_size_and_count_by_bits():
    box = Box("1", "Car", upright_pose(np.array([1.0, 2.0, 3.0]), 0.0), np.array([4.0, 2.0, 1.0]))
    corners = box.corners()
    np.testing.assert_allclose(corners[0], [-1, 1, 2.5])
    np.testing.assert_allclose(corners[4] - corners[0], [4, 0, 0])
    np.testing.assert_allclose(corners[2] - corners[0], [0, 2, 0])
    np.testing.assert_allclose(corners[1] - corners[0], [0, 0, 1])


def test_boxes_are_written_and_read_again_in_any_unit(tmp_path):
    (box,) = read_boxes(written(tmp_path, {**CAR, "moving": False}))
    write_boxes(tmp_path / "again.json", (box,), unit=0.01)
    (again,) = read_boxes(tmp_path / "again.json", unit=0.01)
    np.testing.assert_allclose(again.T_boxes_object, box.T_boxes_object, rtol=1e-15)
    np.testing.assert_allclose(again.size, box.size, rtol=1e-15)
    assert (again.track, again.category, again.moving) == ("7", "Car", False)


@pytest.mark.parametrize(
    ("category", "kind", "stands"),
    [("Pedestrian", "pedestrian", False), ("Person_sitting", "pedestrian", False), ("Cyclist", "vehicle", False),
     ("REGULAR_VEHICLE", "vehicle", False), ("CONSTRUCTION_CONE", "vehicle", True), ("", "vehicle", False)],
)  # fmt: skip
def test_categories_of_the_field_are_vehicles_people_or_things_that_stand(category, kind, stands):
    box = Box("1", category, np.eye(4), np.ones(3))
    assert (box.kind, box.stands) == (kind, stands)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"size": [4, 0, 1]}, r"boxes\[1\].size must be positive"),
        ({"size": [4, 1]}, r"boxes\[1\].size must be three finite numbers"),
        ({"centre": None}, r"boxes\[1\] must have either `centre` \(and `yaw`\) or `T_boxes_object`, got neither"),
        ({"T_boxes_object": np.eye(4).tolist()}, r"boxes\[1\] must have either .* got both"),
        ({"centre": None, "T_boxes_object": (2 * np.eye(4)).tolist()}, r"boxes\[1\].yaw must be left out"),
        ({"centre": None, "yaw": None, "T_boxes_object": np.diag([2, 2, 2, 1]).tolist()}, r".*T_boxes_object must be a rigid pose"),
        ({"track": 7}, r"boxes\[1\].track must be the only one of its frame, got 7"),
        ({"colour": "red"}, r"boxes\[1\].colour must be a known key"),
    ],
)  # fmt: skip
def test_a_box_that_is_none_is_named_by_file_and_key(tmp_path, change, words):
    with pytest.raises(InputError, match=r"boxes.json: " + words):
        read_boxes(written(tmp_path, CAR, {**CAR, "track": 8} | change))
