"""What each pixel's centre sees: the G-buffer, and where it goes until the next frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.simulation import Lens
from scene.transforms import transform_points

from .kernels import film
from .lens import Shutter
from .render import compile_view
from .world import World


@dataclass(frozen=True)
class GBuffer:
    """What each pixel's centre sees.

    Attributes
    ----------
    face : (H, W) int64
        Index of the triangle, -1 where the ray meets nothing.
    barycentric : (H, W, 2) float64
        Weights of its second and third vertex.
    distance, depth : (H, W) float32
        Along the ray, and along the camera's z [m]; inf where nothing is met.
    position : (H, W, 3) float64
        In the world [m]; NaN where nothing is met.
    normal : (H, W, 3) float32
        Interpolated shading normal, turned to the viewer; 0 where nothing is met.
    uv : (H, W, 2) float32
        Texture coordinates.
    shape, instance : (H, W) int32
        Index of the shape (-1: nothing), and its instance id (0: static or nothing).
    """

    face: NDArray[np.int64]
    barycentric: NDArray[np.float64]
    distance: NDArray[np.float32]
    depth: NDArray[np.float32]
    position: NDArray[np.float64]
    normal: NDArray[np.float32]
    uv: NDArray[np.float32]
    shape: NDArray[np.int32]
    instance: NDArray[np.int32]


def gbuffer(world: World, camera: Camera, lens: Lens | None = None, shutter: Shutter | None = None) -> GBuffer:
    """Return what each pixel's centre sees, through the middle of the lens and at the middle of its exposure.

    `depth` is that before the camera at rest, as the shutter opens. Parameters and refusals are those of `render`.
    """
    (view, optics), w = compile_view(camera, lens, shutter), world.arrays
    size = (camera.height, camera.width)
    face, b1, b2, distance = np.zeros(size, np.int64), np.zeros(size), np.zeros(size), np.zeros(size)
    film.primary(w, view, optics, face, b1, b2, distance)
    seen = face >= 0
    corners = w.faces[np.where(seen, face, 0)]
    weights = np.stack([1 - b1 - b2, b1, b2], axis=-1)

    def interpolated(attribute: NDArray) -> NDArray[np.float64]:
        return np.einsum("hwk,hwkc->hwc", weights, attribute[corners].astype(np.float64))

    position = np.where(seen[..., None], interpolated(w.vertices), np.nan)
    normal = interpolated(w.normals)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    with np.errstate(invalid="ignore"):
        away = np.einsum("hwc,hwc->hw", normal, position - camera.position) > 0
    normal = np.where(away[..., None], -normal, normal) * seen[..., None]
    depth = transform_points(camera.T_camera_world, position.reshape(-1, 3))[:, 2].reshape(size)
    shape = np.where(seen, w.face_shape[np.where(seen, face, 0)], -1).astype(np.int32)
    instances = np.array([s.instance for s in world.shapes], np.int32)
    return GBuffer(
        face,
        np.stack([b1, b2], axis=-1),
        np.where(seen, distance, np.inf).astype(np.float32),
        np.where(seen, depth, np.inf).astype(np.float32),
        position,
        normal.astype(np.float32),
        (interpolated(w.uv) * seen[..., None]).astype(np.float32),
        shape,
        np.where(seen, instances[shape], 0).astype(np.int32),
    )


def flow_between(
    buffer: GBuffer, camera: Camera, next_camera: Camera, motions: dict[int, NDArray[np.float64]]
) -> NDArray[np.float32]:
    """Return the true optical flow of what each pixel's centre sees, from one frame to the next.

    Parameters
    ----------
    motions : dict
        Rigid motion `T_next_now` in the world of each instance id that moves; others stand still.

    Returns
    -------
    flow : (H, W, 2) float32
        x right, y down [px]; NaN where the point comes to lie behind the camera. Where a ray meets nothing, what is
        infinitely far away moves by the camera's rotation.
    """
    size = buffer.face.shape
    xy = camera.pixel_centres()
    points = buffer.position.reshape(-1, 3).copy()
    for instance, T_next_now in motions.items():
        moved = buffer.instance.ravel() == instance
        points[moved] = transform_points(T_next_now, points[moved])
    flow, _ = next_camera.project(points)
    nothing = buffer.face.ravel() < 0
    if nothing.any():
        _, directions = camera.rays(xy[nothing])
        far = next_camera.moved_to(_rotation_only(next_camera.T_world_camera))
        flow[nothing], _ = far.project(directions)
    return (flow - xy).reshape(*size, 2).astype(np.float32)


def _rotation_only(T: NDArray[np.float64]) -> NDArray[np.float64]:
    out = T.copy()
    out[:3, 3] = 0
    return out
