"""Surfaces that are a diffuse part and one or two glossy lobes: GGX, Phong's, Ward's, Cook and Torrance's.

f = albedo / pi + tint (specular_scale lobe(alpha) + second_scale lobe(alpha')). The second lobe, wider as a rule, is the
long tail that one lobe of a fit leaves over (Ngan et al. 2005; thesis 5.3.3).
"""

from numba import njit

from . import cook_torrance, ggx, phong, ward
from .fresnel import normal_reflectance, schlick
from .kinds import (
    COOK_TORRANCE,
    GGX,
    NORMALISATION,
    PHONG,
    SECOND_ALPHA_U,
    SECOND_ALPHA_V,
    SECOND_SCALE,
    TINT,
    WARD,
)
from .lambert import INV_PI, pdf_cosine, sample_cosine
from .microfacet import ALPHA_MIN


@njit(cache=True)
def is_lobed(kind):
    """Return whether a kind belongs here."""
    return kind == GGX or (PHONG <= kind <= COOK_TORRANCE)


@njit(cache=True, error_model="numpy")
def _lobe(surface, wo, wi, alpha_u, alpha_v):
    kind = surface.kind
    alpha_u, alpha_v = max(alpha_u, ALPHA_MIN), max(alpha_v, ALPHA_MIN)
    if kind == GGX:
        return ggx.evaluate_schlick(wo, wi, normal_reflectance(surface.eta), alpha_u, alpha_v)
    if kind == PHONG:
        return phong.evaluate(wo, wi, alpha_u)
    if kind == WARD:
        return ward.evaluate(wo, wi, alpha_u, alpha_v, surface.more[NORMALISATION])
    return cook_torrance.evaluate(wo, wi, normal_reflectance(surface.eta), alpha_u, alpha_v)


@njit(cache=True, error_model="numpy")
def _lobe_pdf(kind, wo, wi, alpha_u, alpha_v):
    alpha_u, alpha_v = max(alpha_u, ALPHA_MIN), max(alpha_v, ALPHA_MIN)
    if kind == GGX:
        return ggx.pdf(wo, wi, alpha_u, alpha_v)
    if kind == PHONG:
        return phong.pdf(wo, wi, alpha_u)
    if kind == WARD:
        return ward.pdf(wo, wi, alpha_u, alpha_v)
    return cook_torrance.pdf(wo, wi, alpha_u, alpha_v)


@njit(cache=True, error_model="numpy")
def evaluate(surface, wo, wi):
    """Return the BRDF per channel; both directions above the surface."""
    more = surface.more
    lobe = 0.0
    if surface.specular_scale > 0.0:
        lobe = surface.specular_scale * _lobe(surface, wo, wi, surface.alpha_u, surface.alpha_v)
    if more[SECOND_SCALE] > 0.0:
        lobe += more[SECOND_SCALE] * _lobe(surface, wo, wi, more[SECOND_ALPHA_U], more[SECOND_ALPHA_V])
    return (
        surface.albedo_r * INV_PI + lobe * more[TINT],
        surface.albedo_g * INV_PI + lobe * more[TINT + 1],
        surface.albedo_b * INV_PI + lobe * more[TINT + 2],
    )


@njit(cache=True, error_model="numpy")
def shares(surface, cos_o):
    """Return the probabilities of the first and of the second lobe; the rest is diffuse."""
    more = surface.more
    level = (more[TINT] + more[TINT + 1] + more[TINT + 2]) / 3.0
    if surface.kind == GGX or surface.kind == COOK_TORRANCE:
        level *= schlick(cos_o, normal_reflectance(surface.eta))
    one, two = surface.specular_scale * level, more[SECOND_SCALE] * level
    total = one + two + (surface.albedo_r + surface.albedo_g + surface.albedo_b) / 3.0
    return (one / total, two / total) if total > 0.0 else (0.0, 0.0)


@njit(cache=True, error_model="numpy")
def pdf(surface, wo, wi):
    """Return the density of `sample` per solid angle."""
    more = surface.more
    one, two = shares(surface, wo[2])
    density = one * _lobe_pdf(surface.kind, wo, wi, surface.alpha_u, surface.alpha_v) + (1.0 - one - two) * pdf_cosine(wi)
    if two > 0.0:
        density += two * _lobe_pdf(surface.kind, wo, wi, more[SECOND_ALPHA_U], more[SECOND_ALPHA_V])
    return density


@njit(cache=True, error_model="numpy")
def sample(surface, wo, u0, u1, u2):
    """Return a direction; it may point below the surface, where the BRDF is black."""
    more = surface.more
    one, two = shares(surface, wo[2])
    alpha_u, alpha_v = surface.alpha_u, surface.alpha_v
    if u2 >= one:
        if u2 >= one + two:
            return sample_cosine(u0, u1)
        alpha_u, alpha_v = more[SECOND_ALPHA_U], more[SECOND_ALPHA_V]
    alpha_u, alpha_v = max(alpha_u, ALPHA_MIN), max(alpha_v, ALPHA_MIN)
    kind = surface.kind
    if kind == GGX:
        return ggx.sample(wo, alpha_u, alpha_v, u0, u1)
    if kind == PHONG:
        return phong.sample(wo, alpha_u, u0, u1)
    if kind == WARD:
        return ward.sample(wo, alpha_u, alpha_v, u0, u1)
    return cook_torrance.sample(wo, alpha_u, alpha_v, u0, u1)
