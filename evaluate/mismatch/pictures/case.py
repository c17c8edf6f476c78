"""Recorded and simulated pictures as a case: each pixel is one piece, whose colour is what was simulated of it.

All that the diagnosis does with a case, it does with this one: what veils, bends, blurs and encodes a picture acts on
pieces and pictures, and asks nothing of shapes and lamps.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.mesh import Mesh
from scene.recording import Frame, Noise, Recording
from scene.simulation import EnvironmentLight, Light, Material, Shape, Simulation, Transport

from ..case import Case, Floats, sensor_variance
from ..pieces import Pieces

STATIC = "picture"
_WHITE = "as simulated"
_FAR = 1e6  # [m]: where what is infinitely far is put


@dataclass(frozen=True)
class Given:
    """Pictures and what is known of them.

    Attributes
    ----------
    recorded, simulated : (F, H, W, 3) float32
        Linear; a pixel that is not finite in either is left out.
    depth : (F, H, W) float32 or None
        Along the camera's z [m]; infinite beyond all surfaces, NaN where it is not known.
    labels : (F, H, W) int or None
        Ids of bodies, 0 for all else.
    measured : (F, H, W) bool or None
        Pixels that may be used; None: all.
    extra : (F, H, W, 3) float32 or None
        Variance of the simulation itself, which is added to that of the sensor.
    names : list of str
        Of the frames.
    cameras : tuple of Camera or None
        None: a level camera, above the lowest that it sees.
    focal_px : float or None
        Of that camera; None: the picture's width.
    label_names : dict of str or None
        Names of the ids; None: "picture" and "body ID".
    exposures : tuple of float or None
        By which pictures were divided that the noise is stated of; None: by nothing.
    """

    recorded: Floats
    simulated: Floats
    names: list[str]
    depth: Floats | None = None
    labels: NDArray[np.int64] | None = None
    measured: NDArray[np.bool_] | None = None
    extra: Floats | None = None
    cameras: tuple[Camera, ...] | None = None
    focal_px: float | None = None
    label_names: dict[int, str] | None = None
    exposures: tuple[float, ...] | None = None


@dataclass(frozen=True)
class PictureCase(Case):
    """A case of given pictures.

    Attributes
    ----------
    given : Pieces
        One a pixel.
    extra : (F, H, W, 3) float32 or None
        As of `Given`.
    uncertain : float
        Mean share of `extra` in the variance.
    has_depth : bool
    reasons : dict of str
        Why effects could not be tested, by id.
    layers : dict of dict
        By the name of a frame: what else is known of it, for effects that ask for it.
    """

    given: Pieces | None = None
    extra: Floats | None = None
    uncertain: float = 0.0
    has_depth: bool = False
    reasons: dict[str, str] = field(default_factory=dict)
    layers: dict[str, dict[str, Any]] = field(default_factory=dict)

    @cached_property
    def pieces(self) -> Pieces:
        assert self.given is not None
        return self.given

    def layer(self, key: str) -> list[Any]:
        """Return what is known of each frame under a key."""
        return [self.layers[f.name][key] for f in self.recording.frames]

    @property
    def traced(self) -> bool:
        return False

    @property
    def untestable(self) -> dict[str, str]:
        return self.reasons

    @property
    def shared_variance(self) -> float:
        """That of the simulation itself: where a surface or a camera is off, it is off for all pixels around."""
        return self.uncertain

    def noise_of(self, picture: Floats) -> Floats:
        """Return the variance of a recording of `picture`, with that of the simulation itself."""
        own = super().noise_of(picture)
        return own if self.extra is None else own + self.extra


def build(g: Given, noise: Noise, noise_estimated: bool, notes: tuple[str, ...] = (), root: Path = Path()) -> PictureCase:
    """Return pictures as a case.

    Raises
    ------
    InputError
        If no pixel was measured.
    """
    frames, height, width = g.recorded.shape[:3]
    finite = np.all(np.isfinite(g.recorded), axis=-1) & np.all(np.isfinite(g.simulated), axis=-1)
    valid = finite if g.measured is None else finite & g.measured
    lost = int((~finite).sum())
    if g.depth is not None:
        valid = valid & ~np.isnan(g.depth)
        unknown = int((finite & np.isnan(g.depth)).sum())
        notes += (f"{unknown} pixels have no depth and were left out.",) if unknown else ()
    if not valid.any():
        raise InputError("hold measured pixels", got="NaN or masked ones alone", key="the pictures")
    notes += (f"{lost} pixels are NaN or infinite and were left out.",) if lost else ()
    recorded = np.where(valid[..., None], g.recorded, 0).astype(np.float32)
    cameras = g.cameras or (level_camera(width, height, g.focal_px, g.depth),) * frames
    exposures = g.exposures or (1.0,) * frames
    variance = sensor_variance(recorded, noise, list(exposures))
    entries = tuple(Frame(root / name, c, "linear", exposure=e) for name, c, e in zip(g.names, cameras, exposures, strict=True))
    each = np.arange(frames)
    return PictureCase(
        Recording(entries, root, noise=noise),
        _stand_in(g.labels, g.label_names),
        recorded,
        valid,
        variance if g.extra is None else variance + g.extra,
        tuple(cameras),
        (),
        np.zeros((0, 7)),
        np.full((frames, 1), -1, np.int64),
        np.ones(frames, bool),
        each,
        each,
        np.zeros(frames, np.int64),
        noise,
        noise_estimated,
        notes,
        given=_pieces(g, valid, list(cameras)),
        extra=g.extra,
        uncertain=0.0 if g.extra is None else float((g.extra / (variance + g.extra))[valid].mean()),
        has_depth=g.depth is not None,
    )


def level_camera(width: int, height: int, focal_px: float | None = None, depth: Floats | None = None) -> Camera:
    """Return a camera that looks along the world's y, with the lowest of what it sees at z = 0."""
    pose = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    focal = float(width) if focal_px is None else focal_px
    if depth is not None:
        below = np.where(np.isfinite(depth), depth, 0) * ((np.arange(height)[:, None] + 0.5 - height / 2) / focal)
        pose[2, 3] = float(np.quantile(below, 0.98))
    return Camera("PINHOLE", width, height, pose, focal, focal, width / 2, height / 2)


def body_name(label: int) -> str:
    """Return the name of a body by its id."""
    return f"body {label}" if label else STATIC


def _stand_in(labels: NDArray[np.int64] | None, names: dict[int, str] | None = None) -> Simulation:
    """Return a simulation that shows each piece in its own colour: even light of 1, and nothing in its way."""
    ids = [0] if labels is None else sorted({0, *np.unique(labels).tolist()})
    speck = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32))
    shapes = tuple(Shape(body_name(i) if names is None else names[i], speck, _WHITE, instance=i) for i in ids)
    lights: dict[str, Light] = {_WHITE: EnvironmentLight((1.0, 1.0, 1.0))}
    return Simulation(shapes, {_WHITE: Material("lambert", albedo=(1.0, 1.0, 1.0))}, lights, Transport(1, shadows=False))


def _pieces(g: Given, valid: NDArray[np.bool_], cameras: list[Camera]) -> Pieces:
    frames, height, width = valid.shape
    n = frames * height * width
    depth = np.ones(n) if g.depth is None else np.where(np.isnan(g.depth), 1.0, g.depth).reshape(n).astype(np.float64)
    rays = np.concatenate([c.rays(c.pixel_centres())[1] for c in cameras])
    axis = np.repeat([c.T_world_camera[:3, 2] for c in cameras], height * width, axis=0)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    distance = depth / np.einsum("pc,pc->p", rays, axis)
    eye = np.repeat([c.position for c in cameras], height * width, axis=0)
    near = np.where(np.isfinite(distance), distance, _FAR)
    shape = np.zeros(n, np.int32)
    if g.labels is not None:
        shape = np.searchsorted(sorted({0, *np.unique(g.labels).tolist()}), g.labels.ravel()).astype(np.int32)
    at = np.tile(cameras[0].pixel_centres() / [width, height], (frames, 1))
    nothing = np.zeros((n, 3), np.float32)
    floats = {
        "weight": np.ones(n), "position": eye + near[:, None] * rays, "normal": -rays, "face_normal": -rays,
        "tangent": nothing, "view": -rays, "anchor": nothing, "anchor_normal": nothing, "across": nothing, "down": nothing,
        "albedo": np.where(valid[..., None], g.simulated, _filled(g.simulated)).reshape(n, 3), "uv": at, "distance": distance,
        "visible": np.zeros((n, 1)),
    }  # fmt: skip
    arrays = {name: np.ascontiguousarray(values, np.float32) for name, values in floats.items()}
    return Pieces(np.arange(n + 1), np.arange(n), shape=shape, **arrays, edge=np.zeros(n, bool))


def _filled(simulated: Floats) -> Floats:
    """Return the pictures with the frame's median where they are not finite: what blurs spread must be a number."""
    out = np.where(np.isfinite(simulated), simulated, np.nan)
    middle = np.array([[np.nanmedian(p[..., c]) if np.isfinite(p[..., c]).any() else 0 for c in range(3)] for p in out])
    return np.where(np.isnan(out), middle[:, None, None], out).astype(np.float32)
