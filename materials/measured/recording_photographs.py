"""Photographs of a recording/1 under directional lights, seen by one ORTHOGRAPHIC camera: a photometric-stereo folder.

The lights are those of the `simulation.json` beside it, or the one that is given. Only what photometric stereo needs is read;
`scene` reads the formats as a whole.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..foundation.errors import InputError
from ..foundation.files import read_json
from ..foundation.images import read_image, read_raw
from ..foundation.progress import tracked
from .photographs import Photographs

Floats = NDArray[np.float64]


def read_recording_photographs(path: str | Path, simulation: str | Path | None = None, images: slice | None = None) -> Photographs:
    """Read the photographs of a recording as samples of reflectance.

    Parameters
    ----------
    path : path
        `recording.json` or its folder.
    simulation : path, optional
        `simulation.json` with the lights; by default the one beside the recording. A shape's `normal_map`, if there is one,
        gives normals to compare with, and its zeros what is no object.
    images : slice, optional
        Some of the photographs only.

    Returns
    -------
    photographs : Photographs
        In the camera's frame turned to x right, y up, z to the camera; divided by exposure and irradiance.

    Raises
    ------
    InputError
        If a camera is not ORTHOGRAPHIC or moves, a frame has not exactly one light, a light is not directional or shines from
        behind, or files are missing or disagree.
    """
    path = Path(path)
    path = path / "recording.json" if path.is_dir() else path
    recording = _mapping(read_json(path), path, "the file")
    if recording.get("format") != "recording/1":
        raise InputError("be recording/1", got=recording.get("format"), file=path, key="format")
    frames = recording.get("frames")
    frames = frames[images or slice(None)] if isinstance(frames, list) else frames
    if not isinstance(frames, list) or len(frames) < 3:
        got = len(frames) if isinstance(frames, list) else frames
        raise InputError("hold at least three photographs", got=got, file=path, key="frames")
    simulation = Path(simulation) if simulation is not None else path.parent / "simulation.json"
    believed = _mapping(read_json(simulation), simulation, "the file")
    lights = _mapping(believed.get("lights"), simulation, "lights")
    view = _view(frames, path)
    normal, mask = _normal_map(believed, simulation)
    directions, values, names = [], [], []
    for i, frame in enumerate(tracked(frames, "reading photographs")):
        key = f"frames[{i}]"
        on = frame.get("lights") or (list(lights) if len(lights) == 1 else None)
        if not isinstance(on, list) or len(on) != 1:
            raise InputError("name one light", got=on, file=path, key=f"{key}.lights")
        towards, irradiance = _light(lights.get(on[0]), simulation, f"lights.{on[0]}")
        direction = view @ towards
        if direction[2] <= 0:
            raise InputError("shine on the side that the camera sees", got=towards.tolist(), file=simulation, key=f"lights.{on[0]}")
        file = _below(path.parent, frame.get("image"), path, f"{key}.image")
        linear, _ = read_image(file, frame.get("response"))
        if mask is None:
            mask = np.ones(linear.shape[:2], bool)
        if linear.shape[:2] != mask.shape:
            raise InputError(f"have the size {mask.shape}", got=linear.shape[:2], file=file)
        exposure = frame.get("exposure", 1.0)
        if not isinstance(exposure, int | float) or not exposure > 0:
            raise InputError("be positive", got=exposure, file=path, key=f"{key}.exposure")
        values.append(linear[mask] / (exposure * irradiance).astype(np.float32))
        directions.append(direction)
        names.append(file.name)
    assert mask is not None
    wi = np.array(directions)
    # Noise may have left values below 0; they say as much about the surface as those above it, but no reflectance is negative.
    value = np.maximum(np.stack(values, axis=1), 0)
    wo = np.tile([0.0, 0.0, 1.0], (len(wi), 1))
    valid = np.ones(value.shape[:2], bool)
    name = str(recording.get("name") or path.parent.resolve().name)
    abrdf = ABRDF(wi, wo, value, valid, np.ones(len(wi)), unit="1/sr", normalised=False, mask=mask, name=name)
    return Photographs(abrdf, mask, tuple(names), normal)


def _view(frames: list[Any], path: Path) -> Floats:
    """Return the rotation (3, 3) from the world to x right, y up, z to the camera; the same for all frames."""
    found: Floats | None = None
    for i, frame in enumerate(frames):
        camera = _mapping(_mapping(frame, path, f"frames[{i}]").get("camera"), path, f"frames[{i}].camera")
        if camera.get("model") != "ORTHOGRAPHIC":
            remedy = "Photometric stereo here wants one view from far away."
            raise InputError("be ORTHOGRAPHIC", got=camera.get("model"), file=path, key=f"frames[{i}].camera.model", remedy=remedy)
        try:
            pose = np.array(camera.get("T_world_camera"), np.float64)
        except (TypeError, ValueError):
            pose = np.empty(0)
        rotation = pose[:3, :3] if pose.shape == (4, 4) else np.empty(0)
        if rotation.shape != (3, 3) or not np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-5):
            raise InputError(
                "be a rigid pose", got=camera.get("T_world_camera"), file=path, key=f"frames[{i}].camera.T_world_camera"
            )
        if found is not None and not np.allclose(rotation, found, atol=1e-6):
            raise InputError("stay still", got="another view", file=path, key=f"frames[{i}].camera.T_world_camera")
        found = rotation if found is None else found
    assert found is not None
    return np.diag([1.0, -1.0, -1.0]) @ found.T


def _light(light: Any, file: Path, key: str) -> tuple[Floats, Floats]:
    """Return the unit direction towards a light, in the world, and its irradiance (3,)."""
    light = _mapping(light, file, key)
    if light.get("type") != "directional":
        raise InputError("be directional", got=light.get("type"), file=file, key=f"{key}.type")
    try:
        direction = np.array(light.get("direction"), np.float64).reshape(3)
        irradiance = np.array(light.get("irradiance"), np.float64).reshape(3)
    except (TypeError, ValueError) as error:
        raise InputError("have a direction and an irradiance of three numbers", got=light, file=file, key=key) from error
    length = float(np.linalg.norm(direction))
    if not np.isfinite(length) or length <= 0 or not (irradiance > 0).all():
        raise InputError("have a direction and a positive irradiance", got=light, file=file, key=key)
    return -direction / length, irradiance


def _normal_map(believed: dict[str, Any], file: Path) -> tuple[Floats | None, NDArray[np.bool_] | None]:
    """Return the normals (H, W, 3) of the one shape that is a normal map, and where they are not 0."""
    shapes = believed.get("shapes", [])
    named = next((s["normal_map"] for s in shapes if isinstance(s, dict) and s.get("normal_map")), None)
    if named is None:
        return None, None
    path = _below(file.parent, named, file, "shapes[].normal_map")
    raw = np.asarray(read_raw(path))
    normal = raw.astype(np.float64)
    if raw.dtype.kind in "ui":
        normal = np.where(raw.max(axis=-1, keepdims=True) > 0, 2 * normal / np.iinfo(raw.dtype).max - 1, 0)
    length = np.linalg.norm(normal, axis=-1)
    mask = length > 0.5
    if normal.ndim != 3 or not mask.any():
        raise InputError("hold normals (H, W, 3)", got=raw.shape, file=path)
    return np.where(mask[..., None], normal / np.maximum(length, 1e-9)[..., None], 0), mask


def _below(root: Path, name: Any, file: Path, key: str) -> Path:
    if not isinstance(name, str) or not (root / name).resolve().is_relative_to(root.resolve()):
        raise InputError("be a path below the folder of the JSON", got=name, file=file, key=key)
    return root / name


def _mapping(value: Any, file: Path, key: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError("be an object", got=value, file=file, key=key)
    return value
