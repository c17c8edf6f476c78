"""Phase functions of particles: Henyey and Greenstein's, Draine's, and their blend for water droplets.

`cos_theta` is the cosine between the directions of travel before and after a collision: 1 is straight on. Densities are
per steradian and integrate to 1 over the sphere.
"""

import math
from typing import NamedTuple

from numba import njit

from .frames import basis, to_world

INV_4PI = 1.0 / (4.0 * math.pi)
# Below this |g| the inversion for g divides by almost nothing, and its answer differs from the isotropic one by less than g.
_ISOTROPIC = 1e-5


class Phase(NamedTuple):
    """A blend (1 - weight) HG(g) + weight Draine(g_draine, alpha_draine); weight 0 is Henyey-Greenstein alone."""

    g: float
    weight: float
    g_draine: float
    alpha_draine: float


@njit(cache=True, error_model="numpy")
def henyey_greenstein(cos_theta, g):
    """Return Henyey and Greenstein's density (1941)."""
    t = 1.0 + g * g - 2.0 * g * cos_theta
    return INV_4PI * (1.0 - g * g) / (t * math.sqrt(t))


@njit(cache=True, error_model="numpy")
def draine(cos_theta, g, alpha):
    """Return Draine's density (2003, eq 4): Henyey-Greenstein times 1 + alpha cos^2, normalised."""
    return henyey_greenstein(cos_theta, g) * (1.0 + alpha * cos_theta * cos_theta) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)


@njit(cache=True, error_model="numpy")
def sample_henyey_greenstein(u, g):
    """Return cos_theta of a variate in [0, 1)."""
    if abs(g) < _ISOTROPIC:
        return 2.0 * u - 1.0
    s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u)
    return min(1.0, max(-1.0, (1.0 + g * g - s * s) / (2.0 * g)))


@njit(cache=True, error_model="numpy")
def _draine_primitive(t, g, alpha):
    """Return the primitive over t = 1 + g^2 - 2 g cos of (1 + alpha cos^2) t^(-3/2)."""
    k, a = 1.0 + g * g, alpha / (4.0 * g * g)
    s = math.sqrt(t)
    return -2.0 * (1.0 + a * k * k) / s - 4.0 * a * k * s + a * 2.0 / 3.0 * t * s


@njit(cache=True, error_model="numpy")
def sample_draine(u, g, alpha):
    """Return cos_theta of a variate: the closed distribution function inverted by Newton's steps inside a bracket.

    For g of 0.05 and more: the primitive's terms cancel to the order of 1 / g^2.
    """
    top = (1.0 + g) * (1.0 + g)
    scale = (1.0 - g * g) / (4.0 * g) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)
    end = _draine_primitive(top, g, alpha)
    low, high = -1.0, 1.0
    c = sample_henyey_greenstein(u, g)
    for _ in range(60):
        error = scale * (end - _draine_primitive(1.0 + g * g - 2.0 * g * c, g, alpha)) - u
        if error > 0.0:
            high = c
        else:
            low = c
        step = error / (2.0 * math.pi * draine(c, g, alpha))
        following = c - step
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - c) < 1e-13:
            return following
        c = following
    return c


@njit(cache=True, error_model="numpy")
def evaluate(phase, cos_theta):
    """Return the density of a blend, which is also that of `sample`."""
    p = henyey_greenstein(cos_theta, phase.g)
    if phase.weight > 0.0:
        p += phase.weight * (draine(cos_theta, phase.g_draine, phase.alpha_draine) - p)
    return p


@njit(cache=True, error_model="numpy")
def sample_cosine_of(phase, u):
    """Return cos_theta of a variate in [0, 1); the lower part of it chooses Draine's term."""
    if u < phase.weight:
        return sample_draine(u / phase.weight, phase.g_draine, phase.alpha_draine)
    return sample_henyey_greenstein((u - phase.weight) / (1.0 - phase.weight), phase.g)


@njit(cache=True, error_model="numpy")
def sample(phase, d, u0, u1):
    """Return a direction after a collision of light (or of a path) that travelled along d."""
    c = sample_cosine_of(phase, u0)
    s = math.sqrt(max(0.0, 1.0 - c * c))
    azimuth = 2.0 * math.pi * u1
    t, b = basis(d)
    return to_world((s * math.cos(azimuth), s * math.sin(azimuth), c), t, b, d)


@njit(cache=True)
def evaluate_many(phase, cos_theta, out):
    """Loop over `evaluate`."""
    for i in range(len(cos_theta)):
        out[i] = evaluate(phase, cos_theta[i])


@njit(cache=True)
def sample_many(phase, d, xi, out):
    """Loop over `sample`; d is one direction, xi (N, 2), out (N, 3)."""
    for i in range(len(xi)):
        w = sample(phase, (d[0], d[1], d[2]), xi[i, 0], xi[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = w[0], w[1], w[2]
