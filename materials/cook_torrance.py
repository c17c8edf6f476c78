"""Cook and Torrance's gloss with the anisotropic facets of Ashikhmin and Shirley: the thesis's best model (5.3).

References
----------
Cook, R. L. and Torrance, K. E. (1982), A reflectance model for computer graphics. Ashikhmin, M. and Shirley, P. (2000), An
anisotropic Phong BRDF model. Walter, B. et al. (2007), Microfacet models for refraction through rough surfaces.
"""

from __future__ import annotations

from .gloss import Tail, gloss
from .kernels.kinds import COOK_TORRANCE, Surface
from .scattering import RGB


def surface(
    albedo: RGB,
    alpha: float,
    *,
    alpha_v: float | None = None,
    eta: float = 1.5,
    specular_scale: float = 1.0,
    tint: RGB = (1.0, 1.0, 1.0),
    tail: Tail | None = None,
) -> Surface:
    """Return albedo / pi + specular_scale F D G / (4 cos_o cos_i).

    Parameters
    ----------
    albedo : (3,) float
        Of the diffuse part, in [0, 1].
    alpha, alpha_v : float
        Widths along and across, in (0, 1]; exponents n = 2 / alpha**2 - 2 of the facets' distribution.
    eta : float
        Refractive index for Schlick's F, at least 1.
    specular_scale : float
        Factor of the lobe.
    tint : (3,) float
        Colour of the lobe.
    tail : Tail, optional
        A second lobe.

    Notes
    -----
    D is normalised by its projected area. G is Smith's, separable, from a table of the facets' projected area (round facets;
    at unequal widths that along the azimuth of the direction): Ashikhmin and Shirley's own denominator is no shadowing, and
    that of Beckmann's facets makes light. Single scattering: rough lobes lose some.
    """
    return gloss(COOK_TORRANCE, albedo, alpha, alpha_v, specular_scale, eta, tint, tail)
