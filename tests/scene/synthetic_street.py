"""A street whose every point is labelled, as a scanner on a vehicle sees it: rings, noise, boxes, a bridge, a slope."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GROUND, OBJECT = True, False
HALF_ROAD, KERB = 4.0, 0.14


def street_height(x: NDArray, y: NDArray) -> NDArray:
    """Return the true ground: 3 % camber, kerbs of 14 cm, pavements, an embankment of 20 % beyond 9 m, 4 % uphill."""
    across = np.abs(y)
    road = -0.03 * across
    pavement = -0.03 * HALF_ROAD + KERB + 0.02 * (across - HALF_ROAD)
    slope = 0.20 * np.maximum(across - 9.0, 0)
    return np.where(across < HALF_ROAD, road, pavement) + np.where(y > 0, slope, 0) + 0.04 * x


def ring_points(rng: np.random.Generator, x0: float, noise: float = 0.01) -> NDArray:
    """Return ground points of one sweep: rings whose spacing grows with distance, from a scanner at (x0, 0), 1.7 m up."""
    elevation = np.radians(np.arange(-24.8, -1.5, 0.43))
    azimuth = np.radians(np.arange(0, 360, 0.35))
    e, a = (v.ravel() for v in np.meshgrid(elevation, azimuth, indexing="ij"))
    origin = street_height(np.array([x0]), np.array([0.0]))[0] + 1.7
    distance = -1.7 / np.tan(e)
    for _ in range(20):  # fixed point: where the beam meets the uneven ground
        x, y = x0 + distance * np.cos(a), distance * np.sin(a)
        distance = np.clip((street_height(x, y) - origin) / np.tan(e), 0.5, 60)
    x, y = x0 + distance * np.cos(a), distance * np.sin(a)
    good = (np.abs(street_height(x, y) - origin - distance * np.tan(e)) < 0.02) & (np.abs(y) < 14)
    points = np.column_stack([x, y, street_height(x, y)])[good]
    return points + rng.normal(0, noise, points.shape)


def box_points(rng: np.random.Generator, centre, size, count: int) -> NDArray:
    """Return points on the four sides and the top of a box that stands on the ground, or hangs above it."""
    u = rng.uniform(-0.5, 0.5, (count, 3))
    face = rng.integers(0, 5, count)
    for axis in range(2):
        u[face == axis, axis] = -0.5
        u[face == axis + 2, axis] = 0.5
    u[face == 4, 2] = 0.5
    return u * size + centre


def labelled_street(seed: int = 0) -> tuple[NDArray, NDArray[np.bool_], NDArray]:
    """Return points (N, 3), whether each is ground, and the scanner's path (P, 3)."""
    rng = np.random.default_rng(seed)
    path_x = np.arange(0.0, 31.0, 6.0)
    ground = np.concatenate([ring_points(rng, x) for x in path_x])
    boxes = []
    for x, y, size in (
        (8, 2.8, (4.2, 1.8, 1.5)),
        (20, -5.5, (4.4, 1.8, 1.6)),
        (15, 8.0, (8.0, 0.8, 1.4)),
        (2, -6.5, (0.2, 0.2, 5.0)),
    ):
        z = street_height(np.array([float(x)]), np.array([float(y)]))[0]
        boxes.append(box_points(rng, (x, y, z + size[2] / 2 + 0.18), size, 3000))
        inside = (np.abs(ground[:, 0] - x) < size[0] / 2) & (np.abs(ground[:, 1] - y) < size[1] / 2)
        ground = ground[~inside]
    bridge = np.column_stack([rng.uniform(14, 18, 6000), rng.uniform(-14, 14, 6000), np.full(6000, 5.6)])
    below = np.column_stack([rng.uniform(0, 30, 60), rng.uniform(-3, 3, 60), rng.uniform(-2.5, -1.0, 60)])
    points = np.concatenate([ground, *boxes, bridge, below])
    is_ground = np.arange(len(points)) < len(ground)
    path = np.column_stack([path_x, np.zeros_like(path_x), street_height(path_x, np.zeros_like(path_x)) + 1.7])
    return points, is_ground, path
