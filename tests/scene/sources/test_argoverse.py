"""A log of Argoverse 2 becomes a recording: its tables' poses, its scanner's sweeps, its boxes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather
from scipy.spatial.transform import Rotation

from materials.foundation.errors import InputError
from scene.boxes import read_boxes
from scene.points import read_points
from scene.sources.argoverse import open_argoverse
from scene.sources.recording_source import recognised_format
from scene.transforms import transform_points

T0, TURN = 315968867659956000, 100_000_000
# Camera axes (x right, y down, z forward) in the vehicle's (x forward, y left, z up).
CAMERA = Rotation.from_matrix(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float))
MARK = np.array([12.0, 1.0, 0.5])


def table(file: Path, **columns: Any) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(columns), str(file))


def poses(rotations: list[Rotation], places: list) -> dict[str, Any]:
    q, t = np.array([r.as_quat() for r in rotations]), np.array(places, float)
    return {f"q{n}": q[:, i] for i, n in enumerate("xyzw")} | {f"t{n}_m": t[:, i] for i, n in enumerate("xyz")}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Two sweeps of a vehicle that drives 2 m north in a turn; a mark stands in the city, a car drives ahead."""
    folder = tmp_path / "0af1"
    north = Rotation.from_euler("z", np.pi / 2)
    times = [T0, T0 + TURN]
    places = [(700.0, 1200.0, -20.0), (700.0, 1202.0, -20.0)]
    table(folder / "city_SE3_egovehicle.feather", timestamp_ns=times, **poses([north, north], places))
    names = ["ring_front_center", "ring_rear_left", "up_lidar"]
    turned = Rotation.from_euler("z", 0.01)
    seats = poses([CAMERA, CAMERA, turned], [(1.6, 0, 1.4), (1.1, 0.1, 1.4), (1.35, 0, 1.64)])
    table(folder / "calibration" / "egovehicle_SE3_sensor.feather", sensor_name=names, **seats)
    one = {"fx_px": 60.0, "fy_px": 60.0, "cx_px": 19.5, "cy_px": 24.5, "k1": 0.1, "width_px": 40, "height_px": 50}
    table(folder / "calibration" / "intrinsics.feather", sensor_name=names[:2], **{k: [v, v] for k, v in one.items()})
    for name in names[:2]:
        (folder / "sensors" / "cameras" / name).mkdir(parents=True)
        for time in (T0 + 20_000_000, T0 + 70_000_000, T0 + 95_000_000):
            cv2.imwrite(str(folder / "sensors" / "cameras" / name / f"{time}.jpg"), np.full((50, 40, 3), 90, np.uint8))
    for i, time in enumerate(times):
        seen = MARK - (2.0 * i, 0, 0)
        cloud = np.array([seen, seen + (0, 1, 0)], np.float16)
        columns = {n: cloud[:, k] for k, n in enumerate("xyz")} | {"intensity": np.array([3, 4], np.uint8)}
        table(folder / "sensors" / "lidar" / f"{time}.feather", **columns)
    sizes = {"length_m": [4.0, 4.0], "width_m": [1.8, 1.8], "height_m": [1.5, 1.5]}
    box = poses([Rotation.identity()] * 2, [(9, 0, 0.7), (9, 0, 0.7)])
    table(
        folder / "annotations.feather",
        timestamp_ns=times,
        track_uuid=["a", "a"],
        category=["REGULAR_VEHICLE"] * 2,
        **sizes,
        **box,
    )
    return folder


def test_what_stands_in_the_city_is_at_one_place_in_all_sweeps(log, tmp_path):
    recording = open_argoverse(log, tmp_path / "work")
    assert len(recording.frames) == 2
    for frame in recording.frames:
        assert frame.points is not None
        world = transform_points(frame.points.T_world_points, read_points(frame.points.file)[:, :3].astype(np.float64))
        # The vehicle looks north (y); half floats resolve 8 mm at 12 m.
        np.testing.assert_allclose(world[0], [700 - 1.0, 1200 + 12, -19.5], atol=5e-3)
        # The sweep is about its scanner, as what looks for free space and the vehicle itself expects.
        np.testing.assert_allclose(frame.points.T_world_points[2, 3], -20 + 1.64, atol=1e-9)


def test_a_frame_has_the_picture_nearest_in_time_with_the_pose_of_that_time(log, tmp_path):
    first, second = open_argoverse(log, tmp_path / "work").frames
    assert (first.name, second.name) == (str(T0 + 20_000_000), str(T0 + 95_000_000))
    np.testing.assert_allclose(second.camera.position, [700, 1200 + 1.9 + 1.6, -20 + 1.4], atol=1e-9)
    # It looks north: what is ahead is in the middle, from OpenCV's pixel centres to corners.
    xy, depth = first.camera.project(first.camera.position + np.array([[0, 10.0, 0]]))
    np.testing.assert_allclose(xy, [[20, 25]], atol=1e-9)
    assert depth[0] == pytest.approx(10)


def test_boxes_are_in_the_vehicles_frame_and_moved_to_the_city(log, tmp_path):
    frame = open_argoverse(log, tmp_path / "work").frames[1]
    assert frame.boxes is not None
    (box,) = (box.moved_by(frame.boxes.T_world_boxes) for box in read_boxes(frame.boxes.file))
    assert (box.track, box.kind) == ("a", "vehicle")
    np.testing.assert_allclose(box.T_boxes_object[:3, 3], [700, 1202 + 9, -19.3], atol=1e-9)
    np.testing.assert_allclose(box.T_boxes_object[:3, 0], [0, 1, 0], atol=1e-12)


def test_a_log_is_recognised_and_another_camera_named_by_its_folder(log, tmp_path):
    assert recognised_format(log) == "argoverse"
    folder = log / "sensors" / "cameras" / "ring_rear_left"
    assert recognised_format(folder) == "argoverse"
    assert "ring_rear_left" in str(open_argoverse(folder, tmp_path / "work").frames[0].image)


def test_a_log_without_boxes_has_none(log, tmp_path):
    (log / "annotations.feather").unlink()
    assert all(frame.boxes is None for frame in open_argoverse(log, tmp_path / "work").frames)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda log: (log / "calibration" / "intrinsics.feather").unlink(), r"intrinsics.feather: it must exist"),
        (lambda log: (log / "annotations.feather").write_bytes(b"FEA1"), r"annotations.feather: it must be a whole Feather table"),
        (lambda log: table(log / "sensors" / "lidar" / f"{T0}.feather", x=[1.0], y=[1.0]), r"must have the column z, got x, y"),
        (lambda log: table(log / "city_SE3_egovehicle.feather", timestamp_ns=[T0, T0 + 1], **poses([CAMERA] * 2, [MARK] * 2)),
         r"city_SE3_egovehicle.feather: it must hold poses before and after each sweep and picture"),
        (lambda log: [f.unlink() for f in (log / "sensors" / "cameras" / "ring_front_center").iterdir()],
         r"ring_front_center: it must hold files named by their time"),
    ],
)  # fmt: skip
def test_what_a_log_lacks_is_named(log, tmp_path, change, words):
    change(log)
    with pytest.raises(InputError, match=words):
        open_argoverse(log, tmp_path / "work")
