"""boxes/1: the 3-D boxes of a frame's objects, and the JSON file that says so (docs/formats.md).

A box has its own axes: x along its length, y along its width to the left, z up along its height; its origin is its
centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import write_json
from materials.foundation.typed_json import read_typed_json

from .transforms import as_pose, invert, transform_points

Floats = NDArray[np.floating]

# Words of KITTI, Argoverse 2, nuScenes and Waymo for people on their feet and for what is bolted or put to the ground.
_PEDESTRIANS = ("pedestrian", "person", "person_sitting", "official_signaler", "dog", "animal", "stroller", "wheelchair")
_STANDING = (
    "bollard",
    "construction_barrel",
    "construction_cone",
    "message_board_trailer",
    "mobile_pedestrian_sign",
    "mobile_pedestrian_crossing_sign",
    "sign",
    "stop_sign",
    "traffic_light_trailer",
    "traffic_cone",
    "barrier",
)


@dataclass(frozen=True)
class Box:
    """An object of one frame.

    Attributes
    ----------
    track : str
        Name of the object, the same in all frames.
    category : str
        What it is, in the words of its source: "Car", "REGULAR_VEHICLE".
    T_boxes_object : (4, 4) float64
        Pose of its centre in the file's frame [m].
    size : (3,) float64
        Length, width, height [m].
    moving : bool or None
        Whether it moves; None where nobody said.
    """

    track: str
    category: str
    T_boxes_object: NDArray[np.float64]
    size: NDArray[np.float64]
    moving: bool | None = None

    @property
    def kind(self) -> str:
        """Return "pedestrian" or "vehicle", as the masks of a recording call it; riders go with what they ride."""
        return "pedestrian" if self.category.lower().replace(" ", "_") in _PEDESTRIANS else "vehicle"

    @property
    def stands(self) -> bool:
        """Whether things of its category never move by themselves: cones, signs."""
        return self.category.lower().replace(" ", "_") in _STANDING

    def moved_by(self, T_a_boxes: Floats) -> Box:
        """Return the box in another frame."""
        return replace(self, T_boxes_object=T_a_boxes @ self.T_boxes_object)

    def corners(self) -> NDArray[np.float64]:
        """Return the corners (8, 3) [m]; corner number b has its x, y, z on the high side where bits 4, 2, 1 of b are set."""
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        return transform_points(self.T_boxes_object, signs * self.size)

    def contains(self, points: Floats, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return which points (N, 3) of the box's frame lie in it, widened by `margin` but not downwards, into the ground."""
        p = transform_points(invert(self.T_boxes_object), np.asarray(points, dtype=np.float64))
        half = 0.5 * self.size
        return (np.abs(p[:, :2]) <= half[:2] + margin).all(axis=1) & (p[:, 2] <= half[2] + margin) & (p[:, 2] >= -half[2])


class _BoxJson(msgspec.Struct, forbid_unknown_fields=True):
    track: str | int
    size: list[float]
    category: str = msgspec.field(name="class", default="")
    centre: list[float] | None = None
    yaw: float | None = None
    T_boxes_object: list[list[float]] | None = None
    moving: bool | None = None


class _BoxesJson(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["boxes/1"]
    boxes: list[_BoxJson]


def read_boxes(path: str | Path, unit: float = 1.0) -> tuple[Box, ...]:
    """Read a boxes/1 file whose lengths are so many metres.

    Raises
    ------
    InputError
        If the file is no JSON of this format, a box has no place or two, a size that is not positive, or a track has two
        boxes.
    """
    path = Path(path)
    data = read_typed_json(path, _BoxesJson)
    boxes: list[Box] = []
    try:
        for i, item in enumerate(data.boxes):
            boxes.append(_box(item, f"boxes[{i}]", unit))
            if any(box.track == boxes[-1].track for box in boxes[:-1]):
                raise InputError("be the only one of its frame", got=boxes[-1].track, key=f"boxes[{i}].track")
    except InputError as error:
        raise error.at(file=path) from error
    return tuple(boxes)


def write_boxes(path: str | Path, boxes: tuple[Box, ...], unit: float = 1.0) -> None:
    """Write a boxes/1 file in a unit of so many metres."""
    out: list[dict[str, Any]] = []
    for box in boxes:
        T = np.column_stack([box.T_boxes_object[:, :3], box.T_boxes_object[:, 3] / (unit, unit, unit, 1.0)])
        entry = {"track": box.track, "class": box.category, "T_boxes_object": T.tolist(), "size": (box.size / unit).tolist()}
        out.append(entry if box.moving is None else entry | {"moving": box.moving})
    write_json(path, {"format": "boxes/1", "boxes": out})


def upright_pose(centre: Floats, yaw: float) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a box at a centre (3,), turned about z [rad] from x towards y."""
    T = np.eye(4)
    c, s = np.cos(yaw), np.sin(yaw)
    T[:2, :2] = [[c, -s], [s, c]]
    T[:3, 3] = centre
    return T


def _box(item: _BoxJson, key: str, unit: float) -> Box:
    if (item.centre is None) == (item.T_boxes_object is None):
        got = "neither" if item.centre is None else "both"
        raise InputError("have either `centre` (and `yaw`) or `T_boxes_object`", got=got, key=key)
    size = _three(item.size, f"{key}.size")
    if size.min() <= 0:
        raise InputError("be positive", got=item.size, key=f"{key}.size")
    if item.centre is not None:
        yaw = item.yaw or 0.0
        if not np.isfinite(yaw):
            raise InputError("be finite", got=yaw, key=f"{key}.yaw")
        T = upright_pose(_three(item.centre, f"{key}.centre"), yaw)
    else:
        if item.yaw is not None:
            raise InputError("be left out beside `T_boxes_object`", got=item.yaw, key=f"{key}.yaw")
        T = as_pose(item.T_boxes_object or [], f"{key}.T_boxes_object")
    T[:3, 3] *= unit
    return Box(str(item.track), item.category, T, size * unit, item.moving)


def _three(values: list[float], key: str) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InputError("be three finite numbers", got=values, key=key)
    return array
