"""Phong's cosine lobe about the mirror direction, normalised after Lafortune and Willems (1994): (n + 2) / 2 pi cos^n.

Widths stand for exponents as everywhere here: n = 2 / alpha^2 - 2.
"""

import math

from numba import njit

from .frames import basis, dot, to_world

_INV_2PI = 0.5 / math.pi


@njit(cache=True, error_model="numpy")
def exponent(alpha):
    """Return the exponent of a width in (0, 1]."""
    return 2.0 / (alpha * alpha) - 2.0


@njit(cache=True, error_model="numpy")
def _cosine(wo, wi):
    """Return the cosine between wi and wo mirrored about the normal."""
    return min(wo[2] * wi[2] - wo[0] * wi[0] - wo[1] * wi[1], 1.0)


@njit(cache=True, error_model="numpy")
def evaluate(wo, wi, alpha):
    """Return the lobe; both directions above the surface. Its albedo is 1 upright and falls like cos_o."""
    c = _cosine(wo, wi)
    if c <= 0.0:
        return 0.0
    n = exponent(alpha)
    return (n + 2.0) * _INV_2PI * c**n


@njit(cache=True, error_model="numpy")
def pdf(wo, wi, alpha):
    """Return the density of `sample` per solid angle."""
    c = _cosine(wo, wi)
    if c <= 0.0:
        return 0.0
    n = exponent(alpha)
    return (n + 1.0) * _INV_2PI * c**n


@njit(cache=True, error_model="numpy")
def sample(wo, alpha, u0, u1):
    """Return a direction about the mirror direction; it may point below the surface, where the lobe is black."""
    m = (-wo[0], -wo[1], wo[2])
    c = (1.0 - u0) ** (1.0 / (exponent(alpha) + 1.0))
    s = math.sqrt(max(1.0 - c * c, 0.0))
    phi = 2.0 * math.pi * u1
    t, b = basis(m)
    return to_world((s * math.cos(phi), s * math.sin(phi), c), t, b, m)


@njit(cache=True, error_model="numpy")
def evaluate_half(wo, wi, n):
    """Return (n + 2) / 2 pi (n . h)^n, eq. 2.11 of the thesis as printed: for fits only.

    The factor belongs to the mirror direction; about the half vector the albedo reaches 3.9.
    """
    x, y, z = wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]
    length = math.sqrt(dot((x, y, z), (x, y, z)))
    return (n + 2.0) * _INV_2PI * (z / length) ** n
