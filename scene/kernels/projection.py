"""Loops that ask pictures for the colour of world points, and merge the answers."""

import numpy as np
from numba import njit, prange


@njit(cache=True, parallel=True)
def see(xy, z, normals, depth, dynamic, fx, fy, cx, cy, orthographic, margin, tolerance=0.03):
    """Return 1 for each point that a camera sees, 0.1 close to an outline, where colours mix, 0 for what it does not see.

    `normals` (N, 3) are in the camera's frame. A pixel beside the point is predicted to lie on the point's tangent plane,
    `z' = z (n . r) / (n . r')` with the rays r; what is clearly nearer than that is in front, what is farther is behind.
    """
    height, width = depth.shape
    out = np.zeros(len(z), np.float32)
    for p in prange(len(z)):
        zp = z[p]
        x, y = xy[p, 0], xy[p, 1]
        if not (zp > 0.05 and x >= 0 and y >= 0 and x < width and y < height):
            continue
        col, row = int(x), int(y)
        if dynamic[row, col]:
            continue
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        if orthographic:
            here = nz
        else:
            here = nx * (x - cx) / fx + ny * (y - cy) / fy + nz
        worst = 1.0
        for dr in range(-margin, margin + 1):
            for dc in range(-margin, margin + 1):
                r, c = row + dr, col + dc
                if r < 0 or c < 0 or r >= height or c >= width:
                    continue
                expected = zp
                if not orthographic:
                    there = nx * (c + 0.5 - cx) / fx + ny * (r + 0.5 - cy) / fy + nz
                    # A tangent plane seen edge-on predicts nothing; then the point's own depth has to do.
                    if there * here > 0:
                        expected = min(max(zp * here / there, 0.5 * zp), 2.0 * zp)
                slack = tolerance + 0.002 * zp
                if dr == 0 and dc == 0:
                    # Within one pixel the plane itself covers some depth.
                    slack += min(abs(expected - zp), 0.2 * zp)
                    if depth[r, c] < zp - slack and depth[r, c] < expected - slack:
                        worst = 0.0
                elif worst > 0.1 and abs(depth[r, c] - expected) > 0.05 * expected + slack:
                    worst = 0.1
        out[p] = worst
    return out


@njit(cache=True, parallel=True)
def gather(image, valid, xy, wanted, scale, out):
    """Write the bilinear colour at wanted positions, over valid pixels only; `scale` is the image's share of full size."""
    height, width = valid.shape
    for p in prange(len(xy)):
        if not wanted[p]:
            continue
        x, y = xy[p, 0] * scale - 0.5, xy[p, 1] * scale - 0.5
        i, j = int(np.floor(y)), int(np.floor(x))
        total = 0.0
        r, g, b = 0.0, 0.0, 0.0
        for di in range(2):
            for dj in range(2):
                row, col = min(max(i + di, 0), height - 1), min(max(j + dj, 0), width - 1)
                w = abs(1 - di - (y - i)) * abs(1 - dj - (x - j)) * valid[row, col]
                total += w
                r += w * image[row, col, 0]
                g += w * image[row, col, 1]
                b += w * image[row, col, 2]
        if total > 0:
            out[p, 0], out[p, 1], out[p, 2] = r / total, g / total, b / total


@njit(cache=True, parallel=True)
def keep_best(colour, quality, kept, kept_quality):
    """Put each point's answer into its slots (N, K), in the place of the worst if that is worse."""
    slots = kept_quality.shape[1]
    for p in prange(len(quality)):
        if quality[p] <= 0:
            continue
        worst = 0
        for k in range(1, slots):
            if kept_quality[p, k] < kept_quality[p, worst]:
                worst = k
        if quality[p] > kept_quality[p, worst]:
            kept_quality[p, worst] = quality[p]
            kept[p, worst, 0], kept[p, worst, 1], kept[p, worst, 2] = colour[p, 0], colour[p, 1], colour[p, 2]


@njit(cache=True, parallel=True)
def merge(kept, kept_quality, spread, out, weight):
    """Write the weighted median by luminance, averaged with all answers whose luminance is within a factor of it."""
    slots = kept_quality.shape[1]
    for p in prange(len(out)):
        luminance = np.empty(slots)
        total = 0.0
        for k in range(slots):
            luminance[k] = 0.2126 * kept[p, k, 0] + 0.7152 * kept[p, k, 1] + 0.0722 * kept[p, k, 2]
            total += kept_quality[p, k]
        weight[p] = total
        if total <= 0:
            continue
        order = np.argsort(luminance)
        below, median = 0.0, 0.0
        for k in order:
            below += kept_quality[p, k]
            if kept_quality[p, k] > 0 and below >= 0.5 * total:
                median = luminance[k]
                break
        s, r, g, b = 0.0, 0.0, 0.0, 0.0
        for k in range(slots):
            q = kept_quality[p, k]
            if q > 0 and abs(luminance[k] - median) <= spread * median + 1e-6:
                s += q
                r += q * kept[p, k, 0]
                g += q * kept[p, k, 1]
                b += q * kept[p, k, 2]
        out[p, 0], out[p, 1], out[p, 2] = r / s, g / s, b / s
