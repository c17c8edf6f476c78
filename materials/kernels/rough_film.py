"""How much a rough dielectric interface reflects into all directions, and what its average sends back inside.

A film with a rough surface reflects E(cos) = int f cos of single-scattering GGX with exact Fresnel. All the rest is let
through, what single scattering loses included, so that a clear film over a white base loses nothing. Tabulated is the
difference to the smooth interface, E - F, over sqrt(cos), sqrt(alpha) and (eta - 1) / (eta + 1), eta in [1, 3];
trilinear interpolation is within 0.02 of the integral, worst at grazing on nearly smooth films (tested).
"""

import math

import numpy as np
from numba import njit

from .fresnel import dielectric, diffuse_external

_COSINES, _WIDTHS, _INDICES = 25, 11, 11


def _fresnel(cos: np.ndarray, eta: np.ndarray) -> np.ndarray:
    cos_t = np.sqrt(1.0 - (1.0 - cos * cos) / (eta * eta))
    r_s = (cos - eta * cos_t) / np.maximum(cos + eta * cos_t, 1e-300)
    r_p = (eta * cos - cos_t) / np.maximum(eta * cos + cos_t, 1e-300)
    return 0.5 * (r_s * r_s + r_p * r_p)


def _reflectance_tables() -> tuple[np.ndarray, np.ndarray]:
    """Return E - F, and 2 int (E - F) cos dcos of its interpolant, which keeps the energy balance exact."""
    root = np.linspace(0.0, 1.0, _COSINES)
    cos = np.maximum(root * root, 1e-6)[:, None, None]
    alpha = (np.linspace(0.0, 1.0, _WIDTHS) ** 2)[None, :, None]
    x = np.linspace(0.0, 0.5, _INDICES)
    eta = (1.0 + x) / (1.0 - x)
    # midpoints in the two uniform variates of the visible normals (as microfacet.sample_visible)
    phi, u = np.meshgrid((np.arange(16) + 0.5) / 16 * math.pi, (np.arange(32) + 0.5) / 32)
    phi, u = phi.ravel(), u.ravel()
    sin = np.sqrt(1.0 - cos * cos)
    length = np.sqrt((alpha * sin) ** 2 + cos * cos)
    sx, sz = alpha * sin / length, cos / length
    z = (1.0 - u) * (1.0 + sz) - sz
    r = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    h = np.stack([alpha * (r * np.cos(phi) + sx), alpha * r * np.sin(phi), z + sz])
    h /= np.linalg.norm(h, axis=0)
    c = np.clip(sin * h[0] + cos * h[2], 0.0, 1.0)
    cos_i = 2.0 * c * h[2] - cos
    # G2 / G1 = (1 + Lambda_o) / (1 + Lambda_o + Lambda_i), Lambda from lengths as in microfacet
    with np.errstate(divide="ignore", invalid="ignore"):
        sin2_i = np.maximum(1.0 - cos_i * cos_i, 0.0)
        lambda_o = 0.5 * (length / cos - 1.0)
        lambda_i = 0.5 * (np.sqrt(alpha * alpha * sin2_i + cos_i * cos_i) / cos_i - 1.0)
        weight = np.where(cos_i > 0.0, (1.0 + lambda_o) / (1.0 + lambda_o + lambda_i), 0.0)
    excess = np.stack([(weight * _fresnel(c, e)).mean(-1) - _fresnel(cos[..., 0], e) for e in eta], axis=-1)
    excess[:, 0] = 0.0  # alpha = 0 is smooth
    fine = np.linspace(0.0, 1.0, 40 * (_COSINES - 1) + 1)
    middle = 0.5 * (fine[1:] + fine[:-1])
    mean = np.zeros(excess.shape[1:])
    for j in range(_WIDTHS):
        for k in range(_INDICES):
            # cos = s^2: 2 int D cos dcos = int D 4 s^3 ds
            mean[j, k] = np.mean(np.interp(middle, root, excess[:, j, k]) * 4.0 * middle**3)
    return excess, mean


_EXCESS, _MEAN_EXCESS = _reflectance_tables()


@njit(cache=True)
def _cell(x, count):
    """Return lower node and fraction of x in [0, 1] on `count` nodes."""
    position = min(max(x, 0.0), 1.0) * (count - 1)
    i = min(int(position), count - 2)
    return i, position - i


@njit(cache=True, error_model="numpy")
def reflectance(cos, eta, alpha):
    """Return E at a cosine outside; alpha = 0 is the smooth interface."""
    f = dielectric(cos, eta)
    if alpha <= 0.0:
        return f
    i, a = _cell(math.sqrt(max(cos, 0.0)), _COSINES)
    j, b = _cell(math.sqrt(alpha), _WIDTHS)
    k, c = _cell(2.0 * (eta - 1.0) / (eta + 1.0), _INDICES)
    d = 0.0
    for p in range(2):
        for q in range(2):
            w = (a if p else 1.0 - a) * (b if q else 1.0 - b)
            d += w * ((1.0 - c) * _EXCESS[i + p, j + q, k] + c * _EXCESS[i + p, j + q, k + 1])
    return min(max(f + d, 0.0), 1.0)


@njit(cache=True, error_model="numpy")
def internal_reflectance(eta, alpha):
    """Return Fdi below a clear film, from the balance of E; absorption dims it by `fresnel.absorbed_ratio`."""
    if eta <= 1.0:
        return 0.0
    external = diffuse_external(eta)
    if alpha > 0.0:
        j, b = _cell(math.sqrt(alpha), _WIDTHS)
        k, c = _cell(2.0 * (eta - 1.0) / (eta + 1.0), _INDICES)
        low = (1.0 - c) * _MEAN_EXCESS[j, k] + c * _MEAN_EXCESS[j, k + 1]
        high = (1.0 - c) * _MEAN_EXCESS[j + 1, k] + c * _MEAN_EXCESS[j + 1, k + 1]
        external += (1.0 - b) * low + b * high
    return 1.0 - (1.0 - external) / (eta * eta)
