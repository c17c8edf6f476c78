"""Any recording that we can read, by its path: `open_recording`."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..points import FARTHEST, SUFFIXES, read_points_far, write_points
from ..recording import Recording, read_recording
from .argoverse import is_argoverse, open_argoverse
from .colmap import is_colmap, open_colmap
from .formats import FORMATS
from .kitti_object import is_kitti_object, open_kitti_object
from .kitti_odometry import is_kitti_odometry, open_kitti_odometry
from .kitti_raw import is_kitti_raw, open_kitti_raw
from .nerfstudio import is_nerfstudio, open_nerfstudio
from .recording_copy import check_recording
from .structure_from_motion import is_image_folder, open_images

_LOOKED_FOR = (
    "recording.json; calib_cam_to_cam.txt with image_02/data (KITTI raw); sequences/NN or calib.txt with image_0 or image_2 (KITTI "
    "odometry); image_2 with calib and velodyne (KITTI object); city_SE3_egovehicle.feather with sensors/lidar (Argoverse 2); "
    "transforms.json (nerfstudio); sparse/0 with cameras, images and points3D (COLMAP); two or more images"
)


def open_recording(path: str | Path, format: str = "auto", work_folder: str | Path | None = None, seed: int = 0) -> Recording:
    """Open a recording of any known format; its images are decoded once, so that bad ones are named before work starts.

    Parameters
    ----------
    path : path
        A file (`recording.json`, `transforms.json`, a point cloud) or a folder.
    format : str
        One of `FORMATS`; `auto` recognises it by its files and logs what it took it for.
    work_folder : path, optional
        Keeps what had to be computed (poses, sparse clouds) by the content of its input, and is made when there is
        something to keep; without it that lies in a temporary folder that goes away when Python ends.
    seed : int
        For whatever is estimated with random samples.

    Returns
    -------
    recording : Recording
        World z up; in metres, except where the log says that the scale is unknown (COLMAP, nerfstudio, images). A bare
        cloud gives no frames and only `points`.

    Raises
    ------
    InputError
        If the path does not exist, is not recognised (lists what was looked for), or what it holds cannot be used.
    """
    path = Path(path)
    if format not in FORMATS:
        raise InputError(f"be one of {', '.join(FORMATS)}", got=format, key="format")
    if not path.exists():
        raise InputError("exist", file=path, remedy="Check the path.")
    if format == "auto":
        format = recognised_format(path)
        logger.info("%s: recognised as %s", path, format)
    work = _temporary_folder() if work_folder is None else Path(work_folder)
    openers: dict[str, Callable[[Path, Path, int], Recording]] = {
        "recording": _open_json,
        "kitti-raw": open_kitti_raw,
        "kitti-odometry": open_kitti_odometry,
        "kitti-object": open_kitti_object,
        "argoverse": open_argoverse,
        "colmap": open_colmap,
        "nerfstudio": open_nerfstudio,
        "images": open_images,
        "cloud": _open_cloud,
    }
    return openers[format](path, work, seed)


def recognised_format(path: str | Path) -> str:
    """Return the format of a file or folder by the files it holds.

    Raises
    ------
    InputError
        If nothing known is found; lists what was looked for.
    """
    path = Path(path)
    if path.is_file():
        if path.suffix.lower() in SUFFIXES:
            return "cloud"
        if path.suffix.lower() == ".json":
            return "nerfstudio" if _is_transforms(path) else "recording"
        if is_kitti_object(path):
            return "kitti-object"
        raise InputError(
            f"be a folder, a .json, or a point cloud ({', '.join(SUFFIXES)})", got=path.suffix or "no suffix", file=path
        )
    tests: dict[str, Callable[[Path], bool]] = {
        "recording": lambda p: bool(_recording_files(p)),
        "kitti-raw": is_kitti_raw,
        "kitti-odometry": is_kitti_odometry,
        "kitti-object": is_kitti_object,
        "argoverse": is_argoverse,
        "nerfstudio": is_nerfstudio,
        "colmap": is_colmap,
        "images": is_image_folder,
    }
    for name, test in tests.items():
        if test(path):
            return name
    raise InputError(
        f"be a recording; looked for {_LOOKED_FOR}", file=path, remedy="Name the folder that holds one of these, or give --format."
    )


def _open_json(path: Path, work_folder: Path, seed: int) -> Recording:
    del work_folder, seed
    if path.is_dir():
        files = _recording_files(path)
        if not files:
            raise InputError("hold a recording.json", file=path, remedy="Name the file.")
        if len(files) > 1:
            raise InputError("hold one recording", got=", ".join(f.name for f in files), file=path, remedy="Name one of the files.")
        path = files[0]
    recording = read_recording(path)
    check_recording(recording)
    return recording


def _recording_files(folder: Path) -> list[Path]:
    """Return `recording.json`, or else all `*.recording.json`."""
    if (folder / "recording.json").is_file():
        return [folder / "recording.json"]
    return sorted(folder.glob("*.recording.json"))


def _is_transforms(file: Path) -> bool:
    """Say whether a JSON file without the key `format` holds transform matrices; a broken one is left to its reader."""
    try:
        data = msgspec.json.decode(file.read_bytes())
    except msgspec.DecodeError:
        return file.name.startswith("transforms")
    frames = data.get("frames") if isinstance(data, dict) else None
    return (
        isinstance(frames, list) and "format" not in data and any(isinstance(f, dict) and "transform_matrix" in f for f in frames)
    )


def _open_cloud(path: Path, work_folder: Path, seed: int) -> Recording:
    """A bare cloud: no frames, so meshes and maps can be built of it but no image augmented."""
    del seed
    if not path.is_file():
        raise InputError(f"be a file ({', '.join(SUFFIXES)})", got="a folder", file=path)
    points = read_points_far(path)
    logger.info("%s: %d points without images: meshes and maps only, and z is taken to be up", path, len(points))
    file = path.resolve()
    if np.abs(points[:, :3]).max() > FARTHEST:
        # Map coordinates: keep whole kilometres apart, so that float32 resolves millimetres.
        origin = np.append(np.round(np.median(points[:, :2], axis=0), -3), 0.0)
        points[:, :3] -= origin
        file = work_folder.resolve() / "cloud.npz"
        write_points(file, points)
        logger.info("%s: moved by (%.0f, %.0f, %.0f) m to a near origin", path, *-origin)
    return Recording((), file.parent, path.stem, file)


def _temporary_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="meniscus-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
