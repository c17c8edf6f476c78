"""How vehicles move, from boards or boxes of a few frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scene.boxes import Box, upright_pose, write_boxes
from scene.recording import BoxesFile
from scene.scene_file import Cardboard, Scene
from scene.wetting.vehicle_motion import moving_vehicles
from tests.transport import plain_street as street
from transport.projected_world import vehicle_footprint

VIEW = street.camera(width=32, height=14)


def board(x: float, y: float = 6.0, id: int = 1, kind: str = "vehicle") -> Cardboard:
    """Return the rear of a vehicle that drives along +y, seen from below it in y."""
    corners = [(x - 0.9, y, 0), (x + 0.9, y, 0), (x + 0.9, y, 1.5), (x - 0.9, y, 1.5)]
    return Cardboard(id, kind, np.array(corners, float))


def scene_of(folder, frames: list[tuple[Cardboard, ...]]) -> Scene:
    return street.plain_street(folder, [VIEW] * len(frames), street.PNG, boards=tuple(frames))


def test_boards_that_move_evenly_give_place_size_and_velocity(tmp_path):
    rng = np.random.default_rng(0)
    y = 2.0 * np.arange(5)
    scene = scene_of(tmp_path, [(board(rng.normal(0, 0.05), 4 + v + rng.normal(0, 0.05)),) for v in y])
    found = moving_vehicles(scene, vehicle_footprint)
    middle = found[2][0]
    # Slope of five places of 0.05 m each, 0.1 s apart: 0.16 m/s; four of them.
    np.testing.assert_allclose(middle.velocity, (0, 20), atol=0.65)
    # The camera at y = -5 sees the rear: 4.3 m of length lie behind it.
    np.testing.assert_allclose(middle.centre, (0, 4 + 4 + 2.15), atol=0.2)
    np.testing.assert_allclose(middle.size, (4.3, 1.8, 1.5))
    assert [len(f) for f in found] == [1] * 5


def test_what_is_unknown_throws_up_nothing(tmp_path, caplog):
    single = ((board(0),), (), ())
    jumping = tuple((board(0, 4 + jump),) for jump in (0, 5, 1, 6))
    walking = tuple((board(0, 4 + i, kind="pedestrian"),) for i in range(3))
    standing = tuple((board(0, 4),) for _ in range(3))
    for i, frames in enumerate((single, jumping, walking, standing)):
        assert not any(moving_vehicles(scene_of(tmp_path / str(i), list(frames)), vehicle_footprint))
    with caplog.at_level("INFO", "meniscus"):
        moving_vehicles(scene_of(tmp_path / "again", list(jumping)), vehicle_footprint)
    assert "no spray behind 4 vehicles of single frames whose motion is unknown" in caplog.text


def test_boxes_say_more_than_boards(tmp_path):
    scene = scene_of(tmp_path, [(board(0, 4 + i),) for i in range(3)])
    frames = []
    for i, frame in enumerate(scene.recording.frames):
        car = Box("17", "Car", upright_pose(np.array([3.0 * i, 1.0, 0.8]), 0.0), np.array([4.5, 1.7, 1.4]))
        parked = Box("18", "Car", upright_pose(np.array([0.0, 9.0, 0.8]), 0.0), np.array([4.5, 1.7, 1.4]))
        person = Box("19", "Pedestrian", upright_pose(np.array([1.0 * i, 5.0, 0.8]), 0.0), np.array([0.5, 0.5, 1.8]))
        write_boxes(tmp_path / f"{i}.json", (car, parked, person))
        frames.append(replace(frame, boxes=BoxesFile(tmp_path / f"{i}.json", np.eye(4))))
    scene = replace(scene, recording=replace(scene.recording, frames=tuple(frames)))
    found = moving_vehicles(scene, vehicle_footprint)
    assert [[v.name for v in f] for f in found] == [["17"]] * 3
    assert found[0][0].speed == pytest.approx(30.0)
    np.testing.assert_allclose(found[2][0].centre, (6.0, 1.0))
