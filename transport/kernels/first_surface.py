"""What the surface that the camera sees makes of light: its colour, and its specular lobes apart from its matte part."""

from materials.kernels import bsdf
from materials.kernels.fresnel import conductor
from materials.kernels.kinds import (
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
    TABULATED,
    Surface,
)
from materials.kernels.lambert import INV_PI
from materials.kernels.lean import lean
from materials.kernels.lobes import is_lobed

_BLACK = (0.0, 0.0, 0.0)


@lean(error_model="numpy")
def base_colour(surface):
    """Return a colour that does not depend on the view: the matte part's albedo, or where there is none the mirror's.

    A metal's is its reflectance at normal incidence, glass is white (it loses nothing), what glows is black.
    """
    kind = surface.kind
    if kind == EMISSION:
        return _BLACK
    if kind in (DIELECTRIC, ROUGH_DIELECTRIC):
        return (1.0, 1.0, 1.0)
    if kind == CONDUCTOR:
        more, scale = surface.more, surface.specular_scale
        return (
            scale * conductor(1.0, more[METAL_ETA], more[METAL_K]),
            scale * conductor(1.0, more[METAL_ETA + 1], more[METAL_K + 1]),
            scale * conductor(1.0, more[METAL_ETA + 2], more[METAL_K + 2]),
        )
    return (surface.albedo_r, surface.albedo_g, surface.albedo_b)


@lean()
def without_diffuse(x):
    """Return a surface with its specular lobes alone."""
    r, g, b, more = 0.0, 0.0, 0.0, x.more
    if x.kind == DISNEY:
        # The base colour also tints the lobes of a metal.
        r, g, b = x.albedo_r, x.albedo_g, x.albedo_b
        more = (more[0], more[1], more[2], more[3], more[4], more[5], more[6], more[7], more[8], 0.0)
    scale, film, eta = x.specular_scale, x.film_alpha, x.film_eta
    return Surface(x.kind, r, g, b, scale, x.eta, x.alpha_u, x.alpha_v, eta, film, x.tau_r, x.tau_g, x.tau_b, more)


@lean(error_model="numpy")
def specular_part(surface, wo, wi, f):
    """Return what the specular lobes have in `f`, the value of `bsdf.evaluate` for the same directions."""
    kind = surface.kind
    if kind in (LAMBERT, OREN_NAYAR, TABULATED):  # a measurement does not say what of it is specular
        return _BLACK
    if kind in (CONDUCTOR, MIRROR, DIELECTRIC, ROUGH_DIELECTRIC):
        return f
    if is_lobed(kind):
        # The rest of albedo / pi: a subtraction instead of a second evaluation.
        return (
            max(f[0] - surface.albedo_r * INV_PI, 0.0),
            max(f[1] - surface.albedo_g * INV_PI, 0.0),
            max(f[2] - surface.albedo_b * INV_PI, 0.0),
        )
    return bsdf.evaluate(without_diffuse(surface), wo, wi)


@lean(error_model="numpy")
def specular_share(surface, wo, wi, weight, pdf):
    """Return the specular lobes' share of f per channel, in [0, 1], from a sample's weight f cos / pdf; 0 where f is."""
    if pdf <= 0.0 or wi[2] == 0.0:
        return _BLACK
    scale = pdf / abs(wi[2])
    f = (weight[0] * scale, weight[1] * scale, weight[2] * scale)
    part = specular_part(surface, wo, wi, f)
    return (
        min(part[0] / f[0], 1.0) if f[0] > 0.0 else 0.0,
        min(part[1] / f[1], 1.0) if f[1] > 0.0 else 0.0,
        min(part[2] / f[2], 1.0) if f[2] > 0.0 else 0.0,
    )
