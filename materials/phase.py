"""How particles in the air scatter: Henyey-Greenstein, and water droplets of fog, mist and spray.

Directions are those of travel: a phase function depends on the angle theta by which light turns in one collision.

References
----------
henyey1941, draine2003, jendersie2023 in docs/references.bib.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_finite, check_range, check_shape, check_unit
from .kernels import phase as kernel
from .kernels.phase import Phase

__all__ = ["Phase", "droplets", "evaluate", "henyey_greenstein", "mean_cosine", "sample"]

Floats = NDArray[np.float64]


def henyey_greenstein(g: float) -> Phase:
    """Return the phase function of Henyey and Greenstein (1941).

    Parameters
    ----------
    g : float
        Mean of cos(theta), in (-1, 1); 0 is isotropic, positive is forward.

    Examples
    --------
    >>> isotropic = henyey_greenstein(0.0)
    >>> np.allclose(evaluate(isotropic, 0.3) * 4 * np.pi, 1)
    True
    """
    check_range("g", g, "(-1, 1)")
    return Phase(float(g), 0.0, 0.5, 0.0)


def droplets(diameter_um: float) -> Phase:
    """Return the phase function of water droplets in air: Jendersie and d'Eon's fit to Mie's (2023).

    A Henyey-Greenstein peak blended with Draine's function; four parameters depend on the diameter.

    Parameters
    ----------
    diameter_um : float
        Mean diameter of the droplets [micrometres], in [5, 50]: mist and fog. Coarse spray is larger; its forward peak is
        narrower still.

    Notes
    -----
    The fit leaves out the innermost diffraction peak (the authors quote 95 % of Mie's density matched), the glory and the
    fog bow, whose colours come from the wavelength: this is one density for all channels. Absorption is not part of it;
    that of water droplets is below 1e-4 per collision in the visible.

    Examples
    --------
    >>> round(mean_cosine(droplets(10.0)), 2)
    0.86
    """
    check_range("diameter_um", diameter_um, "[5, 50]")
    d = float(diameter_um)
    return Phase(
        g=math.exp(-0.0990567 / (d - 1.67154)),
        weight=math.exp(-0.599085 / (d - 0.641583) - 0.665888),
        g_draine=math.exp(-2.20679 / (d + 3.91029) - 0.428934),
        alpha_draine=math.exp(3.62489 - 8.29288 / (d + 5.52825)),
    )


def evaluate(phase: Phase, cos_theta: ArrayLike) -> Floats:
    """Return the density of light turning by an angle in one collision.

    Parameters
    ----------
    phase : Phase
    cos_theta : (...) float
        Cosine between travel before and after, in [-1, 1]; 1 is straight on.

    Returns
    -------
    density : (...) float
        Over the sphere [1/sr].
    """
    check_range("cos_theta", cos_theta, "[-1, 1]")
    values = np.asarray(cos_theta, np.float64)
    out = np.empty(values.size)
    kernel.evaluate_many(phase, values.ravel(), out)
    return out.reshape(values.shape)


def sample(phase: Phase, direction: ArrayLike, xi: ArrayLike) -> Floats:
    """Return directions of travel after a collision, drawn with the density that `evaluate` states.

    Parameters
    ----------
    phase : Phase
    direction : (3,) float
        Unit direction of travel before.
    xi : (N, 2) float
        Uniform variates in [0, 1).

    Returns
    -------
    directions : (N, 3) float64
    """
    d, u = np.asarray(direction, np.float64), np.ascontiguousarray(xi, np.float64)
    check_shape("direction", d, (3,))
    check_unit("direction", d)
    check_shape("xi", u, (None, 2))
    check_finite("xi", u)
    check_range("xi", u, "[0, 1)")
    out = np.empty((len(u), 3))
    kernel.sample_many(phase, d, u, out)
    return out


def mean_cosine(phase: Phase) -> float:
    """Return the mean of cos(theta) in closed form; Draine's part by Draine (2003), eq 5."""
    g, a = phase.g_draine, phase.alpha_draine
    of_draine = g * (1 + a * (3 + 2 * g * g) / 5) / (1 + a * (1 + 2 * g * g) / 3)
    return (1 - phase.weight) * phase.g + phase.weight * of_draine
