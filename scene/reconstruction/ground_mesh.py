"""Triangles over a height field: fine near the path, coarse far away, without a crack between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh
from .height_field import BLOCK, LEVELS, HeightField


def triangulate(field: HeightField) -> Mesh:
    """Return the mesh of a height field, upwards, with smooth normals.

    Each block is divided into squares of its level, each of two triangles along the diagonal that departs less from
    level ground (so that a kerb runs along edges). Where a neighbouring block is finer, the square becomes a fan about
    its centre that takes in the neighbour's nodes: all edges match, the mesh is a manifold with one boundary.
    """
    cols = field.height.shape[1]
    triangles = []
    for level in range(LEVELS):
        triangles += _squares(field, level)
    corners = np.concatenate(triangles) if triangles else np.zeros((0, 3), np.int64)
    used, faces = np.unique(corners, return_inverse=True)
    row, col = used // cols, used % cols
    vertices = np.column_stack([field.x_min + col * field.cell, field.y_min + row * field.cell, field.height[row, col]])
    faces = faces.reshape(-1, 3)
    mesh = Mesh(vertices.astype(np.float32), faces.astype(np.uint32))
    return _largest_pieces(mesh).with_smooth_normals()


def _squares(field: HeightField, level: int) -> list[NDArray[np.int64]]:
    """Return the triangles, as node indices, of all blocks of one level."""
    size, cols = 2**level, field.height.shape[1]
    blocks = np.argwhere(field.level == level)
    if len(blocks) == 0:
        return []
    n = BLOCK // size
    sub_row, sub_col = (v.ravel() for v in np.mgrid[:n, :n])
    row = (blocks[:, :1] * BLOCK + sub_row * size).ravel()
    col = (blocks[:, 1:] * BLOCK + sub_col * size).ravel()
    around = np.pad(field.level, 1, mode="edge")
    b = blocks + 1
    # Sides in the order low row, high col, high row, low col: counter-clockwise seen from above (rows along +y).
    finer = [
        ((around[b[:, 0] + dr, b[:, 1] + dc] < level)[:, None] & at_edge).ravel()
        for dr, dc, at_edge in ((-1, 0, sub_row == 0), (0, 1, sub_col == n - 1), (1, 0, sub_row == n - 1), (0, -1, sub_col == 0))
    ]
    covered = field.covered
    keep = covered[row, col] & covered[row + size, col] & covered[row, col + size] & covered[row + size, col + size]
    row, col, finer = row[keep], col[keep], [side[keep] for side in finer]
    corner = [row * cols + col, row * cols + col + size, (row + size) * cols + col + size, (row + size) * cols + col]
    whole = ~(finer[0] | finer[1] | finer[2] | finer[3])
    h = field.height.ravel()
    a, b_, c, d = (v[whole] for v in corner)
    first = np.abs(h[a] - h[c]) <= np.abs(h[b_] - h[d])
    out = [
        np.concatenate([np.column_stack([a, b_, c])[first], np.column_stack([a, c, d])[first]]),
        np.concatenate([np.column_stack([a, b_, d])[~first], np.column_stack([b_, c, d])[~first]]),
    ]
    half = size // 2
    centre = (row + half) * cols + col + half
    middle = [
        row * cols + col + half,
        (row + half) * cols + col + size,
        (row + size) * cols + col + half,
        (row + half) * cols + col,
    ]
    for side in range(4):
        start, end = corner[side], corner[(side + 1) % 4]
        plain, split = ~whole & ~finer[side], ~whole & finer[side]
        out.append(np.column_stack([start, end, centre])[plain])
        out.append(np.column_stack([start, middle[side], centre])[split])
        out.append(np.column_stack([middle[side], end, centre])[split])
    return out


def _largest_pieces(mesh: Mesh, share: float = 0.002) -> Mesh:
    """Drop pieces that hold less than `share` of the largest one's triangles: crumbs of the coverage's edge.

    Pieces hang together by edges: where two touch in a corner only, both normals and edges would be ambiguous.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if mesh.num_faces == 0:
        return mesh
    piece = edge_components(mesh)
    size = np.bincount(piece)
    keep = (size >= share * size.max())[piece]
    faces = mesh.faces[keep].astype(np.int64)
    # A vertex that two fans of triangles share without an edge is doubled, one for each.
    corner_vertex = faces.ravel()
    corner_face = np.repeat(np.arange(len(faces)), 3)
    opposite = np.column_stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).reshape(-1, 2)
    low, high = opposite.min(axis=1), opposite.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    first, second = corner_face[order[:-1][same]], corner_face[order[1:][same]]
    links = []
    for vertices in (low[order[:-1][same]], high[order[:-1][same]]):
        links.append((_corner(faces, first, vertices), _corner(faces, second, vertices)))
    i = np.concatenate([a for a, _ in links])
    j = np.concatenate([b for _, b in links])
    n = len(corner_vertex)
    fan = connected_components(coo_matrix((np.ones(len(i), bool), (i, j)), shape=(n, n)), directed=False)[1]
    _, representative, new = np.unique(np.column_stack([corner_vertex, fan]), axis=0, return_index=True, return_inverse=True)
    return Mesh(mesh.vertices[corner_vertex[representative]], new.reshape(-1, 3).astype(np.uint32))


def _corner(faces: NDArray[np.int64], face: NDArray[np.int64], vertex: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index, among all corners, of the corner of each face that has the given vertex."""
    return 3 * face + np.argmax(faces[face] == vertex[:, None], axis=1)


def edge_components(mesh: Mesh) -> NDArray[np.int64]:
    """Return the number of the piece that each face belongs to; pieces are joined by shared edges."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    faces = mesh.faces.astype(np.int64)
    edges = np.column_stack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).reshape(-1, 2)
    face = np.repeat(np.arange(len(faces)), 3)
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    i, j = face[order[:-1][same]], face[order[1:][same]]
    n = len(faces)
    return connected_components(coo_matrix((np.ones(len(i), bool), (i, j)), shape=(n, n)), directed=False)[1]
