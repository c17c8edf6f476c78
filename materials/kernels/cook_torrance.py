"""Cook and Torrance's (1982) F D G / (4 cos_o cos_i) with the anisotropic cosine-power facets of Ashikhmin and Shirley (2000).

D = sqrt((n_u + 2)(n_v + 2)) / 2 pi (n . h)^(n_u cos^2 phi + n_v sin^2 phi), whose projected area is 1, with
n = 2 / alpha^2 - 2. G is Smith's, separable: G1(wo) G1(wi). Smith's G1 = cos_o / int (wo . m)+ D(m) dm has no closed form
here, and that of Beckmann's facets, often put in its place (Walter et al. 2007, section 5.2), makes up to 30 % too much
light, as cosine-power facets of the same width are steeper. So the integral is tabulated for round facets; those of
unequal widths get the width along the azimuth of w. Fresnel's factor is Schlick's.
"""

import math

import numpy as np
from numba import njit

from .frames import dot, normalize, reflect
from .fresnel import schlick
from .microfacet import stretched_length

# The projected area int (w . m)+ D dm, over sqrt(cos^2 + alpha^2 sin^2), which leaves a smooth ratio between 0.28 and 1:
# rows over alpha in [0, 1], columns over s = cos / sqrt(cos^2 + alpha^2 sin^2) in [0, 1]. Bilinear: off by less than 1e-3.
_ROWS, _COLUMNS = 33, 65


def _area_ratio() -> np.ndarray:
    nodes, weights = np.polynomial.legendre.leggauss(300)
    v, dv = 0.5 * (nodes + 1.0), 0.5 * weights
    table = np.empty((_ROWS, _COLUMNS))
    s = np.arange(_COLUMNS) / (_COLUMNS - 1.0)
    for row in range(_ROWS):
        alpha = max(row / (_ROWS - 1.0), 1e-3)
        # D cos dm is even in u, with cos_m = (1 - u)^(alpha^2 / 2); 1 - u = v^2 takes the pole at the rim away
        cos_m = v ** (alpha * alpha)
        sin_m = np.sqrt(-np.expm1(2.0 * alpha * alpha * np.log(v)))
        cos_w = (s * alpha / np.sqrt(1.0 - s * s * (1.0 - alpha * alpha)))[:, None]
        sin_w = np.sqrt(np.maximum(1.0 - cos_w * cos_w, 0.0))
        a, b = cos_w * cos_m, sin_w * sin_m
        # over the azimuths where a + b cos phi > 0
        rim = np.arccos(np.clip(-a / np.maximum(b, 1e-300), -1.0, 1.0))
        around = (rim * a + b * np.sin(rim)) / np.pi
        area = np.sum(around / cos_m * 2.0 * v * dv, axis=1)
        table[row] = area / np.sqrt(cos_w[:, 0] ** 2 + (alpha * sin_w[:, 0]) ** 2)
    return table


_RATIO = _area_ratio()


@njit(cache=True, error_model="numpy")
def _power(h, alpha_u, alpha_v):
    """Return (n + 2) / 2 along the azimuth of h."""
    sin2 = h[0] * h[0] + h[1] * h[1]
    if sin2 <= 0.0:
        return 1.0
    a, b = h[0] / alpha_u, h[1] / alpha_v
    return (a * a + b * b) / sin2


@njit(cache=True, error_model="numpy")
def ashikhmin_shirley_d(h, alpha_u, alpha_v):
    """Return the density of microfacet normals per area and solid angle; 0 below the surface."""
    if h[2] <= 0.0:
        return 0.0
    return h[2] ** (2.0 * _power(h, alpha_u, alpha_v) - 2.0) / (math.pi * alpha_u * alpha_v)


@njit(cache=True, error_model="numpy")
def projected_area(w, alpha_u, alpha_v):
    """Return the area of facets seen from w above the surface, per area of surface: cos_w / G1."""
    length = stretched_length(w, alpha_u, alpha_v)
    sin2 = w[0] * w[0] + w[1] * w[1]
    alpha = alpha_u
    if alpha_u != alpha_v and sin2 > 0.0:
        p, q = alpha_u * w[0], alpha_v * w[1]
        alpha = math.sqrt((p * p + q * q) / sin2)
    row, column = min(alpha, 1.0) * (_ROWS - 1), min(w[2] / length, 1.0) * (_COLUMNS - 1)
    i, j = min(int(row), _ROWS - 2), min(int(column), _COLUMNS - 2)
    a, b = row - i, column - j
    low = (1.0 - b) * _RATIO[i, j] + b * _RATIO[i, j + 1]
    high = (1.0 - b) * _RATIO[i + 1, j] + b * _RATIO[i + 1, j + 1]
    return length * ((1.0 - a) * low + a * high)


@njit(cache=True, error_model="numpy")
def evaluate(wo, wi, f0, alpha_u, alpha_v):
    """Return the lobe; both directions above the surface, f0 the reflectance at normal incidence."""
    h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
    areas = projected_area(wo, alpha_u, alpha_v) * projected_area(wi, alpha_u, alpha_v)
    return schlick(dot(wo, h), f0) * ashikhmin_shirley_d(h, alpha_u, alpha_v) / (4.0 * areas)


@njit(cache=True, error_model="numpy")
def pdf(wo, wi, alpha_u, alpha_v):
    """Return the density of `sample` per solid angle of wi: D (n . h) / (4 wo . h)."""
    h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
    c = dot(wo, h)
    if c <= 0.0:
        return 0.0
    return ashikhmin_shirley_d(h, alpha_u, alpha_v) * h[2] / (4.0 * c)


@njit(cache=True, error_model="numpy")
def sample(wo, alpha_u, alpha_v, u0, u1):
    """Return wo mirrored about a facet drawn by its projected area; below the surface the lobe is black."""
    psi = 2.0 * math.pi * u1
    x, y = alpha_u * math.cos(psi), alpha_v * math.sin(psi)
    length = math.sqrt(x * x + y * y)
    x, y = x / length, y / length
    z = (1.0 - u0) ** (0.5 / _power((x, y, 0.0), alpha_u, alpha_v))
    s = math.sqrt(max(1.0 - z * z, 0.0))
    return reflect(wo, (s * x, s * y, z))
