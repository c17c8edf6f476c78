"""What every pixel of every frame sees: pieces of surface that can be shaded again under other suppositions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from materials.foundation.progress import tracked
from scene.camera import Camera
from transport.world import World, compile_camera

from ..kernels import fragments as kernel

Floats = NDArray[np.float32]
# Points per side of a pixel: where one surface fills it evenly lit, and where an edge runs through it.
_COARSE, _FINE = 2, 8
# The arrays of `Pieces` with one row a piece, but for `pixel`.
PER_PIECE = (
    "weight", "shape", "position", "normal", "face_normal", "tangent", "view", "anchor", "anchor_normal", "across", "down",
    "albedo", "uv", "distance", "visible",
)  # fmt: skip


@dataclass(frozen=True)
class Pieces:
    """Pieces of surface, pixel by pixel, frame by frame; one shape has at most one piece in a pixel.

    Attributes
    ----------
    start : (P + 1,) int64
        Pixel p (frame, row and column in C order) holds the pieces start[p] to start[p + 1].
    pixel : (N,) int64
        The pixel of each piece.
    weight : (N,) float32
        Its share of the pixel.
    shape : (N,) int32
        Index of its shape; -1 is what lies beyond the world.
    position, normal, face_normal, tangent, view : (N, 3) float32
        Means over the piece in the world [m]; unit vectors on the viewer's side; `view` points to the camera.
    anchor, anchor_normal : (N, 3) float32
        A point of the piece that lies on the surface itself, and its geometric normal: where rays start.
    across, down : (N, 3) float32
        How the point moves on the surface from one pixel to the next [m].
    albedo : (N, 3) float32
        Texture, before any scale (1 without one).
    uv : (N, 2) float32
    distance : (N,) float32
        From the camera [m]; 0 beyond the world.
    visible : (N, S) float32
        Share that the lamp of each slot reaches.
    edge : (P,) bool
        Pixels that an outline or the border of a shadow crosses.
    """

    start: NDArray[np.int64]
    pixel: NDArray[np.int64]
    weight: Floats
    shape: NDArray[np.int32]
    position: Floats
    normal: Floats
    face_normal: Floats
    tangent: Floats
    view: Floats
    anchor: Floats
    anchor_normal: Floats
    across: Floats
    down: Floats
    albedo: Floats
    uv: Floats
    distance: Floats
    visible: Floats
    edge: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.weight)


def gather(
    world: World,
    cameras: list[Camera],
    lamps: NDArray[np.float64],
    slots: NDArray[np.int64],
    label: str = "what the pixels see",
) -> Pieces:
    """Trace all frames.

    Parameters
    ----------
    lamps : (L, 7) float64
        Rows as of `kernels.fragments`.
    slots : (F, S) int64
        The rows of `lamps` that are lit in each frame, -1 where there are fewer.
    """
    parts = [_frame(world, camera, lamps, slots[i]) for i, camera in enumerate(tracked(cameras, label))]
    size = cameras[0].width * cameras[0].height
    counts = np.concatenate([p["count"] for p in parts])
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pixel = np.concatenate([p["pixel"] + i * size for i, p in enumerate(parts)])
    arrays = {name: np.concatenate([p[name] for p in parts]) for name in PER_PIECE}
    return Pieces(start, pixel, **arrays, edge=np.concatenate([p["edge"] for p in parts]))


def _frame(world: World, camera: Camera, lamps: NDArray, lit_by: NDArray) -> dict[str, NDArray]:
    straight = camera if camera.model == "ORTHOGRAPHIC" else replace(camera, model="PINHOLE", k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    view, size = compile_camera(straight), camera.width * camera.height
    bend = kernel.Bend(camera.k1, camera.k2, camera.p1, camera.p2, camera.fx, camera.fy, camera.cx, camera.cy)
    coarse = _look(world, view, bend, np.arange(size), _COARSE, lamps, lit_by)
    mixed = (coarse["shape"][:, 1] != _NONE) | np.any(
        (coarse["visible"] > 0) & (coarse["visible"] < coarse["count"][..., None]), axis=(1, 2)
    )
    # An edge may pass between the points of a pixel: its neighbours differ then.
    first = coarse["shape"][:, 0].reshape(camera.height, camera.width)
    lit = (coarse["visible"][:, 0] > 0).reshape(camera.height, camera.width, -1)
    edge = mixed.reshape(first.shape)
    for axis in (0, 1):
        differs = (np.diff(first, axis=axis) != 0) | np.any(np.diff(lit, axis=axis), axis=-1)
        pad = [(0, 0), (0, 0)]
        pad[axis] = (0, 1)
        edge = edge | np.pad(differs, pad)
        pad[axis] = (1, 0)
        edge = edge | np.pad(differs, pad)
    edge = binary_dilation(edge).ravel()
    fine = _look(world, view, bend, np.flatnonzero(edge), _FINE, lamps, lit_by)
    for name, values in coarse.items():
        values[edge] = fine[name]
    points = np.where(edge, _FINE**2, _COARSE**2)
    return _compress(coarse, points, edge, camera, view, bend)


_NONE = -2


def _look(world: World, view, bend: kernel.Bend, pixels: NDArray, n: int, lamps: NDArray, lit_by: NDArray) -> dict[str, NDArray]:
    m, g = len(pixels), kernel.MAX_PIECES
    out = {
        "shape": np.full((m, g), _NONE, np.int32),
        "count": np.zeros((m, g), np.int32),
        "sums": np.zeros((m, g, kernel.NUM_SUMS), np.float64),
        "visible": np.zeros((m, g, len(lit_by)), np.float32),
    }
    kernel.gather(world.arrays, view, bend, pixels, n, lamps, lit_by, out["shape"], out["count"], out["sums"], out["visible"])
    return out


def _compress(
    looked: dict[str, NDArray], points: NDArray, edge: NDArray, camera: Camera, view, bend: kernel.Bend
) -> dict[str, NDArray]:
    held = looked["count"] > 0
    pixel = np.nonzero(held)[0]
    count = looked["count"][held].astype(np.float64)
    mean = looked["sums"][held] / count[:, None]

    def unit(column: int) -> NDArray[np.float64]:
        v = mean[:, column : column + 3]
        return v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-12)

    position, face_normal = mean[:, :3], unit(kernel.FACE_NORMAL)
    shape = looked["shape"][held]
    if camera.model == "ORTHOGRAPHIC":
        towards = np.broadcast_to(-camera.T_world_camera[:3, 2], position.shape)
    else:
        towards = camera.position - position
        towards = towards / np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-12)
    across, down = np.zeros_like(position), np.zeros_like(position)
    kernel.extents(view, bend, pixel, position, face_normal, across, down)
    first = looked["sums"][held]
    uv = first[:, kernel.UV : kernel.UV + 2]
    floats = {
        "weight": count / points[pixel],
        "position": position,
        "normal": unit(kernel.NORMAL),
        "face_normal": face_normal,
        "tangent": unit(kernel.TANGENT),
        "view": towards,
        "anchor": first[:, kernel.ANCHOR : kernel.ANCHOR + 3],
        "anchor_normal": first[:, kernel.ANCHOR_NORMAL : kernel.ANCHOR_NORMAL + 3],
        "across": across,
        "down": down,
        "albedo": mean[:, kernel.ALBEDO : kernel.ALBEDO + 3],
        "uv": uv,
        "distance": mean[:, kernel.DISTANCE],
        "visible": looked["visible"][held] / count[:, None],
    }
    out = {name: np.ascontiguousarray(values, np.float32) for name, values in floats.items()}
    return out | {"pixel": pixel, "shape": shape, "edge": edge, "count": held.sum(axis=1)}
