"""Moving objects by their 3-D boxes: which tracks move, which points lie in them, and the masks that they draw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from ..boxes import Box, read_boxes
from ..camera import Camera
from ..images import write_raw
from ..points import read_points
from ..recording import Frame, MaskFile, Recording
from ..transforms import invert, transform_points
from .build_settings import DynamicsSettings
from .moving_masks import outlines

Floats = NDArray[np.floating]
# Nearer to the camera's plane than this a box is cut off: what lies in the plane itself is seen infinitely far out [m].
_NEAR = 0.3
# So many points of a sweep draw an outline, if they reach within this of the box's top [m].
_FEWEST, _LACKING = 60, 0.25
# Corner pairs of the twelve edges, corners numbered as `Box.corners` does.
_EDGES = np.array([(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit])


def boxes_world(frame: Frame) -> tuple[Box, ...]:
    """Return the boxes of a frame in the world; none where it has no file of them."""
    if frame.boxes is None:
        return ()
    return tuple(box.moved_by(frame.boxes.T_world_boxes) for box in read_boxes(frame.boxes.file, frame.boxes.unit))


def moving_boxes(recording: Recording, settings: DynamicsSettings | None = None) -> list[list[Box]]:
    """Return, per frame, the boxes of what moves, in the world.

    What the file says counts. Else signs and cones stand, people move, and any other track moves if its centre strays by
    more than `box_motion` over the recording's frames; of a track seen in one frame nobody can know, so it moves.
    """
    settings = settings or DynamicsSettings()
    frames = [boxes_world(frame) for frame in recording.frames]
    centres: dict[str, list[NDArray[np.float64]]] = {}
    for box in (box for boxes in frames for box in boxes):
        centres.setdefault(box.track, []).append(box.T_boxes_object[:3, 3])
    strays = {track: len(c) == 1 or float(np.ptp(np.array(c), axis=0).max()) > settings.box_motion for track, c in centres.items()}

    def moves(box: Box) -> bool:
        if box.moving is not None:
            return box.moving
        return not box.stands and (box.kind == "pedestrian" or strays[box.track])

    return [[box for box in boxes if moves(box)] for boxes in frames]


def in_boxes(points_world: Floats, boxes: list[Box], margin: float) -> NDArray[np.bool_]:
    """Return which points (N, 3) lie in one of the boxes, widened by `margin` [m] but not into the ground."""
    out = np.zeros(len(points_world), bool)
    for box in boxes:
        out |= box.contains(points_world, margin)
    return out


def boxes_to_draw(recording: Recording, settings: DynamicsSettings | None = None) -> list[dict[int, Box]]:
    """Return, per frame, the moving boxes in the world by the id that their track has in all masks drawn of boxes.

    Empty for frames that have masks already.

    Raises
    ------
    InputError
        If more than 65535 tracks move: ids of a mask have 16 bits.
    """
    moving = moving_boxes(recording, settings)
    tracks = sorted({box.track for boxes in moving for box in boxes}, key=lambda name: (len(name), name))
    if len(tracks) > 65535:
        raise InputError("have at most 65535 moving tracks", got=len(tracks), file=recording.root, key="the boxes")
    ids = {track: i + 1 for i, track in enumerate(tracks)}
    return [
        {ids[box.track]: box for box in boxes} if frame.masks is None else {}
        for frame, boxes in zip(recording.frames, moving, strict=True)
    ]


def write_box_masks(recording: Recording, boxes: list[dict[int, Box]], folder: Path) -> None:
    """Draw the masks of the frames that have boxes and no masks: a 16-bit PNG each, `NNNN.png` by the frame's number."""
    for number, frame in _without_masks(recording):
        sweep = None
        if frame.points is not None and boxes[number]:
            points = frame.points.unit * read_points(frame.points.file)[:, :3].astype(np.float64)
            sweep = transform_points(frame.points.T_world_points, points)
        write_raw(folder / f"{number:04d}.png", box_mask(frame.camera, boxes[number], sweep).astype(np.uint16))


def with_box_masks(recording: Recording, boxes: list[dict[int, Box]], folder: Path) -> Recording:
    """Return the recording with the masks that `write_box_masks` drew from the same boxes."""
    frames = list(recording.frames)
    for number, frame in _without_masks(recording):
        classes = {id: box.kind for id, box in boxes[number].items()}
        frames[number] = replace(frame, masks=MaskFile((folder / f"{number:04d}.png").resolve(), "vehicle", classes))
    return replace(recording, frames=tuple(frames))


def _without_masks(recording: Recording) -> list[tuple[int, Frame]]:
    return [(i, frame) for i, frame in enumerate(recording.frames) if frame.boxes is not None and frame.masks is None]


def box_mask(camera: Camera, boxes: dict[int, Box], sweep_world: Floats | None = None) -> NDArray[np.int32]:
    """Return the mask (H, W) of boxes in the world by id, near ones over far ones.

    Each is the convex outline of the box's projection, which is wider than the object in it: what it takes too much is left
    dry. Where the frame's sweep (N, 3) shows the whole of an object, up to the box's top, the outline of its points cuts it.
    """
    mask = np.zeros((camera.height, camera.width), np.int32)
    depth = {id: float((b.T_boxes_object[:3, 3] - camera.position) @ camera.T_world_camera[:3, 2]) for id, b in boxes.items()}
    for id in sorted(boxes, key=lambda id: (-depth[id], id)):
        outline = _outline(camera, boxes[id])
        if outline is None:
            continue
        own = np.zeros(mask.shape, np.uint8)
        # OpenCV's whole numbers are the centres of pixels; 4 bits hold fractions of them.
        cv2.fillConvexPoly(own, np.rint(16 * (outline - 0.5)).astype(np.int32), 1, shift=4)
        body = None if sweep_world is None else _body(boxes[id], sweep_world)
        if body is not None:
            own &= (outlines(camera, body, np.ones(len(body), np.int32)) > 0).astype(np.uint8)
        mask[own > 0] = id
    return mask


def _body(box: Box, sweep_world: Floats) -> NDArray[np.float64] | None:
    """Return the sweep's points on an object, and below its lower ones on the box's lower face; None if they show a part only."""
    points = sweep_world[box.contains(sweep_world, 0.1)]
    local = transform_points(invert(box.T_boxes_object), points)
    height = local[:, 2] + 0.5 * box.size[2]
    above = height > 0.15  # what lies lower may be the road, which fills the box's outline
    if above.sum() < _FEWEST or height[above].max() < box.size[2] - _LACKING:
        return None
    foot = local[above & (height < 0.6)] * (1, 1, 0) - (0, 0, 0.5 * box.size[2])
    return (np.concatenate([points[above], transform_points(box.T_boxes_object, foot)])).astype(np.float64)


def _outline(camera: Camera, box: Box) -> NDArray[np.float32] | None:
    """Return the convex outline (K, 2) of what of a box lies before the camera [px]; None if the image shows none of it."""
    corners = transform_points(camera.T_camera_world, box.corners())
    a, b = corners[_EDGES[:, 0]], corners[_EDGES[:, 1]]
    crosses = (a[:, 2] < _NEAR) != (b[:, 2] < _NEAR)
    t = (_NEAR - a[crosses, 2]) / (b[crosses, 2] - a[crosses, 2])
    p = np.concatenate([corners[corners[:, 2] >= _NEAR], a[crosses] + t[:, None] * (b[crosses] - a[crosses])])
    if len(p) < 3:
        return None
    xy = camera.project(transform_points(camera.T_world_camera, p))[0]
    xy = xy[np.isfinite(xy).all(axis=1)]
    if len(xy) < 3 or (xy.max(axis=0) <= 0).any() or (xy.min(axis=0) >= (camera.width, camera.height)).any():
        return None
    return np.asarray(cv2.convexHull(xy.astype(np.float32)), np.float32)[:, 0]
