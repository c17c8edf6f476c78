"""One specular bounce off microfacets: D G2 F / (4 cos_i cos_o), with exact or Schlick's Fresnel."""

from numba import njit

from .frames import dot, normalize, reflect
from .fresnel import dielectric, schlick
from .microfacet import ggx_d, pdf_reflected, sample_visible, visibility


@njit(cache=True)
def half_vector(wo, wi):
    """Return the unit vector half-way between two directions above the surface."""
    return normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))


@njit(cache=True)
def facets(wo, wi, h, alpha_u, alpha_v):
    """Return the lobe of perfect mirrors, D G2 / (4 cos_i cos_o); both directions above the surface."""
    return ggx_d(h, alpha_u, alpha_v) * visibility(wo, wi, alpha_u, alpha_v)


@njit(cache=True)
def evaluate_schlick(wo, wi, f0, alpha_u, alpha_v):
    """Return the lobe with Schlick's Fresnel; both directions above the surface."""
    h = half_vector(wo, wi)
    return facets(wo, wi, h, alpha_u, alpha_v) * schlick(dot(wo, h), f0)


@njit(cache=True)
def evaluate_exact(wo, wi, eta, alpha_u, alpha_v):
    """Return the lobe with the exact Fresnel reflectance of a dielectric."""
    h = half_vector(wo, wi)
    return facets(wo, wi, h, alpha_u, alpha_v) * dielectric(dot(wo, h), eta)


@njit(cache=True)
def pdf(wo, wi, alpha_u, alpha_v):
    """Return the density of `sample` per solid angle of wi."""
    return pdf_reflected(wo, half_vector(wo, wi), alpha_u, alpha_v)


@njit(cache=True)
def sample(wo, alpha_u, alpha_v, u0, u1):
    """Return wo mirrored about a visible normal; it may point below the surface, where the lobe is black."""
    return reflect(wo, sample_visible(wo, alpha_u, alpha_v, u0, u1))
