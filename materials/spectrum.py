"""Spectra of reflectance to linear Rec. 709 colour.

References
----------
Wyman, Sloan and Shirley (2013), Simple Analytic Approximations to the CIE XYZ Color Matching Functions. ITU-R BT.709.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range
from .foundation.errors import InputError

Floats = NDArray[np.float64]
# Amplitude, centre [nm], widths below and above it [nm], of x, y and z.
_LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
_RGB_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def matching_functions(wavelength_nm: ArrayLike) -> Floats:
    """Return the CIE 1931 colour matching functions (..., 3) at some wavelengths [nm]; their analytic fit, 1 % off at most."""
    w = np.asarray(wavelength_nm, np.float64)
    out = np.zeros((*w.shape, 3))
    for c, lobes in enumerate(_LOBES):
        for amplitude, centre, below, above in lobes:
            out[..., c] += amplitude * np.exp(-0.5 * ((w - centre) / np.where(w < centre, below, above)) ** 2)
    return out


def rgb_weights(wavelengths_nm: ArrayLike) -> Floats:
    """Return the matrix (K, 3) that turns a reflectance at K wavelengths into linear Rec. 709 RGB.

    Parameters
    ----------
    wavelengths_nm : (K,) float
        Rising [nm]; the reflectance is taken to be linear between them and constant beyond.

    Returns
    -------
    weights : (K, 3) float64
        Columns of sum 1: the light is such that a flat spectrum is grey of the same level.

    Raises
    ------
    InputError
        If wavelengths do not rise, or none lies in the visible range of 380 to 780 nm.

    Examples
    --------
    >>> bool(np.allclose(np.full(31, 0.4) @ rgb_weights(np.linspace(400, 700, 31)), 0.4))
    True
    """
    w = np.asarray(wavelengths_nm, np.float64).reshape(-1)
    check_range("wavelengths", w, "(0, inf)")
    if (np.diff(w) <= 0).any():
        raise InputError("rise", got=w.tolist(), key="wavelengths")
    if not ((w >= 380) & (w <= 780)).any():
        raise InputError("reach into 380 to 780 nm", got=f"{w[0]:g} to {w[-1]:g} nm", key="wavelengths")
    fine = np.arange(380.0, 781.0)
    rgb = matching_functions(fine) @ _RGB_FROM_XYZ.T
    rgb /= rgb.sum(axis=0)
    hats = np.stack([np.interp(fine, w, row) for row in np.eye(len(w))])
    return hats @ rgb


def wavelengths_of(channels: tuple[str, ...]) -> Floats | None:
    """Return the wavelengths [nm] of channels named like `550 nm`, or None if they are not."""
    try:
        return np.array([float(name.removesuffix(" nm")) for name in channels if name.endswith(" nm")] or [float("nan")])
    except ValueError:
        return None
