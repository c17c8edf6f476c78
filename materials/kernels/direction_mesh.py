"""Where a direction lies among measured ones: a walk through their triangles on Lambert's disc.

The disc keeps areas, and values that are linear in position on it are met exactly (`materials.directions.interpolation`).
"""

import math
from typing import Any, NamedTuple

from numba import njit

START_CELLS = 32
"""Cells each way of the grid that names a triangle to start from."""
# Rows of `sets`: first node and their number, first triangle and their number.
NODE, NUM_NODES, TRIANGLE, NUM_TRIANGLES = 0, 1, 2, 3
# As `scipy.spatial.Delaunay.find_simplex` is asked: a hair outside counts as inside.
_TOLERANCE = -1e-9


class DirectionMeshes(NamedTuple):
    """Sets of directions, one after the other; indices count from the start of each set."""

    sets: Any  # (S, 4) int64
    nodes: Any  # (N, 2) float64: places on the disc
    triangles: Any  # (E, 3) int64: nodes
    neighbours: Any  # (E, 3) int64: the triangle opposite each corner, -1 beyond the rim
    affine: Any  # (E, 3, 2) float64: from a place to two barycentric coordinates, as SciPy has it
    starts: Any  # (S, START_CELLS, START_CELLS) int64: a triangle in or near each cell


@njit(cache=True)
def on_disc(w):
    """Return the place of a direction above the horizon on a disc of radius 1."""
    s = 1.0 / math.sqrt(1.0 + max(w[2], 0.0))
    return w[0] * s, w[1] * s


@njit(cache=True)
def _barycentric(meshes, triangle, x, y):
    m = meshes.affine[triangle]
    dx, dy = x - m[2, 0], y - m[2, 1]
    a, b = m[0, 0] * dx + m[0, 1] * dy, m[1, 0] * dx + m[1, 1] * dy
    return a, b, 1.0 - a - b


@njit(cache=True)
def _weights(meshes, triangle, a, b, c):
    nodes = meshes.triangles[triangle]
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    s = 1.0 / (a + b + c)
    return (nodes[0], nodes[1], nodes[2]), (a * s, b * s, c * s)


@njit(cache=True)
def _nearest(meshes, which, x, y):
    first, best, least = meshes.sets[which, NODE], 0, math.inf
    for k in range(meshes.sets[which, NUM_NODES]):
        dx, dy = meshes.nodes[first + k, 0] - x, meshes.nodes[first + k, 1] - y
        if dx * dx + dy * dy < least:
            best, least = k, dx * dx + dy * dy
    return (best, best, best), (1.0, 0.0, 0.0)


@njit(cache=True)
def locate(meshes, which, w):
    """Return the three measured directions around w and their weights; beyond the rim the nearest one has all."""
    x, y = on_disc(w)
    first, count = meshes.sets[which, TRIANGLE], meshes.sets[which, NUM_TRIANGLES]
    col = min(max(int(0.5 * (x + 1.0) * START_CELLS), 0), START_CELLS - 1)
    row = min(max(int(0.5 * (y + 1.0) * START_CELLS), 0), START_CELLS - 1)
    k = meshes.starts[which, row, col]
    for _ in range(count):
        a, b, c = _barycentric(meshes, first + k, x, y)
        if a >= _TOLERANCE and b >= _TOLERANCE and c >= _TOLERANCE:
            return _weights(meshes, first + k, a, b, c)
        # Across the side that the place is farthest beyond: in a Delaunay triangulation this walk comes to an end.
        side = 0 if a <= b and a <= c else (1 if b <= c else 2)
        if math.isnan(a):
            break
        k = meshes.neighbours[first + k, side]
        if k < 0:
            return _nearest(meshes, which, x, y)
    # A triangle without area stood in the way.
    for k in range(count):
        a, b, c = _barycentric(meshes, first + k, x, y)
        if a >= _TOLERANCE and b >= _TOLERANCE and c >= _TOLERANCE:
            return _weights(meshes, first + k, a, b, c)
    return _nearest(meshes, which, x, y)
