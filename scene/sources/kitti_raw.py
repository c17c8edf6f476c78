"""Drives of the KITTI raw data set: DATE/calib_*.txt and DATE/DATE_drive_NNNN_sync/{image_02, velodyne_points, oxts,
tracklet_labels.xml}.

Geiger, Lenz, Stiller, Urtasun: Vision meets Robotics: The KITTI Dataset, IJRR 2013. The sweeps are taken as they are: at
10 m/s the scanner's turn moves points beside the car by a few centimetres within the camera's view.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..boxes import write_boxes
from ..points import read_points
from ..recording import BoxesFile, Frame, PointsFile, Recording, StereoFile
from ..transforms import invert
from .gravity import mean_up, spread, turn_to_z, up_from_ground
from .kitti_boxes import read_tracklets
from .kitti_calibration import matrix, read_calibration, read_rigid, rectified_camera, rigid
from .odometry import lidar_poses
from .recording_copy import check_recording

_EARTH_RADIUS = 6378137.0
_ORIGIN = np.eye(4)


def is_kitti_raw(path: Path) -> bool:
    """Say whether a folder is a drive, a date, or holds one date."""
    return bool(_drives(path))


def open_kitti_raw(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open a drive of KITTI raw (synchronised, rectified).

    Parameters
    ----------
    path : path
        The drive's folder, its date's folder, or the folder above; where it holds several drives, one must be named.
    work_folder : Path
        Keeps the estimated poses, and the boxes.
    seed : int
        For the ground plane's RANSAC.

    Returns
    -------
    recording : Recording
        Colour camera 2, with camera 3 as the second of a stereo pair and the sweeps where they exist. The world is z up:
        east and north of the first position if there is `oxts` (position and attitude by GPS and inertial unit); else
        the frame of the first sweep, levelled by the ground along the drive, with poses by LiDAR odometry. Boxes are
        those of `tracklet_labels.xml`, where the drive has one.

    Raises
    ------
    InputError
        If calibration, images, or both oxts and sweeps are missing, or a file is damaged.
    """
    path = Path(path)
    drives = _drives(path)
    if not drives:
        raise InputError("hold calib_cam_to_cam.txt and a drive with image_02/data", file=path, remedy="Name a drive of KITTI raw.")
    if len(drives) > 1:
        names = ", ".join(d.name for d in drives)
        raise InputError("hold one drive", got=names, file=path, remedy="Name the drive's folder.")
    drive = drives[0].resolve()
    calibration = drive if (drive / "calib_cam_to_cam.txt").exists() else drive.parent
    cam_file = calibration / "calib_cam_to_cam.txt"
    cam = read_calibration(cam_file)
    R_rect = rigid(matrix(cam, "R_rect_00", (3, 3), cam_file), np.zeros(3), cam_file, "R_rect_00")
    width, height = (int(n) for n in matrix(cam, "S_rect_02", (1, 2), cam_file)[0])

    images = _by_stem(drive / "image_02" / "data", (".png", ".jpg"))
    right = _by_stem(drive / "image_03" / "data", (".png", ".jpg"))
    sweeps = _by_stem(drive / "velodyne_points" / "data", (".bin", ".npz"))
    oxts = _by_stem(drive / "oxts" / "data", (".txt",))
    boxed: dict[str, Path] = {}
    T_rect_velo = R_rect @ read_rigid(calibration / "calib_velo_to_cam.txt") if sweeps or oxts else _ORIGIN

    def frame_at(stem: str, T_world_velo: NDArray[np.float64]) -> Frame:
        T_world_rect = T_world_velo @ invert(T_rect_velo)
        camera = rectified_camera(matrix(cam, "P_rect_02", (3, 4), cam_file), width, height, T_world_rect, cam_file, "P_rect_02")
        stereo = points = None
        if stem in right:
            P = matrix(cam, "P_rect_03", (3, 4), cam_file)
            stereo = StereoFile(right[stem], rectified_camera(P, width, height, T_world_rect, cam_file, "P_rect_03"))
        if stem in sweeps:
            points = PointsFile(sweeps[stem], T_world_velo)
        boxes = BoxesFile(boxed[stem], T_world_velo) if stem in boxed else None
        return Frame(images[stem], camera, response="srgb", stereo=stereo, points=points, boxes=boxes)

    imu_file = calibration / "calib_imu_to_velo.txt"
    by_oxts = bool(oxts) and imu_file.exists()
    if not by_oxts and not sweeps:
        raise InputError(
            "hold oxts/data with calib_imu_to_velo.txt, or velodyne_points/data",
            got="neither",
            file=drive,
            remedy="Without them there are no poses in metres; --format images on image_02/data gives them up to scale.",
        )
    # Without oxts a frame needs its own sweep to have a pose.
    stems = [stem for stem in images if stem in (oxts if by_oxts else sweeps)]
    if not stems:
        raise InputError("have names in common with the images", file=drive / ("oxts" if by_oxts else "velodyne_points"))
    boxed |= _tracklets(drive, stems, work_folder)
    if len(stems) < len(images):
        logger.info("%s: %d of %d images have a pose and are used", drive, len(stems), len(images))
    recording = Recording(tuple(frame_at(stem, _ORIGIN) for stem in stems), drive, drive.name)
    check_recording(recording)

    if by_oxts:
        T_imu_velo = invert(read_rigid(imu_file))
        poses = [T @ T_imu_velo for T in oxts_poses([oxts[stem] for stem in stems])]
        logger.info("%s: KITTI raw, %d frames, poses of its GPS and inertial unit", drive, len(stems))
    else:
        logger.info("%s: KITTI raw, %d frames, no oxts: poses by LiDAR odometry", drive, len(stems))
        files = [sweeps[stem] for stem in stems]
        poses = levelled(lidar_poses(files, work_folder), files, seed)
    frames = tuple(frame_at(stem, T) for stem, T in zip(stems, poses, strict=True))
    return replace(recording, frames=frames)


def _tracklets(drive: Path, stems: list[str], work_folder: Path) -> dict[str, Path]:
    """Write the boxes of the drive's tracklets frame by frame; nothing if it has none."""
    file = drive / "tracklet_labels.xml"
    if not file.exists():
        return {}
    boxes = read_tracklets(file)
    logger.info("%s: boxes of %d images", file, len(boxes))
    out = {stem: work_folder.resolve() / "boxes" / f"{stem}.json" for stem in stems}
    for stem, target in out.items():
        write_boxes(target, boxes.get(int(stem), ()) if stem.isdigit() else ())
    return out


def levelled(T_first_velo: list[NDArray[np.float64]], sweeps: list[Path], seed: int) -> list[NDArray[np.float64]]:
    """Turn poses about the first scanner so that the ground along the drive is level; as they are if none is found."""
    ups = []
    for i in spread(len(sweeps)):
        up = up_from_ground(read_points(sweeps[i])[:, :3], np.array([0.0, 0.0, 1.0]), seed=seed)
        ups.append(None if up is None else T_first_velo[i][:3, :3] @ up)
    up = mean_up(ups)
    if up is None:
        logger.info("no ground plane found in the sweeps: the first scanner is taken to be level")
        return T_first_velo
    logger.info("levelled by the ground planes along the drive (%.2f degrees)", np.rad2deg(np.arccos(min(1.0, up[2]))))
    T = np.eye(4)
    T[:3, :3] = turn_to_z(up)
    return [T @ pose for pose in T_first_velo]


def oxts_poses(files: list[Path]) -> list[NDArray[np.float64]]:
    """Return `T_world_imu` of OXTS files, world = east, north, up about the first position.

    Position by the Mercator projection at the latitude of the first file and attitude by roll, pitch and yaw, as in the
    KITTI raw development kit (`convertOxtsToPose.m`).

    Raises
    ------
    InputError
        If a file has fewer than six numbers or one of them is not finite.
    """
    poses: list[NDArray[np.float64]] = []
    scale = 1.0
    origin = np.zeros(3)
    for i, file in enumerate(files):
        try:
            values = np.array([float(word) for word in file.read_text().split()[:6]])
        except ValueError as error:
            raise InputError("hold numbers", got=error, file=file) from error
        if len(values) < 6 or not np.all(np.isfinite(values)):
            raise InputError("begin with lat, lon, alt, roll, pitch, yaw", got=values.tolist(), file=file)
        lat, lon, alt, roll, pitch, yaw = values
        if i == 0:
            scale = np.cos(np.deg2rad(lat))
        x = scale * _EARTH_RADIUS * np.deg2rad(lon)
        y = scale * _EARTH_RADIUS * np.log(np.tan(np.pi / 4 + np.deg2rad(lat) / 2))
        position = np.array([x, y, alt])
        if i == 0:
            origin = position
        T = np.eye(4)
        T[:3, :3] = _about_z(yaw) @ _about_y(pitch) @ _about_x(roll)
        T[:3, 3] = position - origin
        poses.append(T)
    return poses


def _drives(path: Path) -> list[Path]:
    """Return the drives at, in, or one date below a folder."""
    if not path.is_dir():
        return []
    if (path / "image_02" / "data").is_dir():
        return [path] if any((p / "calib_cam_to_cam.txt").exists() for p in (path, path.resolve().parent)) else []
    if (path / "calib_cam_to_cam.txt").exists():
        return sorted(d for d in path.iterdir() if (d / "image_02" / "data").is_dir())
    return sorted(d for date in path.iterdir() if (date / "calib_cam_to_cam.txt").exists() for d in _drives(date))


def _by_stem(folder: Path, suffixes: tuple[str, ...]) -> dict[str, Path]:
    """Return the files of a folder by stem, in order; nothing if there is no such folder."""
    if not folder.is_dir():
        return {}
    return {file.stem: file.resolve() for file in sorted(folder.iterdir()) if file.suffix.lower() in suffixes}


def _about_x(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def _about_y(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle: float) -> NDArray[np.float64]:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
