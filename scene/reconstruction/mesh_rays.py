"""Rays and distances against a mesh, by Open3D's ray caster: the few questions that building a scene asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Hits:
    """Where rays met the mesh.

    Attributes
    ----------
    distance : (N,) float64
        Along the unit direction [m]; infinite where nothing is met.
    face : (N,) int64
        Index of the triangle; 0 where nothing is met.
    weights : (N, 3) float64
        Barycentric weights of its corners.
    normals : (N, 3) float64
        Its geometric normal.
    """

    distance: NDArray[np.float64]
    face: NDArray[np.int64]
    weights: NDArray[np.float64]
    normals: NDArray[np.float64]

    @property
    def is_hit(self) -> NDArray[np.bool_]:
        return np.isfinite(self.distance)


class MeshRays:
    """A mesh that answers rays and nearest places.

    Parameters
    ----------
    mesh : Mesh
        With at least one triangle.
    """

    def __init__(self, mesh: Mesh) -> None:
        import open3d

        # Open3D's stubs do not know that its tensors are made of arrays.
        o3d: Any = open3d
        self._tensor = o3d.core.Tensor
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._tensor(mesh.vertices), self._tensor(mesh.faces))

    def cast(self, origins_world: Floats, directions_world: Floats) -> Hits:
        """Return the nearest hits of rays: origins and unit directions (N, 3)."""
        rays = np.ascontiguousarray(np.hstack([origins_world, directions_world]), dtype=np.float32)
        answer = self._scene.cast_rays(self._tensor(rays))
        distance = answer["t_hit"].numpy().astype(np.float64)
        uv = answer["primitive_uvs"].numpy().astype(np.float64)
        face = np.where(np.isfinite(distance), answer["primitive_ids"].numpy(), 0).astype(np.int64)
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        return Hits(distance, face, weights, answer["primitive_normals"].numpy().astype(np.float64))

    def nearest(self, points_world: Floats) -> NDArray[np.float64]:
        """Return the mesh's place (N, 3) nearest to each point [m]."""
        query = self._tensor(np.ascontiguousarray(points_world, dtype=np.float32))
        return self._scene.compute_closest_points(query)["points"].numpy().astype(np.float64)

    def distance(self, points_world: Floats) -> NDArray[np.float64]:
        """Return the distance (N,) of points from the mesh [m]."""
        query = self._tensor(np.ascontiguousarray(points_world, dtype=np.float32))
        return self._scene.compute_distance(query).numpy().astype(np.float64)
