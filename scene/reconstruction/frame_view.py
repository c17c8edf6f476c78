"""What one frame of a recording sees of the static world: its picture, what moves in it, and how far each pixel is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked

from ..camera import Camera
from ..images import read_ids, read_image
from ..kernels import projection as kernel
from ..mesh import Mesh
from ..recording import Frame, Recording

Floats = NDArray[np.floating]
_MARGIN = 3  # px around an outline where colours mix: what four pixels, the coarsest average taken, can reach


@dataclass(frozen=True)
class FrameView:
    """A frame, ready to be asked for the colour of world points.

    Attributes
    ----------
    camera : Camera
        Where it was taken from.
    linear : (H, W, 3) float32
        Linear picture divided by the frame's exposure.
    top : float
        The value a clipped pixel has (infinite for float images).
    instances : (H, W) int32
        Instance ids of what moves; 0 is static.
    dynamic : (H, W) bool
        What moves and two pixels around it, since masks are drawn by hand and edges are blurred.
    depth : (H, W) float32
        Depth of the static world at pixel centres [m]; infinite where a ray hits nothing.
    mesh_index : (H, W) int32
        Which of the meshes it hits, -1 for none.
    """

    camera: Camera
    linear: NDArray[np.float32]
    top: float
    instances: NDArray[np.int32]
    dynamic: NDArray[np.bool_]
    depth: NDArray[np.float32]
    mesh_index: NDArray[np.int32]

    def colours(
        self, points: Floats, normals: Floats, spacing: float | Floats, coarsest: int = 2
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the radiance that the frame sees at world points, and how well it sees them.

        Parameters
        ----------
        points, normals : (N, 3) float
            Surface points and their unit normals, either side.
        spacing : float or (N,) float
            Distance between points [m]: pixels finer than this are averaged first.
        coarsest : int
            At most `2**coarsest` pixels are averaged along each side.

        Returns
        -------
        colour : (N, 3) float32
            Linear; 0 where unseen.
        quality : (N,) float32
            0 unseen (outside, behind something, or something that moves); else up to 1, the share of the points'
            resolution that the picture has, times the cosine of the view; a tenth of that within three pixels of an
            outline, its own or that of something nearer, where colours mix.
        """
        xy, depth = self.camera.project(points)
        return self._gather(points, normals, xy, depth, spacing, coarsest)

    def _gather(self, points, normals, xy, depth, spacing, coarsest):
        R = self.camera.T_camera_world[:3, :3]
        normals_camera = (normals @ R.T).astype(np.float64)
        seen = kernel.see(xy, depth, normals_camera, self.depth, self.dynamic, *_intrinsics(self.camera), _MARGIN)
        colour = np.zeros((len(points), 3), np.float32)
        if not seen.any():
            return colour, np.zeros(len(points), np.float32)
        # Pixels per spacing, across the view; along it they are fewer by the cosine, which the level follows, lest
        # grazing views be blurred beyond need.
        f = self.camera.fx if self.camera.model != "ORTHOGRAPHIC" else np.inf
        cosine = _cosine(self.camera, points, normals)
        pixels = spacing * f * cosine / np.maximum(depth, 1e-3) if np.isfinite(f) else np.full(len(points), 1.0)
        level = np.clip(np.floor(np.log2(np.maximum(pixels, 1)) + 0.5), 0, coarsest).astype(np.int8)
        image, valid = self.linear, (~self.dynamic).astype(np.float32)
        for n in range(int(level[seen > 0].max()) + 1):
            if n > 0:
                image, valid = _halved(image, valid)
            kernel.gather(image, valid, xy, (level == n) & (seen > 0), 0.5**n, colour)
        quality = seen * np.minimum(pixels, 1) * cosine
        return colour, quality.astype(np.float32)


def raycasting_scene(meshes: Iterable[Mesh]) -> Any:
    """Return an Open3D RaycastingScene of meshes; geometry ids count from 0 in their order."""
    import open3d

    o3d: Any = open3d

    scene = o3d.t.geometry.RaycastingScene()
    for mesh in meshes:
        vertices, faces = np.ascontiguousarray(mesh.vertices, np.float32), np.ascontiguousarray(mesh.faces, np.uint32)
        if len(faces) == 0:
            # Ids must count on, so an empty mesh is a triangle that no ray can hit.
            vertices, faces = np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32)
        scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(faces))
    return scene


def depth_map(scene: Any, camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return the depth (H, W) [m] of what a camera sees at its pixel centres, and which mesh (-1 for none)."""
    origins, directions = camera.rays(camera.pixel_centres())
    hits = scene.cast_rays(np.concatenate([origins, directions], axis=1).astype(np.float32))
    distance = hits["t_hit"].numpy()
    index = hits["geometry_ids"].numpy().astype(np.int64)
    depth = distance * (directions @ camera.T_world_camera[:3, 2]).astype(np.float32)
    shape = camera.height, camera.width
    return depth.reshape(shape), np.where(np.isfinite(distance), index, -1).reshape(shape).astype(np.int32)


def frame_views(
    recording: Recording, meshes: Sequence[Mesh] | Mapping[str, Mesh], label: str, indices: Iterable[int] | None = None
) -> Iterator[FrameView]:
    """Yield a view of each frame, one at a time, so that a long drive needs no more memory than a short one."""
    meshes = list(meshes.values()) if isinstance(meshes, Mapping) else list(meshes)
    frames = recording.frames if indices is None else [recording.frames[i] for i in indices]
    scene = raycasting_scene(meshes)
    for frame in tracked(frames, label, len(frames)):
        yield frame_view(frame, scene)


def frame_view(frame: Frame, scene: Any) -> FrameView:
    """Read a frame and cast its depth.

    Raises
    ------
    InputError
        If the picture or the mask is damaged or of another size than the camera.
    """
    import cv2

    camera = frame.camera
    linear, encoding = read_image(frame.image, frame.response)
    if linear.shape[:2] != (camera.height, camera.width):
        size = f"{linear.shape[1]} x {linear.shape[0]}"
        raise InputError(f"have the camera's size {camera.width} x {camera.height}", got=size, file=frame.image)
    instances = np.zeros(linear.shape[:2], np.int32)
    if frame.masks is not None:
        raw = read_ids(frame.masks.file)
        raw = raw if raw.ndim == 2 else raw[..., 0]
        if raw.shape != linear.shape[:2]:
            size = f"{raw.shape[1]} x {raw.shape[0]}"
            raise InputError(f"have the image's size {camera.width} x {camera.height}", got=size, file=frame.masks.file)
        instances = raw.astype(np.int32)
    dynamic = cv2.dilate((instances > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    depth, mesh_index = depth_map(scene, camera)
    top = 1.0 / frame.exposure if encoding.dtype.startswith("uint") else np.inf
    return FrameView(camera, linear / np.float32(frame.exposure), top, instances, dynamic, depth, mesh_index)


def visible_in_frame(
    points: Floats,
    camera: Camera,
    depth: NDArray[np.float32] | Any,
    normals: Floats | None = None,
    tolerance: float = 0.03,
) -> NDArray[np.bool_]:
    """Return which surface points a camera sees: inside its picture, and nothing in front of them.

    Parameters
    ----------
    points : (N, 3) float
        World points [m].
    camera : Camera
        The frame's.
    depth : (H, W) float32 or RaycastingScene
        Depth of the static world at pixel centres (`depth_map`), or the scene to cast it in.
    normals : (N, 3) float, optional
        Unit normals, either side. With them the test allows for the depth that a slanted surface covers within a pixel:
        on a road 40 m ahead that is more than a metre.
    tolerance : float
        How far in front of a point the depth may lie [m]; 0.2 % of the depth comes on top.
    """
    if not isinstance(depth, np.ndarray):
        depth, _ = depth_map(depth, camera)
    xy, z = camera.project(points)
    facing = np.broadcast_to(-camera.T_world_camera[:3, 2], points.shape) if normals is None else normals
    n = (facing @ camera.T_camera_world[:3, :3].T).astype(np.float64)
    nothing = np.zeros(depth.shape, np.bool_)
    return kernel.see(xy, z, n, depth, nothing, *_intrinsics(camera), 0, tolerance) > 0


def _intrinsics(camera: Camera) -> tuple[float, float, float, float, bool]:
    return camera.fx, camera.fy, camera.cx, camera.cy, camera.model == "ORTHOGRAPHIC"


def _cosine(camera: Camera, points: Floats, normals: Floats) -> NDArray[np.float64]:
    """Return the absolute cosine between the normals and the view."""
    if camera.model == "ORTHOGRAPHIC":
        return np.abs(normals @ camera.T_world_camera[:3, 2])
    view = points - camera.position
    return np.abs(np.sum(view * normals, axis=1)) / np.maximum(np.linalg.norm(view, axis=1), 1e-9)


def _halved(image: NDArray[np.float32], valid: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Average 2 x 2 valid pixels."""
    rows, cols = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2

    def pooled(a: NDArray[np.float32]) -> NDArray[np.float32]:
        total = a[0:rows:2, 0:cols:2] + a[1:rows:2, 0:cols:2] + a[0:rows:2, 1:cols:2] + a[1:rows:2, 1:cols:2]
        return (total * np.float32(0.25)).astype(np.float32)

    weight = pooled(valid)
    colour = pooled(image * valid[..., None]) / np.maximum(weight, np.float32(1e-6))[..., None]
    return colour.astype(np.float32), weight.astype(np.float32)
