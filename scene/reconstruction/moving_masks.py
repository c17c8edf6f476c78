"""Masks of what moved, for drives without any: the outlines, in each photograph, of the things that its own sweep saw move.

Without them traffic would be taken for the ground behind it, and get wet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.files import replacing

from ..camera import Camera
from ..images import write_raw
from ..recording import MaskFile, Recording
from .dynamics import things

Floats = NDArray[np.floating]

# A thing has so many points of which most moved, and the size of a person to a lorry [m].
_FEWEST, _MOST_OF_IT = 30, 0.6
_LOWEST, _LONGEST = 0.5, 20.0
# Wide enough to join the columns of beams along a side that is seen at a slant [m].
_CELL = 0.5
# Seen from above a person covers less than this, a vehicle more [m].
_PERSON = 1.2
# How far an outline reaches beyond the points: they are sparse, and edges are missed [px].
_MARGIN = 3


@dataclass(frozen=True)
class MovingThings:
    """Points on things that moved.

    Attributes
    ----------
    points_world : (N, 3) float32
        Where the thing's own sweep saw them, and below its lower ones where it meets the ground [m].
    frames : (N,) int32
        Index of the frame.
    ids : (N,) int32
        Number of the thing within its frame, from 1.
    """

    points_world: NDArray[np.float32]
    frames: NDArray[np.int32]
    ids: NDArray[np.int32]

    def kinds(self, frame: int) -> dict[int, str]:
        """Return "pedestrian" or "vehicle" for each thing of a frame, by its extent as seen from above."""
        out = {}
        for id in np.unique(self.ids[self.frames == frame]):
            points = self.points_world[(self.frames == frame) & (self.ids == id)]
            out[int(id)] = "pedestrian" if np.ptp(points[:, :2], axis=0).max() < _PERSON else "vehicle"
        return out


def things_that_moved(
    points_world: Floats, frame_of_point: NDArray[np.integer], above: Floats, has_moved: NDArray[np.bool_]
) -> MovingThings:
    """Gather the things of each sweep most of whose points have moved.

    Parameters
    ----------
    points_world : (N, 3) float64
        All points of the sweeps but the ground's.
    frame_of_point : (N,) int
    above : (N,) float
        Height above the ground [m].
    has_moved : (N,) bool
        The verdict on each.
    """
    points, frames, ids = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0)]
    for frame in np.unique(frame_of_point[has_moved]):
        members = np.flatnonzero((frame_of_point == frame) & (above < 4.5))
        label = things(points_world[members], _CELL)
        size, moved = np.bincount(label), np.bincount(label, weights=has_moved[members])
        number = 0
        for id in np.flatnonzero((moved >= _FEWEST) & (moved > _MOST_OF_IT * size)):
            chosen = members[label == id]
            p, height = points_world[chosen], above[chosen]
            if np.ptp(p[:, :2], axis=0).max() > _LONGEST or height.max() < _LOWEST:
                continue
            number += 1
            foot = p[height < 0.6] - height[height < 0.6, None] * (0.0, 0.0, 1.0)
            points += [p, foot]
            frames.append(np.full(len(p) + len(foot), frame))
            ids.append(np.full(len(p) + len(foot), number))
    places, numbers = np.concatenate(points).astype(np.float32), np.concatenate(ids).astype(np.int32)
    return MovingThings(places, np.concatenate(frames).astype(np.int32), numbers)


def write_moving(path: Path, moving: MovingThings) -> None:
    """Write the things as npz."""
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, points=moving.points_world, frames=moving.frames, ids=moving.ids)


def read_moving(path: Path) -> MovingThings:
    """Read what `write_moving` wrote."""
    with np.load(path, allow_pickle=False) as data:
        return MovingThings(data["points"], data["frames"], data["ids"])


def write_motion_masks(recording: Recording, moving: MovingThings, folder: Path) -> None:
    """Draw a mask for each frame in which something moved: an 8- or 16-bit PNG each, `NNNN.png` by the frame's number."""
    for number in np.unique(moving.frames):
        chosen = moving.frames == number
        mask = outlines(recording.frames[number].camera, moving.points_world[chosen], moving.ids[chosen])
        write_raw(folder / f"{number:04d}.png", mask.astype(np.uint16 if mask.max() > 255 else np.uint8))


def with_motion_masks(recording: Recording, moving: MovingThings, folder: Path) -> Recording:
    """Return the recording with the masks that `write_motion_masks` drew."""
    frames = list(recording.frames)
    for number in np.unique(moving.frames):
        masks = MaskFile((folder / f"{number:04d}.png").resolve(), "vehicle", moving.kinds(number))
        frames[number] = replace(frames[number], masks=masks)
    return replace(recording, frames=tuple(frames))


def outlines(camera: Camera, points_world: Floats, ids: NDArray[np.integer]) -> NDArray[np.int32]:
    """Return a mask (H, W) of the convex outline of each thing's points and a small margin, near things over far ones."""
    mask = np.zeros((camera.height, camera.width), np.int32)
    xy, depth = camera.project(points_world)
    seen = np.isfinite(xy).all(axis=1) & (depth > 0.3)
    nearest = {int(id): float(np.median(depth[seen & (ids == id)])) for id in np.unique(ids[seen])}
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _MARGIN + 1,) * 2)
    for id in sorted(nearest, key=lambda id: (-nearest[id], id)):
        hull = np.asarray(cv2.convexHull(xy[seen & (ids == id)].astype(np.float32)))[:, 0]
        if len(hull) < 3 or (hull.max(axis=0) <= 0).any() or (hull.min(axis=0) >= (camera.width, camera.height)).any():
            continue
        own = np.zeros(mask.shape, np.uint8)
        cv2.fillConvexPoly(own, np.rint(16 * (hull - 0.5)).astype(np.int32), 1, shift=4)
        mask[cv2.dilate(own, disc) > 0] = id
    return mask
