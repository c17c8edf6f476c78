"""A drive of KITTI raw becomes a recording whose cameras see the sweeps where KITTI's own matrices put them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.boxes import read_boxes
from scene.points import read_points
from scene.recording import read_recording
from scene.sources.kitti_raw import open_kitti_raw, oxts_poses
from scene.transforms import invert, transform_points

# The calibration of 2011_09_26, at a tenth of its image size.
WIDTH, HEIGHT = 124, 37
P2 = [72.15377, 0, 60.95593, 4.485728, 0, 72.15377, 17.28540, 0.02163791, 0, 0, 1, 0.002745884]
P3 = [72.15377, 0, 60.95593, -33.95242, 0, 72.15377, 17.28540, 0.2199936, 0, 0, 1, 0.002729905]
R_RECT = [0.9999239, 0.00983776, -0.007445048, -0.009869795, 0.9999421, -0.004278459, 0.007402527, 0.004351614, 0.9999631]
R_VELO = [0.007533745, -0.9999714, -0.000616602, 0.01480249, 0.0007280733, -0.9998902, 0.9998621, 0.00752379, 0.01480755]
T_VELO = [-0.004069766, -0.07631618, -0.2717806]


def words(values: list[float]) -> str:
    return " ".join(f"{v:.9e}" for v in values)


def make_drive(root: Path, num_frames: int = 3, oxts: bool = True) -> Path:
    """Write a date folder with one drive."""
    date = root / "2011_09_26"
    drive = date / "2011_09_26_drive_0001_sync"
    for name in ("image_02", "image_03", "velodyne_points", "oxts") if oxts else ("image_02", "image_03", "velodyne_points"):
        (drive / name / "data").mkdir(parents=True)
    (date / "calib_cam_to_cam.txt").write_text(
        f"calib_time: 09-Jan-2012 13:57:47\nS_rect_02: {WIDTH} {HEIGHT}\nR_rect_00: {words(R_RECT)}\n"
        f"P_rect_02: {words(P2)}\nP_rect_03: {words(P3)}\n"
    )
    (date / "calib_velo_to_cam.txt").write_text(f"R: {words(R_VELO)}\nT: {words(T_VELO)}\n")
    (date / "calib_imu_to_velo.txt").write_text(f"R: 1 0 0 0 1 0 0 0 1\nT: {words([-0.81, 0.32, -0.8])}\n")
    rng = np.random.default_rng(0)
    for i in range(num_frames):
        for name in ("image_02", "image_03"):
            cv2.imwrite(str(drive / name / "data" / f"{i:010d}.png"), rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8))
        rng.uniform(-20, 20, (600, 4)).astype("<f4").tofile(drive / "velodyne_points" / "data" / f"{i:010d}.bin")
        if oxts:
            # North, 1e-5 degrees a frame: 1.11 m.
            values = [49.0 + 1e-5 * i, 8.4, 110.0, 0.01, -0.02, np.pi / 2] + [0.0] * 24
            (drive / "oxts" / "data" / f"{i:010d}.txt").write_text(words(values))
    return drive


def test_points_fall_where_the_matrices_of_kitti_put_them_half_a_pixel_on(tmp_path: Path) -> None:
    frame = open_kitti_raw(make_drive(tmp_path), tmp_path / "work").frames[1]
    assert frame.points
    p = read_points(frame.points.file)[:, :3].astype(np.float64)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.reshape(R_VELO, (3, 3)), T_VELO
    R = np.eye(4)
    R[:3, :3] = np.reshape(R_RECT, (3, 3))
    homogeneous = np.column_stack([p, np.ones(len(p))]) @ T.T @ R.T
    assert frame.stereo
    for camera, P in ((frame.camera, P2), (frame.stereo.camera, P3)):
        image = homogeneous @ np.reshape(P, (3, 4)).T
        xy, depth = camera.project(transform_points(frame.points.T_world_points, p))
        front = image[:, 2] > 1
        # KITTI's rotations are printed with 7 digits and made orthonormal here: 1e-6 of 100 px a unit at 20 m over 1 m depth.
        np.testing.assert_allclose(xy[front], (image[:, :2] / image[:, 2:])[front] + 0.5, atol=5e-3)
        np.testing.assert_allclose(depth[front], image[front, 2], atol=1e-4)


def test_oxts_gives_a_world_of_east_north_up(tmp_path: Path) -> None:
    recording = open_kitti_raw(make_drive(tmp_path).parent, tmp_path / "work")
    step = recording.frames[2].camera.position - recording.frames[0].camera.position
    # 2e-5 degrees of a sphere of 6378137 m, northwards, plus nothing upwards; Mercator at fixed scale errs by 1e-7 here.
    np.testing.assert_allclose(step, [0, np.deg2rad(2e-5) * 6378137, 0], atol=1e-5)
    forward = recording.frames[0].camera.T_world_camera[:3, 2]
    # Yaw 90 degrees: the car looks north; KITTI's camera is level within 2 degrees of the unit.
    assert forward[1] > 0.99
    assert recording.frames[0].camera.T_world_camera[2, 1] < -0.99
    assert [f.name for f in recording.frames] == ["0000000000", "0000000001", "0000000002"]


def test_the_second_camera_stands_a_baseline_to_the_right(tmp_path: Path) -> None:
    frame = open_kitti_raw(tmp_path / "2011_09_26" if make_drive(tmp_path) else tmp_path, tmp_path / "work").frames[0]
    assert frame.stereo
    offset = invert(frame.camera.T_world_camera) @ frame.stereo.camera.T_world_camera
    assert offset[0, 3] == pytest.approx((4.485728 + 33.95242) / 72.15377, abs=1e-4)


def test_several_drives_need_a_name(tmp_path: Path) -> None:
    drive = make_drive(tmp_path)
    shutil.copytree(drive, drive.with_name("2011_09_26_drive_0002_sync"))
    with pytest.raises(InputError, match=r"hold one drive, got 2011_09_26_drive_0001_sync, 2011_09_26_drive_0002_sync"):
        open_kitti_raw(tmp_path, tmp_path / "work")
    assert open_kitti_raw(drive, tmp_path / "work").name == "2011_09_26_drive_0001_sync"


def test_bad_drives_are_refused_by_file(tmp_path: Path) -> None:
    drive = make_drive(tmp_path)
    image = drive / "image_02" / "data" / "0000000001.png"
    cv2.imwrite(str(image), np.zeros((HEIGHT + 1, WIDTH, 3), np.uint8))
    with pytest.raises(InputError, match=r"0000000001.png.*124 x 37, got 124 x 38"):
        open_kitti_raw(drive, tmp_path / "work")
    calibration = drive.parent / "calib_cam_to_cam.txt"
    text = calibration.read_text()
    calibration.write_text(text.replace("P_rect_02", "P_rect_09"))
    with pytest.raises(InputError, match=r"calib_cam_to_cam.txt: P_rect_02 must be given"):
        open_kitti_raw(drive, tmp_path / "work")
    calibration.write_text(text.replace("R_rect_00: 9.99", "R_rect_00: 8.99"))
    with pytest.raises(InputError, match=r"R_rect_00 must be a rigid pose"):
        open_kitti_raw(drive, tmp_path / "work")
    with pytest.raises(InputError, match=r"hold calib_cam_to_cam.txt"):
        open_kitti_raw(tmp_path / "nothing", tmp_path / "work")
    (tmp_path / "bad.txt").write_text("49 8 110 0 0")
    with pytest.raises(InputError, match="begin with lat"):
        oxts_poses([tmp_path / "bad.txt"])


def test_a_drive_without_any_source_of_poses_says_what_to_do(tmp_path: Path) -> None:
    drive = make_drive(tmp_path, oxts=False)
    shutil.rmtree(drive / "velodyne_points")
    with pytest.raises(InputError, match=r"oxts/data.*or velodyne_points/data, got neither"):
        open_kitti_raw(drive, tmp_path / "work")


def test_the_calibration_of_a_real_drive_agrees_with_an_independent_conversion(shared_data: Path, tmp_path: Path) -> None:
    # Both are of 2011_09_26: the camera relative to the scanner must be the same.
    source = shared_data / "kitti_raw_drive" / "2011_09_26"
    date = tmp_path / "2011_09_26"
    date.mkdir()
    for file in source.glob("*.txt"):
        shutil.copy(file, date)
    drive = "2011_09_26_drive_0000_sync"
    for kind, suffix in (("image_02", "png"), ("velodyne_points", "bin")):
        (date / drive / kind / "data").mkdir(parents=True)
        for i in range(3):
            shutil.copy(source / drive / kind / "data" / f"{i:010d}.{suffix}", date / drive / kind / "data")
    recording = open_kitti_raw(tmp_path, tmp_path / "work")
    known = read_recording(shared_data / "kitti2015_drive" / "street_122_127.recording.json").frames[0]
    frame = recording.frames[0]
    assert frame.points
    assert known.points
    ours = invert(frame.points.T_world_points) @ frame.camera.T_world_camera
    theirs = invert(known.points.T_world_points) @ known.camera.T_world_camera
    # The recording is printed with 9 decimals of a matrix that was not made orthonormal: 1e-6.
    np.testing.assert_allclose(ours, theirs, atol=3e-6)
    assert (frame.camera.cx, frame.camera.cy, frame.camera.fx) == (known.camera.cx, known.camera.cy, known.camera.fx)
    # Poses by odometry: the recorded estimate is good to about 1 cm a step (its own note says 0 to 3 cm).
    reference = json.loads((shared_data / "kitti_raw_drive" / "poses_estimated.json").read_text())["T_world_velo"]
    for i in (1, 2):
        points = recording.frames[i].points
        assert points
        step = invert(frame.points.T_world_points) @ points.T_world_points
        assert np.linalg.norm(step[:3, 3] - np.array(reference[i])[:3, 3]) < 0.03
    # Up is up: the ground is 1.7 m below the scanner, everywhere near the car.
    near = transform_points(frame.points.T_world_points, read_points(frame.points.file)[:, :3].astype(np.float64))
    near = near[(np.hypot(near[:, 0], near[:, 1]) < 10) & (near[:, 2] < -1.5)]
    assert abs(np.median(near[:, 2]) + 1.73) < 0.1


def test_tracklets_become_boxes_of_the_scanners_frame(tmp_path: Path) -> None:
    drive = make_drive(tmp_path)
    pose = "<item><tx>9</tx><ty>1</ty><tz>-1.7</tz><rz>0</rz></item>"
    car = f"<item><objectType>Van</objectType><h>2</h><w>2</w><l>5</l><first_frame>1</first_frame><poses>{pose}</poses></item>"
    (drive / "tracklet_labels.xml").write_text(f"<boost_serialization><tracklets>{car}</tracklets></boost_serialization>")
    frames = open_kitti_raw(drive, tmp_path / "work").frames
    counts = [len(read_boxes(frame.boxes.file)) if frame.boxes else None for frame in frames]
    assert counts == [0, 1, 0]
    assert frames[1].boxes is not None and frames[1].points is not None
    np.testing.assert_array_equal(frames[1].boxes.T_world_boxes, frames[1].points.T_world_points)
    np.testing.assert_allclose(read_boxes(frames[1].boxes.file)[0].T_boxes_object[:3, 3], [9, 1, -0.7])
