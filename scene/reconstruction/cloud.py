"""From sweeps to one static cloud: without the vehicle that carried the scanner, without what moved, without strays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from materials.foundation.errors import InputError
from materials.foundation.files import replacing
from materials.foundation.progress import logger, stage, tracked

from ..points import read_points, read_points_far
from ..recording import Recording
from ..transforms import transform_points
from . import dynamics
from .boxed_objects import in_boxes, moving_boxes
from .build_settings import CloudSettings, DynamicsSettings, GroundSettings
from .ground import split_ground
from .moving_masks import MovingThings, things_that_moved
from .slow_objects import slowly_moving

Floats = NDArray[np.floating]
_FARTHEST_CAMERA = 500.0  # a drone's height, with room
_LOW_MATCH = 0.25  # things of stereo alone that end below this are no things [m]
MAX_COORDINATE = 2000.0  # float32 resolves 0.1 mm up to here


@dataclass(frozen=True)
class Cloud:
    """Static points in the world.

    Attributes
    ----------
    points_world : (N, 3) float32
        Positions [m].
    sensors_world : (N, 3) float32
        Where the scanner (or camera) stood that measured each point; of several, the nearest.
    is_ground : (N,) bool
        Whether the point is ground.
    sources : (N,) uint8
        0 = scanner or given cloud, 1 = stereo.
    counts : dict
        How many points entered and how many each filter took, in order.
    moving : MovingThings or None
        What the sweeps saw move, if that was asked for; it is not written with the cloud.
    """

    points_world: NDArray[np.float32]
    sensors_world: NDArray[np.float32]
    is_ground: NDArray[np.bool_]
    sources: NDArray[np.uint8]
    counts: dict[str, int]
    moving: MovingThings | None = None

    def part(self, chosen: NDArray[np.bool_]) -> Cloud:
        return Cloud(
            self.points_world[chosen], self.sensors_world[chosen], self.is_ground[chosen], self.sources[chosen], self.counts
        )


def world_offset(recording: Recording) -> NDArray[np.float64]:
    """Return what must be added to world positions so that float32 holds them; zero for ordinary worlds.

    Map coordinates (UTM) have millions of metres, where float32 resolves 0.5 m.
    """
    path = path_of(recording)
    if len(path) == 0 or np.abs(path).max() < MAX_COORDINATE:
        return np.zeros(3)
    return -np.round(path.mean(axis=0))


def moved(recording: Recording, offset: NDArray[np.float64]) -> Recording:
    """Return the recording with all poses moved by `offset` (its static cloud, a file, is not)."""
    if not offset.any():
        return recording
    shift = np.eye(4)
    shift[:3, 3] = offset

    def moved_frame(frame):
        points = frame.points and replace(frame.points, T_world_points=shift @ frame.points.T_world_points)
        stereo = frame.stereo and replace(
            frame.stereo, camera=frame.stereo.camera.moved_to(shift @ frame.stereo.camera.T_world_camera)
        )
        boxes = frame.boxes and replace(frame.boxes, T_world_boxes=shift @ frame.boxes.T_world_boxes)
        camera = frame.camera.moved_to(shift @ frame.camera.T_world_camera)
        return replace(frame, camera=camera, points=points, stereo=stereo, boxes=boxes)

    return replace(recording, frames=tuple(moved_frame(frame) for frame in recording.frames))


def path_of(recording: Recording) -> NDArray[np.float64]:
    """Return the places (P, 3) of the scanner, or of the camera where there is none, frame by frame [m]."""
    places = [f.points.T_world_points[:3, 3] if f.points else f.camera.position for f in recording.frames]
    return np.array(places, dtype=np.float64).reshape(-1, 3)


def accumulate(
    recording: Recording,
    settings: CloudSettings | None = None,
    dynamics_settings: DynamicsSettings | None = None,
    ground_settings: GroundSettings | None = None,
    offset: NDArray[np.float64] | None = None,
) -> Cloud:
    """Gather all points of a recording into one static cloud, split into ground and environment.

    Parameters
    ----------
    recording : Recording
        With sweeps, or a static cloud, or stereo pairs; poses already moved by `offset`.
    offset : (3,) float64, optional
        Added to the static cloud, which is a file in the recording's own world [m].

    Returns
    -------
    cloud : Cloud

    Raises
    ------
    InputError
        If there are no points at all, a file is damaged, or filtering leaves nothing.
    """
    settings = settings or CloudSettings()
    dynamics_settings = dynamics_settings or DynamicsSettings()
    path = path_of(recording)
    counts: dict[str, int] = {}
    points, sensors, sources, moving = _scanned(recording, settings, dynamics_settings, ground_settings, counts)
    if recording.points is not None:
        given = recording.points_unit * read_points_far(recording.points)[:, :3] + (0.0 if offset is None else offset)
        counts["in given cloud"] = len(given)
        nearest = path[cKDTree(path).query(given)[1]] if len(path) else given + (0.0, 0.0, 50.0)
        points, sensors = np.concatenate([points, given]), np.concatenate([sensors, nearest])
        sources = np.concatenate([sources, np.zeros(len(given), np.uint8)])
    if settings.stereo or len(points) == 0:
        seen, cameras = _stereo(recording, points, path, counts)
        points, sensors = np.concatenate([points, seen]), np.concatenate([sensors, cameras])
        sources = np.concatenate([sources, np.ones(len(seen), np.uint8)])
    if len(points) == 0:
        raise InputError(
            "hold points (sweeps, a cloud, or stereo pairs)",
            got="none",
            file=recording.root,
            key="the recording",
            remedy="Add a cloud, or record a second camera.",
        )
    if np.abs(points).max() > 50 * MAX_COORDINATE:
        raise InputError(
            f"lie within {MAX_COORDINATE:g} m of the path",
            got=f"{np.abs(points).max():.3g} m",
            key="the cloud",
            remedy="Bring cloud and poses into one world.",
        )
    _check_one_world(points, recording)
    keep = ~strays(points, sensors, sources, settings)
    counts["strays removed"] = int((~keep).sum())
    points, sensors, sources = points[keep], sensors[keep], sources[keep]
    points, sensors, sources = thin(points, sensors, sources, path, settings)
    counts["after thinning"] = len(points)
    is_ground = split_ground(points, path, ground_settings)
    # Matches that miss by a hand's breadth would lie on the road as a thing of their own, and keep it dry.
    low = dynamics.remnants(points, is_ground, _LOW_MATCH) & (sources == 1)
    if low.any():
        counts["low stereo matches removed"] = int(low.sum())
        points, sensors, sources, is_ground = points[~low], sensors[~low], sources[~low], is_ground[~low]
    counts["ground"], counts["environment"] = int(is_ground.sum()), int((~is_ground).sum())
    return Cloud(points.astype(np.float32), sensors.astype(np.float32), is_ground, sources, counts, moving)


def _check_one_world(points: Floats, recording: Recording) -> None:
    """Refuse cameras that are nowhere near any point: poses of another world, or in another unit."""
    if not recording.frames:
        return
    cameras = np.array([frame.camera.position for frame in recording.frames])
    away = cKDTree(points).query(cameras)[0]
    if away.min() > _FARTHEST_CAMERA:
        raise InputError(
            f"lie within {_FARTHEST_CAMERA:g} m of a camera",
            got=f"none nearer than {away.min():.0f} m",
            file=recording.root,
            key="points of the cloud",
            remedy="Bring cloud and poses into one world and one unit.",
        )


def _scanned(recording, settings: CloudSettings, dynamics_settings, ground_settings, counts: dict[str, int]):
    """Return points, scanner places and sources of all sweeps, in the world, without what moved; and what did."""
    frames = [frame for frame in recording.frames if frame.points is not None]
    empty = np.zeros((0, 3))
    if not frames:
        return empty, empty, np.zeros(0, np.uint8), None
    sweeps, kept, owner = [], [], []
    total = ego = far = masked = boxed = 0
    boxes = dict(zip((id(frame) for frame in recording.frames), moving_boxes(recording, dynamics_settings), strict=True))
    for index, frame in enumerate(tracked(frames, "sweeps", len(frames))):
        raw = np.float32(frame.points.unit) * read_points(frame.points.file)[:, :3]
        total += len(raw)
        own = np.hypot(raw[:, 0], raw[:, 1]) < settings.ego_radius
        # The vehicle is around and below its scanner, down to the road; a roof or a branch above is not part of it.
        own &= (raw[:, 2] < 1.0) & (raw[:, 2] > -3.0)
        distant = np.linalg.norm(raw, axis=1) > settings.max_range
        sweeps.append((raw[~own], frame.points.T_world_points))
        raw = raw[~own & ~distant]
        ego, far = ego + int(own.sum()), far + int((distant & ~own).sum())
        world = transform_points(frame.points.T_world_points, raw.astype(np.float64))
        on_object = dynamics.on_masked_objects(world, frame, dynamics_settings)
        masked += int(on_object.sum())
        in_box = in_boxes(world, boxes[id(frame)], dynamics_settings.box_margin) & ~on_object
        boxed += int(in_box.sum())
        on_object |= in_box
        kept.append(world[~on_object])
        owner.append(np.full(int((~on_object).sum()), index, np.int32))
    points, sweep = np.concatenate(kept), np.concatenate(owner)
    counts |= {"in sweeps": total, "ego vehicle removed": ego, "out of range removed": far, "on masked objects removed": masked}
    counts |= {"in moving boxes removed": boxed} if any(boxes.values()) else {}
    if len(points) == 0:
        raise InputError("hold points beyond the vehicle itself", got="none", file=frames[0].points.file, key="the sweeps")
    places = np.array([frame.points.T_world_points[:3, 3] for frame in frames])
    moving = None
    if len(frames) > dynamics_settings.free_space_votes:
        through, agree = dynamics.free_space_votes(points, sweep, sweeps, dynamics_settings)
        is_ground = split_ground(points, places, ground_settings)
        driven = dynamics.on_driven_path(points, places)
        above = dynamics.height_above_ground(points, points[is_ground]) if is_ground.any() else np.zeros(len(points))
        if dynamics_settings.slow_traffic and is_ground.any():
            driven |= slowly_moving(points, sweep, above, places, dynamics_settings.free_space_range)
        through[driven & ~is_ground] += 2 * dynamics_settings.free_space_votes
        gone = dynamics.moving(points, through, agree, is_ground, dynamics_settings)
        counts["seen through, removed"] = int(gone.sum())
        if dynamics_settings.motion_masks and not any(frame.masks or frame.boxes for frame in recording.frames):
            number = np.array([i for i, frame in enumerate(recording.frames) if frame.points is not None])
            above_ground = ~is_ground & (above > 0.05)
            moving = things_that_moved(points[above_ground], number[sweep[above_ground]], above[above_ground], gone[above_ground])
        gone |= dynamics.remnants(points, is_ground | gone)
        points, sweep = points[~gone], sweep[~gone]
    else:
        logger.info("free-space votes need more than %d sweeps, got %d", dynamics_settings.free_space_votes, len(frames))
    return points, places[sweep], np.zeros(len(points), np.uint8), moving


def _stereo(recording: Recording, points: Floats, path: Floats, counts: dict[str, int]):
    """Return stereo points where the scanner has nothing within 0.5 m and only above its beams (all, without a scanner)."""
    from ..sources.stereo import consistent_stereo_points, stereo_points

    frames = [frame for frame in recording.frames if frame.stereo is not None or frame.disparity is not None]
    empty = np.zeros((0, 3))
    if not frames:
        return empty, empty
    with stage("stereo"):
        # A match that no other view confirms may be a mistake; with two views or fewer there is none to ask.
        found = (
            consistent_stereo_points(replace(recording, frames=tuple(frames)))
            if len(frames) > 2
            else [stereo_points(f) for f in frames]
        )
    tree = cKDTree(points) if len(points) else None
    seen, cameras = [], []
    for view in found:
        xyz = np.asarray(view.points_world, dtype=np.float64)
        if tree is not None and len(xyz):
            towards = xyz - path[np.argmin(np.linalg.norm(path - view.camera_position, axis=1))]
            above = towards[:, 2] > np.tan(np.radians(2.0)) * np.hypot(towards[:, 0], towards[:, 1])
            xyz = xyz[above]
            xyz = xyz[tree.query(xyz, distance_upper_bound=0.5)[0] > 0.5]
        seen.append(xyz)
        cameras.append(np.broadcast_to(view.camera_position, xyz.shape))
    xyz = np.concatenate(seen)
    counts["stereo points"] = len(xyz)
    return xyz, np.concatenate(cameras)


def strays(points: Floats, sensors: Floats, sources: NDArray[np.uint8], settings: CloudSettings | None = None) -> NDArray[np.bool_]:
    """Return which points stand alone: rain, dust, multiple reflections, mixed pixels.

    The distance allowed grows with range, as the beams' spacing does. A point that shares its 0.2 m cube with six others
    needs no search.
    """
    settings = settings or CloudSettings()
    _, voxel = np.unique(np.floor(points / 0.2).astype(np.int64), axis=0, return_inverse=True)
    lonely = np.flatnonzero(np.bincount(voxel.ravel())[voxel.ravel()] < 7)
    out = np.zeros(len(points), bool)
    if len(lonely) == 0 or len(points) < 8:
        return out
    distance = cKDTree(points).query(points[lonely], k=7, workers=-1)[0][:, -1]
    range_ = np.linalg.norm(points[lonely] - sensors[lonely], axis=1)
    out[lonely] = distance > settings.stray_distance + settings.stray_per_metre * range_
    return out


def thin(points: Floats, sensors: Floats, sources: NDArray[np.uint8], path: Floats, settings: CloudSettings | None = None):
    """Return one point per voxel, the mean of its points, in voxels that grow with distance from the path.

    Returns
    -------
    points, sensors, sources
        Positions are means, which lowers the noise; the sensor is that of the point measured from nearest.
    """
    settings = settings or CloudSettings()
    away = cKDTree(path).query(points)[0] if len(path) else np.zeros(len(points))
    level = np.floor(np.log2(np.maximum(away / settings.voxel_range, 0.5))).astype(np.int64) + 1
    size = settings.voxel * 2.0**level
    key = np.column_stack([level, np.floor(points / size[:, None]).astype(np.int64)])
    range_ = np.linalg.norm(points - sensors, axis=1)
    order = np.lexsort((range_, key[:, 1], key[:, 2], key[:, 3], key[:, 0]))
    sorted_key = key[order]
    first = np.ones(len(order), bool)
    first[1:] = (sorted_key[1:] != sorted_key[:-1]).any(axis=1)
    group = np.cumsum(first) - 1
    count = np.bincount(group)
    means = np.column_stack([np.bincount(group, weights=points[order, axis]) / count for axis in range(3)])
    best = order[first]
    return means, sensors[best], sources[best]


def write_cloud(path: str | Path, cloud: Cloud) -> None:
    """Write a cloud as npz."""
    with replacing(path) as temporary, open(temporary, "wb") as file:
        names = np.array(list(cloud.counts))
        values = np.array(list(cloud.counts.values()), np.int64)
        np.savez(
            file,
            points=cloud.points_world,
            sensors=cloud.sensors_world,
            is_ground=cloud.is_ground,
            sources=cloud.sources,
            names=names,
            values=values,
        )


def read_cloud(path: str | Path) -> Cloud:
    """Read what `write_cloud` wrote."""
    with np.load(path, allow_pickle=False) as data:
        counts = {str(n): int(v) for n, v in zip(data["names"], data["values"], strict=True)}
        return Cloud(data["points"], data["sensors"], data["is_ground"], data["sources"], counts)
