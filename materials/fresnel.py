"""What an interface reflects: exact for dielectrics and metals, Schlick's, and averages over diffuse light.

References
----------
Born, M. and Wolf, E., Principles of Optics, ch. 1.5 and 14.2. Schlick, C. (1994), An inexpensive BRDF model for
physically-based rendering. Walsh, J. W. T. (1926), as given by Duntley, S. Q. (1942), The optical properties of diffusing
materials.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range
from .kernels import arrays as kernel

Floats = NDArray[np.float64]


def dielectric(cos_i: ArrayLike, eta: ArrayLike) -> Floats:
    """Return the reflectance for unpolarised light; 1 beyond the critical angle.

    Parameters
    ----------
    cos_i : (...) float
        Cosine of incidence, in [0, 1].
    eta : (...) float
        Index behind the interface over the index before it.

    Examples
    --------
    >>> float(dielectric(1.0, 1.5).round(12))
    0.04
    """
    check_range("cos_i", cos_i, "[0, 1]")
    check_range("eta", eta, "(0, inf)")
    (c, e), shape = _flat(cos_i, eta)
    return kernel.dielectric(c, e).reshape(shape)


def schlick(cos_i: ArrayLike, eta: ArrayLike) -> Floats:
    """Return Schlick's approximation, F0 + (1 - F0)(1 - cos)^5, F0 = ((eta - 1) / (eta + 1))^2; knows no critical angle."""
    check_range("cos_i", cos_i, "[0, 1]")
    f0 = normal_reflectance(eta)
    return f0 + (1 - f0) * (1 - np.asarray(cos_i, dtype=np.float64)) ** 5


def normal_reflectance(eta: ArrayLike) -> Floats:
    """Return the reflectance at normal incidence, ((eta - 1) / (eta + 1))^2."""
    check_range("eta", eta, "(0, inf)")
    e = np.asarray(eta, dtype=np.float64)
    return ((e - 1) / (e + 1)) ** 2


def conductor(cos_i: ArrayLike, eta: ArrayLike, k: ArrayLike) -> Floats:
    """Return the reflectance of a metal of index eta + ik for unpolarised light.

    Parameters
    ----------
    cos_i : (...) float
        Cosine of incidence, in [0, 1].
    eta, k : (...) float
        Refractive index and extinction coefficient, relative to the medium before the metal.

    Examples
    --------
    >>> float(conductor(1.0, 0.2, 3.9).round(3))  # silver, green
    0.952
    """
    check_range("cos_i", cos_i, "[0, 1]")
    check_range("eta", eta, "(0, inf)")
    check_range("k", k, "[0, inf)")
    (c, e, x), shape = _flat(cos_i, eta, k)
    return kernel.conductor(c, e, x).reshape(shape)


def diffuse_internal(eta: ArrayLike, tau: ArrayLike = 0.0) -> Floats:
    """Return the share of diffuse light from inside that an interface sends back inside.

    Parameters
    ----------
    eta : (...) float
        Index inside over outside, in [1, 3].
    tau : (...) float
        Optical depth of the layer below the interface, crossed up and down; not negative.

    Notes
    -----
    In closed form without absorption, within 1e-4 with.

    Examples
    --------
    >>> float(diffuse_internal(1.33).round(3))
    0.472
    """
    check_range("eta", eta, "[1, 3]")
    check_range("tau", tau, "[0, inf)")
    (e, t), shape = _flat(eta, tau)
    return kernel.diffuse_internal(e, t).reshape(shape)


def diffuse_external(eta: ArrayLike) -> Floats:
    """Return the share of diffuse light from outside that an interface reflects, eta in [1, 3]."""
    e = np.asarray(eta, dtype=np.float64)
    return 1 - e * e * (1 - diffuse_internal(e))  # etendue is kept


def _flat(*values: ArrayLike) -> tuple[list[Floats], tuple[int, ...]]:
    arrays = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in values))
    return [np.ascontiguousarray(a).reshape(-1) for a in arrays], arrays[0].shape
