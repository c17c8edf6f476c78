"""What the sweeps saw move gets a mask in each photograph."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scene.camera import Camera
from scene.images import read_ids
from scene.reconstruction.moving_masks import (
    read_moving,
    things_that_moved,
    with_motion_masks,
    write_motion_masks,
    write_moving,
)
from scene.recording import Frame, Recording
from scene.transforms import look_at

from .test_slow_objects import seen

CAMERA = Camera("PINHOLE", 480, 120, look_at((0, 0, 1.5), (20, 0, 1.2)), 200, 200, 240, 60)
SCANNER = np.array([0.0, 0.0, 1.7])
CAR = np.array([8.0, -2.9, 0.1]), np.array([12.0, -1.1, 1.4])
PERSON = np.array([10.0, 2.0, 0.1]), np.array([10.5, 2.6, 1.6])
PARKED = np.array([8.0, -7.0, 0.1]), np.array([12.0, -5.0, 1.4])


def scanned():
    """One sweep's points, whether each has moved, and which thing it belongs to."""
    parts = [seen(SCANNER, *box) for box in (CAR, PERSON, PARKED)]
    thing = np.concatenate([np.full(len(p), k) for k, p in enumerate(parts)])
    return np.concatenate(parts), thing < 2, thing


def test_a_mask_covers_the_moving_things_and_not_the_standing_one(tmp_path: Path):
    points, has_moved, thing = scanned()
    moving = things_that_moved(points, np.zeros(len(points), int), points[:, 2], has_moved)
    assert sorted(moving.kinds(0).values()) == ["pedestrian", "vehicle"]
    write_moving(tmp_path / "moving.npz", moving)
    again = read_moving(tmp_path / "moving.npz")
    recording = Recording((Frame(tmp_path / "0.png", CAMERA), Frame(tmp_path / "1.png", CAMERA)), tmp_path)
    write_motion_masks(recording, again, tmp_path)
    masked = with_motion_masks(recording, again, tmp_path)
    assert masked.frames[1].masks is None and masked.frames[0].masks is not None
    mask = read_ids(masked.frames[0].masks.file)
    xy = CAMERA.project(points)[0].astype(int)
    ids = mask[xy[:, 1], xy[:, 0]]
    for k, kind in ((0, "vehicle"), (1, "pedestrian")):
        (id,) = np.unique(ids[thing == k])
        assert masked.frames[0].masks.classes is not None and masked.frames[0].masks.classes[int(id)] == kind
    assert not ids[thing == 2].any()
    # It reaches down to the road: the car's back, 8 m away, meets it 1.5 m below the camera.
    (foot,) = CAMERA.project(np.array([[8.0, -2.0, 0.0]]))[0]
    assert abs(np.flatnonzero(mask[:, int(foot[0])]).max() - foot[1]) <= 4  # the margin of 3 px, and a pixel's rounding


def test_scattered_points_that_seemed_to_move_make_no_thing():
    points, has_moved, thing = scanned()
    rng = np.random.default_rng(0)
    few = has_moved & (rng.random(len(points)) < 0.3) | (thing == 2) & (rng.random(len(points)) < 0.3)
    assert len(things_that_moved(points, np.zeros(len(points), int), points[:, 2], few).ids) == 0


def test_nothing_that_moved_gives_no_masks(tmp_path: Path):
    points, _, _ = scanned()
    none = things_that_moved(points, np.zeros(len(points), int), points[:, 2], np.zeros(len(points), bool))
    assert len(none.ids) == 0 and none.points_world.shape == (0, 3)
