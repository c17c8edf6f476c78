"""About how much light a surface sends towards a viewer: cheap, for guiding decisions and for the albedo layer."""

import math

from numba import njit

from . import coated, disney, oren_nayar
from .fresnel import absorbed_ratio, conductor, normal_reflectance, schlick
from .kinds import (
    COATED,
    CONDUCTOR,
    COOK_TORRANCE,
    DIELECTRIC,
    DISNEY,
    GGX,
    LAMBERT,
    METAL_ETA,
    METAL_K,
    MIRROR,
    OREN_NAYAR,
    PHONG,
    ROUGH_DIELECTRIC,
    SECOND_ALPHA_U,
    SECOND_ALPHA_V,
    SECOND_SCALE,
    SIGMA,
    TINT,
)
from .lobes import is_lobed
from .rough_film import internal_reflectance


@njit(cache=True, error_model="numpy")
def _tilted(cos_o, alpha_u, alpha_v):
    """Return the cosine at which Fresnel counts: facets seen at grazing are tilted to the viewer, the more the rougher."""
    return cos_o + 0.25 * (alpha_u + alpha_v) * (1.0 - cos_o)


@njit(cache=True, error_model="numpy")
def _lobe(surface, cos_o, alpha_u, alpha_v):
    if surface.kind == GGX or surface.kind == COOK_TORRANCE:
        return schlick(_tilted(cos_o, alpha_u, alpha_v), normal_reflectance(surface.eta))
    return cos_o if surface.kind == PHONG else 1.0


@njit(cache=True, error_model="numpy")
def _lobed(surface, cos_o):
    more = surface.more
    lobe = surface.specular_scale * _lobe(surface, cos_o, surface.alpha_u, surface.alpha_v)
    lobe += more[SECOND_SCALE] * _lobe(surface, cos_o, more[SECOND_ALPHA_U], more[SECOND_ALPHA_V])
    return (
        surface.albedo_r + lobe * more[TINT],
        surface.albedo_g + lobe * more[TINT + 1],
        surface.albedo_b + lobe * more[TINT + 2],
    )


@njit(cache=True, error_model="numpy")
def _disney_channel(value, brightness, p, fade):
    lobe = disney.normal_specular(value, brightness, p)
    return p[disney.MATTE] * (1.0 - p[disney.METALLIC]) * value + lobe + (1.0 - lobe) * fade


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
    if is_lobed(kind):
        return _lobed(surface, cos_o)
    if kind == OREN_NAYAR:
        a = oren_nayar.albedo(cos_o, surface.more[SIGMA])
        return (surface.albedo_r * a, surface.albedo_g * a, surface.albedo_b * a)
    if kind == CONDUCTOR:
        more, scale, c = surface.more, surface.specular_scale, _tilted(cos_o, surface.alpha_u, surface.alpha_v)
        return (
            scale * conductor(c, more[METAL_ETA], more[METAL_K]),
            scale * conductor(c, more[METAL_ETA + 1], more[METAL_K + 1]),
            scale * conductor(c, more[METAL_ETA + 2], more[METAL_K + 2]),
        )
    if kind == DISNEY:
        brightness = disney.luminance(surface.albedo_r, surface.albedo_g, surface.albedo_b)
        fade = schlick(_tilted(cos_o, surface.alpha_u, surface.alpha_v), 0.0)
        return (
            _disney_channel(surface.albedo_r, brightness, surface.more, fade),
            _disney_channel(surface.albedo_g, brightness, surface.more, fade),
            _disney_channel(surface.albedo_b, brightness, surface.more, fade),
        )
    if kind == COATED:
        eta = surface.film_eta
        f, _, lobe = coated.lobe_weights(cos_o, 0.0, surface.specular_scale, surface.eta, eta, surface.film_alpha)
        inner = internal_reflectance(eta, surface.film_alpha)
        return (
            _coated_albedo(eta, surface.albedo_r, surface.tau_r, inner, f, lobe),
            _coated_albedo(eta, surface.albedo_g, surface.tau_g, inner, f, lobe),
            _coated_albedo(eta, surface.albedo_b, surface.tau_b, inner, f, lobe),
        )
    return (0.0, 0.0, 0.0)
