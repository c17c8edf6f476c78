"""The wetness mask M of eq 6.5: what the ground is made of, from segmentations or else from colour and shape.

The thesis draws it by hand and suggests segmentation for larger drives. Three classes: ground that hardly gets wet
(vegetation, M = 0.25), ground where water seeps away (soil, open joints: 0.5), ground that holds it (road, pavement: 1).

A segmentation picture holds one class id per pixel, of Cityscapes' label ids:

| ids | class |
|---|---|
| 7 road, 8 sidewalk, 9 parking, 15 bridge, 16 tunnel | holds |
| 6 ground, 10 rail track | seeps |
| 21 vegetation, 22 terrain | hardly |

All other ids say nothing about the ground.

Without segmentation the ground along the camera's path, which is driven on, is taken as paved, and its chromaticity as
grey: so neither white balance nor the blue of shade matters much. Ground that is greener than it by the excess-green index
(2G - R - B) / (R + G + B) of Woebbecke et al. (1995), lit or in shade, is vegetation; a weak excess, or brown (more red over
blue) with a rough surface, is soil. Each cell's colour is the robust mean of all frames that see it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import logger

from ..grid import GroundGrid
from ..images import read_ids
from ..mesh import Mesh
from ..reconstruction.frame_view import FrameView, frame_views
from ..reconstruction.merge_views import MergedColours
from ..recording import Recording
from .map_filters import blur, fill_holes, fit_local_plane

HOLDS, SEEPS, HARDLY = 0, 1, 2
CITYSCAPES = {7: HOLDS, 8: HOLDS, 9: HOLDS, 15: HOLDS, 16: HOLDS, 6: SEEPS, 10: SEEPS, 21: HARDLY, 22: HARDLY}
_CELL = 0.1  # of the classification [m]: about the size of a pixel on the road 10 m ahead at 700 px
_TRACK = 1.2  # half the width of what a car drives on [m]


@dataclass(frozen=True)
class MaskSettings:
    """Where the mask comes from, its values and its blur, see `TerrainSettings`."""

    source: str = "auto"
    blur: float = 0.15
    hardly: float = 0.25
    seeps: float = 0.5
    holds: float = 1.0


def wetness_mask(
    ground: Mesh,
    recording: Recording,
    grid: GroundGrid,
    height: NDArray[np.float32],
    covered: NDArray[np.bool_],
    settings: MaskSettings = MaskSettings(),
    occluders: Iterable[Mesh] = (),
) -> NDArray[np.float32]:
    """Return M (rows, cols), blurred.

    Parameters
    ----------
    ground : Mesh
        Ground in the world.
    recording : Recording
        Frames with pictures, and perhaps segmentations.
    grid, height, covered
        Grid, height [m] and coverage of the ground.
    settings : MaskSettings
        Source, values and blur.
    occluders : iterable of Mesh
        What may hide the ground.

    Raises
    ------
    InputError
        If a segmentation is asked for and no frame has one, or one is of the wrong size.
    """
    has_segmentation = any(frame.segmentation is not None for frame in recording.frames)
    source = settings.source
    if source == "segmentation" and not has_segmentation:
        raise InputError("be in at least one frame", got="none", key="segmentation", remedy="Use --mask-source colour.")
    if source == "auto":
        source = "segmentation" if has_segmentation else "colour"
    values = np.array([settings.holds, settings.seeps, settings.hardly], np.float32)
    if source == "none" or not recording.frames:
        return np.full(grid.shape, settings.holds, np.float32)
    coarse, points, normals = _cells(grid, height, covered)
    meshes = [ground, *occluders]
    if source == "segmentation":
        shares = _segmented(points, normals, recording, meshes)
    else:
        shares = _coloured(points, normals, recording, meshes, coarse, covered, grid)
    known = np.zeros(coarse.shape, bool)
    known.ravel()[_index(coarse, points)] = shares.sum(axis=1) > 0
    if not known.any():
        logger.warning("no frame sees the ground: it is all taken to hold water")
        return np.full(grid.shape, settings.holds, np.float32)
    maps = []
    for kind in range(3):
        share = np.zeros(coarse.shape, np.float32)
        share.ravel()[_index(coarse, points)] = shares[:, kind]
        # A little context: what a cell is, its neighbours within 30 cm mostly are too.
        smooth = blur(share, known.astype(np.float32), 0.3, coarse.cell)
        maps.append(fill_holes(np.nan_to_num(smooth), np.isfinite(smooth)))
    kind = np.argmax(np.stack(maps), axis=0)
    x, y = grid.centres()
    cells = np.clip(np.rint(coarse.position(np.column_stack([x.ravel(), y.ravel()]))).astype(int), 0, np.array(coarse.shape) - 1)
    M = values[kind[cells[:, 0], cells[:, 1]]].reshape(grid.shape)
    logger.info(
        "wetness mask from %s: %.0f %% holds water, %.0f %% seeps, %.0f %% hardly gets wet", source, *_percent(M, values, covered)
    )
    return np.nan_to_num(blur(M, np.ones_like(M), settings.blur, grid.cell), nan=settings.holds)


def _cells(grid: GroundGrid, height: NDArray, covered: NDArray[np.bool_]) -> tuple[GroundGrid, NDArray, NDArray]:
    """Return the grid of classification, and position and normal of its covered cells."""
    x, y = grid.centres()
    coarse = GroundGrid.covering(np.array([[x.min(), y.min()], [x.max(), y.max()]]), max(_CELL, grid.cell))
    X, Y = coarse.centres()
    where = np.column_stack([X.ravel(), Y.ravel()])
    inside = grid.sample(covered, where) > 0.5
    plane = fit_local_plane(height, covered.astype(np.float32), 0.2, grid.cell)
    z = grid.sample(height, where)
    n = np.column_stack([-grid.sample(np.nan_to_num(s), where) for s in (plane.slope_x, plane.slope_y)] + [np.ones(len(z))])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return coarse, np.column_stack([where, z])[inside], n[inside]


def _index(grid: GroundGrid, points: NDArray) -> NDArray[np.int64]:
    """Return the flat index of the cell that each point lies in."""
    cells = np.rint(grid.position(points)).astype(np.int64)
    return cells[:, 0] * grid.cols + cells[:, 1]


def _segmented(points: NDArray, normals: NDArray, recording: Recording, meshes: list[Mesh]) -> NDArray[np.float32]:
    """Return the votes (N, 3) of the frames' segmentations, weighted by how well each frame sees the cell."""
    table = np.full(65536, -1)
    for label, kind in CITYSCAPES.items():
        table[label] = kind
    votes = np.zeros((len(points), 3), np.float32)
    indices = [i for i, frame in enumerate(recording.frames) if frame.segmentation is not None]
    for i, view in zip(indices, frame_views(recording, meshes, "Wetness mask", indices), strict=True):
        file = recording.frames[i].segmentation
        assert file is not None
        labels = read_ids(file)
        labels = labels if labels.ndim == 2 else labels[..., 0]
        if labels.shape != view.depth.shape:
            size = f"{labels.shape[1]} x {labels.shape[0]}"
            raise InputError(f"have the image's size {view.camera.width} x {view.camera.height}", got=size, file=file)
        _, quality = view.colours(points, normals, _CELL)
        seen = np.flatnonzero(quality > 0)
        xy = view.camera.project(points[seen])[0].astype(int)
        kind = table[labels[xy[:, 1], xy[:, 0]]]
        votes[seen[kind >= 0], kind[kind >= 0]] += quality[seen[kind >= 0]]
    return (votes / np.maximum(votes.sum(axis=1, keepdims=True), 1e-9)).astype(np.float32, copy=False)


def _coloured(
    points: NDArray,
    normals: NDArray,
    recording: Recording,
    meshes: list[Mesh],
    coarse: GroundGrid,
    covered: NDArray,
    grid: GroundGrid,
) -> NDArray[np.float32]:
    """Return the shares (N, 3) of the classes by colour and roughness; 0 where no frame sees a cell."""
    merged = MergedColours(len(points))
    path = []
    for view in frame_views(recording, meshes, "Wetness mask"):
        path.append(view.camera.position)
        merged.add(*view.colours(points, normals, _CELL), dark=_too_dark(view))
    colour, weight = merged.result()
    total = np.maximum(colour.sum(axis=1), 1e-6)
    share = colour / total[:, None]
    driven = (weight > 0) & _near_path(points, np.array(path))
    reference = (
        np.median(share[driven], axis=0)
        if driven.sum() > 50
        else np.median(share[weight > 0], axis=0)
        if (weight > 0).any()
        else np.full(3, 1 / 3)
    )
    # Scaled so that the road is grey.
    r, g, b = (share / np.maximum(reference, 1e-3) / 3).T
    norm = np.maximum(r + g + b, 1e-6)
    green = (2 * g - r - b) / norm
    brown = np.log(np.maximum(r, 1e-3) / np.maximum(b, 1e-3))
    # Noise of a dark pixel's chromaticity would look like grass; 8-bit shadows carry little colour.
    trust = np.clip(colour.mean(axis=1) / 0.01, 0, 1)
    hardly = _rise(green * trust, 0.06, 0.14)
    seeps = np.maximum(_rise(green * trust, 0.03, 0.06), _rise(brown * trust, 0.3, 0.6)) * (1 - hardly)
    shares = np.column_stack([1 - hardly - seeps, seeps, hardly])
    # What the cameras drove over holds water, whatever its colour (painted or littered with leaves).
    shares[_near_path(points, np.array(path))] = (1, 0, 0)
    return (shares * ((weight > 0) | _near_path(points, np.array(path)))[:, None]).astype(np.float32)


def _near_path(points: NDArray, path: NDArray) -> NDArray[np.bool_]:
    """Return which points lie below the polyline of the cameras, within a car's width, at a car's height."""
    near = np.zeros(len(points), bool)
    if len(path) < 2 or np.linalg.norm(path[-1] - path[0]) < 1:
        return near
    for a, b in itertools.pairwise(path):
        ab = b[:2] - a[:2]
        length2 = float(ab @ ab)
        if length2 < 1e-6 or length2 > 20.0**2:
            continue
        t = np.clip((points[:, :2] - a[:2]) @ ab / length2, 0, 1)
        away = np.linalg.norm(points[:, :2] - a[:2] - t[:, None] * ab, axis=1)
        below = a[2] + t * (b[2] - a[2]) - points[:, 2]
        near |= (away < _TRACK) & (below > 0.5) & (below < 3.5)
    return near


def _too_dark(view: FrameView) -> float:
    """Return the radiance below which an 8-bit pixel holds no colour: about 6 of 255 in sRGB."""
    return 0.0018 * view.top if np.isfinite(view.top) else 0.0


def _rise(x: NDArray, low: float, high: float) -> NDArray:
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _percent(M: NDArray, values: NDArray, covered: NDArray[np.bool_]) -> list[float]:
    return [100 * float(np.isclose(M[covered], v).mean()) for v in values]
