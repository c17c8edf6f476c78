"""Points on things that moved: by the masks of their own photograph, and by other sweeps that saw through their place."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_dilation
from scipy.spatial import cKDTree

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked

from ..images import read_ids
from ..kernels import free_space
from ..recording import Frame
from ..transforms import invert
from .build_settings import DynamicsSettings

Floats = NDArray[np.floating]
# Wider than the spacing of common scanners' beams (0.2 to 0.45 degrees), so that a 3 x 3 window always holds some.
STEP = math.radians(0.4)


def on_masked_objects(points_world: Floats, frame: Frame, settings: DynamicsSettings | None = None) -> NDArray[np.bool_]:
    """Return which points of a frame's own sweep lie on an object of its mask.

    A point that projects into a mask may belong to what is seen past the object from the scanner's higher place. It is
    kept if it lies more than `object_length` behind the object's nearest points (5th percentile).
    """
    settings = settings or DynamicsSettings()
    out = np.zeros(len(points_world), bool)
    if frame.masks is None:
        return out
    mask = instance_mask(frame)
    if not mask.any():
        return out
    mask = grey_dilation(mask, size=(2 * settings.mask_dilation + 1,) * 2)
    xy, depth = frame.camera.project(points_world)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0.3) & (xy >= 0).all(axis=1) & (xy[:, 0] < mask.shape[1]) & (xy[:, 1] < mask.shape[0])
    seen = np.flatnonzero(inside)
    column, row = xy[seen].astype(np.int64).T
    instance = mask[row, column]
    for id in np.unique(instance[instance > 0]):
        members = seen[instance == id]
        nearest = np.percentile(depth[members], 5)
        out[members[depth[members] < nearest + settings.object_length]] = True
    return out


def instance_mask(frame: Frame) -> NDArray[np.int64]:
    """Read the instance ids of a frame (H, W), 0 = static; all 0 without a mask.

    Raises
    ------
    InputError
        If the file is damaged, has colours, or another size than the camera.
    """
    shape = (frame.camera.height, frame.camera.width)
    if frame.masks is None:
        return np.zeros(shape, np.int64)
    mask = read_ids(frame.masks.file)
    if mask.ndim != 2 or not np.issubdtype(mask.dtype, np.integer):
        raise InputError("hold one integer per pixel, the id of an object", got=f"{mask.shape} {mask.dtype}", file=frame.masks.file)
    if mask.shape != shape:
        raise InputError(
            f"have the camera's size {shape[1]} x {shape[0]}", got=f"{mask.shape[1]} x {mask.shape[0]}", file=frame.masks.file
        )
    return mask.astype(np.int64)


def free_space_votes(
    points_world: Floats,
    sweep_of_point: NDArray[np.integer],
    sweeps: list[tuple[Floats, Floats]],
    settings: DynamicsSettings | None = None,
) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """Count, per point, the other sweeps that saw through it and those that saw something there.

    Parameters
    ----------
    points_world : (N, 3) float64
    sweep_of_point : (N,) int
        Index of the sweep that each point came from; it does not vote.
    sweeps : list of (points (M, 3+) in the scanner's frame, T_world_points (4, 4))
        With all their returns: also those that a filter removed have passed through free space.

    Returns
    -------
    through, agree : (N,) uint16
    """
    settings = settings or DynamicsSettings()
    through, agree = np.zeros(len(points_world), np.uint16), np.zeros(len(points_world), np.uint16)
    points_world = np.ascontiguousarray(points_world, dtype=np.float64)
    for index, (points, T_world_points) in enumerate(tracked(sweeps, "free space", len(sweeps))):
        near, far, count = free_space.widen(*free_space.range_image(np.ascontiguousarray(points[:, :3], dtype=np.float32), STEP))
        T = invert(T_world_points)
        free_space.vote(
            points_world,
            np.ascontiguousarray(T[:3, :3]),
            np.ascontiguousarray(T[:3, 3]),
            near,
            far,
            count,
            STEP,
            settings.free_space_margin,
            0.01,  # registration: 0.6 degrees of heading between sweeps
            settings.free_space_range,
            sweep_of_point == index,
            through,
            agree,
        )
    return through, agree


def on_driven_path(
    points_world: Floats, path_world: Floats, half_width: float = 0.9, height: float = 1.2, before: float = 12.0, ahead: float = 2.5
) -> NDArray[np.bool_]:
    """Return which points lie where the recording vehicle itself has driven: what is there now has moved.

    Traffic that follows the vehicle hides its own earlier places from the scanner, so no beam can vote on them. The path
    is continued straight back by `before` metres from where the recording starts, if the vehicle was under way, and by
    `ahead` from where it ends: so far its bonnet reaches beyond the scanner.

    Parameters
    ----------
    points_world : (N, 3) float
    path_world : (P, 3) float
        Places of the scanner in order of time [m].
    """
    out = np.zeros(len(points_world), bool)
    if len(path_world) < 2:
        return out
    path = np.asarray(path_world, dtype=np.float64)
    start = path[0] - path[1]
    if np.linalg.norm(start) > 0.3:
        path = np.concatenate([[path[0] + start / np.linalg.norm(start) * before], path])
    end = path[-1] - path[-2]
    if np.linalg.norm(end) > 0.05:
        path = np.concatenate([path, [path[-1] + end / np.linalg.norm(end) * ahead]])
    for a, b in pairwise(path):
        along = b - a
        length = np.linalg.norm(along[:2])
        if length < 1e-3:
            continue
        p = points_world - a
        s = (p[:, :2] @ along[:2]) / length
        across = np.abs(p[:, 0] * along[1] - p[:, 1] * along[0]) / length
        level = p[:, 2] - along[2] * s / length
        # Above the scanner there may be a bridge; the road itself is ground and stays.
        out |= (s >= 0) & (s <= length) & (across < half_width) & (level < 0.3) & (level > -height)
    return out


def moving(
    points_world: Floats,
    through: NDArray[np.integer],
    agree: NDArray[np.integer],
    is_ground: NDArray[np.bool_],
    settings: DynamicsSettings | None = None,
) -> NDArray[np.bool_]:
    """Turn votes into a decision, pooled over 0.4 m voxels and then over whole things that stand on the ground.

    Single votes err at edges and in foliage; what moves, moves as a whole: a compact thing of a vehicle's size or less
    most of whose voxels were seen through goes entirely. Ground never moves.
    """
    settings = settings or DynamicsSettings()
    out = np.zeros(len(points_world), bool)
    members = np.flatnonzero(~is_ground)
    if len(members) == 0:
        return out
    _, voxel = np.unique(np.floor(points_world[members] / 0.4).astype(np.int64), axis=0, return_inverse=True)
    voxel = voxel.ravel()
    n = np.bincount(voxel)
    free = np.bincount(voxel, weights=through[members])
    held = np.bincount(voxel, weights=agree[members])
    share = free / np.maximum(free + held, 1)
    free_voxel = (free / n >= settings.free_space_votes * 0.75) & (share >= settings.free_space_share)
    out[members] = free_voxel[voxel]
    out[members] |= (through[members] >= settings.free_space_votes) & (through[members] > 2.0 * agree[members])
    thing = things(points_world[members])
    size = np.bincount(thing)
    gone = np.bincount(thing, weights=out[members])
    extent = np.zeros((len(size), 3))
    for axis in range(3):
        values = points_world[members, axis]
        high, low = np.full(len(size), -np.inf), np.full(len(size), np.inf)
        np.maximum.at(high, thing, values)
        np.minimum.at(low, thing, values)
        extent[:, axis] = high - low
    compact = (extent[:, :2].max(axis=1) < 14.0) & (extent[:, 2] < 4.5)
    whole = compact & (gone > 0.4 * size)
    out[members] |= whole[thing]
    return out


def remnants(points_world: Floats, is_ground: NDArray[np.bool_], lowest: float = 0.4) -> NDArray[np.bool_]:
    """Return which points belong to things that end below `lowest` above the ground [m].

    They are what beams could not vote on when a vehicle went: its sill and wheels, seen against the road.
    """
    out = np.zeros(len(points_world), bool)
    members = np.flatnonzero(~is_ground)
    if len(members) == 0 or not is_ground.any():
        return out
    above = height_above_ground(points_world[members], points_world[is_ground])
    thing = things(points_world[members])
    top = np.full(thing.max() + 1, -np.inf)
    np.maximum.at(top, thing, above)
    out[members] = (top < lowest)[thing]
    return out


def height_above_ground(points_world: Floats, ground: Floats) -> NDArray[np.float64]:
    """Return heights (N,) above the nearest of the ground's points (G, 3) [m]; infinite where none is within 2 m."""
    away, nearest = cKDTree(ground[:, :2]).query(points_world[:, :2], distance_upper_bound=2.0, workers=-1)
    below = ground[np.minimum(nearest, len(ground) - 1), 2]
    return np.where(np.isfinite(away), points_world[:, 2] - below, np.inf)


def things(points: Floats, cell: float = 0.3) -> NDArray[np.int64]:
    """Label points by connected cells seen from above."""
    from scipy.ndimage import label

    cells = np.floor(points[:, :2] / cell).astype(np.int64)
    cells -= cells.min(axis=0)
    occupied = np.zeros(cells.max(axis=0) + 1, bool)
    occupied[tuple(cells.T)] = True
    labels, _ = label(occupied, structure=np.ones((3, 3)))
    return labels[tuple(cells.T)].astype(np.int64)
