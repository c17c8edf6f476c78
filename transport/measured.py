"""Pictures of meshes that carry measured reflectance: a BTF, or textures fitted to one, through the mesh's u and v.

Light comes from directional lights, once, with shadows (thesis, chapter 4: objects of measured materials). The local frame of a
place has its normal from the mesh and x along dp/du; texels are looked up bilinearly and repeat, directions as the material does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from materials.btf import BTF
from materials.foundation.errors import InputError
from materials.svbrdf import SVBRDF
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import DirectionalLight

from .embree import EmbreeScene
from .kernels import measured as kernel

Floats = NDArray[np.float64]


def render_measured(
    mesh: Mesh, material: BTF | SVBRDF, camera: Camera, lights: Sequence[DirectionalLight], repeats: float = 1.0
) -> NDArray[np.float32]:
    """Return linear radiance (H, W, 3); 0 where no surface is seen.

    Parameters
    ----------
    mesh : Mesh
        With normals and u, v.
    material : BTF or SVBRDF
        Its mask must be full: textures have no holes here.
    camera : Camera
    lights : sequence of DirectionalLight
    repeats : float
        How often the texture repeats over u and v from 0 to 1.

    Raises
    ------
    InputError
        If the mesh has no normals or no u, v, or the material has holes.
    """
    if mesh.normals is None or mesh.uv is None:
        raise InputError("have normals and u, v", key="mesh")
    if not material.mask.all():
        raise InputError("be known everywhere", got="a mask with holes", key="material")
    scene = EmbreeScene(mesh.vertices, mesh.faces)
    origins, directions = camera.rays(camera.pixel_centres())
    origins, directions = np.ascontiguousarray(origins, np.float64), np.ascontiguousarray(directions, np.float64)
    faces, coordinates = np.empty(len(origins), np.int64), np.empty((len(origins), 3))
    kernel.nearest(scene.handle, origins, directions, faces, coordinates)
    seen = np.flatnonzero(faces >= 0)
    out = np.zeros((camera.height, camera.width, 3), np.float32)
    if not len(seen):
        return out
    corners = mesh.faces[faces[seen]].astype(np.int64)
    b1, b2, distance = coordinates[seen].T
    shares = np.stack([1 - b1 - b2, b1, b2], axis=1)
    places = origins[seen] + distance[:, None] * directions[seen]
    frame, ng = surface_frames(mesh, corners, shares)
    wo = np.einsum("qab,qa->qb", frame, -directions[seen])
    uv = np.einsum("qk,qkc->qc", shares, mesh.uv[corners].astype(np.float64)) * repeats
    total = np.zeros((len(seen), 3))
    for light in lights:
        towards = -np.asarray(light.direction, np.float64)
        towards /= np.linalg.norm(towards)
        wi = np.einsum("qab,a->qb", frame, towards)
        start = np.ascontiguousarray(places + ng * (1e-5 * np.abs(places).max() + 1e-6))
        hidden = np.empty(len(seen), np.bool_)
        kernel.blocked(scene.handle, start, towards, np.inf, hidden)
        lit = ~hidden & (wi[:, 2] > 0) & (wo[:, 2] > 0) & (ng @ towards > 0)
        total[lit] += _looked_up(material, uv[lit], wi[lit], wo[lit]) * np.asarray(light.irradiance)
    out.reshape(-1, 3)[seen] = total
    return out


def surface_frames(mesh: Mesh, corners: NDArray[np.int64], shares: Floats) -> tuple[Floats, Floats]:
    """Return frames (Q, 3, 3) with columns x, y, n, and geometric normals on the side of n."""
    assert mesh.normals is not None and mesh.uv is not None
    n = np.einsum("qk,qkc->qc", shares, mesh.normals[corners].astype(np.float64))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    p, uv = mesh.vertices[corners].astype(np.float64), mesh.uv[corners].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    along = d2[:, 1:] * e1 - d1[:, 1:] * e2
    along *= np.sign(d1[:, :1] * d2[:, 1:] - d1[:, 1:] * d2[:, :1])
    x = along - (along * n).sum(axis=1, keepdims=True) * n
    length = np.linalg.norm(x, axis=1, keepdims=True)
    # Where u, v say nothing any tangent serves.
    spare = np.where(np.abs(n[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    spare = spare - (spare * n).sum(axis=1, keepdims=True) * n
    x = np.where(length > 1e-12, x / np.maximum(length, 1e-12), spare / np.linalg.norm(spare, axis=1, keepdims=True))
    y = np.asarray(np.cross(n, x), np.float64)
    ng = np.asarray(np.cross(e1, e2), np.float64)
    ng /= np.maximum(np.linalg.norm(ng, axis=1, keepdims=True), 1e-300)
    ng *= np.where((ng * n).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return np.stack([x, y, n], axis=-1), ng


def _looked_up(material: BTF | SVBRDF, uv: Floats, wi: Floats, wo: Floats) -> Floats:
    """Return f cos theta_i (Q, 3), bilinear between the four nearest texels, repeating."""
    height, width = material.mask.shape
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    col, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    total = np.zeros((len(uv), 3))
    for i in range(2):
        for j in range(2):
            share = np.where(i, y - row, 1 - y + row) * np.where(j, x - col, 1 - x + col)
            texels = (row + i) % height * width + (col + j) % width
            if isinstance(material, BTF):
                value = material.reflect(texels, wi, wo)
            else:
                value = material.reflect(wi, wo, texels)
            total += share[:, None] * value
    return total
