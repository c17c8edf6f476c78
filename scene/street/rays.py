"""Rays against the street's exact triangles: what stands is built once, what moves per frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..simulation import Shape

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Hits:
    """Nearest hits of N rays.

    Attributes
    ----------
    distance : (N,) float64
        Along the ray, inf where nothing is met [m].
    instance : (N,) int32
        0 where static or nothing.
    normal : (N, 3) float32
        Geometric normal of the triangle; 0 where nothing is met.
    shape : (N,) int32
        Index into the scene's shapes, -1 where nothing is met.
    """

    distance: NDArray[np.float64]
    instance: NDArray[np.int32]
    normal: NDArray[np.float32]
    shape: NDArray[np.int32]


class RayScene:
    """Static and moving shapes under Open3D's ray caster."""

    def __init__(self, static: tuple[Shape, ...], moving: tuple[Shape, ...] = (), reuse: RayScene | None = None) -> None:
        same = reuse is not None and reuse._static == tuple(id(s.mesh) for s in static)
        self._static = tuple(id(s.mesh) for s in static)
        self.shapes = (*static, *moving)
        self._parts = [(reuse._parts[0] if same and reuse is not None else _built(static))]
        if moving:
            self._parts.append(_built(moving))
        self._offsets = (0, len(static))
        self._instances = np.array([s.instance for s in self.shapes], np.int32)

    def cast(self, origins: Floats, directions: Floats) -> Hits:
        """Return the nearest hits of rays with unit directions (N, 3)."""
        import open3d as o3d

        rays = o3d.core.Tensor.from_numpy(np.concatenate([origins, directions], axis=1).astype(np.float32))
        n = len(directions)
        hits = Hits(np.full(n, np.inf), np.zeros(n, np.int32), np.zeros((n, 3), np.float32), np.full(n, -1, np.int32))
        for (scene, first_face), offset in zip(self._parts, self._offsets, strict=False):
            found = scene.cast_rays(rays)
            distance = found["t_hit"].numpy().astype(np.float64)
            nearer = distance < hits.distance
            face = found["primitive_ids"].numpy()[nearer].astype(np.int64)
            shape = np.searchsorted(first_face, face, side="right") - 1 + offset
            hits.distance[nearer] = distance[nearer]
            hits.normal[nearer] = found["primitive_normals"].numpy()[nearer]
            hits.shape[nearer] = shape
            hits.instance[nearer] = self._instances[shape]
        return hits


def _built(shapes: tuple[Shape, ...]):
    """Return the ray caster of all shapes as one mesh, and the index of each shape's first triangle."""
    import open3d as o3d

    meshes = [s.mesh for s in shapes]
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    vertices = np.concatenate([m.vertices for m in meshes])
    faces = np.concatenate([m.faces.astype(np.int64) + o for m, o in zip(meshes, offsets, strict=True)])
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(faces.astype(np.uint32)))
    return scene, np.cumsum([0] + [m.num_faces for m in meshes[:-1]])
