"""Matte and gloss: Lambert plus a GGX lobe, isotropic or brushed."""

from __future__ import annotations

from .foundation.checks import check_range
from .kernels.bsdf import GGX, Surface
from .lambert import surface as lambert_surface
from .scattering import RGB, check_albedo


def surface(albedo: RGB, alpha: float, *, eta: float = 1.5, specular_scale: float = 1.0, alpha_v: float | None = None) -> Surface:
    """Return Lambert (not reduced by the lobe) + specular_scale x GGX, Schlick's Fresnel from eta.

    Parameters
    ----------
    albedo : (3,) float
        Of the diffuse part, in [0, 1].
    alpha : float
        GGX width, in (0, 1]; `roughness**2`. Along u if `alpha_v` is given.
    eta : float
        Refractive index, at least 1.
    specular_scale : float
        Factor of the lobe, not negative.
    alpha_v : float, optional
        Width across, for anisotropic surfaces.

    Notes
    -----
    Height-correlated Smith shadowing (Heitz 2014), single scattering. As the diffuse part is not reduced, a bright
    albedo with a strong lobe can reflect more than it receives; `water_film.coated` cannot.

    Examples
    --------
    >>> surface((0.1, 0.1, 0.1), 0.25).alpha_v
    0.25
    """
    check_albedo(albedo)
    check_range("alpha", alpha, "(0, 1]")
    across = alpha if alpha_v is None else alpha_v
    check_range("alpha_v", across, "(0, 1]")
    check_range("eta", eta, "[1, inf)")
    check_range("specular_scale", specular_scale, "[0, inf)")
    return lambert_surface(albedo)._replace(
        kind=GGX, specular_scale=float(specular_scale), eta=float(eta), alpha_u=float(alpha), alpha_v=float(across)
    )
