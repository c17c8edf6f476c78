"""Light spread evenly over the hemisphere."""

import math

from numba import njit

INV_PI = 1.0 / math.pi


@njit(cache=True)
def sample_cosine(u0, u1):
    """Return a direction with density cos / pi."""
    r = math.sqrt(u0)
    phi = 2.0 * math.pi * u1
    return (r * math.cos(phi), r * math.sin(phi), math.sqrt(max(1.0 - u0, 0.0)))


@njit(cache=True)
def pdf_cosine(wi):
    """Return the density of `sample_cosine`."""
    return max(wi[2], 0.0) * INV_PI
