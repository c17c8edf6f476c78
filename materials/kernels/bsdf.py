"""The one door to all surfaces: evaluate, pdf and sample by kind, in the local frame z = n.

`wo` points towards the viewer, `wi` towards the light; `f` has no cosine. Opaque kinds scatter on the side of the
normal only: who wants a two-sided surface turns the frame. Weights are for radiance.
"""

import math
from typing import NamedTuple

from numba import njit

from . import coated, ggx
from . import dielectric as glass
from .fresnel import absorbed_ratio, dielectric, normal_reflectance, schlick
from .lambert import INV_PI, pdf_cosine, sample_cosine
from .microfacet import ALPHA_MIN
from .rough_film import internal_reflectance, reflectance

LAMBERT, GGX, COATED, MIRROR, DIELECTRIC, ROUGH_DIELECTRIC, EMISSION = 0, 1, 2, 3, 4, 5, 6

_BLACK = (0.0, 0.0, 0.0)


class Surface(NamedTuple):
    """All that a scattering event needs; float64 but for `kind`.

    eta is inside over outside for the dielectrics and the specular lobe of `GGX` and of a coated base (over air, not
    over the film). film_eta in [1, 3], film_alpha (0: smooth) and tau (optical depth of one vertical crossing, per
    channel) belong to `COATED`.
    """

    kind: int
    albedo_r: float
    albedo_g: float
    albedo_b: float
    specular_scale: float
    eta: float
    alpha_u: float
    alpha_v: float
    film_eta: float
    film_alpha: float
    tau_r: float
    tau_g: float
    tau_b: float


@njit(cache=True)
def is_specular(surface):
    """Return whether there are only delta lobes, so that sampling lights is pointless."""
    return surface.kind == MIRROR or surface.kind == DIELECTRIC


@njit(cache=True)
def _widths(surface):
    return max(surface.alpha_u, ALPHA_MIN), max(surface.alpha_v, ALPHA_MIN)


@njit(cache=True, error_model="numpy")
def _ggx_share(surface, cos_o):
    """Return the probability of the specular lobe of `GGX`; the rest is diffuse."""
    lobe = surface.specular_scale * schlick(cos_o, normal_reflectance(surface.eta))
    total = lobe + (surface.albedo_r + surface.albedo_g + surface.albedo_b) / 3.0
    return lobe / total if total > 0.0 else 0.0


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
    if kind == GGX:
        lobe = 0.0
        if surface.specular_scale > 0.0:
            alpha_u, alpha_v = _widths(surface)
            lobe = surface.specular_scale * ggx.evaluate_schlick(wo, wi, normal_reflectance(surface.eta), alpha_u, alpha_v)
        return (surface.albedo_r * INV_PI + lobe, surface.albedo_g * INV_PI + lobe, surface.albedo_b * INV_PI + lobe)
    if kind == COATED:
        return _evaluate_coated(surface, wo, wi)
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
    if kind == LAMBERT:
        return pdf_cosine(wi)
    if kind == GGX:
        share = _ggx_share(surface, wo[2])
        alpha_u, alpha_v = _widths(surface)
        return share * ggx.pdf(wo, wi, alpha_u, alpha_v) + (1.0 - share) * pdf_cosine(wi)
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
    if kind == GGX:
        if u2 < _ggx_share(surface, wo[2]):
            alpha_u, alpha_v = _widths(surface)
            wi = ggx.sample(wo, alpha_u, alpha_v, u0, u1)
        else:
            wi = sample_cosine(u0, u1)
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


@njit(cache=True, error_model="numpy")
def _coated_albedo(film_eta, albedo, tau, inner, reflected, lobe):
    """Return the share of one channel that leaves a film, each crossing taken at twice the vertical depth."""
    out = (1.0 - inner) * math.exp(-2.0 * tau)
    series = 1.0 - albedo * inner * absorbed_ratio(film_eta, tau)
    return reflected + (1.0 - reflected) * (albedo * out / series + lobe * math.exp(-2.0 * tau))


@njit(cache=True, error_model="numpy")
def albedo(surface, cos_o):
    """Return roughly how much of the light towards wo is reflected or passed on, per channel; exact for smooth clear kinds."""
    kind = surface.kind
    cos_o = abs(cos_o)
    if kind in (LAMBERT, MIRROR):
        return (surface.albedo_r, surface.albedo_g, surface.albedo_b)
    if kind in (DIELECTRIC, ROUGH_DIELECTRIC):
        return (1.0, 1.0, 1.0)
    if kind == GGX:
        # microfacets seen at grazing are tilted towards the viewer: the rougher, the less Fresnel rises
        alpha = 0.5 * (surface.alpha_u + surface.alpha_v)
        lobe = surface.specular_scale * schlick(cos_o + alpha * (1.0 - cos_o) * 0.5, normal_reflectance(surface.eta))
        return (surface.albedo_r + lobe, surface.albedo_g + lobe, surface.albedo_b + lobe)
    if kind == COATED:
        eta = surface.film_eta
        f, _, lobe = coated.lobe_weights(cos_o, 0.0, surface.specular_scale, surface.eta, eta, surface.film_alpha)
        inner = internal_reflectance(eta, surface.film_alpha)
        return (
            _coated_albedo(eta, surface.albedo_r, surface.tau_r, inner, f, lobe),
            _coated_albedo(eta, surface.albedo_g, surface.tau_g, inner, f, lobe),
            _coated_albedo(eta, surface.albedo_b, surface.tau_b, inner, f, lobe),
        )
    return _BLACK
