"""Rough matte surfaces: the qualitative model of Oren and Nayar (1994, eq. 30), Lambertian V-grooves of slope spread sigma.

f = albedo / pi (A + B max(0, cos dphi) sin a tan b), a and b the larger and the smaller polar angle. With
sin a tan b = sin_i sin_o / max(cos_i, cos_o) no angle has to be taken. Sampled as Lambert's.
"""

import math

from numba import njit

from .lambert import INV_PI


@njit(cache=True, error_model="numpy")
def coefficients(sigma):
    """Return (A, B) of a spread of slopes sigma [rad]."""
    s2 = sigma * sigma
    return 1.0 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)


@njit(cache=True, error_model="numpy")
def evaluate(wo, wi, sigma):
    """Return the BRDF of a white surface; both directions above it."""
    a, b = coefficients(sigma)
    s = wo[0] * wi[0] + wo[1] * wi[1]
    if s <= 0.0:
        return a * INV_PI
    return (a + b * s / max(wo[2], wi[2])) * INV_PI


@njit(cache=True, error_model="numpy")
def albedo(cos_o, sigma):
    """Return the share of light that a white surface sends towards cos_o, in closed form.

    The integral of sin a tan b cos_i over the half of the sky with cos dphi > 0 splits at the viewer's polar angle. It
    exceeds 1 by up to 1.5 % at grazing (sigma near 0.2): the fit of the paper's table, not of this code.
    """
    a, b = coefficients(sigma)
    c = min(max(cos_o, 1e-9), 1.0)
    s = math.sqrt(1.0 - c * c)
    theta = math.acos(c)
    inner = s * (0.5 * theta - 0.5 * s * c)
    outer = s / c * (1.0 - s * s * s) / 3.0
    return a + b * 2.0 * INV_PI * (inner + outer)
