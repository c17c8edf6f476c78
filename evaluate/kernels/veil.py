"""Fog along lines of sight: how much gets through, and the light of lamps that it scatters once."""

import math

from numba import njit, prange

from materials.kernels.frames import dot
from materials.kernels.phase import henyey_greenstein

from .fragments import LAMP_POWER, towards


@njit(cache=True)
def _density(z, scale_height, base):
    return 1.0 if scale_height <= 0.0 else math.exp(-max(z - base, 0.0) / scale_height)


@njit(cache=True, parallel=True, error_model="numpy")
def veil(eye, frame, view, distance, slots, lamps, sigma_t, scale_height, base, g, steps, through, light):
    """Fill `through` (N, 3) and `light` (N, 3): radiance once scattered per unit of single-scattering albedo.

    The lamps' own way through the fog, and what hides them from it, are left out: a constant, to first order.
    """
    for k in prange(view.shape[0]):
        f = frame[k]
        d = (-float(view[k, 0]), -float(view[k, 1]), -float(view[k, 2]))
        h = float(distance[k]) / steps
        tau = 0.0
        for i in range(steps):
            t = (i + 0.5) * h
            p = (eye[f, 0] + t * d[0], eye[f, 1] + t * d[1], eye[f, 2] + t * d[2])
            own = sigma_t * _density(p[2], scale_height, base) * h
            # Scattered within the step, dimmed to its nearer end and on average within it.
            share = math.exp(-tau) * (1.0 - math.exp(-own))
            tau += own
            if share <= 0.0:
                continue
            for s in range(slots.shape[1]):
                lamp = slots[f, s]
                if lamp < 0:
                    continue
                w, r = towards(lamps, lamp, p)
                # Light travels along -w, and after the collision along -d.
                e = henyey_greenstein(dot(w, d), g)
                if not math.isinf(r):
                    e /= max(r * r, 1e-4)
                for c in range(3):
                    light[k, c] += share * e * lamps[lamp, LAMP_POWER + c]
        for c in range(3):
            through[k, c] = math.exp(-tau)
