"""How much better pictures agree with a recording where a drop on the glass shows another part of them."""

import math

from numba import njit, prange


@njit(cache=True)
def _sample(picture, x, y, c):
    """Return a channel of a picture (H, W, 3) at a place [px], bilinearly; beyond the border the border goes on."""
    height, width = picture.shape[0], picture.shape[1]
    x, y = min(max(x - 0.5, 0.0), width - 1.0), min(max(y - 0.5, 0.0), height - 1.0)
    i, j = min(int(x), width - 2), min(int(y), height - 2)
    u, v = x - i, y - j
    upper = (1.0 - u) * picture[j, i, c] + u * picture[j, i + 1, c]
    return (1.0 - v) * upper + v * ((1.0 - u) * picture[j + 1, i, c] + u * picture[j + 1, i + 1, c])


@njit(cache=True, parallel=True, error_model="numpy")
def gains(picture, blurred, residual, weight, free, drops, magnification, level, out):
    """Fill `out` (N,): by how much each of `drops` (N, 3: column, row, radius [px]) lowers chi-square.

    `picture` (F, H, W, 3) is predicted without drops, `blurred` the same as blurred as it is within them, `residual` what the
    recording is above `picture`, `free` (H, W) is 0 where another drop lies already.
    """
    frames, height, width = picture.shape[0], picture.shape[1], picture.shape[2]
    for k in prange(drops.shape[0]):
        cx, cy, r = drops[k, 0], drops[k, 1], drops[k, 2]
        total = 0.0
        for row in range(max(int(cy - r - 1.0), 0), min(int(cy + r + 2.0), height)):
            for column in range(max(int(cx - r - 1.0), 0), min(int(cx + r + 2.0), width)):
                dx, dy = column + 0.5 - cx, row + 0.5 - cy
                share = min(max(r + 0.5 - math.sqrt(dx * dx + dy * dy), 0.0), 1.0) * free[row, column]
                if share <= 0.0:
                    continue
                x, y = cx - magnification * dx, cy - magnification * dy
                for f in range(frames):
                    for c in range(3):
                        w = weight[f, row, column, c]
                        if w > 0.0:
                            change = share * (level * _sample(blurred[f], x, y, c) - picture[f, row, column, c])
                            total += w * change * (2.0 * residual[f, row, column, c] - change)
        out[k] = total
