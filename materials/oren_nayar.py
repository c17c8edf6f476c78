"""Rough matte surfaces, which look flat where Lambert's fall off, and brighten towards the light.

References
----------
Oren, M. and Nayar, S. K. (1994), Generalization of Lambert's reflectance model, SIGGRAPH, eq. 30 (the "qualitative" model).
"""

from __future__ import annotations

from .foundation.checks import check_range
from .kernels.kinds import OREN_NAYAR, PLAIN, Surface
from .lambert import surface as lambert_surface
from .scattering import RGB


def surface(albedo: RGB, sigma: float) -> Surface:
    """Return the qualitative model of Oren and Nayar.

    Parameters
    ----------
    albedo : (3,) float
        Of the facets, in [0, 1].
    sigma : float
        Standard deviation of the facets' slope angle [rad], in [0, pi / 2]; 0 is Lambert.

    Notes
    -----
    Light between facets is left out, so rough surfaces reflect less than `albedo`; and the model's coefficients are a fit:
    a white surface with sigma near 0.2 reflects up to 1.5 % too much at grazing.

    Examples
    --------
    >>> surface((0.2, 0.2, 0.2), 0.3).more[0]
    0.3
    """
    check_range("sigma", sigma, "[0, 1.5708]")
    return lambert_surface(albedo)._replace(kind=OREN_NAYAR, more=(float(sigma), *PLAIN[1:]))
