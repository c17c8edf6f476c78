"""recording/1: what was measured, frame by frame, and the JSON file that says so (docs/formats.md)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import write_json
from materials.foundation.typed_json import read_typed_json

from .camera import Camera
from .recording_json import CameraJson, FrameJson, RecordingJson
from .transforms import as_pose

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


@dataclass(frozen=True)
class PointsFile:
    """A sweep: file, pose `T_world_points` of its frame (the scanner) [m], and how many metres a unit in the file is."""

    file: Path
    T_world_points: NDArray[np.float64]
    unit: float = 1.0


@dataclass(frozen=True)
class MaskFile:
    """Instance ids of dynamic objects (0 = static); `default_class` is "vehicle" or "pedestrian"; `classes` per id wins."""

    file: Path
    default_class: str = "vehicle"
    classes: dict[int, str] | None = None


@dataclass(frozen=True)
class StereoFile:
    """The second camera of a rectified pair."""

    image: Path
    camera: Camera


@dataclass(frozen=True)
class DisparityFile:
    """Measured disparity: px = stored / scale, 0 = none; `baseline` in metres."""

    file: Path
    scale: float
    baseline: float


@dataclass(frozen=True)
class DepthFile:
    """True depth along the camera's z: metres = stored / scale (0, NaN or infinity = none)."""

    file: Path
    scale: float = 1.0


@dataclass(frozen=True)
class BoxesFile:
    """3-D boxes of the frame's objects (`scene.boxes`), the pose of their frame [m], and how many metres a unit is."""

    file: Path
    T_world_boxes: NDArray[np.float64]
    unit: float = 1.0


@dataclass(frozen=True)
class Frame:
    """One photograph and what was measured with it; `flow` is the true one, to the recording's next frame."""

    image: Path
    camera: Camera
    response: str | None = None
    exposure: float = 1.0
    lights: tuple[str, ...] | None = None
    points: PointsFile | None = None
    masks: MaskFile | None = None
    stereo: StereoFile | None = None
    disparity: DisparityFile | None = None
    segmentation: Path | None = None
    flow: Path | None = None
    depth: DepthFile | None = None
    boxes: BoxesFile | None = None

    @property
    def name(self) -> str:
        """Name of the frame: its image file without suffix."""
        return self.image.stem


@dataclass(frozen=True)
class Noise:
    """Pixel variance `read_sigma**2 + shot_gain * signal`, in the image's linear units."""

    read_sigma: float
    shot_gain: float


@dataclass(frozen=True)
class Recording:
    """All frames of a drive or a capture; all paths are absolute once read.

    Attributes
    ----------
    frames : tuple of Frame
        In order of time; empty for a bare point cloud.
    points : Path or None
        A static cloud of the whole recording, in world coordinates.
    points_unit : float
        How many metres a unit in that file is.
    root : Path
        Folder that the files lie below.
    """

    frames: tuple[Frame, ...]
    root: Path
    name: str = ""
    points: Path | None = None
    noise: Noise | None = None
    points_unit: float = 1.0


def read_recording(path: str | Path) -> Recording:
    """Read a recording/1 file, or the `recording.json` of a folder.

    Lengths are converted to metres; clouds carry their unit, as their files are read later. That the files it names exist
    is checked here; that they can be read, when they are.

    Raises
    ------
    InputError
        If the file is no JSON, a key is unknown, missing or of the wrong kind, a pose is not rigid, a path leaves the
        folder or does not exist, or there are neither frames nor points.
    """
    path = Path(path)
    path = path / "recording.json" if path.is_dir() else path
    data = read_typed_json(path, RecordingJson)
    try:
        if not data.frames and data.points is None:
            raise InputError("hold at least one frame, or the recording a cloud in `points`", got="none", key="frames")
        unit = _METRES[data.length_unit]
        root = path.parent
        frames = tuple(_frame(f, f"frames[{i}]", root, unit) for i, f in enumerate(data.frames))
        points = None if data.points is None else _below(root, data.points, "points")
        noise = None
        if data.noise is not None:
            for key in ("read_sigma", "shot_gain"):
                if not getattr(data.noise, key) >= 0:
                    raise InputError("be at least 0", got=getattr(data.noise, key), key=f"noise.{key}")
            noise = Noise(data.noise.read_sigma, data.noise.shot_gain)
    except InputError as error:
        raise error.at(file=path) from error
    return Recording(frames, root.resolve(), data.name or path.parent.resolve().name, points, noise, unit)


def write_recording(path: str | Path, recording: Recording) -> None:
    """Write a recording/1 file, in the unit of its clouds; every file of it must lie below the JSON's folder."""
    root = Path(path).parent.resolve()
    name, unit = _common_unit(recording)
    out: dict[str, Any] = {"format": "recording/1", "length_unit": name, "name": recording.name}
    if recording.points is not None:
        out["points"] = _relative(recording.points, root)
    if recording.noise is not None:
        out["noise"] = {"read_sigma": recording.noise.read_sigma, "shot_gain": recording.noise.shot_gain}
    out["frames"] = [_frame_json(frame, root, unit) for frame in recording.frames]
    write_json(path, out)


def _common_unit(recording: Recording) -> tuple[str, float]:
    """Return the unit of all clouds, which the JSON then has: `m` without clouds."""
    units = {frame.points.unit for frame in recording.frames if frame.points is not None}
    units |= {frame.boxes.unit for frame in recording.frames if frame.boxes is not None}
    units |= {recording.points_unit} if recording.points is not None else set()
    if len(units) > 1:
        raise InputError(
            "have one unit", got=sorted(units), key="all clouds and boxes of a recording", remedy="Convert some of them."
        )
    unit = units.pop() if units else 1.0
    return next(name for name, metres in _METRES.items() if metres == unit), unit


def camera_json(camera: Camera, unit: float = 1.0) -> dict[str, Any]:
    """Return a camera as the formats write it, in a unit of so many metres."""
    out: dict[str, Any] = {"model": camera.model, "width": camera.width, "height": camera.height}
    if camera.model == "ORTHOGRAPHIC":
        out |= {"pixel_size": None if camera.pixel_size is None else camera.pixel_size / unit, "cx": camera.cx, "cy": camera.cy}
    else:
        out |= {key: getattr(camera, key) for key in ("fx", "fy", "cx", "cy")}
    if camera.model == "OPENCV":
        out |= {key: getattr(camera, key) for key in ("k1", "k2", "p1", "p2")}
    return out | {"T_world_camera": _pose_json(camera.T_world_camera, unit)}


def select_frames(recording: Recording, indices: list[int]) -> Recording:
    """Return the recording with some of its frames only."""
    return replace(recording, frames=tuple(recording.frames[i] for i in indices))


def _frame(f: FrameJson, key: str, root: Path, unit: float) -> Frame:
    if not 1e-12 <= f.exposure <= 1e12:  # what float32 pictures bear; anything else is a slip
        raise InputError("lie in [1e-12, 1e12]", got=f.exposure, key=f"{key}.exposure")
    points = masks = stereo = disparity = None
    if f.points is not None:
        pose = _pose(f.points.T_world_points, f"{key}.points.T_world_points", unit)
        points = PointsFile(_below(root, f.points.file, f"{key}.points.file"), pose, unit)
    if f.masks is not None:
        classes = f.masks.classes
        if classes is not None and not all(name.isdigit() for name in classes):
            raise InputError("have instance numbers as keys", got=list(classes), key=f"{key}.masks.classes")
        by_id = None if classes is None else {int(name): kind for name, kind in classes.items()}
        masks = MaskFile(_below(root, f.masks.file, f"{key}.masks.file"), f.masks.default_class, by_id)
    if f.stereo is not None:
        image = _below(root, f.stereo.image, f"{key}.stereo.image")
        stereo = StereoFile(image, _camera(f.stereo.camera, f"{key}.stereo.camera", unit))
    if f.disparity is not None:
        for name in ("scale", "baseline"):
            if not getattr(f.disparity, name) > 0:
                raise InputError("be positive", got=getattr(f.disparity, name), key=f"{key}.disparity.{name}")
        file = _below(root, f.disparity.file, f"{key}.disparity.file")
        disparity = DisparityFile(file, f.disparity.scale, f.disparity.baseline * unit)
    segmentation = None if f.segmentation is None else _below(root, f.segmentation, f"{key}.segmentation")
    flow = None if f.flow is None else _below(root, f.flow, f"{key}.flow")
    depth = boxes = None
    if f.depth is not None:
        if not f.depth.scale > 0:
            raise InputError("be positive", got=f.depth.scale, key=f"{key}.depth.scale")
        depth = DepthFile(_below(root, f.depth.file, f"{key}.depth.file"), f.depth.scale / unit)
    if f.boxes is not None:
        pose = _pose(f.boxes.T_world_boxes, f"{key}.boxes.T_world_boxes", unit)
        boxes = BoxesFile(_below(root, f.boxes.file, f"{key}.boxes.file"), pose, unit)
    return Frame(
        _below(root, f.image, f"{key}.image"),
        _camera(f.camera, f"{key}.camera", unit),
        f.response,
        f.exposure,
        None if f.lights is None else tuple(f.lights),
        points,
        masks,
        stereo,
        disparity,
        segmentation,
        flow,
        depth,
        boxes,
    )


def _camera(c: CameraJson, key: str, unit: float) -> Camera:
    for name in ("width", "height"):
        if not 0 < getattr(c, name) <= 65535:
            raise InputError("lie in [1, 65535]", got=getattr(c, name), key=f"{key}.{name}")
    if c.model == "ORTHOGRAPHIC":
        if c.pixel_size is None or not c.pixel_size > 0:
            raise InputError("be given and positive for an ORTHOGRAPHIC camera", got=c.pixel_size, key=f"{key}.pixel_size")
    else:
        for name in ("fx", "fy"):
            value = getattr(c, name)
            if value is None or not value > 0:
                raise InputError(f"be given and positive for a {c.model} camera", got=value, key=f"{key}.{name}")
    pose = _pose(c.T_world_camera, f"{key}.T_world_camera", unit)
    cx = c.width / 2 if c.cx is None else c.cx
    cy = c.height / 2 if c.cy is None else c.cy
    size = None if c.pixel_size is None else c.pixel_size * unit
    return Camera(c.model, c.width, c.height, pose, c.fx or 1.0, c.fy or 1.0, cx, cy, c.k1, c.k2, c.p1, c.p2, size)


def _pose(rows: list[list[float]], key: str, unit: float) -> NDArray[np.float64]:
    T = as_pose(rows, key)
    T[:3, 3] *= unit
    return T


def _pose_json(T: NDArray[np.float64], unit: float) -> list[list[float]]:
    return np.column_stack([T[:, :3], T[:, 3] / (unit, unit, unit, 1.0)]).tolist()


def _below(root: Path, name: str, key: str) -> Path:
    """Resolve a path of the JSON, refusing what leaves its folder."""
    if not name or PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise InputError("be a path below the folder of the JSON", got=name, key=key)
    path = root / name
    if not path.exists():
        raise InputError("name a file that exists", got=name, key=key, remedy="Check the path.")
    return path.resolve()


def _relative(path: Path, root: Path) -> str:
    try:
        return path.resolve().relative_to(root).as_posix()
    except ValueError as error:
        raise InputError(f"lie below {root}", got=path, key="every file of a recording") from error


def _frame_json(frame: Frame, root: Path, unit: float) -> dict[str, Any]:
    out: dict[str, Any] = {"image": _relative(frame.image, root)}
    if frame.response is not None:
        out["response"] = frame.response
    if frame.exposure != 1.0:
        out["exposure"] = frame.exposure
    if frame.lights is not None:
        out["lights"] = list(frame.lights)
    out["camera"] = camera_json(frame.camera, unit)
    if frame.points is not None:
        out["points"] = {
            "file": _relative(frame.points.file, root),
            "T_world_points": _pose_json(frame.points.T_world_points, unit),
        }
    if frame.masks is not None:
        masks: dict[str, Any] = {"file": _relative(frame.masks.file, root), "default_class": frame.masks.default_class}
        if frame.masks.classes is not None:
            masks["classes"] = {str(k): v for k, v in frame.masks.classes.items()}
        out["masks"] = masks
    if frame.stereo is not None:
        out["stereo"] = {"image": _relative(frame.stereo.image, root), "camera": camera_json(frame.stereo.camera, unit)}
    if frame.disparity is not None:
        d = frame.disparity
        out["disparity"] = {"file": _relative(d.file, root), "scale": d.scale, "baseline": d.baseline / unit}
    if frame.segmentation is not None:
        out["segmentation"] = _relative(frame.segmentation, root)
    if frame.flow is not None:
        out["flow"] = _relative(frame.flow, root)
    if frame.depth is not None:
        out["depth"] = {"file": _relative(frame.depth.file, root), "scale": frame.depth.scale * unit}
    if frame.boxes is not None:
        pose = _pose_json(frame.boxes.T_world_boxes, unit)
        out["boxes"] = {"file": _relative(frame.boxes.file, root), "T_world_boxes": pose}
    return out
