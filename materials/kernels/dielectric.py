"""A dielectric interface that light passes: smooth, or rough after Walter et al. (2007).

Both sides: wo below the surface sees the world upside down, with the index inverted. Weights are for radiance, which
is compressed on entering the denser side: light that is refracted from wi to wo carries (n_o / n_i)^2, n_o the index
on the viewer's side. A path that goes in and comes out again keeps the factor 1.
"""

from numba import njit

from .frames import dot, normalize, reflect, refract
from .fresnel import dielectric
from .ggx import evaluate_exact
from .microfacet import g2_correlated, g2_separable, ggx_d, pdf_visible, sample_visible, smith_lambda


@njit(cache=True, error_model="numpy")
def sample_smooth(wo, eta, u):
    """Return wi, the weight, and the probability of the branch taken: reflected with probability F, else refracted."""
    side = 1.0 if wo[2] >= 0.0 else -1.0
    ratio = eta if side > 0.0 else 1.0 / eta
    f = dielectric(abs(wo[2]), ratio)
    if u < f:
        return (-wo[0], -wo[1], wo[2]), 1.0, f
    wi, _ = refract(wo, (0.0, 0.0, side), ratio)
    return wi, 1.0 / (ratio * ratio), 1.0 - f


@njit(cache=True, error_model="numpy")
def _transmission_half(wo, wi, ratio):
    """Return the microfacet normal, above the surface, that bends wo (above) into wi (below)."""
    h = normalize((-wo[0] - ratio * wi[0], -wo[1] - ratio * wi[1], -wo[2] - ratio * wi[2]))
    return h if h[2] > 0.0 else (-h[0], -h[1], -h[2])


@njit(cache=True, error_model="numpy")
def evaluate_rough(wo, wi, eta, alpha_u, alpha_v):
    """Return the BSDF without the cosine (Walter et al. 2007, eqs. 20 and 21), for radiance."""
    ratio = eta
    if wo[2] < 0.0:
        wo, wi, ratio = (wo[0], wo[1], -wo[2]), (wi[0], wi[1], -wi[2]), 1.0 / eta
    if wo[2] == 0.0 or wi[2] == 0.0:
        return 0.0
    if wi[2] > 0.0:
        return evaluate_exact(wo, wi, ratio, alpha_u, alpha_v)
    h = _transmission_half(wo, wi, ratio)
    c_o, c_i = dot(wo, h), dot(wi, h)
    if c_o <= 0.0 or c_i >= 0.0:
        return 0.0
    s = c_o + ratio * c_i
    if s == 0.0:
        return 0.0
    t = (1.0 - dielectric(c_o, ratio)) * ggx_d(h, alpha_u, alpha_v) * g2_separable(wo, wi, alpha_u, alpha_v)
    return t * c_o * c_i / (wo[2] * wi[2] * s * s)


@njit(cache=True, error_model="numpy")
def pdf_rough(wo, wi, eta, alpha_u, alpha_v):
    """Return the density of `sample_rough` per solid angle of wi."""
    ratio = eta
    if wo[2] < 0.0:
        wo, wi, ratio = (wo[0], wo[1], -wo[2]), (wi[0], wi[1], -wi[2]), 1.0 / eta
    if wo[2] == 0.0 or wi[2] == 0.0:
        return 0.0
    if wi[2] > 0.0:
        h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
        c_o = dot(wo, h)
        return dielectric(c_o, ratio) * pdf_visible(wo, h, alpha_u, alpha_v) / (4.0 * c_o)
    h = _transmission_half(wo, wi, ratio)
    c_o, c_i = dot(wo, h), dot(wi, h)
    if c_o <= 0.0 or c_i >= 0.0:
        return 0.0
    s = c_o + ratio * c_i
    if s == 0.0:
        return 0.0
    return (1.0 - dielectric(c_o, ratio)) * pdf_visible(wo, h, alpha_u, alpha_v) * ratio * ratio * -c_i / (s * s)


@njit(cache=True, error_model="numpy")
def sample_rough(wo, eta, alpha_u, alpha_v, u0, u1, u2):
    """Return wi and its weight f |cos| / pdf; the weight is 0 where the microfacet sends light to the wrong side."""
    side = 1.0
    ratio = eta
    if wo[2] < 0.0:
        side, wo, ratio = -1.0, (wo[0], wo[1], -wo[2]), 1.0 / eta
    h = sample_visible(wo, alpha_u, alpha_v, u0, u1)
    lambda_o = smith_lambda(wo, alpha_u, alpha_v)
    if u2 < dielectric(dot(wo, h), ratio):
        wi = reflect(wo, h)
        if wi[2] <= 0.0:
            return (wi[0], wi[1], side * wi[2]), 0.0
        weight = g2_correlated(wo, wi, alpha_u, alpha_v) * (1.0 + lambda_o)
    else:
        wi, _ = refract(wo, h, ratio)
        if wi[2] >= 0.0:
            return (wi[0], wi[1], side * wi[2]), 0.0
        weight = g2_separable(wo, wi, alpha_u, alpha_v) * (1.0 + lambda_o) / (ratio * ratio)
    return (wi[0], wi[1], side * wi[2]), weight
