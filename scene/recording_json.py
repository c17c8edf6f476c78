"""recording/1 as typed: msgspec refuses unknown keys and wrong kinds at every depth."""

from __future__ import annotations

from typing import Literal

import msgspec


class CameraJson(msgspec.Struct, forbid_unknown_fields=True):
    model: Literal["PINHOLE", "OPENCV", "ORTHOGRAPHIC"]
    width: int
    height: int
    T_world_camera: list[list[float]]
    fx: float | None = None
    fy: float | None = None
    cx: float | None = None
    cy: float | None = None
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    pixel_size: float | None = None


class PointsJson(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    T_world_points: list[list[float]]


class MasksJson(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    default_class: Literal["vehicle", "pedestrian"] = "vehicle"
    classes: dict[str, Literal["vehicle", "pedestrian"]] | None = None


class StereoJson(msgspec.Struct, forbid_unknown_fields=True):
    image: str
    camera: CameraJson


class DisparityJson(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    scale: float
    baseline: float


class DepthJson(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    scale: float = 1.0


class BoxesJson(msgspec.Struct, forbid_unknown_fields=True):
    file: str
    T_world_boxes: list[list[float]]


class FrameJson(msgspec.Struct, forbid_unknown_fields=True):
    image: str
    camera: CameraJson
    response: Literal["linear", "srgb"] | None = None
    exposure: float = 1.0
    lights: list[str] | None = None
    points: PointsJson | None = None
    masks: MasksJson | None = None
    stereo: StereoJson | None = None
    disparity: DisparityJson | None = None
    segmentation: str | None = None
    flow: str | None = None
    depth: DepthJson | None = None
    boxes: BoxesJson | None = None


class NoiseJson(msgspec.Struct, forbid_unknown_fields=True):
    read_sigma: float
    shot_gain: float


class RecordingJson(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["recording/1"]
    frames: list[FrameJson]
    length_unit: Literal["m", "cm", "mm"] = "m"
    name: str = ""
    points: str | None = None
    noise: NoiseJson | None = None
