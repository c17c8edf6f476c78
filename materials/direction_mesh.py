"""Sets of measured directions as compiled code looks them up: their triangulation on Lambert's disc."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from .foundation.errors import InputError
from .kernels.direction_mesh import START_CELLS, DirectionMeshes


def direction_meshes(sets: Sequence[NDArray[np.float64]]) -> DirectionMeshes:
    """Triangulate sets of directions.

    Parameters
    ----------
    sets : sequence of (N, 3) float
        Unit directions above the horizon, at least three each, not in one line.

    Raises
    ------
    InputError
        If directions span no triangle.
    """
    rows, nodes, triangles, neighbours, affine, starts = [], [], [], [], [], []
    middles = (np.arange(START_CELLS) + 0.5) * (2 / START_CELLS) - 1
    cells = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    for directions in sets:
        places = directions[:, :2] / np.sqrt(1 + np.maximum(directions[:, 2:], 0))
        try:
            mesh = Delaunay(places)
        except (QhullError, ValueError) as error:
            raise InputError("span the hemisphere", got=f"{len(places)} in one line", key="directions") from error
        rows.append([sum(map(len, nodes)), len(places), sum(map(len, triangles)), len(mesh.simplices)])
        nodes.append(places)
        triangles.append(mesh.simplices)
        neighbours.append(mesh.neighbors)
        affine.append(mesh.transform)
        _, near = cKDTree(places[mesh.simplices].mean(axis=1)).query(cells)
        starts.append(np.asarray(near).reshape(START_CELLS, START_CELLS))
    return DirectionMeshes(
        np.array(rows, np.int64).reshape(-1, 4),
        np.concatenate([np.zeros((0, 2)), *nodes]),
        np.concatenate([np.zeros((0, 3), np.int64), *triangles]).astype(np.int64),
        np.concatenate([np.zeros((0, 3), np.int64), *neighbours]).astype(np.int64),
        np.concatenate([np.zeros((0, 3, 2)), *affine]),
        np.array(starts, np.int64).reshape(-1, START_CELLS, START_CELLS),
    )
