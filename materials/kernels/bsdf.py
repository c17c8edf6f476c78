"""The one door to all surfaces: evaluate, pdf and sample by kind (see `kinds`), in the local frame z = n.

`wo` points towards the viewer, `wi` towards the light; `f` has no cosine. Opaque kinds scatter on the side of the
normal only: who wants a two-sided surface turns the frame. Weights are for radiance.
"""

import math

from numba import njit

from . import coated, disney, ggx, lobes, oren_nayar
from . import dielectric as glass
from .frames import dot
from .fresnel import conductor, dielectric
from .kinds import (
    COATED,
    CONDUCTOR,
    DIELECTRIC,
    DISNEY,
    EMISSION,
    LAMBERT,
    METAL_ETA,
    METAL_K,
    MIRROR,
    OREN_NAYAR,
    ROUGH_DIELECTRIC,
    SIGMA,
)
from .lambert import INV_PI, pdf_cosine, sample_cosine
from .microfacet import ALPHA_MIN
from .rough_film import internal_reflectance, reflectance

_BLACK = (0.0, 0.0, 0.0)


@njit(cache=True)
def is_specular(surface):
    """Return whether there are only delta lobes, so that sampling lights is pointless."""
    kind = surface.kind
    return kind in (MIRROR, DIELECTRIC) or (kind == CONDUCTOR and surface.alpha_u <= 0.0)


@njit(cache=True)
def _widths(surface):
    return max(surface.alpha_u, ALPHA_MIN), max(surface.alpha_v, ALPHA_MIN)


@njit(cache=True, error_model="numpy")
def _metal_reflectance(surface, cos_i):
    """Return Fresnel's reflectance of a conductor per channel, times its scale."""
    more, scale = surface.more, surface.specular_scale
    return (
        scale * conductor(cos_i, more[METAL_ETA], more[METAL_K]),
        scale * conductor(cos_i, more[METAL_ETA + 1], more[METAL_K + 1]),
        scale * conductor(cos_i, more[METAL_ETA + 2], more[METAL_K + 2]),
    )


@njit(cache=True, error_model="numpy")
def _evaluate_conductor(surface, wo, wi):
    if surface.alpha_u <= 0.0:
        return _BLACK
    alpha_u, alpha_v = _widths(surface)
    h = ggx.half_vector(wo, wi)
    lobe = ggx.facets(wo, wi, h, alpha_u, alpha_v)
    f = _metal_reflectance(surface, dot(wo, h))
    return (lobe * f[0], lobe * f[1], lobe * f[2])


@njit(cache=True, error_model="numpy")
def _coated_shares(surface, cos_o):
    """Return the probabilities of the interface and of the diffuse base of `COATED`; the rest is the base's lobe."""
    mean = (surface.albedo_r + surface.albedo_g + surface.albedo_b) / 3.0
    f, diffuse, lobe = coated.lobe_weights(cos_o, mean, surface.specular_scale, surface.eta, surface.film_eta, surface.film_alpha)
    total = f + diffuse + lobe
    return (f / total, diffuse / total) if total > 0.0 else (0.0, 1.0)


@njit(cache=True, error_model="numpy")
def evaluate(surface, wo, wi):
    """Return the BSDF without the cosine, per channel; delta lobes count 0."""
    kind = surface.kind
    if kind == ROUGH_DIELECTRIC:
        alpha_u, alpha_v = _widths(surface)
        f = glass.evaluate_rough(wo, wi, surface.eta, alpha_u, alpha_v)
        return (f, f, f)
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return _BLACK
    if kind == LAMBERT:
        return (surface.albedo_r * INV_PI, surface.albedo_g * INV_PI, surface.albedo_b * INV_PI)
    if kind == COATED:
        return _evaluate_coated(surface, wo, wi)
    if lobes.is_lobed(kind):
        return lobes.evaluate(surface, wo, wi)
    if kind == OREN_NAYAR:
        f = oren_nayar.evaluate(wo, wi, surface.more[SIGMA])
        return (surface.albedo_r * f, surface.albedo_g * f, surface.albedo_b * f)
    if kind == CONDUCTOR:
        return _evaluate_conductor(surface, wo, wi)
    if kind == DISNEY:
        alpha_u, alpha_v = _widths(surface)
        return disney.evaluate(surface.albedo_r, surface.albedo_g, surface.albedo_b, alpha_u, alpha_v, surface.more, wo, wi)
    return _BLACK


@njit(cache=True, error_model="numpy")
def _evaluate_coated(surface, wo, wi):
    eta = surface.film_eta
    wo_in, wi_in = coated.inside(wo, eta), coated.inside(wi, eta)
    rough = surface.film_alpha
    through = (1.0 - reflectance(wo[2], eta, rough)) * (1.0 - reflectance(wi[2], eta, rough))
    path = 1.0 / wo_in[2] + 1.0 / wi_in[2]
    inner = internal_reflectance(eta, rough)
    r = coated.diffuse_channel(surface.albedo_r, eta, inner, surface.tau_r, path)
    g = coated.diffuse_channel(surface.albedo_g, eta, inner, surface.tau_g, path)
    b = coated.diffuse_channel(surface.albedo_b, eta, inner, surface.tau_b, path)
    if surface.specular_scale > 0.0:
        alpha_u, alpha_v = _widths(surface)
        lobe = coated.base_lobe(wo_in, wi_in, surface.eta, eta, alpha_u, alpha_v) * surface.specular_scale / (eta * eta)
        r += lobe * math.exp(-surface.tau_r * path)
        g += lobe * math.exp(-surface.tau_g * path)
        b += lobe * math.exp(-surface.tau_b * path)
    top = 0.0
    if surface.film_alpha > 0.0:
        alpha = max(surface.film_alpha, ALPHA_MIN)
        top = ggx.evaluate_exact(wo, wi, eta, alpha, alpha)
    return (through * r + top, through * g + top, through * b + top)


@njit(cache=True, error_model="numpy")
def pdf(surface, wo, wi):
    """Return the density of `sample` per solid angle; delta lobes count 0."""
    kind = surface.kind
    if kind == ROUGH_DIELECTRIC:
        alpha_u, alpha_v = _widths(surface)
        return glass.pdf_rough(wo, wi, surface.eta, alpha_u, alpha_v)
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return 0.0
    if kind in (LAMBERT, OREN_NAYAR):
        return pdf_cosine(wi)
    if lobes.is_lobed(kind):
        return lobes.pdf(surface, wo, wi)
    if kind == CONDUCTOR:
        if surface.alpha_u <= 0.0:
            return 0.0
        alpha_u, alpha_v = _widths(surface)
        return ggx.pdf(wo, wi, alpha_u, alpha_v)
    if kind == DISNEY:
        alpha_u, alpha_v = _widths(surface)
        return disney.pdf(surface.albedo_r, surface.albedo_g, surface.albedo_b, alpha_u, alpha_v, surface.more, wo, wi)
    if kind == COATED:
        top, diffuse = _coated_shares(surface, wo[2])
        density = diffuse * pdf_cosine(wi)
        if surface.film_alpha > 0.0:
            alpha = max(surface.film_alpha, ALPHA_MIN)
            density += top * ggx.pdf(wo, wi, alpha, alpha)
        if surface.specular_scale > 0.0:
            alpha_u, alpha_v = _widths(surface)
            eta = surface.film_eta
            wo_in, wi_in = coated.inside(wo, eta), coated.inside(wi, eta)
            density += (1.0 - top - diffuse) * coated.base_pdf(wo_in, wi_in, wi[2], eta, alpha_u, alpha_v)
        return density
    return 0.0


@njit(cache=True, error_model="numpy")
def sample(surface, wo, u0, u1, u2):
    """Return wi, the weight f |cos| / pdf per channel, the pdf, and whether the lobe is a delta.

    A weight of 0 is light absorbed. The pdf is per solid angle; for a delta lobe it is the probability of the branch.
    """
    kind = surface.kind
    if kind == DIELECTRIC:
        wi, w, p = glass.sample_smooth(wo, surface.eta, u2)
        return wi, (w, w, w), p, True
    if kind == ROUGH_DIELECTRIC:
        alpha_u, alpha_v = _widths(surface)
        wi, w = glass.sample_rough(wo, surface.eta, alpha_u, alpha_v, u0, u1, u2)
        p = glass.pdf_rough(wo, wi, surface.eta, alpha_u, alpha_v) if w > 0.0 else 0.0
        if p <= 0.0:
            w = 0.0
        return wi, (w, w, w), p, False
    mirrored = (-wo[0], -wo[1], wo[2])
    if wo[2] <= 0.0 or kind == EMISSION:
        return mirrored, _BLACK, 0.0, False
    if kind == MIRROR:
        return mirrored, (surface.albedo_r, surface.albedo_g, surface.albedo_b), 1.0, True
    if kind == LAMBERT:
        wi = sample_cosine(u0, u1)
        return wi, (surface.albedo_r, surface.albedo_g, surface.albedo_b), pdf_cosine(wi), False
    if lobes.is_lobed(kind):
        wi = lobes.sample(surface, wo, u0, u1, u2)
    elif kind == OREN_NAYAR:
        wi = sample_cosine(u0, u1)
    elif kind == CONDUCTOR:
        if surface.alpha_u <= 0.0:
            return mirrored, _metal_reflectance(surface, wo[2]), 1.0, True
        alpha_u, alpha_v = _widths(surface)
        wi = ggx.sample(wo, alpha_u, alpha_v, u0, u1)
    elif kind == DISNEY:
        alpha_u, alpha_v = _widths(surface)
        wi = disney.sample(surface.albedo_r, surface.albedo_g, surface.albedo_b, alpha_u, alpha_v, surface.more, wo, u0, u1, u2)
    else:
        top, diffuse = _coated_shares(surface, wo[2])
        if u2 < top:
            if surface.film_alpha <= 0.0:
                w = dielectric(wo[2], surface.film_eta) / top
                return mirrored, (w, w, w), top, True
            alpha = max(surface.film_alpha, ALPHA_MIN)
            wi = ggx.sample(wo, alpha, alpha, u0, u1)
        elif u2 < top + diffuse or surface.specular_scale <= 0.0:
            wi = sample_cosine(u0, u1)
        else:
            alpha_u, alpha_v = _widths(surface)
            wi = coated.base_sample(coated.inside(wo, surface.film_eta), surface.film_eta, alpha_u, alpha_v, u0, u1)
    p = pdf(surface, wo, wi)
    if p <= 0.0:
        return wi, _BLACK, 0.0, False
    f = evaluate(surface, wo, wi)
    s = wi[2] / p
    return wi, (f[0] * s, f[1] * s, f[2] * s), p, False
