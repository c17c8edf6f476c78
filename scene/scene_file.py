"""scene/1: a reconstructed drive on disk, and in memory as the augmentation reads it.

    SCENE/
      scene.json                 this file's format
      recording/recording.json   the input images, masks and poses, copied byte by byte: a scene stands on its own
      meshes/ground.ply, meshes/environment.ply
      cardboards/FRAME.ply       all dynamic objects of a frame; vertex attribute `instance` is the mask id
      maps/*.exr                 ground maps on one metric grid (rows along +y), and the sky panorama
      preview/*.png, report.json

Static meshes carry per-vertex attributes `fill_r, fill_g, fill_b` (linear radiance seen by other frames) and `fill_w`
(0 = seen by no frame).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range, check_shape
from materials.foundation.errors import InputError
from materials.foundation.files import write_json
from materials.foundation.typed_json import read_typed_json

from .grid import GroundGrid
from .images import read_exr, write_exr
from .mesh import Mesh, read_ply, write_ply
from .recording import Recording, read_recording

CLASSES = ("ground", "environment", "vehicle", "pedestrian")
GROUND_MAPS = ("height", "mask", "moisture", "puddles", "coverage")


@dataclass(frozen=True)
class Cardboard:
    """A dynamic object of one frame: a vertical rectangle that its mask cuts out.

    Attributes
    ----------
    instance : int
        Id in the frame's mask.
    kind : str
        "vehicle" or "pedestrian".
    corners_world : (4, 3) float64
        Bottom left, bottom right, top right, top left as the camera sees it [m].
    """

    instance: int
    kind: str
    corners_world: NDArray[np.float64]


@dataclass(frozen=True)
class Sky:
    """Radiance from beyond all meshes.

    Attributes
    ----------
    panorama : (H, W, 4) float32
        Linear RGB, usable everywhere, and its weight: 1 where a frame saw it, 0 where it is generic. Rows from the
        zenith (first) to the nadir, columns from azimuth -pi to pi, where azimuth = atan2(y, x) in the world.
    """

    panorama: NDArray[np.float32]


@dataclass(frozen=True)
class Scene:
    """A reconstructed drive.

    Attributes
    ----------
    ground, environment : Mesh
        Static world, with the fill colours of `scene/1`.
    maps : dict of (rows, cols) float32
        `height` [m], `mask` (M of eq 6.5), `moisture` (S0), `puddles` (A0), `coverage` (1 where there is ground).
    class_means : dict of (3,)
        Mean linear radiance of "ground", "environment", "vehicle", "pedestrian" over the drive, for what no frame sees.
    cardboards : tuple of tuples
        Per frame of the recording.
    settings : dict
        All settings of the build.
    gains : tuple of float
        Exposure of each frame relative to the first, as measured on the static world; empty: all alike.
    """

    name: str
    recording: Recording
    ground: Mesh
    environment: Mesh
    grid: GroundGrid
    maps: dict[str, NDArray[np.float32]]
    sky: Sky
    class_means: dict[str, NDArray[np.float32]]
    cardboards: tuple[tuple[Cardboard, ...], ...]
    settings: dict[str, Any] = field(default_factory=dict)
    gains: tuple[float, ...] = ()

    def gain(self, frame: int) -> float:
        """Return a frame's exposure relative to the first, in which fill colours and sky are given."""
        return self.gains[frame] if self.gains else 1.0


class _GridJson(msgspec.Struct, forbid_unknown_fields=True):
    x_min: float
    y_min: float
    cell: float
    rows: int
    cols: int
    maps: dict[str, str]


class _CardboardJson(msgspec.Struct, forbid_unknown_fields=True):
    instance: int
    kind: Literal["vehicle", "pedestrian"]
    corners_world: list[list[float]]


class _FrameJson(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    cardboards: list[_CardboardJson]
    gain: float = 1.0


class _SceneJson(msgspec.Struct, forbid_unknown_fields=True):
    format: Literal["scene/1"]
    name: str
    recording: str
    ground: str
    environment: str
    ground_maps: _GridJson
    sky: str
    class_means: dict[str, list[float]]
    frames: list[_FrameJson]
    settings: dict[str, Any]


def write_scene(folder: str | Path, scene: Scene) -> None:
    """Write meshes, maps and `scene.json`, the last of all: a folder without it is no scene.

    The recording must already lie in `folder/recording`.

    Raises
    ------
    InputError
        If two frames have images of the same name: the files of a scene go by it.
    """
    folder = Path(folder)
    names = [frame.name for frame in scene.recording.frames]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError("have a name of its own", got=twice, key="each image of a scene", remedy="Rename the images.")
    write_ply(folder / "meshes" / "ground.ply", scene.ground)
    write_ply(folder / "meshes" / "environment.ply", scene.environment)
    for name, values in scene.maps.items():
        write_exr(folder / "maps" / f"{name}.exr", {"Y": values})
    write_exr(folder / "maps" / "sky.exr", dict(zip("RGBA", np.moveaxis(scene.sky.panorama, -1, 0), strict=True)))
    for frame, boards in zip(scene.recording.frames, scene.cardboards, strict=True):
        if boards:
            write_ply(folder / "cardboards" / f"{frame.name}.ply", cardboard_mesh(boards))
    grid = {key: getattr(scene.grid, key) for key in ("x_min", "y_min", "cell", "rows", "cols")}
    frames = [
        {
            "name": frame.name,
            "gain": scene.gain(i),
            "cardboards": [{"instance": b.instance, "kind": b.kind, "corners_world": b.corners_world.tolist()} for b in boards],
        }
        for i, (frame, boards) in enumerate(zip(scene.recording.frames, scene.cardboards, strict=True))
    ]
    write_json(
        folder / "scene.json",
        {
            "format": "scene/1",
            "name": scene.name,
            "recording": "recording/recording.json",
            "ground": "meshes/ground.ply",
            "environment": "meshes/environment.ply",
            "ground_maps": {**grid, "maps": {name: f"maps/{name}.exr" for name in scene.maps}},
            "sky": "maps/sky.exr",
            "class_means": {name: [float(c) for c in value] for name, value in scene.class_means.items()},
            "frames": frames,
            "settings": scene.settings,
        },
    )


def read_scene(folder: str | Path) -> Scene:
    """Read a scene folder.

    Raises
    ------
    InputError
        If `scene.json` is missing or breaks the format, or a file that it names is missing or damaged.
    """
    folder = Path(folder)
    file = folder / "scene.json"
    if not file.exists():
        raise InputError("be a scene (with a scene.json)", file=folder, remedy="Build it with scene-build RECORDING -o SCENE.")
    data = read_typed_json(file, _SceneJson, remedy="Build the scene again.")
    try:
        return _scene(folder, data)
    except InputError as error:
        raise error.at(file=file) from error


def _scene(folder: Path, data: _SceneJson) -> Scene:
    g = data.ground_maps
    check_range("ground_maps.cell", g.cell, "(0, inf)")
    grid = GroundGrid(g.x_min, g.y_min, g.cell, g.rows, g.cols)
    maps = {}
    for name, path in g.maps.items():
        maps[name] = _channels(_below(folder, path, f"ground_maps.maps.{name}"), "Y")[0]
        if not np.all(np.isfinite(maps[name])):
            raise InputError("be finite", got="NaN or infinity", file=folder / path, remedy="Build the scene again.")
        if maps[name].shape != grid.shape:
            raise InputError(f"have the grid's shape {grid.shape}", got=maps[name].shape, file=folder / path)
    missing = [name for name in GROUND_MAPS if name not in maps]
    if missing:
        raise InputError("be given", key=f"ground_maps.maps.{missing[0]}", remedy="Build the scene again.")
    sky = np.stack(_channels(_below(folder, data.sky, "sky"), "RGBA"), axis=-1)
    for name in CLASSES:
        if name not in data.class_means:
            raise InputError("be given", key=f"class_means.{name}", remedy="Build the scene again.")
    for name, value in data.class_means.items():
        check_shape(f"class_means.{name}", np.array(value), (3,))
    for i, frame in enumerate(data.frames):
        check_range(f"frames[{i}].gain", frame.gain, "(0, inf)")
    recording = read_recording(_below(folder, data.recording, "recording"))
    if [f.name for f in data.frames] != [f.name for f in recording.frames]:
        raise InputError("list the frames of the recording", key="frames", remedy="Build the scene again.")
    ground = read_ply(_below(folder, data.ground, "ground"))
    if ground.num_faces == 0 or not np.all(np.isfinite(ground.vertices)):
        got = "NaN or infinity" if ground.num_faces else "no triangles"
        raise InputError("be triangles between finite places", got=got, file=folder / data.ground, remedy="Build the scene again.")
    return Scene(
        data.name,
        recording,
        ground,
        read_ply(_below(folder, data.environment, "environment")),
        grid,
        maps,
        Sky(sky),
        {name: np.array(value, np.float32) for name, value in data.class_means.items()},
        tuple(_cardboards(frame, f"frames[{i}]") for i, frame in enumerate(data.frames)),
        data.settings,
        tuple(f.gain for f in data.frames),
    )


def _cardboards(frame: _FrameJson, key: str) -> tuple[Cardboard, ...]:
    boards = []
    for i, board in enumerate(frame.cardboards):
        if [len(corner) for corner in board.corners_world] != [3, 3, 3, 3]:
            raise InputError("be four corners of three numbers", key=f"{key}.cardboards[{i}].corners_world")
        boards.append(Cardboard(board.instance, board.kind, np.array(board.corners_world)))
    return tuple(boards)


def _channels(path: Path, names: str) -> list[NDArray[np.float32]]:
    layers = read_exr(path)
    if missing := [name for name in names if name not in layers]:
        raise InputError(f"have the channel {missing[0]}", got=", ".join(layers), file=path, remedy="Build the scene again.")
    return [layers[name].astype(np.float32) for name in names]


def _below(folder: Path, name: str, key: str) -> Path:
    if not name or PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
        raise InputError("be a path below the folder of the JSON", got=name, key=key)
    return folder / name


def cardboard_mesh(boards: tuple[Cardboard, ...]) -> Mesh:
    """Return the cardboards of a frame as one mesh; vertex attribute `instance` holds the mask id."""
    vertices = np.concatenate([b.corners_world for b in boards]).astype(np.float32)
    quad = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    faces = np.concatenate([quad + np.uint32(4 * i) for i in range(len(boards))])
    instance = np.repeat([b.instance for b in boards], 4).astype(np.int32)
    return Mesh(vertices, faces, attributes={"instance": instance})
