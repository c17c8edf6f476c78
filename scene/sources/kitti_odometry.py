"""Sequences of the KITTI odometry benchmark: sequences/NN/{image_0..3, velodyne, calib.txt} and poses/NN.txt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..images import read_raw
from ..points import read_points
from ..recording import Frame, PointsFile, Recording, StereoFile
from ..transforms import invert
from .gravity import R_LEVEL_CAMERA, mean_up, spread, turn_to_z, up_from_ground
from .kitti_calibration import matrix, read_calibration, rectified_camera, rigid
from .odometry import lidar_poses
from .recording_copy import check_recording
from .stereo import stereo_points


def is_kitti_odometry(path: Path) -> bool:
    """Say whether a folder is a sequence or holds some."""
    return bool(_sequences(path))


def open_kitti_odometry(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open a sequence of KITTI odometry.

    Parameters
    ----------
    path : path
        The sequence's folder, or the root with `sequences` and `poses` if it holds only one.
    work_folder : Path
        Keeps poses that had to be estimated.
    seed : int
        For the ground plane's RANSAC.

    Returns
    -------
    recording : Recording
        Colour cameras 2 and 3 if they are there, else the grey ones 0 and 1. The world is the first camera 0 turned to
        x forward, y left, z up, and levelled by the ground along the drive, in sweeps or, without them, stereo pairs.

    Raises
    ------
    InputError
        If calibration or images are missing, poses are and there are no sweeps to estimate them, or their numbers differ.
    """
    path = Path(path)
    sequences = _sequences(path)
    if not sequences:
        raise InputError("hold calib.txt with image_0 or image_2", file=path, remedy="Name a sequence of KITTI odometry.")
    if len(sequences) > 1:
        raise InputError(
            "hold one sequence", got=", ".join(s.name for s in sequences), file=path, remedy="Name the sequence's folder."
        )
    folder = sequences[0]
    calib_file = folder / "calib.txt"
    calib = read_calibration(calib_file)
    left, right = (2, 3) if (folder / "image_2").is_dir() else (0, 1)
    images = _files(folder / f"image_{left}", (".png", ".jpg"))
    seconds = {file.stem: file for file in _files(folder / f"image_{right}", (".png", ".jpg"))}
    sweeps = {file.stem: file for file in _files(folder / "velodyne", (".bin", ".npz"))}
    if not images:
        raise InputError("hold images", file=folder / f"image_{left}")
    T_cam0_velo = None
    if sweeps:
        Tr = matrix(calib, "Tr", (3, 4), calib_file)
        T_cam0_velo = rigid(Tr[:, :3], Tr[:, 3], calib_file, "Tr")
    poses = _read_poses(folder, images)
    if poses is None:
        images = [image for image in images if image.stem in sweeps]
        if not images:
            raise InputError(
                "have poses (poses/NN.txt or poses.txt) or velodyne sweeps to estimate them",
                got="neither",
                file=folder,
                remedy="--format images on its image folder estimates poses up to scale.",
            )
    height, width = read_raw(images[0]).shape[:2]

    def frame_at(image: Path, T_world_cam0: NDArray[np.float64]) -> Frame:
        def camera(number: int):
            P = matrix(calib, f"P{number}", (3, 4), calib_file)
            return rectified_camera(P, width, height, T_world_cam0, calib_file, f"P{number}")

        second, sweep = seconds.get(image.stem), sweeps.get(image.stem)
        return Frame(
            image,
            camera(left),
            response="srgb",
            stereo=None if second is None else StereoFile(second, camera(right)),
            points=None if sweep is None or T_cam0_velo is None else PointsFile(sweep, T_world_cam0 @ T_cam0_velo),
        )

    recording = Recording(tuple(frame_at(image, np.eye(4)) for image in images), folder.resolve(), f"sequence_{folder.name}")
    check_recording(recording)
    if poses is None:
        assert T_cam0_velo is not None
        logger.info("%s: KITTI odometry, %d frames, no poses: LiDAR odometry", folder, len(images))
        T = lidar_poses([sweeps[image.stem] for image in images], work_folder)
        poses = [T_cam0_velo @ pose @ invert(T_cam0_velo) for pose in T]
    else:
        logger.info("%s: KITTI odometry, %d frames, recorded poses", folder, len(images))
    T_world_first = np.eye(4)
    T_world_first[:3, :3] = _level(list(recording.frames), poses, seed)
    frames = tuple(frame_at(image, T_world_first @ T) for image, T in zip(images, poses, strict=True))
    return replace(recording, frames=frames)


def _level(frames: list[Frame], T_first_cam0: list[NDArray[np.float64]], seed: int) -> NDArray[np.float64]:
    """Return the rotation from the first camera 0 to the z-up world; the frames' own poses must be about camera 0."""
    ups = []
    for i in spread(len(frames)):
        frame = frames[i]
        if frame.points is not None:
            sweep = read_points(frame.points.file)[:, :3].astype(np.float64)
            points = sweep @ frame.points.T_world_points[:3, :3].T
        elif frame.stereo is not None:
            points = stereo_points(frame, max_depth=25.0).points_world
        else:
            continue
        up = up_from_ground(points, np.array([0.0, -1.0, 0.0]), seed=seed)
        ups.append(None if up is None else T_first_cam0[i][:3, :3] @ up)
    up = mean_up(ups)
    if up is None:
        logger.info("no ground plane found: the first camera is taken to be level")
        return R_LEVEL_CAMERA
    logger.info("levelled by the ground planes along the drive (%.2f degrees)", np.rad2deg(np.arccos(min(1.0, -up[1]))))
    return turn_to_z(R_LEVEL_CAMERA @ up) @ R_LEVEL_CAMERA


def _read_poses(folder: Path, images: list[Path]) -> list[NDArray[np.float64]] | None:
    """Read twelve numbers a line, one line per image; None if there is no such file."""
    choices = (folder.parent.parent / "poses" / f"{folder.name}.txt", folder / "poses.txt")
    file = next((f for f in choices if f.exists()), None)
    if file is None:
        return None
    poses = []
    for number, line in enumerate(file.read_text().splitlines(), start=1):
        if not line.strip():
            continue
        try:
            row = np.array([float(word) for word in line.split()])
        except ValueError as error:
            raise InputError("hold numbers", got=error, file=file, key=f"line {number}") from error
        if row.size != 12:
            raise InputError("hold 12 numbers", got=row.size, file=file, key=f"line {number}")
        poses.append(rigid(row.reshape(3, 4)[:, :3], row.reshape(3, 4)[:, 3], file, f"line {number}"))
    numbers = [int(image.stem) if image.stem.isdigit() else len(poses) for image in images]
    if len(poses) != len(images) and max(numbers) < len(poses):
        # Part of a sequence: images carry the numbers of their lines.
        return [poses[number] for number in numbers]
    if len(poses) != len(images):
        raise InputError(
            f"have one line per image, {len(images)}", got=len(poses), file=file, remedy="Give the poses of this sequence."
        )
    return poses


def _sequences(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    path = path.resolve()
    if (path / "calib.txt").exists() and any((path / name).is_dir() for name in ("image_0", "image_2")):
        return [path]
    parent = path / "sequences"
    return sorted(s for folder in parent.iterdir() for s in _sequences(folder)) if parent.is_dir() else []


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    return sorted(f.resolve() for f in folder.iterdir() if f.suffix.lower() in suffixes) if folder.is_dir() else []
