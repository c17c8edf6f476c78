"""Moving objects as vertical rectangles that stand on the ground, one per instance of a frame's mask (thesis 6.3.2).

A pedestrian's board faces the camera where the mask's lowest point meets the ground. A vehicle's goes through its two
lowest contacts, the wheels that the mask's lower edge shows as two minima. Where only one contact can be seen, the
frame's own sweep tells how the vehicle stands.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ..boxes import Box
from ..camera import Camera
from ..mesh import Mesh
from ..recording import Frame
from ..scene_file import Cardboard
from .build_settings import CardboardSettings
from .dynamics import instance_mask
from .mesh_rays import MeshRays

Floats = NDArray[np.floating]


class GroundCaster:
    """Answers where rays meet the ground mesh; beyond its edge, where they meet the level of its nearest part.

    Parameters
    ----------
    ground : Mesh
        Not empty.
    """

    def __init__(self, ground: Mesh) -> None:
        self._rays = MeshRays(ground)

    def hit(self, camera: Camera, xy: Floats) -> NDArray[np.float64]:
        """Return where pixel positions (N, 2) meet the ground (N, 3) [m]; NaN where the ray does not go down to it."""
        origins, directions = camera.rays(xy)
        distance = self._rays.cast(origins, directions).distance
        level = self._rays.nearest(origins + directions * 15.0)[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            to_level = (level - origins[:, 2]) / directions[:, 2]
        # A cast may slip through a gap of the mesh; a plane at the level of what is near says nearly the same.
        to_level = np.where(to_level > 0.5, to_level, np.nan)
        return origins + directions * np.where(np.isfinite(distance), distance, to_level)[:, None]

    def below(self, points_world: Floats) -> NDArray[np.float64]:
        """Return the ground's height straight below or above points (N,) [m]; where there is none, that near by."""
        start = np.array(points_world, dtype=np.float64)
        start[:, 2] += 1000.0
        distance = self._rays.cast(start, np.broadcast_to((0.0, 0.0, -1.0), start.shape)).distance
        return np.where(np.isfinite(distance), start[:, 2] - distance, self._rays.nearest(points_world)[:, 2])


def cardboards(
    frame: Frame,
    ground: GroundCaster,
    sweep_world: Floats | None = None,
    settings: CardboardSettings | None = None,
    boxes_world: dict[int, Box] | None = None,
) -> tuple[tuple[Cardboard, ...], dict[int, dict[str, Any]]]:
    """Return the boards of a frame and how each was found.

    Parameters
    ----------
    frame : Frame
        With masks; without, there are no boards.
    ground : GroundCaster
    sweep_world : (N, 3) float, optional
        The frame's own sweep in the world, moving objects included [m].
    boxes_world : dict of Box, optional
        The 3-D boxes of instances, where there are some: they say best how an object stands.

    Returns
    -------
    boards : tuple of Cardboard
        In order of instance. Each covers its mask's projection, with `board_margin` to spare.
    notes : dict
        Per instance `method` ("contacts", "sweep", "facing", "box"), `depth` [m] and, where the sweep has enough points on it,
        `sweep_depth` [m], their median depth near the contact.
    """
    settings = settings or CardboardSettings()
    mask = instance_mask(frame)
    boards, notes = [], {}
    depth_of = _sweep_depths(frame, mask, sweep_world)
    for id in (int(i) for i in np.unique(mask) if i > 0):
        inside = mask == id
        if inside.sum() < settings.board_pixels:
            continue
        assert frame.masks is not None
        kind = (frame.masks.classes or {}).get(id, frame.masks.default_class)
        seen = depth_of.get(id)
        board, note = _board(frame.camera, inside, id, kind, ground, seen, (boxes_world or {}).get(id), settings)
        if board is not None:
            boards.append(board)
            notes[id] = note
    return tuple(boards), notes


def _board(camera: Camera, inside, id: int, kind: str, ground: GroundCaster, seen, box: Box | None, settings: CardboardSettings):
    """Place one board: its vertical plane through `foot` along `along`, then its extent from the mask."""
    columns = np.flatnonzero(inside.any(axis=0))
    bottom = inside.shape[0] - np.argmax(inside[::-1, columns], axis=0)  # lower edges of the lowest pixels
    cut = {"left": columns[0] <= 1, "right": columns[-1] >= inside.shape[1] - 2, "bottom": bottom.max() >= inside.shape[0] - 1}
    contacts = _contacts(columns, bottom.astype(np.float64), kind, cut)
    feet = ground.hit(camera, contacts)
    feet = feet[np.isfinite(feet).all(axis=1)]
    facing = camera.T_world_camera[:3, 0] * (1, 1, 0)
    facing /= np.linalg.norm(facing)
    method, along, foot = "facing", facing, None
    if len(feet):
        foot = feet[np.argmin((feet - camera.position) @ camera.T_world_camera[:3, 2])]
    if kind == "vehicle" and len(feet) == 2 and 0.8 <= np.linalg.norm(np.diff(feet[:, :2], axis=0)) <= 9.0:
        span = (feet[1] - feet[0]) * (1, 1, 0)
        along, method = span / np.linalg.norm(span), "contacts"
    note: dict[str, Any] = {}
    if seen is not None and len(seen) >= 12:
        note["sweep_depth"] = round(float(np.percentile((seen - camera.position) @ camera.T_world_camera[:3, 2], 25)), 2)
    trusted = foot is not None and not cut["bottom"]
    if kind == "vehicle" and method != "contacts" and seen is not None and len(seen) >= 12:
        along, method = _side(seen, facing), "sweep"
    depth = None if foot is None else float((foot - camera.position) @ camera.T_world_camera[:3, 2])
    seen_depth = note.get("sweep_depth")
    if seen is not None and seen_depth and (depth is None or not trusted or abs(depth - seen_depth) > 0.15 * seen_depth + 2.0):
        # The mask's lower edge is no contact (cut by the image, or hidden): the sweep says where the object is.
        nearest = seen[np.argsort((seen - camera.position) @ camera.T_world_camera[:3, 2])[: max(6, len(seen) // 4)]]
        foot = np.median(nearest, axis=0)
        if method == "contacts":
            along, method = _side(seen, facing), "sweep"
    if box is not None:
        foot, side = _nearest_side(camera, box)
        along, method = (side if kind == "vehicle" else facing), "box"
    if foot is None:
        return None, note
    tilt = np.radians(settings.board_tilt_deg)
    if abs(along @ facing) < np.cos(tilt):
        # A board seen edge-on would need endless length to cover its mask.
        away = np.cross((0, 0, 1.0), facing)
        along = np.cos(tilt) * facing * np.sign(along @ facing or 1) + np.sin(tilt) * away * np.sign(along @ away or 1)
    if along @ facing < 0:
        along = -along
    corners = _extent(camera, inside, foot, along, ground, settings)
    if corners is None and method != "facing":
        along, method = facing, "facing"
        corners = _extent(camera, inside, foot, along, ground, settings)
    if corners is None:
        return None, note
    depth = float((corners[:2].mean(axis=0) - camera.position) @ camera.T_world_camera[:3, 2])
    if depth > settings.board_range:
        return None, note
    return Cardboard(id, kind, corners), {"method": method, "depth": round(depth, 2), **note}


def _nearest_side(camera: Camera, box: Box) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle of the lower edge of the box's side that the camera sees widest, and the edge's level direction."""
    R, centre = box.T_boxes_object[:3, :3], box.T_boxes_object[:3, 3]
    best, foot, along = -np.inf, centre, R[:, 0]
    for normal, edge in ((0, 1), (1, 0)):
        for sign in (-0.5, 0.5):
            middle = centre + sign * box.size[normal] * R[:, normal] - 0.5 * box.size[2] * R[:, 2]
            towards = camera.position - middle
            seen = box.size[edge] * float(towards @ R[:, normal]) * np.sign(sign) / float(towards @ towards)
            if seen > best:
                best, foot, along = seen, middle, R[:, edge]
    level = along * (1, 1, 0)
    return foot, level / np.linalg.norm(level)


def _contacts(columns: NDArray[np.integer], bottom: Floats, kind: str, cut: dict[str, bool]) -> NDArray[np.float64]:
    """Return pixel positions where the object touches the ground: one, or two for a vehicle that shows two.

    A vehicle's contacts are the lowest points of the outer thirds of the mask's lower edge, if the edge has its wheels
    there: between two minima the body's sill runs higher, and seen obliquely the edge descends to both ends' wheels.
    """
    smooth = uniform_filter1d(bottom, max(1, len(bottom) // 40), mode="nearest")
    lowest = int(np.argmax(smooth))
    single = np.array([[columns[lowest] + 0.5, bottom[lowest]]])
    if kind != "vehicle" or len(columns) < 12:
        return single
    if cut["left"] or cut["right"]:
        return single
    minima = _minima(smooth)
    if len(minima) < 2:
        return single
    best, pair = -1.0, None
    for i, a in enumerate(minima):
        for b in minima[i + 1 :]:
            width = (b - a) / len(bottom)
            if width < 0.3:
                continue
            # The pair that lies lowest; of equals the wider one.
            score = smooth[a] + smooth[b] + 4.0 * width
            if score > best:
                best, pair = score, (a, b)
    if pair is None:
        return single
    a, b = pair
    return np.array([[columns[a] + 0.5, bottom[a]], [columns[b] + 0.5, bottom[b]]])


def _minima(bottom: Floats) -> list[int]:
    """Return where the lower edge is locally lowest in the image (largest row), over a tenth of its width each side."""
    reach = max(2, len(bottom) // 10)
    found: list[int] = []
    for i in range(len(bottom)):
        window = bottom[max(0, i - reach) : i + reach + 1]
        if bottom[i] == window.max() and (not found or i - found[-1] > reach):
            found.append(i)
    return found


def _sweep_depths(frame: Frame, mask: NDArray[np.integer], sweep_world: Floats | None) -> dict[int, NDArray[np.float64]]:
    """Return, per instance, the sweep's points on it: those in its mask within 6 m of the nearest of them."""
    if sweep_world is None or len(sweep_world) == 0 or not mask.any():
        return {}
    xy, depth = frame.camera.project(sweep_world)
    with np.errstate(invalid="ignore"):
        seen = np.flatnonzero((depth > 0.3) & (xy >= 0).all(axis=1) & (xy[:, 0] < mask.shape[1]) & (xy[:, 1] < mask.shape[0]))
    column, row = xy[seen].astype(np.int64).T
    instance = mask[row, column]
    out = {}
    for id in np.unique(instance[instance > 0]):
        members = seen[instance == id]
        out[int(id)] = sweep_world[members[depth[members] < np.percentile(depth[members], 5) + 6.0]]
    return out


def _side(points: Floats, facing: Floats) -> NDArray[np.float64]:
    """Return the horizontal direction of the side that the scanner saw: that of the densest line through the points."""
    xy = points[:, :2]
    best, along = -1.0, np.asarray(facing, dtype=np.float64)
    for angle in np.radians(np.arange(0, 180, 3.0)):
        direction = np.array([np.cos(angle), np.sin(angle)])
        across = xy @ (-direction[1], direction[0])
        score = np.bincount(((across - across.min()) / 0.15).astype(int)).max() / len(points)
        if score > best + 1e-12:
            best, along = score, np.array([*direction, 0.0])
    return along


def _extent(camera: Camera, inside, foot: Floats, along: Floats, ground: GroundCaster, settings: CardboardSettings):
    """Return corners (4, 3) of the rectangle in the plane that covers the mask; None if the plane cannot."""
    hull = _outline(inside)
    origins, directions = camera.rays(hull)
    n = np.cross(along, (0, 0, 1.0))
    speed = directions @ n
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((foot - origins) @ n) / speed
    if not np.all(np.isfinite(distance)) or distance.min() <= 0.3:
        return None
    hits = origins + directions * distance[:, None]
    s = (hits - foot) @ along
    margin = settings.board_margin
    low, high = s.min() - margin, s.max() + margin
    if high - low > 30.0:
        return None
    ends = foot + np.outer((low, high), along)
    # It stands on the lower of both ends' ground, or lower still where the mask reaches below: it must cover all of it.
    base = min(float(ground.below(ends).min()), float(hits[:, 2].min())) - margin / 5
    top = float(hits[:, 2].max()) + margin
    ends[:, 2] = base
    upper = ends.copy()
    upper[:, 2] = top
    return np.array([ends[0], ends[1], upper[1], upper[0]])


def _outline(inside) -> NDArray[np.float64]:
    """Return the corners (K, 2) of the convex hull of all pixels' squares, from each column's highest and lowest pixel."""
    from scipy.spatial import ConvexHull

    columns = np.flatnonzero(inside.any(axis=0))
    part = inside[:, columns]
    top = np.argmax(part, axis=0)
    bottom = inside.shape[0] - np.argmax(part[::-1], axis=0)
    corners = np.concatenate([np.column_stack([columns + dx, edge]) for dx in (0, 1) for edge in (top, bottom)]).astype(np.float64)
    return corners[ConvexHull(corners).vertices]
