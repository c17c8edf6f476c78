"""KITTI's calibration files, and the camera that they describe in our conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from ..camera import Camera
from ..transforms import as_pose, invert

# KITTI counts pixel positions from the centre of the top-left pixel, we from its corner.
PIXEL_CENTRE = 0.5


def read_calibration(path: Path) -> dict[str, NDArray[np.float64]]:
    """Read `KEY: numbers` lines; lines of words (dates) are left out.

    Raises
    ------
    InputError
        If the file is missing or holds no such line.
    """
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="KITTI keeps it beside the drive; copy it there.") from error
    out: dict[str, NDArray[np.float64]] = {}
    for line in lines:
        key, colon, rest = line.partition(":")
        try:
            out[key.strip()] = np.array([float(word) for word in rest.split()])
        except ValueError:
            continue
        if not colon or len(out[key.strip()]) == 0:
            del out[key.strip()]
    if not out:
        raise InputError("hold lines `KEY: numbers`", file=path)
    return out


def matrix(values: dict[str, NDArray[np.float64]], key: str, shape: tuple[int, int], path: Path) -> NDArray[np.float64]:
    """Return one entry in its shape.

    Raises
    ------
    InputError
        If it is missing, has another number of values, or one is not finite.
    """
    if key not in values:
        raise InputError("be given", file=path, key=key)
    if values[key].size != shape[0] * shape[1] or not np.all(np.isfinite(values[key])):
        raise InputError(f"have {shape[0] * shape[1]} finite numbers", got=values[key].size, file=path, key=key)
    return values[key].reshape(shape)


def rigid(R: NDArray[np.float64], t: NDArray[np.float64], path: Path, key: str) -> NDArray[np.float64]:
    """Return a pose (4, 4) of rotation and translation, naming file and key if it is none."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    try:
        return as_pose(T, key)
    except InputError as error:
        raise error.at(file=path) from error


def read_rigid(path: Path) -> NDArray[np.float64]:
    """Read a file with `R` and `T`, as KITTI raw writes `calib_velo_to_cam.txt`."""
    values = read_calibration(path)
    return rigid(matrix(values, "R", (3, 3), path), matrix(values, "T", (1, 3), path)[0], path, "R")


def rectified_camera(
    P: NDArray[np.float64], width: int, height: int, T_world_rect: NDArray[np.float64], path: Path, key: str
) -> Camera:
    """Return the camera of a rectified projection matrix.

    Parameters
    ----------
    P : (3, 4) float
        Projects points of the rectified frame of camera 0: `P = K [I | t]`.
    width, height : int
        Image size [px].
    T_world_rect : (4, 4) float
        Pose of that frame.

    Raises
    ------
    InputError
        If `P` is no projection matrix of a rectified camera.
    """
    K = P[:, :3]
    if K[0, 0] <= 0 or K[1, 1] <= 0 or np.abs(K[[0, 1, 2, 2], [1, 0, 0, 1]]).max() > 1e-6 or abs(K[2, 2] - 1) > 1e-6:
        raise InputError("be a rectified projection matrix", got=P.tolist(), file=path, key=key)
    # The whole offset K^-1 P[:, 3], not only its x: camera 2 of KITTI stands 3 mm before camera 0.
    T_camera_rect = np.eye(4)
    T_camera_rect[:3, 3] = np.linalg.solve(K, P[:, 3])
    pose = T_world_rect @ invert(T_camera_rect)
    fx, fy, cx, cy = (float(v) for v in (K[0, 0], K[1, 1], K[0, 2] + PIXEL_CENTRE, K[1, 2] + PIXEL_CENTRE))
    return Camera("PINHOLE", width, height, pose, fx, fy, cx, cy)
