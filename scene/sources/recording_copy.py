"""A recording's pictures, checked before work starts and copied to where a scene keeps them."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, replacing_folder
from materials.foundation.progress import tracked

from ..boxes import read_boxes
from ..depth_files import read_depth
from ..flow_files import read_flow
from ..images import read_ids, read_raw
from ..recording import Frame, Recording, read_recording, write_recording
from .undistort import is_distorted, pinhole_of, undistort_ids, undistort_image


def check_recording(recording: Recording) -> None:
    """Decode every picture once, before any heavy work.

    Raises
    ------
    InputError
        If an image, mask, disparity, segmentation, flow or depth is missing, damaged, or not of its camera's size; names
        the file and both sizes. Also if a mask or segmentation has colours instead of ids, or boxes break their format.
    """
    for index, frame in enumerate(tracked(recording.frames, "Checking images", len(recording.frames))):
        if is_distorted(frame.camera):
            given = ("stereo", "disparity", "flow", "depth")
            if named := [name for name in given if getattr(frame, name) is not None]:
                raise InputError(
                    f"be PINHOLE where there is {' or '.join(named)}, which belongs to images without distortion",
                    got="OPENCV with distortion",
                    file=recording.root,
                    key=f"frames[{index}].camera.model",
                    remedy=f"Undistort the images, or leave the {' and '.join(named)} out.",
                )
            try:
                pinhole_of(frame.camera)
            except InputError as error:
                raise error.at(file=recording.root) from error
        size = frame.camera.height, frame.camera.width
        _check(frame.image, size)
        if frame.stereo is not None:
            _check(frame.stereo.image, (frame.stereo.camera.height, frame.stereo.camera.width))
        if frame.masks is not None:
            _check(frame.masks.file, size, what="mask", ids=True)
        if frame.disparity is not None:
            _check(frame.disparity.file, size, what="disparity", ids=False)
        if frame.segmentation is not None:
            _check(frame.segmentation, size, what="segmentation", ids=True)
        if frame.flow is not None:
            _check_size(frame.flow, read_flow(frame.flow).size, size, "flow")
        if frame.depth is not None:
            _check_size(frame.depth.file, read_depth(frame.depth.file).shape[:2], size, "depth")
        if frame.boxes is not None:
            read_boxes(frame.boxes.file)


def copy_recording(recording: Recording, folder: str | Path) -> Recording:
    """Copy a recording so that it stands on its own, and return it re-read: byte for byte, or undistorted.

    Parameters
    ----------
    recording : Recording
        Any recording, from whatever files.
    folder : path
        Gets `recording.json` and below it a folder for each kind of file (`image/`, `mask/`, …); an earlier folder of this
        name is replaced as a whole, or kept as it was if anything fails. Files carry their frame's name.

    Returns
    -------
    copy : Recording
        Read back from the new file. Pictures, masks and segmentations of a lens with distortion are resampled to a
        PINHOLE camera, as the tracer has no other. Sweeps and the static cloud are not copied, since a scene has their
        meshes; only a recording without frames keeps its cloud, as it has nothing else.

    Raises
    ------
    InputError
        If a file cannot be read or the folder not be written to.
    """
    folder = Path(folder)
    with replacing_folder(folder) as temporary:
        names = unique_names(recording)
        frames = tuple(
            _copy_frame(frame, name, temporary)
            for frame, name in tracked(zip(recording.frames, names, strict=True), "Copying images", total=len(names))
        )
        cloud = None
        if not frames and recording.points is not None:
            cloud = _copy(recording.points, temporary / "points" / recording.points.name)
        write_recording(temporary / "recording.json", replace(recording, frames=frames, points=cloud, root=temporary))
    return read_recording(folder / "recording.json")


def unique_names(recording: Recording) -> list[str]:
    """Return a name per frame: its image's, preceded by the folder's where two frames would share it, then numbered."""
    stems = [frame.name for frame in recording.frames]
    repeated = {stem for stem in stems if stems.count(stem) > 1}
    names: list[str] = []
    taken: set[str] = set()
    for frame in recording.frames:
        base = f"{frame.image.parent.name}_{frame.name}" if frame.name in repeated else frame.name
        name, number = base, 2
        while name in taken or (name != base and name in stems):
            name, number = f"{base}_{number}", number + 1
        taken.add(name)
        names.append(name)
    return names


def _copy_frame(frame: Frame, name: str, folder: Path) -> Frame:
    if is_distorted(frame.camera):
        return _undistorted(frame, name, folder)

    def copied(file: Path, kind: str) -> Path:
        return _copy(file, folder / kind / (name + file.suffix))

    stereo, masks, disparity = frame.stereo, frame.masks, frame.disparity
    return replace(
        frame,
        image=copied(frame.image, "image"),
        points=None,
        stereo=None if stereo is None else replace(stereo, image=copied(stereo.image, "stereo")),
        masks=None if masks is None else replace(masks, file=copied(masks.file, "mask")),
        disparity=None if disparity is None else replace(disparity, file=copied(disparity.file, "disparity")),
        segmentation=None if frame.segmentation is None else copied(frame.segmentation, "segmentation"),
        flow=None if frame.flow is None else copied(frame.flow, "flow"),
        depth=None if frame.depth is None else replace(frame.depth, file=copied(frame.depth.file, "depth")),
        boxes=None if frame.boxes is None else replace(frame.boxes, file=copied(frame.boxes.file, "boxes")),
    )


def _undistorted(frame: Frame, name: str, folder: Path) -> Frame:
    camera = frame.camera
    pinhole = pinhole_of(camera)

    def straightened(file: Path, kind: str) -> Path:
        target = folder / kind / (name + file.suffix)
        undistort_ids(file, target, camera, pinhole)
        return target

    image = folder / "image" / (name + frame.image.suffix)
    undistort_image(frame.image, image, camera, pinhole, frame.response)
    masks, segmentation, boxes = frame.masks, frame.segmentation, frame.boxes
    if boxes is not None:
        boxes = replace(boxes, file=_copy(boxes.file, folder / "boxes" / (name + boxes.file.suffix)))
    return replace(
        frame,
        image=image,
        camera=pinhole,
        points=None,
        masks=None if masks is None else replace(masks, file=straightened(masks.file, "mask")),
        segmentation=None if segmentation is None else straightened(segmentation, "segmentation"),
        boxes=boxes,
    )


def _copy(source: Path, target: Path) -> Path:
    make_folder(target.parent)
    try:
        shutil.copyfile(source, target)
    except FileNotFoundError as error:
        raise InputError("exist", file=source, remedy="Check the recording.") from error
    return target


def _check(file: Path, size: tuple[int, int], what: str = "image", ids: bool | None = None) -> None:
    """Decode a file and compare its size (rows, columns); `ids` says whether it must hold whole numbers."""
    raw = read_ids(file) if ids else read_raw(file)
    _check_size(file, raw.shape[:2], size, what)
    if ids is not None and raw.ndim != 2:
        raise InputError("have one channel", got=f"{raw.shape[2]}", file=file, key=f"the {what}", remedy="Save it as a grey PNG.")
    if ids and not np.issubdtype(raw.dtype, np.integer):
        raise InputError(
            "hold whole numbers (ids)", got=raw.dtype, file=file, key=f"the {what}", remedy="Save it as an 8- or 16-bit PNG."
        )


def _check_size(file: Path, got: tuple[int, ...], size: tuple[int, int], what: str) -> None:
    if got != size:
        raise InputError(
            f"have the size of its camera, {size[1]} x {size[0]}",
            got=f"{got[1]} x {got[0]}",
            file=file,
            key=f"the {what}",
            remedy="Give the calibration of this size of image, or the images of this calibration.",
        )
