"""A water film or varnish: a dielectric interface over a base that lies inside it, with absorption in between.

Radiance through the interface from wi to wo carries T(cos_i) T(cos_o) / film_eta^2, T = 1 - F, and exp(-tau / cos) on
each crossing, cos inside. Over a Lambertian base the light that the interface sends back inside is a geometric series,
summed in closed form: a / pi / (1 - a Fdi(tau)). Over a base with a specular lobe the lobe is seen once through the
interface; light of the lobe that the interface sends back inside is neglected (it is lost). A rough interface
(film_alpha > 0) adds its own lobe and lets through what `rough_film` says; light inside is bent as by a smooth one.
"""

import math

from numba import njit

from .fresnel import absorbed_ratio, normal_reflectance, schlick
from .ggx import evaluate_schlick
from .ggx import pdf as ggx_pdf
from .ggx import sample as ggx_sample
from .lambert import INV_PI
from .rough_film import reflectance


@njit(cache=True, error_model="numpy")
def inside(w, film_eta):
    """Return the direction inside the film, leaving the base, that w above the film is bent into."""
    # z from the cosine, not from 1 - x^2 - y^2, which cancels where the film's index is near 1; and never 0
    z2 = (film_eta * film_eta - 1.0 + w[2] * w[2]) / (film_eta * film_eta)
    return (w[0] / film_eta, w[1] / film_eta, math.sqrt(max(z2, 1e-30)))


@njit(cache=True, error_model="numpy")
def diffuse_channel(albedo, film_eta, inner, tau, path):
    """Return the diffuse BRDF of one channel but for T T.

    inner is Fdi of the clear film, path is 1 / cos_i + 1 / cos_o inside it.
    """
    if albedo <= 0.0:
        return 0.0
    dimmed = 1.0
    if tau > 0.0:
        dimmed = math.exp(-tau * path)
        inner *= absorbed_ratio(film_eta, tau)
    return albedo * INV_PI * dimmed / (film_eta * film_eta * (1.0 - albedo * inner))


@njit(cache=True, error_model="numpy")
def base_lobe(wo_in, wi_in, eta, film_eta, alpha_u, alpha_v):
    """Return the specular lobe of the base, lit and seen from inside the film."""
    return evaluate_schlick(wo_in, wi_in, normal_reflectance(eta / film_eta), alpha_u, alpha_v)


@njit(cache=True, error_model="numpy")
def base_pdf(wo_in, wi_in, cos_i, film_eta, alpha_u, alpha_v):
    """Return the density of `base_sample` per solid angle outside: dw_in / dw = cos_i / (film_eta^2 cos_in)."""
    return ggx_pdf(wo_in, wi_in, alpha_u, alpha_v) * cos_i / (film_eta * film_eta * wi_in[2])


@njit(cache=True, error_model="numpy")
def base_sample(wo_in, film_eta, alpha_u, alpha_v, u0, u1):
    """Return a direction outside, reached by the base's lobe; z <= 0 where the light cannot leave the film."""
    wi_in = ggx_sample(wo_in, alpha_u, alpha_v, u0, u1)
    x, y = wi_in[0] * film_eta, wi_in[1] * film_eta
    z2 = 1.0 - x * x - y * y
    if wi_in[2] <= 0.0 or z2 <= 0.0:
        return (0.0, 0.0, -1.0)
    return (x, y, math.sqrt(z2))


@njit(cache=True, error_model="numpy")
def lobe_weights(cos_o, mean_albedo, specular_scale, eta, film_eta, film_alpha):
    """Return about how much light the interface, the diffuse base and the base's lobe send towards cos_o."""
    f = reflectance(cos_o, film_eta, film_alpha)
    through = (1.0 - f) * (1.0 - f)
    lobe = 0.0
    if specular_scale > 0.0:
        cos_in = math.sqrt(max(1.0 - (1.0 - cos_o * cos_o) / (film_eta * film_eta), 0.0))
        lobe = through * specular_scale * schlick(cos_in, normal_reflectance(eta / film_eta))
    return f, (1.0 - f) * mean_albedo, lobe
