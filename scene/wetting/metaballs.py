"""The surface of drops on a glass: metaballs that blend where they come near (Blinn 1982, thesis 6.3.5).

Each drop is the part above the glass of a ball whose centre lies below it, so that the ball alone would meet the glass at
the contact angle. Its field falls from 1 at the centre to 0 at a finite radius (Wyvill et al. 1986), and where the sum of
the fields exceeds a threshold there is water: drops that nearly touch grow a neck.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from materials.foundation.checks import check_range

from ..mesh import Mesh
from .windshield import Drops

_THRESHOLD = 0.3
# Radius of a lone ball's surface, in radii of its field: (1 - q^2)^3 = threshold.
_SURFACE = float(np.sqrt(1 - np.cbrt(_THRESHOLD)))


def drop_mesh(drops: Drops, contact_angle_deg: float, resolution: float) -> Mesh:
    """Return the closed surface of the drops in glass coordinates.

    Parameters
    ----------
    drops : Drops
    contact_angle_deg : float
        Between water and glass, at most 90.
    resolution : float
        Of the grid on which the surface is found [m].

    Returns
    -------
    mesh : Mesh
        Faces outwards, normals those of the field. What lies on the glass has n = 0 exactly; its faces are flat.
    """
    check_range("contact_angle_deg", contact_angle_deg, "(0, 90]")
    check_range("resolution", resolution, "(0, inf)")
    angle = np.radians(contact_angle_deg)
    balls = drops.radii / np.sin(angle)
    below, reach = balls * np.cos(angle), balls / _SURFACE
    parts = []
    for members in _clusters(drops, reach):
        parts.append(_cluster_mesh(drops.centres[members], below[members], reach[members], balls[members], resolution))
    if not parts:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros((0, 3), np.float32))
    offsets = np.cumsum([0] + [len(v) for v, _, _ in parts[:-1]])
    return Mesh(
        np.concatenate([v for v, _, _ in parts]).astype(np.float32),
        np.concatenate([f + o for (_, f, _), o in zip(parts, offsets, strict=True)]).astype(np.uint32),
        np.concatenate([n for _, _, n in parts]).astype(np.float32),
    )


def _clusters(drops: Drops, reach: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """Return the members of each group of drops whose fields meet."""
    n = len(drops.radii)
    if n == 0:
        return []
    pairs = cKDTree(drops.centres).query_pairs(2 * float(reach.max()), output_type="ndarray")
    i, j = pairs.T
    near = np.linalg.norm(drops.centres[i] - drops.centres[j], axis=1) < reach[i] + reach[j]
    graph = coo_array((np.ones(near.sum()), (i[near], j[near])), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    order = np.argsort(label, kind="stable")
    return np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])


def _cluster_mesh(
    centres: NDArray[np.float64],
    below: NDArray[np.float64],
    reach: NDArray[np.float64],
    balls: NDArray[np.float64],
    resolution: float,
) -> tuple[NDArray, NDArray, NDArray]:
    # The smallest drop is still to have some cells across, and the largest cluster no more than memory holds.
    h = min(resolution, 0.25 * float(balls.min()))
    low = (centres - reach[:, None]).min(axis=0)
    high = (centres + reach[:, None]).max(axis=0)
    # Blended drops rise above each of them, but not above the reach of their fields.
    top = float((reach - below).max())
    shape = [int(np.ceil((b - a) / h)) + 1 for a, b in zip((*low, 0.0), (*high, top), strict=True)]
    # One layer below the glass holds no water and closes the surface.
    field = np.zeros((shape[0], shape[1], shape[2] + 1), np.float32)
    for (u, v), depth, r in zip(centres, below, reach, strict=True):
        box = [slice(max(int((c - r - a) / h), 0), int((c + r - a) / h) + 2) for c, a in zip((u, v), low, strict=True)]
        x = low[0] + h * np.arange(shape[0])[box[0]] - u
        y = low[1] + h * np.arange(shape[1])[box[1]] - v
        z = h * np.arange(shape[2]) + depth
        q = (x[:, None, None] ** 2 + y[None, :, None] ** 2 + z**2) / r**2
        field[box[0], box[1], 1:] += np.maximum(1 - q, 0).astype(np.float32) ** 3
    if field.max() <= _THRESHOLD:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros((0, 3))
    p, faces, _, _ = marching_cubes(field, _THRESHOLD)
    p = p.astype(np.float64) * h + (*low, -h)
    p[:, 2] = np.maximum(p[:, 2], 0.0)
    normals = _normals(p, centres, below, reach)
    corners = p[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = normals[faces].sum(axis=1)
    outwards[np.all(corners[..., 2] == 0, axis=1)] = (0, 0, -1)
    flipped = np.einsum("fc,fc->f", area, outwards) < 0
    faces = np.where(flipped[:, None], faces[:, ::-1], faces)
    # What was pressed onto the glass from the side has no area.
    return p, faces[np.linalg.norm(area, axis=1) > 1e-9 * h * h], normals


def _normals(p: NDArray, centres: NDArray, below: NDArray, reach: NDArray) -> NDArray[np.float64]:
    """Return unit vectors against the gradient of the field."""
    gradient = np.zeros_like(p)
    for (u, v), depth, r in zip(centres, below, reach, strict=True):
        d = p - (u, v, -depth)
        gradient += 6 * np.maximum(1 - np.einsum("nc,nc->n", d, d) / r**2, 0)[:, None] ** 2 * d / r**2
    return gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)
