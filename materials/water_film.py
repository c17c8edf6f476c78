"""Water on a surface: a film, its absorption, and what share of the ground it covers.

References
----------
Pope, R. M. and Fry, E. S. (1997), Absorption spectrum (380-700 nm) of pure water, Applied Optics 36, 8710, table 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range
from .kernels.kinds import COATED, Surface
from .lambert import surface as lambert_surface
from .scattering import RGB, check_albedo

ETA_WATER = 1.33
SIGMA_A_WATER: RGB = (0.264, 0.0565, 0.0101)
"""Absorption of pure water [1/m] at 610, 550 and 465 nm, near the dominant wavelengths of the Rec. 709 primaries
(Pope and Fry 1997). Street water is murkier, mostly by scattering, which a film does not model."""


def optical_depth(thickness: ArrayLike, sigma_a: RGB = SIGMA_A_WATER) -> NDArray[np.float64]:
    """Return tau of one vertical crossing per channel.

    Parameters
    ----------
    thickness : (...) float
        Depth of the water [m].
    sigma_a : (3,) float
        Absorption [1/m].

    Returns
    -------
    tau : (..., 3) float

    Examples
    --------
    >>> optical_depth(0.1).round(3)
    array([0.026, 0.006, 0.001])
    """
    check_range("thickness", thickness, "[0, inf)")
    check_range("sigma_a", sigma_a, "[0, inf)")
    return np.asarray(thickness, dtype=np.float64)[..., None] * np.asarray(sigma_a, dtype=np.float64)


def coated(
    albedo: RGB,
    *,
    film_eta: float = ETA_WATER,
    film_alpha: float = 0.0,
    thickness: float = 0.0,
    sigma_a: RGB = SIGMA_A_WATER,
    specular_scale: float = 0.0,
    eta: float = 1.5,
    alpha: float = 0.3,
) -> Surface:
    """Return a base below a film, with all reflections between a matte base and the film's surface.

    Parameters
    ----------
    albedo : (3,) float
        Of the matte base, as it is inside the film (`wetness.diffuse_attenuation` dims pores; the film's own darkening
        by total internal reflection comes on top).
    film_eta : float
        Index of the film, in [1, 3].
    film_alpha : float
        GGX width of its surface, in [0, 1]; 0 is smooth.
    thickness : float
        [m]; only absorption depends on it.
    sigma_a : (3,) float
        Absorption [1/m].
    specular_scale, eta, alpha : float
        GGX lobe of the base: factor (0: none), index over air, width. Seen once through the film's surface.

    Notes
    -----
    f = T(cos_i) T(cos_o) / film_eta^2 x exp(-tau (1 / cos_ti + 1 / cos_to)) x albedo / pi / (1 - albedo Fdi(tau)),
    T = 1 - F with exact Fresnel F, cosines cos_t inside. Fdi(tau) is the share of diffuse light that the film's surface
    sends back, absorbed on both ways (within 1e-4). Clear, over a white base, nothing is lost. Neglected: refraction's
    sideways shift, and light of the base's specular lobe that the film's surface sends back inside.

    Examples
    --------
    >>> wet = coated((0.2, 0.2, 0.2), thickness=0.01)
    >>> round(wet.tau_r, 5)
    0.00264
    """
    check_albedo(albedo)
    check_range("film_eta", film_eta, "[1, 3]")
    check_range("film_alpha", film_alpha, "[0, 1]")
    check_range("specular_scale", specular_scale, "[0, inf)")
    check_range("eta", eta, "[1, inf)")
    check_range("alpha", alpha, "(0, 1]")
    tau_r, tau_g, tau_b = (float(t) for t in optical_depth(thickness, sigma_a))
    return lambert_surface(albedo)._replace(
        kind=COATED,
        film_eta=float(film_eta),
        film_alpha=float(film_alpha),
        tau_r=tau_r,
        tau_g=tau_g,
        tau_b=tau_b,
        specular_scale=float(specular_scale),
        eta=float(eta),
        alpha_u=float(alpha),
        alpha_v=float(alpha),
    )
