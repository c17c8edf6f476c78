"""The pictures on the surfaces (thesis 6.4.1): each frame's projection, and the colours that other frames give to the rest.

A frame's own picture is mapped by projection (`project_uv`). What the frame does not see takes the colour that the other
frames of the drive saw (`fill_colours`), and what none saw the mean of its class (`class_means`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from materials.foundation.progress import logger

from ..camera import Camera
from ..mesh import Mesh
from ..recording import MaskFile, Recording
from ..scene_file import CLASSES, Cardboard
from .frame_view import FrameView, depth_map, frame_views, raycasting_scene, visible_in_frame
from .merge_views import MergedColours

__all__ = ["class_means", "depth_map", "fill_colours", "frame_gains", "project_uv", "raycasting_scene", "visible_in_frame"]

_GAIN_POINTS = 20_000
_GAIN_REACH = 3  # frames compared with each: farther ones share little and add no strength to a chain
_SHADOW = 1.5  # reach of a moving object's contact shadow on the ground [m]


def project_uv(mesh: Mesh, camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return where each vertex falls in a camera's picture, as texture coordinates.

    Parameters
    ----------
    mesh : Mesh
        Vertices in the world [m].
    camera : Camera
        The frame's.

    Returns
    -------
    uv : (V, 2) float32
        In [0, 1] over the picture, v = 0 at its first row; clipped to its border where outside, so that no viewer repeats
        the picture; 0 behind the camera.
    inside : (V,) bool
        Whether the vertex lies within the frustum. That it is not hidden is `visible_in_frame`'s to say.
    """
    xy, depth = camera.project(mesh.vertices)
    uv = xy / (camera.width, camera.height)
    inside = (depth > 0) & np.all((uv >= 0) & (uv < 1), axis=1)
    return np.clip(np.nan_to_num(uv), 0, 1).astype(np.float32), inside


def fill_colours(
    meshes: Mapping[str, Mesh],
    recording: Recording,
    cardboards: Sequence[Sequence[Cardboard]] = (),
    gains: NDArray[np.float64] | None = None,
) -> dict[str, Mesh]:
    """Return the meshes with the radiance that all frames saw at their vertices.

    A frame counts where it sees the vertex: inside the picture, not hidden by a mesh, and not in a mask of what moves
    (the cardboards' outlines are those masks). Near, frontal views weigh more; near outlines, and on ground within 1.5 m of
    a cardboard, which may lie in its shadow, a tenth. Answers that disagree with the weighted median are dropped.

    Parameters
    ----------
    meshes : mapping of str to Mesh
        All static meshes; they hide each other.
    recording : Recording
        Frames.
    cardboards : sequence of sequences
        Per frame; may be empty.
    gains : (F,) float, optional
        Exposure of each frame relative to the first, as `frame_gains` gives it, which is called when it is absent.

    Returns
    -------
    meshes : dict of str to Mesh
        With float32 vertex attributes `fill_r, fill_g, fill_b`, linear and in the exposure of the first frame (multiply by
        `gains[t]` to compare with frame t), and `fill_w` in [0, 1]: 0 seen by none, 1 seen at full resolution from the front
        at least once in total.
    """
    if gains is None:
        gains = frame_gains(meshes, recording)
    normals = {name: _normals(mesh) for name, mesh in meshes.items()}
    spacing = {name: _spacing(mesh) for name, mesh in meshes.items()}
    merged = {name: MergedColours(len(mesh.vertices)) for name, mesh in meshes.items()}
    for t, view in enumerate(frame_views(recording, meshes, "Colours of surfaces")):
        boards = cardboards[t] if t < len(cardboards) else ()
        for name, mesh in meshes.items():
            colour, quality = view.colours(mesh.vertices, normals[name], spacing[name])
            for board in boards:
                quality = np.where(_near_foot(mesh.vertices, board), 0.1 * quality, quality)
            merged[name].add(colour / np.float32(gains[t]), quality, dark=0.0)
    out = {}
    for name, mesh in meshes.items():
        colour, weight = merged[name].result()
        fill = {f"fill_{c}": colour[:, i].copy() for i, c in enumerate("rgb")} | {"fill_w": np.minimum(weight, 1)}
        out[name] = replace(mesh, attributes={**mesh.attributes, **fill})
    return out


def frame_gains(meshes: Mapping[str, Mesh], recording: Recording) -> NDArray[np.float64]:
    """Return the exposure of each frame relative to the first, from static points that frames share.

    The log ratio of two frames is the median over the points that both see, unclipped and not too dark, from similar
    distances; all ratios of neighbours are then solved by least squares. Frames that share fewer than 50 points with the
    rest keep the gain of the frame before.

    Returns
    -------
    gains : (F,) float64
        1 for the first frame; recorded exposures are already divided out.
    """
    points, normals, spacing = _sample_vertices(meshes)
    n = len(recording.frames)
    recent: list[tuple[int, NDArray, NDArray]] = []
    rows, ratios, strength = [], [], []
    for t, view in enumerate(frame_views(recording, meshes, "Exposure of frames")):
        colour, quality = view.colours(points, normals, spacing, coarsest=5)
        luminance = colour @ np.array([0.2126, 0.7152, 0.0722], np.float32)
        usable = (
            (quality > 0.02) & (colour.max(axis=1) < 0.9 * view.top) & (luminance > 0.01 * min(view.top, np.median(view.linear)))
        )
        value = np.where(usable, np.log(np.maximum(luminance, 1e-9)), np.nan)
        for s, other, other_quality in recent:
            near = np.isfinite(value) & np.isfinite(other)
            near &= np.abs(np.log(np.maximum(quality, 1e-6) / np.maximum(other_quality, 1e-6))) < np.log(4)
            if near.sum() >= 50:
                rows.append((s, t))
                ratios.append(float(np.median(value[near] - other[near])))
                strength.append(np.sqrt(near.sum()))
        recent = [*recent, (t, value, quality)][-_GAIN_REACH:]
    # One weak equation per step holds frames that share nothing at the gain of the one before.
    steps = [(t - 1, t) for t in range(1, n)]
    A = np.zeros((len(rows) + len(steps), n))
    for i, (s, t) in enumerate(rows + steps):
        A[i, t], A[i, s] = 1, -1
    weight = np.array(strength + [1e-3] * len(steps))
    b = np.array(ratios + [0.0] * len(steps))
    gains = np.ones(n)
    if n > 1:
        gains[1:] = np.exp(np.linalg.lstsq(A[:, 1:] * weight[:, None], b * weight, rcond=None)[0])
    if n:
        logger.info("exposure relative to the first frame: %.3f to %.3f", gains.min(), gains.max())
    return gains


def class_means(
    recording: Recording, meshes: Mapping[str, Mesh], cardboards: Sequence[Sequence[Cardboard]] = ()
) -> dict[str, NDArray[np.float32]]:
    """Return the mean linear radiance of "ground", "environment", "vehicle" and "pedestrian" over the drive.

    Ground and environment are the pixels whose rays hit those meshes and in which nothing moves; vehicles and pedestrians
    are the masks, told apart by their cardboards, else by the recording. A class that no frame shows takes the mean of the
    environment, or of the ground, or 0.18 if there is no picture at all.
    """
    names = list(meshes)
    sums: dict[str, NDArray[np.float64]] = {name: np.zeros(3) for name in CLASSES}
    counts: dict[str, int] = dict.fromkeys(CLASSES, 0)
    for t, view in enumerate(frame_views(recording, meshes, "Class means")):
        for name, pixels in _classes(view, names, recording.frames[t].masks, cardboards[t] if t < len(cardboards) else ()):
            sums[name] += view.linear[pixels].sum(axis=0, dtype=np.float64)
            counts[name] += int(pixels.sum())
    means = {name: (sums[name] / counts[name]).astype(np.float32) for name in CLASSES if counts[name]}
    spare = means.get("environment", means.get("ground", np.full(3, 0.18, np.float32)))
    return {name: means.get(name, spare.copy()) for name in CLASSES}


def _classes(view: FrameView, names: list[str], masks: MaskFile | None, boards: Sequence[Cardboard]):
    """Yield the pixels (H, W) of each class in a frame."""
    for name in ("ground", "environment"):
        if name in names:
            yield name, (view.mesh_index == names.index(name)) & ~view.dynamic
    kinds = {board.instance: board.kind for board in boards}
    for instance in np.unique(view.instances[view.instances > 0]):
        named = None if masks is None or masks.classes is None else masks.classes.get(int(instance))
        kind = kinds.get(int(instance)) or named or (masks.default_class if masks else "vehicle")
        yield kind, view.instances == instance


def _near_foot(points: NDArray, board: Cardboard) -> NDArray[np.bool_]:
    """Return which points lie on the ground around a cardboard, where its shadow may be."""
    a, b = board.corners_world[0], board.corners_world[1]
    ab = b[:2] - a[:2]
    t = np.clip((points[:, :2] - a[:2]) @ ab / max(float(ab @ ab), 1e-9), 0, 1)
    away = np.linalg.norm(points[:, :2] - a[:2] - t[:, None] * ab, axis=1)
    return (away < _SHADOW) & (np.abs(points[:, 2] - min(a[2], b[2])) < 0.3)


def _normals(mesh: Mesh) -> NDArray[np.float32]:
    normals = mesh.normals if mesh.normals is not None else mesh.with_smooth_normals().normals
    assert normals is not None
    return normals


def _spacing(mesh: Mesh) -> float:
    """Return the median length of the edges [m], from some thousand faces."""
    faces = mesh.faces[:: max(len(mesh.faces) // 5000, 1)]
    if len(faces) == 0:
        return 0.05
    return float(np.median(np.linalg.norm(mesh.vertices[faces[:, 0]] - mesh.vertices[faces[:, 1]], axis=1)))


def _sample_vertices(meshes: Mapping[str, Mesh]) -> tuple[NDArray, NDArray, float]:
    """Return evenly picked vertices of all meshes with their normals, and a common spacing."""
    total = sum(len(m.vertices) for m in meshes.values())
    step = max(total // _GAIN_POINTS, 1)
    points = np.concatenate([m.vertices[::step] for m in meshes.values()])
    normals = np.concatenate([_normals(m)[::step] for m in meshes.values()])
    # Both frames of a pair have to average over the same patch: the median of a coarse-grained asphalt's logarithm rises
    # as it is blurred. 0.4 m is what a pixel covers along the road 15 m ahead; on the real drive it brings direct and
    # chained ratios together (0.41 against 0.30 over three frames with 0.2 m, 0.38 against 0.33 with 0.4 m).
    return points, normals, 0.4
