"""Phong's gloss, physically plausible: a cosine lobe about the mirror direction.

References
----------
Lafortune, E. P. and Willems, Y. D. (1994), Using the modified Phong reflectance model for physically based rendering.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range
from .gloss import Tail, gloss
from .kernels.kinds import PHONG, Surface
from .scattering import RGB


def surface(
    albedo: RGB, alpha: float, *, specular_scale: float = 0.1, tint: RGB = (1.0, 1.0, 1.0), tail: Tail | None = None
) -> Surface:
    """Return albedo / pi + specular_scale (n + 2) / 2 pi cos^n, the cosine to the mirror direction.

    Parameters
    ----------
    albedo : (3,) float
        Of the diffuse part, in [0, 1].
    alpha : float
        Width, in (0, 1]; the exponent is n = 2 / alpha**2 - 2, see `alpha_of_exponent`.
    specular_scale : float
        Albedo of the lobe seen upright; at grazing it falls like the cosine. No more than 1 - albedo keeps energy.
    tint : (3,) float
        Colour of the lobe.
    tail : Tail, optional
        A second lobe.

    Notes
    -----
    No Fresnel. Eq. 2.11 of the thesis puts this normalisation on the half vector, where the albedo reaches 3.9; that form
    is for fits only (`kernels.phong.evaluate_half`).
    """
    return gloss(PHONG, albedo, alpha, None, specular_scale, 1.5, tint, tail)


def alpha_of_exponent(exponent: ArrayLike) -> NDArray[np.float64]:
    """Return the width in (0, 1] that stands for an exponent of 0 or more.

    Examples
    --------
    >>> alpha_of_exponent([6.0, 198.0])
    array([0.5, 0.1])
    """
    check_range("exponent", exponent, "[0, inf)")
    return np.sqrt(2 / (np.asarray(exponent, dtype=np.float64) + 2))
