"""The GGX (Trowbridge-Reitz) distribution of microfacets, anisotropic, with Smith's shadowing and visible normals."""

import math

from numba import njit

from .frames import dot, normalize

# Below this width the peak of D overflows the benefit of being rough at all; smooth interfaces have kinds of their own.
ALPHA_MIN = 1e-4


@njit(cache=True, error_model="numpy")
def ggx_d(h, alpha_u, alpha_v):
    """Return the density of microfacet normals per area and solid angle; 0 below the surface."""
    if h[2] <= 0.0:
        return 0.0
    a, b = h[0] / alpha_u, h[1] / alpha_v
    e = a * a + b * b + h[2] * h[2]
    return 1.0 / (math.pi * alpha_u * alpha_v * e * e)


@njit(cache=True)
def stretched_length(w, alpha_u, alpha_v):
    """Return the length of (alpha_u wx, alpha_v wy, wz): |cos| (1 + 2 Lambda), finite at grazing."""
    a, b = alpha_u * w[0], alpha_v * w[1]
    return math.sqrt(a * a + b * b + w[2] * w[2])


@njit(cache=True, error_model="numpy")
def smith_lambda(w, alpha_u, alpha_v):
    """Return Smith's Lambda, (sqrt(1 + alpha^2 tan^2) - 1) / 2 along the azimuth of w."""
    return 0.5 * (stretched_length(w, alpha_u, alpha_v) / abs(w[2]) - 1.0)


@njit(cache=True, error_model="numpy")
def g2_correlated(wo, wi, alpha_u, alpha_v):
    """Return the height-correlated masking and shadowing of two directions above the surface (Heitz 2014, eq. 99)."""
    return 1.0 / (1.0 + smith_lambda(wo, alpha_u, alpha_v) + smith_lambda(wi, alpha_u, alpha_v))


@njit(cache=True, error_model="numpy")
def g2_separable(wo, wi, alpha_u, alpha_v):
    """Return G1(wo) G1(wi), for directions on opposite sides (Walter et al. 2007, eq. 23)."""
    return 1.0 / ((1.0 + smith_lambda(wo, alpha_u, alpha_v)) * (1.0 + smith_lambda(wi, alpha_u, alpha_v)))


@njit(cache=True, error_model="numpy")
def visibility(wo, wi, alpha_u, alpha_v):
    """Return G2 / (4 cos_o cos_i) with correlated G2; the cosines cancel, so that grazing angles are safe."""
    return 0.5 / (wo[2] * stretched_length(wi, alpha_u, alpha_v) + wi[2] * stretched_length(wo, alpha_u, alpha_v))


@njit(cache=True)
def sample_visible(wo, alpha_u, alpha_v, u0, u1):
    """Return a microfacet normal as seen from wo above the surface (spherical caps, Dupuy and Benyoub 2023)."""
    s = normalize((alpha_u * wo[0], alpha_v * wo[1], wo[2]))
    phi = 2.0 * math.pi * u0
    z = (1.0 - u1) * (1.0 + s[2]) - s[2]
    r = math.sqrt(max(1.0 - z * z, 0.0))
    c = (r * math.cos(phi) + s[0], r * math.sin(phi) + s[1], z + s[2])
    return normalize((alpha_u * c[0], alpha_v * c[1], max(c[2], 0.0)))


@njit(cache=True, error_model="numpy")
def pdf_visible(wo, h, alpha_u, alpha_v):
    """Return the density of `sample_visible` per solid angle of h: G1 D (wo . h) / cos_o."""
    c = dot(wo, h)
    if c <= 0.0:
        return 0.0
    return 2.0 * c * ggx_d(h, alpha_u, alpha_v) / (wo[2] + stretched_length(wo, alpha_u, alpha_v))


@njit(cache=True, error_model="numpy")
def pdf_reflected(wo, h, alpha_u, alpha_v):
    """Return the density of wo mirrored about a visible normal: `pdf_visible` / (4 wo . h)."""
    if dot(wo, h) <= 0.0:
        return 0.0
    return 0.5 * ggx_d(h, alpha_u, alpha_v) / (wo[2] + stretched_length(wo, alpha_u, alpha_v))
