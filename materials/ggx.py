"""Matte and gloss: Lambert plus a GGX lobe, isotropic or brushed."""

from __future__ import annotations

from .gloss import Tail, gloss
from .kernels.kinds import GGX, Surface
from .scattering import RGB


def surface(
    albedo: RGB,
    alpha: float,
    *,
    eta: float = 1.5,
    specular_scale: float = 1.0,
    alpha_v: float | None = None,
    tint: RGB = (1.0, 1.0, 1.0),
    tail: Tail | None = None,
) -> Surface:
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
    tint : (3,) float
        Colour of the lobe.
    tail : Tail, optional
        A second lobe.

    Notes
    -----
    Height-correlated Smith shadowing (Heitz 2014), single scattering. As the diffuse part is not reduced, a bright
    albedo with a strong lobe can reflect more than it receives; `water_film.coated` cannot.

    Examples
    --------
    >>> surface((0.1, 0.1, 0.1), 0.25).alpha_v
    0.25
    """
    return gloss(GGX, albedo, alpha, alpha_v, specular_scale, eta, tint, tail)
