"""A recorded drive whose true flow is known: from its files, or from measured disparity and the camera's poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.flow_files import Flow, as_flow, read_flow
from scene.images import read_ids, read_raw
from scene.recording import Frame, read_recording

from .settings import StreetPart
from .wet_street import WettedDrive

# A target is hidden if what is measured there is nearer than what should be seen, by this share of the distance.
_NEARER = 0.05


class RecordedDrive(WettedDrive):
    """A recording that is reconstructed, wetted, and scored where the truth is known.

    Parameters
    ----------
    file : path
        A recording whose frames have `flow`, or `disparity`.
    folder : path
    settings : StreetPart
        Pairs, samples and seed count here.

    Raises
    ------
    InputError
        If no two consecutive frames have a true flow.
    """

    def __init__(self, file: Path, folder: Path, settings: StreetPart) -> None:
        recording = read_recording(file)
        frames = recording.frames
        known = [i for i in range(len(frames) - 1) if frames[i].flow is not None or frames[i].disparity is not None]
        self.pairs = [(i, i + 1) for i in known[: settings.pairs]]
        if not self.pairs:
            raise InputError("have flow or disparity in a frame that is not the last", got="none", file=file, key="frames")
        super().__init__(recording, folder, settings, sorted({i for pair in self.pairs for i in pair}))

    def true_flow(self, frame: int) -> Flow:
        """Return the true flow to the next frame, unknown where something moves by itself unless the recording has it."""
        frames = self.scene.recording.frames
        given = frames[frame].flow
        return flow_of_disparity(frames[frame], frames[frame + 1]) if given is None else read_flow(given)

    def visible(self, frame: int) -> NDArray[np.bool_]:
        """Return what has a true flow: where a target is hidden it is unknown, as far as the measurements tell."""
        return self.true_flow(frame).valid


def flow_of_disparity(first: Frame, second: Frame) -> Flow:
    """Return the flow of the static world between two frames, from the first one's disparity and both poses.

    Unknown where there is no disparity, where something moves by itself, where the target is outside the second picture,
    and where the second frame's disparity, if any, shows something nearer there.

    Raises
    ------
    InputError
        If the disparity has another size than the picture.
    """
    depth = _depth(first)
    xy = first.camera.pixel_centres()
    origins, directions = first.camera.rays(xy)
    along = directions @ first.camera.T_world_camera[:3, 2]
    known = np.isfinite(depth.ravel())
    if first.masks is not None:
        known &= read_ids(first.masks.file).ravel() == 0
    points = origins + directions * (np.where(known, depth.ravel(), 1.0) / along)[:, None]
    target, far = second.camera.project(points)
    height, width = second.camera.height, second.camera.width
    with np.errstate(invalid="ignore"):
        known &= (far > 0) & (target >= 0).all(axis=1) & (target[:, 0] < width) & (target[:, 1] < height)
    if second.disparity is not None:
        column, row = (np.where(known, target[:, i], 0).astype(int) for i in range(2))
        # Unknown depth is NaN, which hides nothing.
        known &= ~(_depth(second)[row, column] < (1 - _NEARER) * far)
    return as_flow((target - xy).reshape(*depth.shape, 2), known.reshape(depth.shape))


def _depth(frame: Frame) -> NDArray[np.float64]:
    """Return the measured depth along the camera's z (H, W) [m], NaN where there is none."""
    assert frame.disparity is not None
    stored = read_raw(frame.disparity.file).astype(np.float64)
    if stored.shape != (frame.camera.height, frame.camera.width):
        remedy = "Give disparity of the picture's size."
        raise InputError(
            f"have shape {(frame.camera.height, frame.camera.width)}",
            got=stored.shape,
            file=frame.disparity.file,
            key="the disparity",
            remedy=remedy,
        )
    stored[~(stored > 0)] = np.nan
    return frame.camera.fx * frame.disparity.baseline / (stored / frame.disparity.scale)
