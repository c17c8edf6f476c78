"""COLMAP models (cameras, images, points3D; binary or text), read through pycolmap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..camera import Camera
from ..points import write_points
from ..recording import Frame, Recording
from ..transforms import invert, transform_points
from .gravity import levelled_world
from .recording_copy import check_recording

# A point seen by three cameras within 2 px is one; of those seen by two, every tenth is a mismatch.
_MIN_TRACK, _MAX_ERROR_PX = 3, 2.0
# Which parameters of ours COLMAP's models hold, in their order; f stands for fx and fy.
_PARAMETERS = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k1"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
}


def is_colmap(path: Path) -> bool:
    """Say whether a folder is, or holds, a COLMAP model."""
    return _model(path) is not None


def open_colmap(path: str | Path, work_folder: Path, seed: int = 0) -> Recording:
    """Open a COLMAP model with its images.

    Parameters
    ----------
    path : path
        The project (with `sparse/0` and `images`), or the model's own folder with the images near it.
    work_folder : Path
        Gets the sparse points in the levelled world.
    seed : int
        Not used; reading is exact.

    Returns
    -------
    recording : Recording
        One frame per registered image, by name, and the sparse points seen at least three times. The scale is the model's.
        The world is turned so that z is up, on the assumption that the photographs were taken upright; a model whose z
        is within 5 degrees of that already keeps its axes.

    Raises
    ------
    InputError
        If there is no model, it is damaged, its camera model is not one of ours, or none of its images is there.
    """
    del seed
    path = Path(path)
    model = _model(path)
    if model is None:
        raise InputError(
            "hold a COLMAP model (cameras, images, points3D as .bin or .txt)", file=path, remedy="Name the folder with sparse/0."
        )
    reconstruction = read_model(model)
    names = sorted(image.name for image in reconstruction.images.values() if image.has_pose)
    if not names:
        raise InputError("hold registered images", got="none", file=model)
    places = (path / "images", path, model / "images", model.parent / "images", model.parent.parent / "images", model.parent.parent)
    folder = next((p for p in places if any((p / name).is_file() for name in names)), None)
    if folder is None:
        raise InputError(
            "have its images beside it", got=f"no {names[0]} in {path / 'images'}", file=model, remedy="Put them into images/."
        )
    logger.info("%s: COLMAP model of %d images; its scale is taken as metres, as nothing says otherwise", model, len(names))
    recording = recording_of(reconstruction, folder, work_folder / "colmap_points.npz", path.resolve().name)
    check_recording(recording)
    return recording


def read_model(folder: Path) -> Any:
    """Read a model folder as a `pycolmap.Reconstruction`.

    Raises
    ------
    InputError
        If a file is damaged or missing.
    """
    import pycolmap

    try:
        return pycolmap.Reconstruction(str(folder))
    except Exception as error:  # pycolmap raises what COLMAP's checks happen to throw
        raise InputError(
            "be a whole COLMAP model", got=str(error).split("] ")[-1], file=folder, remedy="Export it again."
        ) from error


def recording_of(reconstruction: Any, image_folder: Path, points_file: Path, name: str, scale: float = 1.0) -> Recording:
    """Return a reconstruction as a recording in a levelled world.

    Parameters
    ----------
    reconstruction : pycolmap.Reconstruction
        With registered images.
    image_folder : Path
        Their names are relative to it; images that are not there are left out and counted in the log.
    points_file : Path
        Written with the sparse points.
    name : str
        The recording's.
    scale : float
        Metres per unit of the reconstruction.
    """
    images = sorted((i for i in reconstruction.images.values() if i.has_pose), key=lambda i: i.name)
    present = [image for image in images if (image_folder / image.name).is_file()]
    if len(present) < len(images):
        logger.warning(
            "%s: %d of %d images of the model are not there and left out", image_folder, len(images) - len(present), len(images)
        )
    poses = [_pose(image) for image in present]
    T_level = levelled_world(np.stack([T[:3, :3] for T in poses]))
    frames = []
    for image, pose in zip(present, poses, strict=True):
        pose = T_level @ pose
        pose[:3, 3] *= scale
        frames.append(Frame((image_folder / image.name).resolve(), camera_of(image.camera, pose), response=None))
    tracks = [p for p in reconstruction.points3D.values() if p.track.length() >= _MIN_TRACK and p.error <= _MAX_ERROR_PX]
    points = None
    if tracks:
        xyz = transform_points(T_level, np.stack([p.xyz for p in tracks])) * scale
        write_points(points_file, xyz[np.lexsort(xyz.T)])
        points = points_file.resolve()
    else:
        logger.warning("%s: no sparse point is seen by three images within 2 px", name)
    return Recording(tuple(frames), image_folder.resolve(), name, points)


def camera_of(camera: Any, T_world_camera: NDArray[np.float64]) -> Camera:
    """Return a `pycolmap.Camera` as ours; both count pixels from the image's corner.

    Raises
    ------
    InputError
        If its model has more distortion than ours.
    """
    kind = camera.model.name
    if kind not in _PARAMETERS:
        raise InputError(
            f"be one of {', '.join(_PARAMETERS)}",
            got=kind,
            key="the camera model",
            remedy="Undistort the images (colmap image_undistorter).",
        )
    values = dict(zip(_PARAMETERS[kind], (float(p) for p in camera.params), strict=True))
    if "f" in values:
        values["fx"] = values["fy"] = values.pop("f")
    model = "OPENCV" if any(values.get(k) for k in ("k1", "k2", "p1", "p2")) else "PINHOLE"
    return Camera(model, camera.width, camera.height, T_world_camera, **values)


def _pose(image: Any) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3] = image.cam_from_world().matrix()
    return invert(T)


def _model(path: Path) -> Path | None:
    if not path.is_dir():
        return None
    places = [path, path / "sparse" / "0", path / "sparse", path / "colmap" / "sparse" / "0"]
    for place in places:
        for suffix in (".bin", ".txt"):
            if all((place / (name + suffix)).is_file() for name in ("cameras", "images", "points3D")):
                return place
    return None
