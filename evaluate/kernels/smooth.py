"""Averages over neighbouring pieces of the same surface."""

import math

from numba import njit, prange


@njit(cache=True, parallel=True)
def smooth(start, height, width, pixel, shape, position, normal, across, down, values, radius, out):
    """Average `values` (N, C) over pixels within `radius` whose piece has the same shape, a near normal and lies near."""
    size = height * width
    for k in prange(pixel.shape[0]):
        frame, row, col = pixel[k] // size, (pixel[k] % size) // width, pixel[k] % width
        n0, n1, n2 = normal[k, 0], normal[k, 1], normal[k, 2]
        reach = 0.0
        for m in range(3):
            reach += across[k, m] * across[k, m] + down[k, m] * down[k, m]
        reach = (radius + 1.0) * math.sqrt(reach) + 1e-9
        total = 0.0
        for c in range(values.shape[1]):
            out[k, c] = 0.0
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
                    total += 1.0
                    for c in range(values.shape[1]):
                        out[k, c] += values[other, c]
        if total > 0.0:
            for c in range(values.shape[1]):
                out[k, c] /= total
        else:
            for c in range(values.shape[1]):
                out[k, c] = values[k, c]
