"""What is true of each frame without any light: depth, instances, flow, occlusion, normals, classes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..camera import Camera
from ..transforms import invert, transform_points
from .rays import RayScene
from .world import Street

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class FrameTruth:
    """Truth at the centres of all pixels of a frame.

    Attributes
    ----------
    depth : (H, W) float32
        Along the camera's z [m]; inf in the sky.
    instance : (H, W) uint8
        Id of the moving thing, 0 = static.
    shape : (H, W) int32
        Index into `shapes`, -1 = sky.
    normal : (H, W, 3) float32
        Geometric normal in the world, turned to the camera; 0 in the sky.
    flow : (H, W, 2) float32 or None
        x right, y down, to the next frame [px]; None in the last frame. The sky moves as what is infinitely far away.
    visible : (H, W) bool or None
        Whether that place is seen in the next frame: inside the image and not behind anything.
    """

    depth: NDArray[np.float32]
    instance: NDArray[np.uint8]
    shape: NDArray[np.int32]
    normal: NDArray[np.float32]
    flow: NDArray[np.float32] | None
    visible: NDArray[np.bool_] | None


def ray_scene(street: Street, frame: int, reuse: RayScene | None = None) -> RayScene:
    """Return the dry street of a frame for ray casting; `reuse` an earlier frame's for its static part."""
    return RayScene(street.static, street.moving_shapes(frame), reuse)


def frame_truth(street: Street, frame: int, scene: RayScene, next_scene: RayScene | None = None) -> FrameTruth:
    """Return the truth of a frame.

    Parameters
    ----------
    scene, next_scene : RayScene
        Of this frame and of the next; without the latter there is no flow.
    """
    camera = street.cameras[frame]
    size = (camera.height, camera.width)
    origins, directions = camera.rays(camera.pixel_centres())
    hits = scene.cast(origins, directions)
    seen = np.isfinite(hits.distance)
    points = origins + directions * np.where(seen, hits.distance, 0.0)[:, None]
    depth = np.where(seen, hits.distance * (directions @ camera.T_world_camera[:3, 2]), np.inf)
    away = np.einsum("nc,nc->n", hits.normal, directions) > 0
    normal = np.where(away[:, None], -hits.normal, hits.normal)
    flow = visible = None
    if next_scene is not None:
        motions = {k: street.poses[frame + 1][k] @ invert(T) for k, T in street.poses[frame].items()}
        flow, visible = _flow(camera, street.cameras[frame + 1], points, directions, seen, hits.instance, motions, next_scene)
        flow, visible = flow.reshape(*size, 2), visible.reshape(size)
    return FrameTruth(
        depth.reshape(size).astype(np.float32),
        hits.instance.reshape(size).astype(np.uint8),
        hits.shape.reshape(size),
        normal.reshape(*size, 3),
        flow,
        visible,
    )


def _flow(
    camera: Camera,
    next_camera: Camera,
    points: Floats,
    directions: Floats,
    seen: NDArray[np.bool_],
    instance: NDArray[np.int32],
    motions: dict[int, NDArray[np.float64]],
    next_scene: RayScene,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return flow (N, 2) and visibility (N,) of what pixel centres see."""
    points = points.copy()
    for number, T_next_now in motions.items():
        chosen = instance == number
        points[chosen] = transform_points(T_next_now, points[chosen])
    # The sky is infinitely far away: seen from the next camera it lies in the same direction.
    points[~seen] = next_camera.position + directions[~seen]
    xy, depth = next_camera.project(points)
    towards = points - next_camera.position
    distance = np.linalg.norm(towards, axis=1)
    towards /= distance[:, None]
    hits = next_scene.cast(np.broadcast_to(next_camera.position, towards.shape), towards)
    # Rays are float32 and surfaces may be seen at a grazing angle: 2 mm and a thousandth of the distance.
    unhidden = np.where(seen, hits.distance > distance - 2e-3 - 1e-3 * distance, ~np.isfinite(hits.distance))
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & (xy >= 0).all(axis=1) & (xy[:, 0] <= next_camera.width) & (xy[:, 1] <= next_camera.height)
    return (xy - camera.pixel_centres()).astype(np.float32), inside & unhidden
