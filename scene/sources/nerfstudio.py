"""`transforms.json` as nerfstudio and instant-ngp write it: OpenGL camera axes (x right, y up, z backward)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..camera import Camera
from ..images import read_raw
from ..points import read_points, write_points
from ..recording import Frame, Recording
from ..transforms import as_pose, transform_points
from .gravity import levelled_world
from .recording_copy import check_recording
from .structure_from_motion import sparse_points

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
_NAMES = ("transforms.json", "transforms_train.json")
_MODELS = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "SIMPLE_RADIAL", "RADIAL")


def is_nerfstudio(path: Path) -> bool:
    """Say whether a folder holds a transforms.json."""
    return any((path / name).is_file() for name in _NAMES)


def open_nerfstudio(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open a transforms.json with its images.

    Parameters
    ----------
    path : path
        The JSON or its folder.
    work_folder : Path
        Keeps the sparse points, which are triangulated between the given poses if the file names no cloud.
    seed : int
        For triangulation.

    Returns
    -------
    recording : Recording
        The frames whose image exists. The scale is the file's. The world is kept if its z is within 30 degrees of the
        vertical that upright photographs suggest, as the format promises z up; else it is turned.

    Raises
    ------
    InputError
        If the JSON is damaged, a needed key is missing or of the wrong kind, the camera model is not one of ours, or no
        image is there.
    """
    path = Path(path)
    file = path if path.is_file() else next((path / n for n in _NAMES if (path / n).is_file()), path / _NAMES[0])
    data = _read(file)
    listed = data.get("frames")
    if not isinstance(listed, list) or not listed:
        raise InputError("be a list of frames", got=listed, file=file, key="frames")
    frames: list[Frame] = []
    for i, entry in enumerate(listed):
        try:
            frame = _frame(file.parent, data, entry, f"frames[{i}]")
        except InputError as error:
            raise error.at(file=file) from error
        if frame is not None:
            frames.append(frame)
    if not frames:
        raise InputError("name images that exist", got="none", file=file, remedy="Put the images where file_path says.")
    if len(frames) < len(listed):
        logger.info("%s: %d of %d listed images exist and are used", file, len(frames), len(listed))
    frames.sort(key=lambda frame: frame.image)
    T_level = levelled_world(np.stack([f.camera.T_world_camera[:3, :3] for f in frames]), least_tilt_deg=30.0)
    frames = [Frame(f.image, f.camera.moved_to(T_level @ f.camera.T_world_camera), response=None) for f in frames]
    logger.info("%s: transforms.json, %d frames; its scale is taken as metres, as nothing says otherwise", file, len(frames))
    recording = Recording(tuple(frames), file.parent.resolve(), file.parent.resolve().name)
    check_recording(recording)
    points = work_folder.resolve() / "nerfstudio_points.npz"
    if data.get("ply_file_path"):
        cloud = read_points(file.parent / str(data["ply_file_path"]))
        write_points(points, transform_points(T_level, cloud[:, :3].astype(np.float64)))
    else:
        found = sparse_points(recording, work_folder, seed)
        if found is None:
            return recording
        points = found
    return Recording(recording.frames, recording.root, recording.name, points)


def _read(file: Path) -> dict[str, Any]:
    try:
        data = msgspec.json.decode(file.read_bytes())
    except FileNotFoundError as error:
        raise InputError("exist", file=file, remedy="Check the path.") from error
    except msgspec.DecodeError as error:
        raise InputError("be JSON", got=error, file=file, remedy="Mend the file.") from error
    if not isinstance(data, dict):
        raise InputError("be an object", got=type(data).__name__, file=file)
    return data


def _frame(folder: Path, data: dict[str, Any], entry: Any, key: str) -> Frame | None:
    """Return one frame in OpenCV axes, or None if its image is not there; keys of the frame win over those of the file."""
    if not isinstance(entry, dict):
        raise InputError("be an object", got=entry, key=key)
    values = {**data, **entry}
    name = values.get("file_path")
    if not isinstance(name, str) or not name:
        raise InputError("be a path", got=name, key=f"{key}.file_path")
    # The synthetic NeRF scenes leave the suffix out.
    image = next((p for p in (folder / name, folder / f"{name}.png", folder / f"{name}.jpg") if p.is_file()), None)
    if image is None:
        return None
    if "transform_matrix" not in values:
        raise InputError("be given", key=f"{key}.transform_matrix")
    pose = as_pose(values["transform_matrix"], f"{key}.transform_matrix") @ _FLIP
    return Frame(image.resolve(), _camera(values, image, pose, key), response=None)


def _camera(values: dict[str, Any], image: Path, pose: NDArray[np.float64], key: str) -> Camera:
    model = values.get("camera_model", "OPENCV")
    if model not in _MODELS:
        raise InputError(f"be one of {', '.join(_MODELS)}", got=model, key="camera_model", remedy="Undistort the images first.")
    if any(_number(values, name, key, 0.0) for name in ("k3", "k4")):
        raise InputError(
            "be 0", got=[values.get("k3"), values.get("k4")], key=f"{key}.k3, k4", remedy="Undistort the images first."
        )
    if "w" in values and "h" in values:
        width, height = int(_number(values, "w", key)), int(_number(values, "h", key))
    else:
        height, width = read_raw(image).shape[:2]
    if "fl_x" in values:
        fx = _number(values, "fl_x", key)
    elif "camera_angle_x" in values:
        fx = width / (2 * np.tan(_number(values, "camera_angle_x", key) / 2))
    else:
        raise InputError("be given", key=f"{key}.fl_x or camera_angle_x")
    fy = _number(values, "fl_y", key, fx)
    if not (fx > 0 and fy > 0):
        raise InputError("be positive", got=(fx, fy), key=f"{key}.fl_x, fl_y")
    cx, cy = _number(values, "cx", key, width / 2), _number(values, "cy", key, height / 2)
    distortion = {name: _number(values, name, key, 0.0) for name in ("k1", "k2", "p1", "p2")}
    return Camera("OPENCV" if any(distortion.values()) else "PINHOLE", width, height, pose, fx, fy, cx, cy, **distortion)


def _number(values: dict[str, Any], name: str, key: str, default: float | None = None) -> float:
    value = values.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise InputError("be a number", got=value, key=f"{key}.{name}")
    return float(value)
