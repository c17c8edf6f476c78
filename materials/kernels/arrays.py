"""The scalar kernels over arrays: plain loops, arguments already broadcast to common length and float64."""

import numpy as np
from numba import njit

from . import albedo as quick
from . import bsdf, fresnel, microfacet, tabulated


@njit(cache=True)
def dielectric(cos_i, eta):
    """Loop over `fresnel.dielectric`."""
    out = np.empty(cos_i.size)
    for i in range(cos_i.size):
        out[i] = fresnel.dielectric(cos_i[i], eta[i])
    return out


@njit(cache=True)
def conductor(cos_i, eta, k):
    """Loop over `fresnel.conductor`."""
    out = np.empty(cos_i.size)
    for i in range(cos_i.size):
        out[i] = fresnel.conductor(cos_i[i], eta[i], k[i])
    return out


@njit(cache=True)
def diffuse_internal(eta, tau):
    """Loop over `fresnel.diffuse_internal_absorbed`."""
    out = np.empty(eta.size)
    for i in range(eta.size):
        out[i] = fresnel.diffuse_internal_absorbed(eta[i], tau[i])
    return out


@njit(cache=True)
def _direction(w, i):
    return (w[i, 0], w[i, 1], w[i, 2])


@njit(cache=True)
def ggx_d(h, alpha_u, alpha_v):
    """Loop over `microfacet.ggx_d`."""
    out = np.empty(len(h))
    for i in range(len(h)):
        out[i] = microfacet.ggx_d(_direction(h, i), alpha_u[i], alpha_v[i])
    return out


@njit(cache=True)
def smith_lambda(w, alpha_u, alpha_v):
    """Loop over `microfacet.smith_lambda`."""
    out = np.empty(len(w))
    for i in range(len(w)):
        out[i] = microfacet.smith_lambda(_direction(w, i), alpha_u[i], alpha_v[i])
    return out


@njit(cache=True)
def pdf_visible(wo, h, alpha_u, alpha_v):
    """Loop over `microfacet.pdf_visible`."""
    out = np.empty(len(wo))
    for i in range(len(wo)):
        out[i] = microfacet.pdf_visible(_direction(wo, i), _direction(h, i), alpha_u[i], alpha_v[i])
    return out


@njit(cache=True)
def sample_visible(wo, alpha_u, alpha_v, xi):
    """Loop over `microfacet.sample_visible`."""
    out = np.empty((len(wo), 3))
    for i in range(len(wo)):
        h = microfacet.sample_visible(_direction(wo, i), alpha_u[i], alpha_v[i], xi[i, 0], xi[i, 1])
        out[i, 0], out[i, 1], out[i, 2] = h[0], h[1], h[2]
    return out


@njit(cache=True)
def evaluate(surface, wo, wi):
    """Loop over `bsdf.evaluate`."""
    out = np.empty((len(wo), 3))
    for i in range(len(wo)):
        f = bsdf.evaluate(surface, _direction(wo, i), _direction(wi, i))
        out[i, 0], out[i, 1], out[i, 2] = f[0], f[1], f[2]
    return out


@njit(cache=True)
def pdf(surface, wo, wi):
    """Loop over `bsdf.pdf`."""
    out = np.empty(len(wo))
    for i in range(len(wo)):
        out[i] = bsdf.pdf(surface, _direction(wo, i), _direction(wi, i))
    return out


@njit(cache=True)
def sample(surface, wo, xi):
    """Loop over `bsdf.sample`."""
    wi, weight = np.empty((len(wo), 3)), np.empty((len(wo), 3))
    density, is_delta = np.empty(len(wo)), np.empty(len(wo), dtype=np.bool_)
    for i in range(len(wo)):
        w, f, density[i], is_delta[i] = bsdf.sample(surface, _direction(wo, i), xi[i, 0], xi[i, 1], xi[i, 2])
        for j in range(3):
            wi[i, j], weight[i, j] = w[j], f[j]
    return wi, weight, density, is_delta


@njit(cache=True)
def albedo(surface, cos_o):
    """Loop over `albedo.albedo`."""
    out = np.empty((cos_o.size, 3))
    for i in range(cos_o.size):
        a = quick.albedo(surface, cos_o[i])
        out[i, 0], out[i, 1], out[i, 2] = a[0], a[1], a[2]
    return out


@njit(cache=True)
def evaluate_tables(tables, which, uv, wo, wi):
    """Loop over `tabulated.evaluate`."""
    out = np.empty((len(wo), 3))
    for i in range(len(wo)):
        f = tabulated.evaluate(tables, which, uv[i, 0], uv[i, 1], _direction(wo, i), _direction(wi, i))
        out[i, 0], out[i, 1], out[i, 2] = f[0], f[1], f[2]
    return out


@njit(cache=True)
def pdf_tables(tables, which, uv, wo, wi):
    """Loop over `tabulated.pdf`."""
    out = np.empty(len(wo))
    for i in range(len(wo)):
        out[i] = tabulated.pdf(tables, which, uv[i, 0], uv[i, 1], _direction(wo, i), _direction(wi, i))
    return out


@njit(cache=True)
def sample_tables(tables, which, uv, wo, xi):
    """Loop over `tabulated.sample`."""
    wi, weight, density = np.empty((len(wo), 3)), np.empty((len(wo), 3)), np.empty(len(wo))
    for i in range(len(wo)):
        place, o = (uv[i, 0], uv[i, 1]), _direction(wo, i)
        w, f, density[i] = tabulated.sample(tables, which, place[0], place[1], o, xi[i, 0], xi[i, 1], xi[i, 2])
        for j in range(3):
            wi[i, j], weight[i, j] = w[j], f[j]
    return wi, weight, density
