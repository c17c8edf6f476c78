"""How the vehicles of a drive move: from their 3-D boxes, or from their cardboards by the ids of the masks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from materials.foundation.progress import logger

from ..reconstruction.boxed_objects import moving_boxes
from ..scene_file import Cardboard, Scene
from .wake_settings import WakeSettings
from .wakes import MovingVehicle

# Frames before and after that a motion is fitted to.
_AROUND = 2
# Per track, per frame: the middle of the footprint (2,) and the size (3,).
_Track = dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]
Footprint = Callable[[Cardboard, NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]


def moving_vehicles(scene: Scene, footprint: Footprint, settings: WakeSettings = WakeSettings()) -> list[list[MovingVehicle]]:
    """Return the vehicles of each frame whose motion is known and fast enough to throw up spray.

    A vehicle's velocity is the slope of a straight, even motion through its places in up to two frames before and after, so
    steps of one frame, which masks know to some decimetres, do not shake it. A track of one frame, or one that strays from
    such a motion, is unknown: it is skipped, and counted in the log.

    Parameters
    ----------
    footprint : callable
        (cardboard, camera's position) -> middle of the footprint (2,) and size (3,) [m], for drives without boxes.
    """
    tracks = _boxes(scene) if any(frame.boxes for frame in scene.recording.frames) else _boards(scene, footprint)
    out: list[list[MovingVehicle]] = [[] for _ in scene.recording.frames]
    unknown = 0
    for name, track in tracks.items():
        for frame, (centre, size) in track.items():
            velocity = _velocity(track, frame, settings)
            if velocity is None:
                unknown += 1
            elif settings.slowest <= np.hypot(*velocity):
                out[frame].append(MovingVehicle(name, centre, velocity, size))
    if unknown:
        logger.info("no spray behind %d vehicles of single frames whose motion is unknown", unknown)
    return out


def _boxes(scene: Scene) -> dict[str, _Track]:
    tracks: dict[str, _Track] = {}
    for i, boxes in enumerate(moving_boxes(scene.recording)):
        for box in boxes:
            if box.kind == "vehicle":
                tracks.setdefault(box.track, {})[i] = (box.T_boxes_object[:2, 3].copy(), box.size)
    return tracks


def _boards(scene: Scene, footprint: Footprint) -> dict[str, _Track]:
    tracks: dict[str, _Track] = {}
    for i, boards in enumerate(scene.cardboards):
        for board in boards:
            if board.kind == "vehicle":
                place = footprint(board, scene.recording.frames[i].camera.position)
                tracks.setdefault(str(board.instance), {})[i] = place
    return tracks


def _velocity(track: _Track, frame: int, settings: WakeSettings) -> NDArray[np.float64] | None:
    """Return the velocity (2,) at a frame [m/s]; None where it is not known."""
    first = last = frame
    while first - 1 in track and first > frame - _AROUND:
        first -= 1
    while last + 1 in track and last < frame + _AROUND:
        last += 1
    if first == last:
        return None
    t = settings.frame_time * (np.arange(first, last + 1) - frame)
    places = np.array([track[i][0] for i in range(first, last + 1)])
    A = np.column_stack([np.ones_like(t), t])
    line = np.linalg.lstsq(A, places, rcond=None)[0]
    stray = float(np.sqrt(((places - A @ line) ** 2).sum(axis=1).mean()))
    if stray > settings.stray or np.hypot(*line[1]) > settings.fastest:
        return None
    return line[1]
