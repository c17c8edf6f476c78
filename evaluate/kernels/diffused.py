"""Light that has spread below a surface, at its pieces: between places where it is known, under the lamps of each frame."""

from numba import njit, prange

from .fragments import LAMP_POWER


@njit(cache=True, parallel=True, error_model="numpy")
def irradiance(spread, near, weight, slots, lamps, out):
    """Fill `out` (N, 3) from `spread` (M, L), per unit of each lamp, at the places `near` (N, K) with their `weight` (N, K)."""
    for i in prange(near.shape[0]):
        r, g, b = 0.0, 0.0, 0.0
        for s in range(slots.shape[1]):
            lamp = slots[i, s]
            if lamp < 0:
                continue
            e = 0.0
            for k in range(near.shape[1]):
                e += weight[i, k] * spread[near[i, k], lamp]
            r += e * lamps[lamp, LAMP_POWER]
            g += e * lamps[lamp, LAMP_POWER + 1]
            b += e * lamps[lamp, LAMP_POWER + 2]
        out[i, 0], out[i, 1], out[i, 2] = r, g, b
