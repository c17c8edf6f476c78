"""Sets of directions over the hemisphere: even ones, the solid angle of each, and interpolation from one set to another.

Directions are unit vectors in the local frame of a surface, z = n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range, check_shape, check_unit
from .foundation.errors import InputError

Floats = NDArray[np.float64]


def spherical(theta: ArrayLike, phi: ArrayLike) -> Floats:
    """Return unit vectors (..., 3) from the angle to the normal and the azimuth from +x towards +y [rad]."""
    theta, phi = np.broadcast_arrays(np.asarray(theta, np.float64), np.asarray(phi, np.float64))
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def even_directions(count: int, max_theta_deg: float = 75.0) -> Floats:
    """Return directions of equal solid angle on a cap about the normal, along a golden spiral.

    Parameters
    ----------
    count : int
        Number of directions; the dome of the thesis has 151 (a spacing of 9.4 degrees).
    max_theta_deg : float
        Rim of the cap, in (0, 90]; that dome ends at 75 degrees.

    Returns
    -------
    directions : (count, 3) float64

    References
    ----------
    González (2010), Measurement of areas on a sphere using Fibonacci and latitude-longitude lattices.

    Examples
    --------
    >>> bool(even_directions(151)[:, 2].min() > np.cos(np.radians(75)))
    True
    """
    if count < 1:
        raise InputError("be at least 1", got=count, key="count")
    check_range("max_theta_deg", max_theta_deg, "(0, 90]")
    i = np.arange(count) + 0.5
    z = 1 - i / count * (1 - math.cos(math.radians(max_theta_deg)))
    phi = i * math.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)


def solid_angles(directions: ArrayLike, resolution: int = 40000) -> Floats:
    """Return the solid angle of the part of the hemisphere that is nearer to each direction than to any other [sr].

    Parameters
    ----------
    directions : (N, 3) float
        Unit, above or on the horizon; equal ones share their cell evenly.
    resolution : int
        Points of equal area that are assigned to the nearest direction. The error of a cell is about the length of its
        boundary times half the points' spacing: 2 % for 151 directions and the default.

    Returns
    -------
    weights : (N,) float64
        Their sum is 2 pi.
    """
    from scipy.spatial import cKDTree

    d = np.asarray(directions, np.float64)
    check_shape("directions", d, (None, 3))
    check_unit("directions", d)
    check_range("directions' z", d[:, 2], "[-1e-6, 1.0001]")
    unique, inverse, counts = np.unique(np.round(d, 7), axis=0, return_inverse=True, return_counts=True)
    _, nearest = cKDTree(unique).query(even_directions(max(resolution, 20 * len(unique)), 90.0))
    cell = np.bincount(nearest, minlength=len(unique)) * (2 * math.pi / len(nearest))
    inverse = inverse.reshape(-1)
    return cell[inverse] / counts[inverse]


@dataclass(frozen=True)
class Interpolation:
    """How values at some directions give values at others.

    Attributes
    ----------
    indices : (Q, 3) int
        The corners of the triangle around each query.
    weights : (Q, 3) float64
        Barycentric, at least 0, of sum 1.
    inside : (Q,) bool
        Whether the query lies in the triangulated region; outside, the nearest direction has all the weight.
    """

    indices: NDArray[np.int64]
    weights: Floats
    inside: NDArray[np.bool_]

    def __call__(self, values: NDArray, axis: int = 0) -> NDArray:
        """Interpolate `values` along one axis that runs over the given directions."""
        moved = np.moveaxis(values, axis, 0)
        shape = (-1, *([1] * (moved.ndim - 1)))
        out = sum(moved[self.indices[:, k]] * self.weights[:, k].reshape(shape) for k in range(3))
        return np.moveaxis(np.asarray(out), 0, axis)


def interpolation(directions: ArrayLike, queries: ArrayLike) -> Interpolation:
    """Return linear interpolation between directions over a Delaunay triangulation.

    The plane is Lambert's azimuthal projection of the hemisphere (equal area), where a value that is linear in
    position is met exactly.

    Parameters
    ----------
    directions : (N, 3) float
        Where values are known, at least three, not in one line.
    queries : (Q, 3) float
        Where they are wanted.

    Raises
    ------
    InputError
        If the directions span no triangle.
    """
    from scipy.spatial import Delaunay, QhullError, cKDTree

    known, wanted = _disc(np.asarray(directions, np.float64)), _disc(np.asarray(queries, np.float64))
    try:
        mesh = Delaunay(known)
    except (QhullError, ValueError) as error:
        raise InputError("span the hemisphere", got=f"{len(known)} in one line", key="directions") from error
    simplex = mesh.find_simplex(wanted, tol=1e-9)
    inside = simplex >= 0
    affine = mesh.transform[simplex]
    two = np.einsum("qij,qj->qi", affine[:, :2], wanted - affine[:, 2])
    weights = np.clip(np.concatenate([two, 1 - two.sum(axis=1, keepdims=True)], axis=1), 0, 1)
    weights /= weights.sum(axis=1, keepdims=True)
    indices = mesh.simplices[simplex].astype(np.int64)
    _, nearest = cKDTree(known).query(wanted)
    indices[~inside] = np.asarray(nearest)[~inside, None]
    weights[~inside] = (1.0, 0.0, 0.0)
    return Interpolation(indices, weights, inside)


def _disc(d: Floats) -> Floats:
    """Project the hemisphere to a disc of radius 1, keeping areas."""
    return d[:, :2] / np.sqrt(1 + np.maximum(d[:, 2:], 0))
