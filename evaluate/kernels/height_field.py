"""Shadows and light bounced on a height field seen from above, along z; distances in pixels."""

import math

import numpy as np
from numba import njit, prange


@njit(cache=True, parallel=True, error_model="numpy")
def visible(height, rows, cols, lights, rise):
    """Return whether each light reaches each pixel (P, N): a ray must stay above the field less `rise` until it leaves it.

    height is (H, W), NaN where there is no object; lights (N, 3) are unit, x right, y up (against the rows), z to the viewer.
    """
    num, (high, wide) = len(rows), height.shape
    out = np.ones((num, len(lights)), np.float32)
    for p in prange(num):
        for j in range(len(lights)):
            across = math.hypot(lights[j, 0], lights[j, 1])
            if across < 1e-6:
                continue
            dx, dy, dz = lights[j, 0] / across, -lights[j, 1] / across, lights[j, 2] / across
            x, y, z = float(cols[p]), float(rows[p]), height[rows[p], cols[p]]
            for step in range(2, high + wide):
                c, r = math.floor(x + step * dx + 0.5), math.floor(y + step * dy + 0.5)
                if c < 0 or r < 0 or c >= wide or r >= high:
                    break
                h = height[r, c]
                if h == h and h > z + step * dz + rise:
                    out[p, j] = 0.0
                    break
    return out


@njit(cache=True, parallel=True, error_model="numpy")
def exchange(place, normal):
    """Return the share of light (P, P) that patch p gets of the radiosity of patch q: cos cos / (pi r²) times q's area.

    place (P, 3) and normal (P, 3), both x right, y up, z to the viewer. What lies between two patches is not looked at.
    """
    num = len(place)
    out = np.zeros((num, num), np.float32)
    for p in prange(num):
        for q in range(num):
            if p == q:
                continue
            x, y, z = place[q, 0] - place[p, 0], place[q, 1] - place[p, 1], place[q, 2] - place[p, 2]
            square = x * x + y * y + z * z
            here = normal[p, 0] * x + normal[p, 1] * y + normal[p, 2] * z
            there = -(normal[q, 0] * x + normal[q, 1] * y + normal[q, 2] * z)
            if here > 0.0 and there > 0.0:
                area = 1.0 / max(normal[q, 2], 0.1)
                # Patches nearer than their size: a share is never above what touches.
                out[p, q] = here * there * area / (math.pi * square * max(square, area))
    return out
