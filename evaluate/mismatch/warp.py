"""Pictures whose points come to lie elsewhere: motions of the camera, lenses that bend, as smooth displacements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scene.transforms import transform_points

from .case import Case, Floats
from .sensor_plane import cubic

TWIST = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")


def first_piece(case: Case) -> NDArray[np.int64]:
    """Return the largest piece of each pixel (P,), -1 for none."""
    if "first_piece" not in case.cache:
        p = case.pieces
        order = np.lexsort((p.weight, p.pixel))
        out = np.full(len(p.start) - 1, -1, np.int64)
        out[p.pixel[order]] = order
        case.cache["first_piece"] = out
    return case.cache["first_piece"]


def twist_flow(case: Case) -> Floats:
    """Return how pixels move per unit of a camera's twist (6, F, H, W, 2) [px per rad, px per m].

    The camera turns by w and shifts by v in its own frame, T_actual = T_believed exp(w, v): what is at p in its frame comes
    to be at p - w x p - v. What is infinitely far is moved by turning only.
    """
    if "twist_flow" not in case.cache:
        height, width = case.size
        out = np.zeros((6, case.num_frames, height, width, 2), np.float32)
        first = first_piece(case).reshape(case.num_frames, -1)
        for f, camera in enumerate(case.gathered_cameras):
            k = first[f]
            seen = (k >= 0) & (case.pieces.shape[k] >= 0)
            p = transform_points(camera.T_camera_world, case.pieces.position[k].astype(np.float64))
            xy = camera.pixel_centres()
            if camera.model == "ORTHOGRAPHIC":
                assert camera.pixel_size is not None
                q = np.where(seen[:, None], p, 0.0)
                fx, scale_x, scale_y = None, 1 / camera.pixel_size, 1 / camera.pixel_size
            else:
                ray = np.stack([(xy[:, 0] - camera.cx) / camera.fx, (xy[:, 1] - camera.cy) / camera.fy, np.ones(len(xy))], 1)
                q = np.where(seen[:, None], p, ray * 1e9)
                fx, scale_x, scale_y = camera.fx, camera.fx, camera.fy
            for i in range(6):
                unit = np.zeros(3)
                unit[i % 3] = 1.0
                move = -np.cross(unit, q) if i < 3 else -np.broadcast_to(unit, q.shape)
                if fx is None:
                    d = np.stack([move[:, 0] * scale_x, move[:, 1] * scale_y], 1)
                else:
                    z = q[:, 2:]
                    d = np.stack([scale_x, scale_y]) * (move[:, :2] - q[:, :2] / z * move[:, 2:]) / z
                out[i, f] = d.reshape(height, width, 2)
        case.cache["twist_flow"] = out
    return case.cache["twist_flow"]


def moved(picture: Floats, flow: Floats) -> Floats:
    """Return a picture (H, W, 3) whose points have been moved by a smooth flow (H, W, 2) [px]."""
    height, width = picture.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    return cubic(picture, x - flow[..., 0], y - flow[..., 1])


def twisted(case: Case, pictures: Floats, twist: NDArray, share: NDArray | float = 1.0) -> Floats:
    """Return pictures (F, H, W, 3) as seen after a twist (F, 6) of each camera, times `share`, a number or one a row (H,)."""
    basis = twist_flow(case)
    out = np.empty_like(pictures)
    by = np.asarray(share, np.float32)
    by = by if by.ndim == 0 else by[:, None, None]
    for f in range(len(pictures)):
        out[f] = moved(pictures[f], np.tensordot(twist[f].astype(np.float32), basis[:, f], 1) * by)
    return out


def typical_distance(case: Case) -> float:
    """Return the median distance of what is seen [m]."""
    distance = case.pieces.distance[case.pieces.shape >= 0]
    return float(np.median(distance)) if len(distance) else 1.0
