"""Single frames of KITTI's object benchmark: image_2, calib, velodyne and label_2, each with a file per frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..boxes import write_boxes
from ..images import read_raw
from ..recording import BoxesFile, Frame, PointsFile, Recording, StereoFile
from ..transforms import invert
from .kitti_boxes import read_object_labels
from .kitti_calibration import matrix, read_calibration, rectified_camera, rigid
from .kitti_raw import levelled
from .recording_copy import check_recording

_FOLDERS = ("image_2", "image_3", "velodyne", "label_2", "calib")


def is_kitti_object(path: Path) -> bool:
    """Say whether a path is a folder with image_2, calib and velodyne, or a file in one of its folders."""
    root = path.parent.parent if path.is_file() and path.parent.name in _FOLDERS else path
    return all((root / name).is_dir() for name in ("image_2", "calib", "velodyne"))


def open_kitti_object(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open one frame of the object benchmark; its frames belong to different places, so no two make a recording.

    Parameters
    ----------
    path : path
        A file of the frame (its image, sweep, calibration or label), or the folder above if it holds one frame.
    work_folder : Path
        Gets the boxes.
    seed : int
        For the ground plane's RANSAC.

    Returns
    -------
    recording : Recording
        One frame; the world is that of the scanner, levelled by its ground. Labelled objects count as moving.

    Raises
    ------
    InputError
        If the folder holds several frames, or a file of the frame is missing or damaged.
    """
    path = Path(path)
    root = (path.parent.parent if path.is_file() else path).resolve()
    images = sorted(file for file in (root / "image_2").glob("*") if file.suffix in (".png", ".jpg"))
    images = [file for file in images if file.stem == path.stem] if path.is_file() else images
    if not images:
        raise InputError("belong to an image", file=path, remedy=f"Its image would be in {root / 'image_2'}.")
    if len(images) > 1:
        remedy = f"They are places of their own: name one, as {images[0]}."
        raise InputError("hold one frame", got=f"{len(images)} images", file=path, remedy=remedy)
    image = images[0].resolve()
    cam_file = root / "calib" / f"{image.stem}.txt"
    calib = read_calibration(cam_file)
    R_rect = rigid(matrix(calib, "R0_rect", (3, 3), cam_file), np.zeros(3), cam_file, "R0_rect")
    Tr = matrix(calib, "Tr_velo_to_cam", (3, 4), cam_file)
    T_rect_velo = R_rect @ rigid(Tr[:, :3], Tr[:, 3], cam_file, "Tr_velo_to_cam")
    sweep = root / "velodyne" / f"{image.stem}.bin"
    (T_world_velo,) = levelled([np.eye(4)], [sweep], seed)
    T_world_rect = T_world_velo @ invert(T_rect_velo)
    height, width = read_raw(image).shape[:2]

    def camera(name: str):
        return rectified_camera(matrix(calib, name, (3, 4), cam_file), width, height, T_world_rect, cam_file, name)

    right, label = root / "image_3" / image.name, root / "label_2" / f"{image.stem}.txt"
    boxes = None
    if label.exists():
        file = work_folder.resolve() / "boxes" / f"{image.stem}.json"
        write_boxes(file, read_object_labels(label))
        boxes = BoxesFile(file, T_world_rect)
    frame = Frame(
        image,
        camera("P2"),
        response="srgb",
        points=PointsFile(sweep, T_world_velo),
        stereo=StereoFile(right.resolve(), camera("P3")) if right.exists() else None,
        boxes=boxes,
    )
    recording = Recording((frame,), root, f"object_{image.stem}")
    check_recording(recording)
    logger.info("%s: one frame of KITTI's object benchmark%s", image, "" if boxes is None else ", with its boxes")
    return recording
