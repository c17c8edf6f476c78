"""Averages over neighbouring pieces of the same surface."""

import math

import numpy as np
from numba import njit, prange


@njit(cache=True, parallel=True)
def smooth(start, height, width, pixel, shape, position, normal, across, down, values, radius, out):
    """Smooth `values` (N, C) over pixels within `radius` whose piece has the same shape, a near normal and lies near.

    A plane is fitted over columns and rows, not a mean: where a surface ends at a crease, neighbours are to one side only,
    and the mean would be that of a place farther in.
    """
    size = height * width
    for k in prange(pixel.shape[0]):
        frame, row, col = pixel[k] // size, (pixel[k] % size) // width, pixel[k] % width
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        reach = 0.0
        for m in range(3):
            reach += across[k, m] * across[k, m] + down[k, m] * down[k, m]
        reach = (radius + 1.0) * math.sqrt(reach) + 1e-9
        s, sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        sums = np.zeros((values.shape[1], 3))
        for j in range(max(row - radius, 0), min(row + radius, height - 1) + 1):
            for i in range(max(col - radius, 0), min(col + radius, width - 1) + 1):
                q = frame * size + j * width + i
                for other in range(start[q], start[q + 1]):
                    if shape[other] != shape[k]:
                        continue
                    if n0 * normal[other, 0] + n1 * normal[other, 1] + n2 * normal[other, 2] < 0.95:
                        continue
                    d = 0.0
                    for m in range(3):
                        d += (position[other, m] - position[k, m]) ** 2
                    if math.sqrt(d) > reach:
                        continue
                    x, y = float(i - col), float(j - row)
                    s += 1.0
                    sx += x
                    sy += y
                    sxx += x * x
                    sxy += x * y
                    syy += y * y
                    for c in range(values.shape[1]):
                        v = values[other, c]
                        sums[c, 0] += v
                        sums[c, 1] += x * v
                        sums[c, 2] += y * v
        # The first row of the inverse of the normal equations gives the plane's value in the middle.
        a0, a1, a2 = sxx * syy - sxy * sxy, sxy * sy - sx * syy, sx * sxy - sxx * sy
        det = s * a0 + sx * a1 + sy * a2
        planar = det > 0.5 * s
        for c in range(values.shape[1]):
            if planar:
                out[k, c] = (a0 * sums[c, 0] + a1 * sums[c, 1] + a2 * sums[c, 2]) / det
            elif s > 0.0:
                out[k, c] = sums[c, 0] / s
            else:
                out[k, c] = values[k, c]
