"""Fog along lines of sight and towards lamps: how much gets through, and the light of lamps that it scatters once."""

import math

from numba import njit, prange

from materials.kernels.frames import dot
from materials.kernels.phase import henyey_greenstein

from .fragments import LAMP_POWER, towards

_FAR = 1e4  # through fog that has no end nothing comes


@njit(cache=True)
def _density(z, scale_height, base):
    return 1.0 if scale_height <= 0.0 else math.exp(-max(z - base, 0.0) / scale_height)


@njit(cache=True)
def column(z, up, r, scale_height, base):
    """Return the way through fog of unit density from height z over a distance r [m]; `up` is the direction's vertical part.

    Even fog (scale height 0) is thin enough to be there: what it takes from the light of a lamp at infinity is taken
    everywhere alike, and left to the albedos.
    """
    if scale_height <= 0.0:
        return 0.0 if math.isinf(r) else r
    if math.isinf(r):
        return min((max(base - z, 0.0) + scale_height * _density(z, scale_height, base)) / up, _FAR) if up > 0.0 else _FAR
    # Simpson's rule: lamps stand within few scale heights.
    ends = _density(z, scale_height, base) + _density(z + r * up, scale_height, base)
    return r * (ends + 4.0 * _density(z + 0.5 * r * up, scale_height, base)) / 6.0


@njit(cache=True, parallel=True, error_model="numpy")
def arriving(frame, position, slots, lamps, sigma, scale_height, base, out):
    """Fill `out` (N, S): the share of each lamp's light that comes through the fog to each piece."""
    for k in prange(position.shape[0]):
        p = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
        for s in range(slots.shape[1]):
            lamp = slots[frame[k], s]
            if lamp >= 0:
                w, r = towards(lamps, lamp, p)
                out[k, s] = math.exp(-sigma * column(p[2], w[2], r, scale_height, base))


@njit(cache=True, parallel=True, error_model="numpy")
def veil(eye, frame, view, distance, slots, lamps, sigma_t, sigma_lamp, scale_height, base, g, steps, through, light, lift):
    """Fill `through` (N, 3), and `light` (N, 3): radiance once scattered per unit of single-scattering albedo.

    Lamps reach the line of sight through fog of extinction `sigma_lamp`; what hides them from it is left out. `lift` (N,)
    is the height [m] where light is scattered into the line of sight, times the share that is.
    """
    for k in prange(view.shape[0]):
        f = frame[k]
        d = (-float(view[k, 0]), -float(view[k, 1]), -float(view[k, 2]))
        h = float(distance[k]) / steps
        tau, lift[k] = 0.0, 0.0
        for i in range(steps):
            t = (i + 0.5) * h
            p = (eye[f, 0] + t * d[0], eye[f, 1] + t * d[1], eye[f, 2] + t * d[2])
            own = sigma_t * _density(p[2], scale_height, base) * h
            # Scattered within the step, dimmed to its nearer end and on average within it.
            share = math.exp(-tau) * (1.0 - math.exp(-own))
            tau += own
            if share <= 0.0:
                continue
            lift[k] += share * p[2]
            for s in range(slots.shape[1]):
                lamp = slots[f, s]
                if lamp < 0:
                    continue
                w, r = towards(lamps, lamp, p)
                # Light travels along -w, and after the collision along -d.
                e = henyey_greenstein(dot(w, d), g)
                e *= math.exp(-sigma_lamp * column(p[2], w[2], r, scale_height, base))
                if not math.isinf(r):
                    e /= max(r * r, 1e-4)
                for c in range(3):
                    light[k, c] += share * e * lamps[lamp, LAMP_POWER + c]
        for c in range(3):
            through[k, c] = math.exp(-tau)
