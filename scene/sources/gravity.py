"""Which way is up: from the ground below a scanner, or from how the cameras were held.

A world of this toolkit has z up. Recordings with an inertial unit know the vertical; others only let us assume it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]

# Turns camera axes (x right, y down, z forward) into x forward, y left, z up.
R_LEVEL_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def up_from_ground(points: Floats, nominal_up: Floats, max_tilt_deg: float = 12.0, seed: int = 0) -> NDArray[np.float64] | None:
    """Return the normal of the ground plane around a vehicle.

    Parameters
    ----------
    points : (N, 3) float
        Points about the sensor, which is at the origin [m].
    nominal_up : (3,) float
        Up as the sensor is mounted; unit vector.
    max_tilt_deg : float
        Planes farther than this from `nominal_up` are walls or embankments and do not count.

    Returns
    -------
    up : (3,) float64 or None
        Unit normal; None if no plane below the sensor holds at least a fifth of the near points.

    Notes
    -----
    RANSAC (Fischler and Bolles 1981) over points that lie 0.5 m or more below the sensor and within 20 m, inliers within
    8 cm, then least squares. On a road that climbs, the road's normal takes the place of the vertical.
    """
    up = np.asarray(nominal_up, dtype=np.float64)
    p = np.asarray(points, dtype=np.float64)
    height = p @ up
    horizontal = np.linalg.norm(p - height[:, None] * up, axis=1)
    p = p[(height < -0.5) & (horizontal > 2) & (horizontal < 20)]
    if len(p) < 200:
        return None
    rng = np.random.default_rng(seed)
    if len(p) > 20000:
        p = p[np.sort(rng.choice(len(p), 20000, replace=False))]
    best, best_count = np.zeros(len(p), bool), 0
    for _ in range(300):
        a, b, c = p[rng.choice(len(p), 3, replace=False)]
        n = np.cross(b - a, c - a)
        length = np.linalg.norm(n)
        if length < 1e-6:
            continue
        n = n / length
        if abs(n @ up) < np.cos(np.deg2rad(max_tilt_deg)):
            continue
        inlier = np.abs((p - a) @ n) < 0.08
        if inlier.sum() > best_count:
            best, best_count = inlier, int(inlier.sum())
    if best_count < 0.2 * len(p):
        return None
    q = p[best] - p[best].mean(axis=0)
    n = np.linalg.svd(q, full_matrices=False)[2][2]
    n = n if n @ up > 0 else -n
    return n if n @ up >= np.cos(np.deg2rad(max_tilt_deg)) else None


def spread(count: int, most: int = 5) -> list[int]:
    """Return up to `most` indices spread over `count`, the first and last among them."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, most))})


def mean_up(ups: list[NDArray[np.float64] | None]) -> NDArray[np.float64] | None:
    """Return the mean direction of those that were found: a camber or a kerb tilts one, a whole drive hardly."""
    found = [up for up in ups if up is not None]
    if not found:
        return None
    total = np.sum(found, axis=0)
    return total / np.linalg.norm(total)


def up_from_cameras(R_world_camera: Floats) -> NDArray[np.float64]:
    """Return the vertical on the assumption that the photographs were taken upright.

    Parameters
    ----------
    R_world_camera : (N, 3, 3) float
        Rotations of the cameras (x right, y down, z forward).

    Returns
    -------
    up : (3,) float64
        Unit vector.

    Notes
    -----
    Two things are assumed of an upright camera: its x axis is level, and its -y axis points up on the average. The first
    is exact however the camera is pitched, but tells nothing when all cameras look the same way, as on a straight drive;
    so the second only decides where the first does not: up minimises sum (x_i . up)^2 / N + 0.01 |up - mean(-y_i)|^2.
    """
    R = np.asarray(R_world_camera, dtype=np.float64)
    x, mean_up = R[:, :, 0], -R[:, :, 1].mean(axis=0)
    up = np.linalg.solve(x.T @ x / len(x) + 0.01 * np.eye(3), mean_up)
    return up / np.linalg.norm(up)


def turn_to_z(up: Floats) -> NDArray[np.float64]:
    """Return the smallest rotation (3, 3) that takes the unit vector `up` to (0, 0, 1)."""
    z = np.array([0.0, 0.0, 1.0])
    v, c = np.cross(up, z), float(np.dot(up, z))
    if c < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + K + K @ K / (1 + c)


def levelled_world(R_world_camera: Floats, least_tilt_deg: float = 5.0) -> NDArray[np.float64]:
    """Return the rotation (4, 4) that makes a world of upright photographs z up.

    The identity if z is already within `least_tilt_deg` of the vertical that the cameras suggest: a world that somebody
    levelled (by map coordinates, say) knows better than our assumption.
    """
    up = up_from_cameras(R_world_camera)
    T = np.eye(4)
    if up[2] < np.cos(np.deg2rad(least_tilt_deg)):
        T[:3, :3] = turn_to_z(up)
    return T
