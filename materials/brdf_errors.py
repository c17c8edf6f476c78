"""How far a fitted BRDF is from a measured one, in the measures of the field.

References
----------
Ngan et al. (2005), Experimental Analysis of BRDF Models (cosine-weighted). Löw et al. (2012), BRDF Models for Accurate and
Efficient Rendering of Glossy Surfaces (logarithm). Bieron and Peers (2020), An Adaptive BRDF Fitting Metric (cube root).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .foundation.errors import InputError

Floats = NDArray[np.float64]
MEASURES = {
    "rms": "root mean square of the cosine-weighted residual, cos θi (f̂ − f) [1/sr]",
    "relative": "the same over the root mean square of cos θi f",
    "log": "root mean square of log(1 + cos θi f̂) − log(1 + cos θi f)",
    "cube root": "root mean square of the difference of cube roots of cos θi f [sr^(-1/3)]",
}


def brdf_errors(fitted: NDArray, measured: NDArray, cos_i: NDArray, weight: NDArray | None = None) -> dict[str, float]:
    """Return each of `MEASURES` over samples.

    Parameters
    ----------
    fitted, measured : (N, C) float
        Reflectance without the cosine [1/sr].
    cos_i : (N,) float
        Cosine of the light on the surface.
    weight : (N,) float, optional
        Solid angles; by default all samples count alike.

    Raises
    ------
    InputError
        If shapes disagree.

    Examples
    --------
    >>> f = np.full((4, 3), 0.1)
    >>> brdf_errors(f, f, np.ones(4))["rms"]
    0.0
    """
    if fitted.shape != measured.shape or len(cos_i) != len(fitted):
        raise InputError(f"have shape {measured.shape}", got=fitted.shape, key="fitted")
    a, b = (np.maximum(np.asarray(f, np.float64) * cos_i[:, None], 0) for f in (fitted, measured))

    def rms(difference: Floats) -> float:
        per_sample = (difference**2).mean(axis=1)
        return float(np.sqrt(np.average(per_sample, weights=weight))) if len(per_sample) else float("nan")

    level = rms(b)
    return {
        "rms": rms(a - b),
        "relative": rms(a - b) / level if level > 0 else float("nan"),
        "log": rms(np.log1p(a) - np.log1p(b)),
        "cube root": rms(np.cbrt(a) - np.cbrt(b)),
    }
