"""Range images of sweeps, and the vote whether a later or earlier beam passed through a point."""

import math

import numpy as np
from numba import njit, prange


@njit(cache=True)
def range_image(points, step):
    """Return the nearest and the farthest range (rows, cols) of a sweep about its scanner [m]; `inf` and 0 where empty.

    Rows run from elevation -pi/2 upwards, columns from azimuth -pi, both in steps of `step` radians.
    """
    rows = math.ceil(math.pi / step)
    cols = math.ceil(2 * math.pi / step)
    nearest = np.full((rows, cols), np.inf, np.float32)
    farthest = np.zeros((rows, cols), np.float32)
    for i in range(len(points)):
        x, y, z = float(points[i, 0]), float(points[i, 1]), float(points[i, 2])
        r = math.sqrt(x * x + y * y + z * z)
        if r < 1e-3:
            continue
        row = min(int((math.asin(z / r) + 0.5 * math.pi) / step), rows - 1)
        col = int((math.atan2(y, x) + math.pi) / step) % cols
        nearest[row, col] = min(nearest[row, col], r)
        farthest[row, col] = max(farthest[row, col], r)
    return nearest, farthest


@njit(cache=True)
def widen(nearest, farthest):
    """Return the extremes over each cell's 3 x 3 neighbourhood, and how many of its nine cells hold a return."""
    rows, cols = nearest.shape
    near, far = np.full_like(nearest, np.inf), np.zeros_like(farthest)
    count = np.zeros((rows, cols), np.uint8)
    for i in range(rows):
        for j in range(cols):
            for di in range(-1, 2):
                for dj in range(-1, 2):
                    k, m = i + di, (j + dj) % cols
                    if k < 0 or k >= rows or farthest[k, m] == 0:
                        continue
                    near[i, j] = min(near[i, j], nearest[k, m])
                    far[i, j] = max(far[i, j], farthest[k, m])
                    count[i, j] += 1
    return near, far, count


@njit(cache=True, parallel=True)
def vote(points_world, R, t, near, far, count, step, margin, margin_per_metre, max_range, own, through, agree):
    """Add one sweep's votes to `through` and `agree`, in place; points with `own` set came from this very sweep.

    `R, t` take the world to the scanner. All beams within a cell of the point's direction must have gone further than
    the point (by the margin) for a vote of free space: at grazing incidence on the ground, and at edges, neighbouring
    beams reach from before the point to behind it, and say nothing against it.
    """
    rows, cols = near.shape
    for i in prange(len(points_world)):
        if own[i]:
            continue
        px, py, pz = points_world[i, 0], points_world[i, 1], points_world[i, 2]
        x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + t[0]
        y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + t[1]
        z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + t[2]
        r = math.sqrt(x * x + y * y + z * z)
        if r < 1.0 or r > max_range:
            continue
        row = min(int((math.asin(z / r) + 0.5 * math.pi) / step), rows - 1)
        col = int((math.atan2(y, x) + math.pi) / step) % cols
        if count[row, col] < 3:
            continue
        slack = margin + margin_per_metre * r
        if r < near[row, col] - slack:
            through[i] += 1
        elif r <= far[row, col] + slack:
            agree[i] += 1
