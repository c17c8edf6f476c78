"""Poses of LiDAR sweeps when nobody recorded them: each sweep is registered to the map of those before it.

Generalised ICP (Segal, Haehnel, Thrun, RSS 2009) as `small_gicp` implements it, on one thread, so that the same sweeps
give the same poses everywhere. The start is the last motion repeated. Moving traffic is kept out by a correspondence
distance that shrinks to 0.3 m, and by judging a result only on upright surfaces, as the ground fits any motion along it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import read_json, write_json
from materials.foundation.progress import logger, tracked

from ..points import read_points
from ..transforms import as_pose, invert, transform_points

# Returns nearer than this belong to the car itself; farther than 80 m they are too few to have a surface.
_NEAREST, _FARTHEST = 2.5, 80.0
_VOXEL = 0.25
_MAP_SWEEPS = 8
_CORRESPONDENCES = (2.0, 1.0, 0.5, 0.3)
# A wrong local minimum fits 0.2 of the upright points where the right one fits 0.6 (measured on KITTI at 0 to 9 m a step).
_POOR = 0.35
_GUESSES = (0.0, 4.0, 8.0)


@dataclass(frozen=True)
class _Sweep:
    cloud: Any
    tree: Any


def lidar_poses(files: list[Path], work_folder: Path | None = None) -> list[NDArray[np.float64]]:
    """Return the pose of each sweep in the frame of the first.

    Parameters
    ----------
    files : list of path
        Sweeps in order of time: x forward, y left, z up about the scanner.
    work_folder : path, optional
        Keeps the result by the content of the sweeps, so that it is not computed again.

    Returns
    -------
    T_first_sweep : list of (4, 4) float64
        The first is the identity.

    Raises
    ------
    InputError
        If a sweep cannot be read or has fewer than 500 points between 2.5 and 80 m.

    Notes
    -----
    Steps of up to about 8 m are found from standstill; drift is not corrected by closing loops.
    """
    key = _key(files)
    cache = None if work_folder is None else Path(work_folder) / "lidar_poses.json"
    if cache is not None and cache.exists():
        saved = read_json(cache)
        if isinstance(saved, dict) and saved.get("key") == key:
            return [as_pose(T, "T_first_sweep") for T in saved["T_first_sweep"]]
    poses: list[NDArray[np.float64]] = [np.eye(4)]
    recent = [_prepare(_near(files[0]))]
    for file in tracked(files[1:], "LiDAR odometry", total=len(files) - 1):
        sweep = _prepare(_near(file))
        step = invert(poses[-2]) @ poses[-1] if len(poses) > 1 else np.eye(4)
        # The map is built about the last pose: far along a drive, coordinates stay small and voxels stay the same.
        merged = np.concatenate(
            [
                transform_points(invert(poses[-1]) @ T, s.cloud.points()[:, :3])
                for T, s in zip(poses[-len(recent) :], recent, strict=True)
            ]
        )
        target = _prepare(merged)
        found, share = _register(target, sweep, step)
        # At the start the speed is unknown, and a cut in the recording breaks it: try others before believing a poor fit.
        if len(poses) == 1 or share < _POOR:
            for metres in _GUESSES:
                guess = np.eye(4)
                guess[0, 3] = metres
                other, other_share = _register(target, sweep, guess)
                # Strictly better by a margin: equal fits are the same minimum, and the prediction is the steadier name.
                if other_share > share + 0.01:
                    found, share = other, other_share
        if share < _POOR:
            logger.warning("%s: LiDAR odometry is uncertain here, only %.0f %% of the upright points fit", file, 100 * share)
        poses.append(as_pose(poses[-1] @ found, "T_first_sweep"))
        recent = [*recent, sweep][-_MAP_SWEEPS:]
    if cache is not None:
        write_json(cache, {"key": key, "T_first_sweep": [T.tolist() for T in poses]})
    return poses


def _register(target: _Sweep, sweep: _Sweep, guess: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the motion from coarse to fine correspondences, and the share of upright points within 0.2 m of the map's."""
    import small_gicp

    T = guess
    for distance in _CORRESPONDENCES:
        T = small_gicp.align(
            target.cloud,
            sweep.cloud,
            target.tree,
            T,
            registration_type="GICP",
            max_correspondence_distance=distance,
            num_threads=1,
            max_iterations=30,
            translation_epsilon=1e-4,
            rotation_epsilon=1e-4,
        ).T_target_source
    from scipy.spatial import cKDTree

    moved = transform_points(T, _upright(sweep))
    distance, _ = cKDTree(_upright(target)).query(moved, distance_upper_bound=0.2)
    return T, float(np.mean(np.isfinite(distance)))


def _upright(sweep: _Sweep) -> NDArray[np.float64]:
    points, normals = sweep.cloud.points()[:, :3], sweep.cloud.normals()[:, :3]
    upright = points[np.abs(normals[:, 2]) < 0.5]
    return upright if len(upright) else points


def _near(file: Path) -> NDArray[np.float64]:
    points = read_points(file)[:, :3].astype(np.float64)
    distance = np.linalg.norm(points, axis=1)
    points = points[(distance > _NEAREST) & (distance < _FARTHEST)]
    if len(points) < 500:
        raise InputError("have at least 500 points between 2.5 and 80 m", got=len(points), file=file, remedy="Leave the sweep out.")
    return points


def _prepare(points: NDArray[np.float64]) -> _Sweep:
    """Thin to voxels and estimate normals and covariances from 20 neighbours."""
    import small_gicp

    return _Sweep(*small_gicp.preprocess_points(points, _VOXEL, 20, 1))


def _key(files: list[Path]) -> str:
    digest = hashlib.sha256(b"lidar_poses 1")
    for file in files:
        if not file.is_file():
            raise InputError("exist", file=file, remedy="Check the path.")
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
