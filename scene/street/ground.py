"""The ground as one watertight sheet of triangles, cut into strips (road, kerbs, pavements, grass) and sections along x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh
from . import layout as at
from .relief import Relief

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Patch:
    """A piece of ground: one strip of one section, with its own uv rectangle.

    `u` runs along x over [x0, x1]; `v` along the profile's arc over [y0, y1], which is y itself except on kerbs.
    """

    name: str
    strip: str
    kind: str
    x0: float
    x1: float
    y0: float
    y1: float
    columns: slice
    rows: slice


@dataclass(frozen=True)
class Sheet:
    """Lines of the sheet's grid and its true heights.

    Attributes
    ----------
    x, y : (nx,), (ny,)
        Lines along and across the street [m], ascending.
    z : (ny, nx)
        Height at their crossings [m].
    patches : tuple of Patch
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    patches: tuple[Patch, ...]

    def meshes(self, z: Floats | None = None) -> dict[str, Mesh]:
        """Return the mesh of each patch, for the dry ground or for other heights on the same lines (a water surface)."""
        z = self.z if z is None else z
        normals = _grid_normals(self.x, self.y, z)
        return {patch.name: self._mesh(patch, z, normals) for patch in self.patches}

    def v_of_rows(self, patch: Patch) -> NDArray[np.float64]:
        """Return v at the patch's lines: arc length across the street, scaled to [0, 1]."""
        y = self.y[patch.rows]
        if patch.strip != "kerb":
            return (y - patch.y0) / (patch.y1 - patch.y0)
        z = self.z[patch.rows].mean(axis=1)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
        return arc / arc[-1]

    def _mesh(self, patch: Patch, z: Floats, normals: Floats) -> Mesh:
        x, y = self.x[patch.columns], self.y[patch.rows]
        X, Y = np.meshgrid(x, y)
        vertices = np.stack([X, Y, z[patch.rows, patch.columns]], axis=-1).reshape(-1, 3)
        U, V = np.meshgrid((x - patch.x0) / (patch.x1 - patch.x0), self.v_of_rows(patch))
        corner = (np.arange(len(y) - 1)[:, None] * len(x) + np.arange(len(x) - 1)[None]).ravel()
        a, b, c, d = corner, corner + 1, corner + len(x) + 1, corner + len(x)
        faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
        n = normals[patch.rows, patch.columns].reshape(-1, 3)
        return Mesh(
            vertices.astype(np.float32),
            faces.astype(np.uint32),
            n.astype(np.float32),
            np.stack([U.ravel(), V.ravel()], axis=1).astype(np.float32),
        )


def sheet(relief: Relief, detail: float) -> Sheet:
    """Lay the sheet's lines, fine where the camera looks closely, and sample the true height on them."""
    x, y = _lines_x(0.04 / detail), _lines_y(relief.lines_y, 0.04 / detail)
    X, Y = np.meshgrid(x, y)
    strips = [
        ("land", "land", "pavement", -at.OUTER, at.WALL_RIGHT),
        ("pavement_right", "pavement", "pavement", at.WALL_RIGHT, at.PAVEMENT_RIGHT[1]),
        ("kerb_right", "kerb", "pavement", at.PAVEMENT_RIGHT[1], at.ROAD_RIGHT),
        ("road", "road", "road", at.ROAD_RIGHT, at.ROAD_LEFT),
        ("kerb_left", "kerb", "pavement", at.ROAD_LEFT, at.GRASS[0]),
        ("grass", "grass", "vegetation", *at.GRASS),
        ("pavement_left", "pavement", "pavement", *at.PAVEMENT_LEFT),
        ("land_left", "land", "pavement", at.WALL_LEFT, at.OUTER),
    ]
    sections = [("back", at.X_BACK, at.X_NEAR), ("near", at.X_NEAR, at.X_FAR), ("far", at.X_FAR, at.X_END)]
    patches = []
    for name, strip, kind, y0, y1 in strips:
        for section, x0, x1 in sections:
            patches.append(Patch(f"{name}_{section}", strip, kind, x0, x1, y0, y1, _between(x, x0, x1), _between(y, y0, y1)))
    return Sheet(x, y, relief.height(X, Y), tuple(patches))


def _between(lines: Floats, low: float, high: float) -> slice:
    i, j = np.searchsorted(lines, [low - 1e-6, high + 1e-6])
    return slice(int(i), int(j))


def _lines_x(cell: float) -> NDArray[np.float64]:
    near = np.linspace(at.X_NEAR, at.X_FAR, int(np.ceil((at.X_FAR - at.X_NEAR) / cell)) + 1)
    back = -_growing(cell, 0.4 * max(1, cell / 0.04), -at.X_BACK, 1.04)[::-1]
    far = at.X_FAR + _growing(cell, 0.4 * max(1, cell / 0.04), at.X_END - at.X_FAR, 1.012)
    return np.concatenate([back[:-1], near, far[1:]])


def _growing(first: float, last: float, length: float, ratio: float) -> NDArray[np.float64]:
    """Return 0 … length in steps that grow by `ratio` from `first` to `last`."""
    steps = [first]
    while sum(steps) < length:
        steps.append(min(steps[-1] * ratio, last))
    lines = np.concatenate([[0.0], np.cumsum(steps)])
    return lines * (length / lines[-1])


def _lines_y(corners: Floats, cell: float) -> NDArray[np.float64]:
    inner = np.arange(at.WALL_RIGHT, at.WALL_LEFT, cell)
    # Corners of kerb, gutter and strips are kept to the millimetre; regular lines that crowd them give way.
    keep = np.array([c for c in corners if not at.ROAD_RIGHT + at.GUTTER < c < at.ROAD_LEFT - at.GUTTER])
    keep = np.concatenate([keep, [at.ROAD_RIGHT + at.GUTTER, at.ROAD_LEFT - at.GUTTER]])
    inner = inner[np.abs(inner[:, None] - keep[None]).min(axis=1) > 0.3 * cell]
    kerbs = (inner > at.ROAD_LEFT) & (inner < at.GRASS[0]) | (inner < at.ROAD_RIGHT) & (inner > at.PAVEMENT_RIGHT[1])
    return np.unique(np.round(np.concatenate([keep, inner[~kerbs]]), 6))


def _grid_normals(x: Floats, y: Floats, z: Floats) -> NDArray[np.float64]:
    """Return unit normals (ny, nx, 3) of the height field by central differences on uneven lines."""
    dz_dy, dz_dx = np.gradient(z, y, x)
    n = np.stack([-dz_dx, -dz_dy, np.ones_like(z)], axis=-1).astype(np.float64, copy=False)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)
