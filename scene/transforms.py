"""Rigid poses as 4 x 4 matrices whose names read as equations: `p_a = T_a_b @ p_b`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from materials.foundation.errors import InputError

Floats = NDArray[np.floating]


def as_pose(matrix: ArrayLike, key: str = "pose") -> NDArray[np.float64]:
    """Return a (4, 4) rigid pose in float64, with its rotation made exactly orthonormal.

    Poses read from text carry rounding of about 1e-6; more than 1e-3 means a scale, a shear or a wrong matrix.

    Raises
    ------
    InputError
        If the shape is wrong, a value is not finite, the rotation is not one, or the last row is not 0 0 0 1.
    """
    try:
        T = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("be a 4 x 4 matrix of numbers", key=key) from error
    if T.shape != (4, 4):
        raise InputError("be a 4 x 4 matrix", got=f"shape {T.shape}", key=key)
    if not np.all(np.isfinite(T)):
        raise InputError("be finite", got="NaN or infinity", key=key)
    if np.abs(T[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise InputError("have the last row 0 0 0 1", got=T[3].tolist(), key=key)
    R = T[:3, :3]
    error = np.abs(R @ R.T - np.eye(3)).max()
    if error > 1e-3 or np.linalg.det(R) < 0:
        got = f"determinant {np.linalg.det(R):.4g}, R R^T off the identity by {error:.2g}"
        raise InputError("be a rigid pose (rotation and translation)", got=got, key=key, remedy="Remove scale, shear or mirroring.")
    # What is orthonormal to rounding stays as it is, so that a pose written and read again is the same to the bit.
    if error > 1e-12:
        U, _, Vt = np.linalg.svd(R)
        T[:3, :3] = U @ Vt
    return T


def invert(T_a_b: Floats) -> NDArray[np.float64]:
    """Return `T_b_a` of a rigid pose."""
    R, t = T_a_b[:3, :3], T_a_b[:3, 3]
    T = np.eye(4)
    T[:3, :3] = R.T
    T[:3, 3] = -R.T @ t
    return T


def transform_points(T_a_b: Floats, points_b: Floats) -> NDArray[np.float64]:
    """Move points (N, 3) from frame b to frame a."""
    return points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3]


def transform_vectors(T_a_b: Floats, vectors_b: Floats) -> NDArray[np.float64]:
    """Turn vectors (N, 3) from frame b to frame a, without translation."""
    return vectors_b @ T_a_b[:3, :3].T


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0, 0, 1)) -> NDArray[np.float64]:
    """Return `T_world_camera` of a camera (x right, y down, z forward) at `eye` that looks at `target`.

    Raises
    ------
    InputError
        If eye and target coincide, or the view is along `up`, so that nothing tells right from left.
    """
    eye, target, up = (np.asarray(v, dtype=np.float64) for v in (eye, target, up))
    z = target - eye
    distance = np.linalg.norm(z)
    if not distance > 0:
        raise InputError("differ from eye", got=target.tolist(), key="target")
    z = z / distance
    x = np.cross(z, up)
    sine = np.linalg.norm(x)
    if not sine > 1e-9 * np.linalg.norm(up):
        raise InputError("not be parallel to the view", got=up.tolist(), key="up", remedy="Give another direction.")
    x = x / sine
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = eye
    return T
