"""A walking person: a smooth union of capsules, meshed once, that then moves rigidly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh

Floats = NDArray[np.floating]

# Capsules: start, end [m], radii at both, material. x is the way of walking, z up, the lowest sole at z = 0.
_BODY = [
    ((0.20, 0.09, 0.05), (0.33, 0.10, 0.045), 0.05, 0.042, "shoe"),
    ((-0.27, -0.09, 0.13), (-0.15, -0.10, 0.055), 0.048, 0.042, "shoe"),
    ((0.00, 0.09, 0.90), (0.13, 0.09, 0.50), 0.095, 0.068, "trousers"),
    ((0.13, 0.09, 0.50), (0.20, 0.09, 0.09), 0.066, 0.045, "trousers"),
    ((0.00, -0.09, 0.90), (-0.02, -0.09, 0.50), 0.095, 0.068, "trousers"),
    ((-0.02, -0.09, 0.50), (-0.26, -0.09, 0.16), 0.066, 0.045, "trousers"),
    ((0.00, 0.00, 0.95), (0.01, 0.00, 1.15), 0.135, 0.14, "jacket"),
    ((0.01, 0.06, 1.15), (0.015, 0.09, 1.38), 0.13, 0.095, "jacket"),
    ((0.01, -0.06, 1.15), (0.015, -0.09, 1.38), 0.13, 0.095, "jacket"),
    ((0.015, -0.13, 1.42), (0.015, 0.13, 1.42), 0.07, 0.07, "jacket"),
    ((0.01, 0.20, 1.40), (-0.09, 0.25, 1.15), 0.058, 0.05, "jacket"),
    ((-0.09, 0.25, 1.15), (-0.06, 0.25, 0.93), 0.048, 0.038, "jacket"),
    ((0.01, -0.20, 1.40), (0.10, -0.25, 1.16), 0.058, 0.05, "jacket"),
    ((0.10, -0.25, 1.16), (0.26, -0.24, 1.05), 0.048, 0.038, "jacket"),
    ((-0.055, 0.25, 0.89), (-0.04, 0.25, 0.84), 0.036, 0.03, "skin"),
    ((0.29, -0.24, 1.035), (0.335, -0.235, 1.02), 0.036, 0.03, "skin"),
    ((0.015, 0.00, 1.44), (0.03, 0.00, 1.54), 0.055, 0.055, "skin"),
    ((0.04, 0.00, 1.60), (0.045, 0.00, 1.66), 0.078, 0.085, "skin"),
    ((0.00, 0.00, 1.67), (0.02, 0.00, 1.71), 0.088, 0.078, "hair"),
]
_CELL = 0.02
_SMOOTH = 0.022


def pedestrian() -> dict[str, Mesh]:
    """Return the person's meshes by material, feet at the origin, walking along +x."""
    from skimage.measure import marching_cubes

    low, high = np.array([-0.44, -0.40, -0.08]), np.array([0.50, 0.40, 1.90])
    axes = [np.arange(a, b, _CELL) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    field = np.full(grid.shape[:3], 1e3)
    for start, end, r0, r1, _ in _BODY:
        d = _capsule(grid.reshape(-1, 3), start, end, r0, r1).reshape(field.shape)
        # Smooth minimum (Quilez): a fillet of about 2 cm where limbs meet.
        blend = np.maximum(_SMOOTH - np.abs(field - d), 0) / _SMOOTH
        field = np.minimum(field, d) - blend * blend * _SMOOTH / 4
    vertices, faces, normals, _ = marching_cubes(field.astype(np.float32), 0.0, spacing=(_CELL,) * 3, gradient_direction="ascent")
    vertices = vertices + low
    # Soles are flat: what hangs below the ground plane is pressed up onto it.
    vertices[:, 2] = np.maximum(vertices[:, 2] - vertices[:, 2].min(), 0.0)
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.uint32))
    mesh = mesh.with_smooth_normals()
    outward = np.einsum("vc,vc->v", mesh.normals, normals)  # type: ignore[arg-type]
    if np.median(outward) < 0:
        mesh = Mesh(mesh.vertices, mesh.faces[:, ::-1].copy()).with_smooth_normals()
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    distance = np.stack([_capsule(centre, *part[:4]) for part in _BODY])
    owner = np.argmin(distance, axis=0)
    names = np.array([part[4] for part in _BODY])
    return {name: _take(mesh, names[owner] == name) for name in sorted(set(names))}


def _capsule(p: Floats, start: tuple, end: tuple, r0: float, r1: float) -> NDArray[np.float64]:
    a, b = np.array(start), np.array(end)
    t = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - (a + t[:, None] * (b - a)), axis=1) - (r0 + t * (r1 - r0))


def _take(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    assert mesh.normals is not None
    uv = np.zeros((len(used), 2), np.float32)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3).astype(np.uint32), mesh.normals[used], uv)
