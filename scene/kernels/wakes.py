"""Density of the spray that tyres leave behind: a Gaussian across, half a Gaussian above the ground, fading with distance."""

import math

from materials.kernels.lean import lean

# Columns of a wake: where the tyre stands (x, y), the level unit vector from it backwards (x, y), how far the wake reaches [m],
# its extinction over a unit of cross-section [m], the distance in which it falls to 1/e, its width and its height at the tyre,
# both a vehicle's height behind it, and that height [m].
X, Y, BACK_X, BACK_Y, REACH, AMOUNT, FADES, WIDTH, HEIGHT, ACROSS, UP, VEHICLE = range(12)
COLUMNS = 12
# The Gaussians end here, in standard deviations: 1e-4 of the water is beyond.
CUT = 4.0
_INVERSE_PI = 1.0 / math.pi


@lean(error_model="numpy")
def width_at(start, far, vehicle, s):
    """Return the standard deviation at s [m] behind the tyre: variances add, that of the wake grows with the root of s."""
    return math.sqrt(start * start + far * far * math.sqrt(s / vehicle))


@lean(error_model="numpy")
def wake_density(wakes, x, y, d):
    """Return the mean extinction [1/m] of all wakes (K, COLUMNS) at a place x, y at the height d above the ground."""
    total = 0.0
    for k in range(wakes.shape[0]):
        w = wakes[k]
        rx, ry = x - w[X], y - w[Y]
        s = rx * w[BACK_X] + ry * w[BACK_Y]
        if s < 0.0 or s > w[REACH]:
            continue
        across = rx * w[BACK_Y] - ry * w[BACK_X]
        a = width_at(w[WIDTH], w[ACROSS], w[VEHICLE], s)
        u = width_at(w[HEIGHT], w[UP], w[VEHICLE], s)
        p, q = across / a, d / u
        if abs(p) > CUT or q > CUT:
            continue
        # 1 / (sqrt(2 pi) a) times 2 / (sqrt(2 pi) u): all of it is above the ground.
        total += w[AMOUNT] * _INVERSE_PI / (a * u) * math.exp(-0.5 * (p * p + q * q) - s / w[FADES])
    return total


@lean(error_model="numpy")
def wake_bound(wakes, x0, x1, y0, y1, d):
    """Return an upper bound of `wake_density` over a rectangle, at heights of d and more above its ground."""
    total = 0.0
    for k in range(wakes.shape[0]):
        w = wakes[k]
        cx, cy = 0.5 * (x0 + x1) - w[X], 0.5 * (y0 + y1) - w[Y]
        hx, hy = 0.5 * (x1 - x0), 0.5 * (y1 - y0)
        s, across = cx * w[BACK_X] + cy * w[BACK_Y], cx * w[BACK_Y] - cy * w[BACK_X]
        hs, ha = hx * abs(w[BACK_X]) + hy * abs(w[BACK_Y]), hx * abs(w[BACK_Y]) + hy * abs(w[BACK_X])
        near, far = max(s - hs, 0.0), min(s + hs, w[REACH])
        if near > far:
            continue
        # Each factor at the end of [near, far] where it is the largest: the widths grow with s.
        p = max(abs(across) - ha, 0.0) / width_at(w[WIDTH], w[ACROSS], w[VEHICLE], far)
        q = d / width_at(w[HEIGHT], w[UP], w[VEHICLE], far)
        if p > CUT or q > CUT:
            continue
        a = width_at(w[WIDTH], w[ACROSS], w[VEHICLE], near)
        u = width_at(w[HEIGHT], w[UP], w[VEHICLE], near)
        total += w[AMOUNT] * _INVERSE_PI / (a * u) * math.exp(-0.5 * (p * p + q * q) - near / w[FADES])
    return total
