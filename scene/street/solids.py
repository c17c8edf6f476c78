"""Simple solids from which facades, trees and furniture are put together; all faces look outwards."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mesh import Mesh

Floats = NDArray[np.floating]


def quads(corners: ArrayLike, uv_scale: float = 1.0, uv: Floats | None = None) -> Mesh:
    """Return rectangles (or other flat quadrilaterals) as triangles with flat normals.

    Parameters
    ----------
    corners : (N, 4, 3) float
        Counter-clockwise seen from outside [m].
    uv_scale : float
        Side of a texture tile [m]; u runs along the more horizontal of the quad's directions, v downwards.
    uv : (N, 4, 2), optional
        Texture coordinates, if they are known.
    """
    corners = np.asarray(corners, float).reshape(-1, 4, 3)
    n = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    if uv is None:
        # u = horizontal direction in the plane of the quad; v = downhill; both measured from the world's origin, so
        # that a pattern runs on across neighbouring quads.
        flat = np.abs(n[:, 2]) > 0.999
        tangent = np.where(flat[:, None], [1.0, 0, 0], np.cross([0, 0, 1.0], n))
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        down = np.cross(tangent, n)
        uv = np.stack([np.einsum("nkc,nc->nk", corners, tangent), np.einsum("nkc,nc->nk", corners, down)], axis=-1) / uv_scale
    base = 4 * np.arange(len(corners))[:, None]
    faces = np.stack([base + [0, 1, 2], base + [0, 2, 3]], axis=1).reshape(-1, 3)
    return Mesh(
        corners.reshape(-1, 3).astype(np.float32),
        faces.astype(np.uint32),
        np.repeat(n, 4, axis=0).astype(np.float32),
        np.asarray(uv).reshape(-1, 2).astype(np.float32),
    )


def box(low: ArrayLike, high: ArrayLike, uv_scale: float = 1.0) -> Mesh:
    """Return an axis-aligned box between two corners."""
    x0, y0, z0 = np.asarray(low, float)
    x1, y1, z1 = np.asarray(high, float)
    return quads(
        [
            [(x0, y0, z0), (x0, y1, z0), (x1, y1, z0), (x1, y0, z0)],
            [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
            [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
            [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
            [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
            [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
        ],
        uv_scale,
    )


def tube(path: ArrayLike, radii: ArrayLike, sides: int = 12, caps: bool = True, uv_scale: float = 1.0) -> Mesh:
    """Return a round tube along a polyline, with smooth normals.

    Parameters
    ----------
    path : (N, 3) float
        Centre line [m].
    radii : (N,) float
        Radius at each of its points [m].
    """
    path, radii = np.asarray(path, float), np.asarray(radii, float)
    t = np.gradient(path, axis=0)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    # One reference direction for the whole tube: it must lie along no part of it, or the rings would twist.
    reference = np.array([1.0, 0.1, 0.05]) if np.abs(t[:, 0]).max() < 0.9 else np.array([0.05, 0.1, 1.0])
    a = np.cross(t, reference)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(t, a)
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    normal = np.cos(angle)[None, :, None] * a[:, None] + np.sin(angle)[None, :, None] * b[:, None]
    vertices = path[:, None] + radii[:, None, None] * normal
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    # A whole number of tiles around, so that the seam does not show.
    around = max(1, round(2 * np.pi * radii.max() / uv_scale))
    uv = np.stack(np.broadcast_arrays(angle[None] / (2 * np.pi) * around, length[:, None] / uv_scale), axis=-1)
    n, m = len(path), sides + 1
    corner = (np.arange(n - 1)[:, None] * m + np.arange(sides)[None]).ravel()
    faces = np.stack([corner, corner + 1, corner + m + 1, corner, corner + m + 1, corner + m], axis=1).reshape(-1, 3)
    parts_v, parts_n, parts_uv, parts_f = [vertices.reshape(-1, 3)], [normal.reshape(-1, 3)], [uv.reshape(-1, 2)], [faces]
    if caps:
        count = n * m
        for ring, sign in ((0, -1), (n - 1, 1)):
            parts_v += [vertices[ring, :sides], path[ring][None]]
            parts_n.append(np.tile(sign * t[ring], (sides + 1, 1)))
            parts_uv.append(np.zeros((sides + 1, 2)))
            i = np.arange(sides)
            fan = np.stack([i, (i + 1) % sides, np.full(sides, sides)], axis=1)
            parts_f.append((fan if sign > 0 else fan[:, ::-1]) + count)
            count += sides + 1
    mesh = Mesh(
        np.concatenate(parts_v).astype(np.float32),
        np.concatenate(parts_f).astype(np.uint32),
        np.concatenate(parts_n).astype(np.float32),
        np.concatenate(parts_uv).astype(np.float32),
    )
    return _outward(mesh)


def moved(mesh: Mesh, T: Floats) -> Mesh:
    """Return a mesh under a rigid motion (4, 4)."""
    R, t = T[:3, :3], T[:3, 3]
    vertices = (mesh.vertices.astype(np.float64) @ R.T + t).astype(np.float32)
    normals = None if mesh.normals is None else (mesh.normals.astype(np.float64) @ R.T).astype(np.float32)
    return Mesh(vertices, mesh.faces, normals, mesh.uv, mesh.attributes)


def pose(x: float, y: float, z: float, yaw: float = 0.0) -> NDArray[np.float64]:
    """Return a rigid motion: a turn about z, then a shift."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]], float)


def _outward(mesh: Mesh) -> Mesh:
    """Turn the triangles that look against their own vertex normals."""
    assert mesh.normals is not None
    against = np.einsum("fc,fc->f", mesh.face_normals(), mesh.normals[mesh.faces].mean(axis=1)) < 0
    faces = mesh.faces.copy()
    faces[against] = faces[against][:, ::-1]
    return Mesh(mesh.vertices, faces, mesh.normals, mesh.uv, mesh.attributes)
