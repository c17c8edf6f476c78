"""What a camera sees of a reconstructed scene, and in what light it would mirror its surroundings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from scene.camera import Camera
from scene.scene_file import Scene

from ..case import Floats

GROUND, ENVIRONMENT, NOTHING = 0, 1, -1
# The sky is mirrored by rough ground: it is blurred by about this angle first.
_GLOSS_BLUR_DEG = 8.0
_SMOOTH = 2.0  # [px]: normals of a mesh that is right to centimetres are those of an area


@dataclass(frozen=True)
class Look:
    """What the centres of pixels see.

    Attributes
    ----------
    points, normals, rays : (P, 3) float64
        In the world [m]; normals face the camera; rays lead away from it.
    depth : (P,) float64
        Along the camera's z [m]; infinite beyond all meshes.
    mesh : (P,) int64
        GROUND, ENVIRONMENT or NOTHING.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    rays: NDArray[np.float64]
    depth: NDArray[np.float64]
    mesh: NDArray[np.int64]

    @property
    def cosine(self) -> NDArray[np.float64]:
        """Between the normal and the way to the camera (P,)."""
        return np.clip(-(self.rays * self.normals).sum(axis=1), 0, 1)


def look(rays_scene: Any, camera: Camera) -> Look:
    """Cast a ray through the centre of each pixel; mesh 0 of the scene is the ground, 1 the environment."""
    origins, rays = camera.rays(camera.pixel_centres())
    hits = rays_scene.cast_rays(np.concatenate([origins, rays], axis=1).astype(np.float32))
    distance = hits["t_hit"].numpy().astype(np.float64)
    seen = np.isfinite(distance)
    mesh = np.where(seen, hits["geometry_ids"].numpy().astype(np.int64), NOTHING)
    normals = hits["primitive_normals"].numpy().astype(np.float64)
    normals *= np.where((normals * rays).sum(axis=1, keepdims=True) > 0, -1.0, 1.0)
    smooth = np.zeros_like(normals)
    for m in (GROUND, ENVIRONMENT):
        own = (mesh == m)[:, None]
        wide = (normals * own).reshape(camera.height, camera.width, 3)
        smooth += own * gaussian_filter(wide, (_SMOOTH, _SMOOTH, 0)).reshape(-1, 3)
    smooth /= np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-9)
    points = origins + np.where(seen, distance, 0)[:, None] * rays
    depth = distance * (rays @ camera.T_world_camera[:3, 2])
    return Look(points, smooth, rays, np.where(seen, depth, np.inf), mesh)


@dataclass(frozen=True)
class Surroundings:
    """What surfaces mirror: the panorama of the sky (rows, cols, 3), blurred, and the mean colour of the environment (3,)."""

    sky: Floats
    environment: Floats


def surroundings_of(scene: Scene) -> Surroundings:
    """Return what rough surfaces of a scene mirror."""
    panorama = scene.sky.panorama[..., :3]
    blur = _GLOSS_BLUR_DEG / 180 * len(panorama)
    sky = gaussian_filter(panorama, (blur, blur, 0), mode=("nearest", "wrap", "nearest"))
    return Surroundings(sky, scene.class_means["environment"])


def mirrored(surroundings: Surroundings, rays_scene: Any, seen: Look, eye: NDArray[np.float64]) -> Floats:
    """Return the radiance that the surfaces seen would mirror to an eye elsewhere (P, 3), were they smooth, of index 1.5.

    Sky that frames saw, or its generic form; what is hidden by the environment has the mean colour of that.
    """
    to_eye = eye - seen.points
    to_eye /= np.maximum(np.linalg.norm(to_eye, axis=1, keepdims=True), 1e-9)
    along = (to_eye * seen.normals).sum(axis=1, keepdims=True)
    out = 2 * along * seen.normals - to_eye
    start = seen.points + 0.05 * seen.normals
    hits = rays_scene.cast_rays(np.concatenate([start, out], axis=1).astype(np.float32))
    hidden = np.isfinite(hits["t_hit"].numpy())
    rows, cols = surroundings.sky.shape[:2]
    row = np.clip(np.arccos(np.clip(out[:, 2], -1, 1)) / np.pi * rows, 0, rows - 1).astype(np.int64)
    col = ((np.arctan2(out[:, 1], out[:, 0]) / (2 * np.pi) + 0.5) % 1.0 * cols).astype(np.int64) % cols
    light = np.where(hidden[:, None], surroundings.environment, surroundings.sky[row, col])
    fresnel = 0.04 + 0.96 * (1 - np.clip(along, 0, 1)) ** 5
    return np.where((along > 0) & (seen.mesh >= 0)[:, None], fresnel * light, 0).astype(np.float32)
