"""Surface normals from photographs under many lights: least squares for matte surfaces, and a fit that knows gloss.

The idea of eq. 5.3 of the thesis (a diffuse term and a specular lobe about a free normal) for data with one viewing
direction, where a single cosine lobe says too little: per candidate normal, a dictionary of reflectances with coefficients
of at least 0 is fitted robustly, and the normal with the smallest misfit wins.

References
----------
Woodham (1980), Photometric Method for Determining Surface Orientation from Multiple Images. Hui and Sankaranarayanan (2017),
Shape and Spatially-Varying Reflectance Estimation from Virtual Exemplars (measured exemplars there; analytic lobes here).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .abrdf import ABRDF
from .foundation.checks import check_shape
from .foundation.errors import InputError
from .foundation.progress import tracked
from .foundation.settings import check_settings, setting
from .kernels import photometric as kernel

Floats = NDArray[np.float64]
_BATCH = 4096


@dataclass(frozen=True)
class NormalSettings:
    """How normals are sought.

    Attributes
    ----------
    alphas : tuple of float
        GGX widths of the dictionary's lobes.
    spread : float
        Standard deviation of a value, relative to its level: what the dictionary is expected to miss.
    floor : float
        The same relative to the pixel's median, for its dark values: light from elsewhere, noise.
    """

    alphas: tuple[float, ...] = setting((0.08, 0.22, 0.45, 0.8), "GGX widths of the dictionary's lobes, in [0.02, 1]")
    spread: float = setting(0.03, "expected misfit relative to a value's level", within="(0, 1]")
    floor: float = setting(0.06, "expected misfit of dark values, relative to the pixel's median", within="(0, 1]")
    rounds: int = setting(4, "reweighted least squares per candidate normal", within="[1, 100]")

    def __post_init__(self) -> None:
        check_settings(self)
        if not self.alphas or not all(0.02 <= a <= 1 for a in self.alphas):
            raise InputError("be numbers in [0.02, 1]", got=self.alphas, key="alphas")


@dataclass(frozen=True)
class Normals:
    """Normals and what they were found with.

    Attributes
    ----------
    normal : (P, 3) float64
        Unit, x right, y up, z to the camera.
    misfit : (P,) float64
        Mean of log(1 + z²) over the lights, z the residual in units of its expected spread: the quality map.
    coefficients : (P, 1 + A) float64
        Albedo (over the unit light) of the matte term, and scales of the lobes.
    """

    normal: Floats
    misfit: Floats
    coefficients: Floats


def lambert_normals(photographs: ABRDF) -> Floats:
    """Return normals (P, 3) by plain least squares over all images: the baseline of the field (Woodham 1980)."""
    lights, values = _data(photographs)
    return _facing(kernel.least_squares_normals(lights, values, _ranked(values, 0)))


def robust_normals(photographs: ABRDF, settings: NormalSettings = NormalSettings()) -> Normals:
    """Return normals that explain each pixel's photographs best, whatever its gloss.

    Parameters
    ----------
    photographs : ABRDF
        Pixels of an object seen along z, not normalised (`measured.photographs.read_photographs`). Channels are averaged.
    settings : NormalSettings

    Returns
    -------
    normals : Normals

    Raises
    ------
    InputError
        If there are fewer than four images, or samples are missing or normalised.

    Notes
    -----
    One to two minutes for 40 000 pixels and 96 images on two busy cores. Cast shadows and interreflections are not
    modelled: Cauchy's loss keeps them from pulling the normal as long as most lights reach the pixel.
    """
    lights, values = _data(photographs)
    num = len(lights)
    # The start: without the darkest (shadows) and the brightest fifth (highlights), where enough remain.
    cut = num // 5 if num >= 15 else 0
    start = _facing(kernel.least_squares_normals(lights, values, _ranked(values, cut)))
    steps = np.radians([8.0, 4.0, 2.0, 1.0, 0.5, 0.25])
    alphas = np.array(settings.alphas, np.float64)
    floor = np.maximum(settings.floor * np.median(values, axis=1), 1e-9)
    misfit, coefficients = np.empty(len(values)), np.empty((len(values), 1 + len(alphas)))
    # In batches, so that the bar moves and Ctrl-C is heard; pixels are independent, so this changes nothing.
    for first in tracked(range(0, len(values), _BATCH), "estimating normals"):
        part = slice(first, first + _BATCH)
        misfit[part], coefficients[part] = kernel.fit_normals(
            lights, values[part], start[part], alphas, settings.spread, floor[part], steps, settings.rounds
        )
    return Normals(start, misfit, coefficients)


def angular_error_deg(normal: Floats, truth: Floats) -> Floats:
    """Return the angle between normals (..., 3) and true ones, per pixel [deg]."""
    if normal.shape != truth.shape:
        raise InputError(f"have shape {truth.shape}", got=normal.shape, key="normal")
    cross = np.linalg.norm(np.cross(normal, truth), axis=-1)
    return np.degrees(np.arctan2(cross, (normal * truth).sum(axis=-1)))


def _data(photographs: ABRDF) -> tuple[Floats, Floats]:
    if photographs.normalised:
        raise InputError("keep its shading", got="normalised samples", key="photographs", remedy="Use `with_cosine()`.")
    if (photographs.wo[:, 2] < 1 - 1e-6).any():
        raise InputError("be seen along z", got="another view", key="photographs")
    if not photographs.valid.all():
        raise InputError("have all samples valid", got="some that are not", key="photographs")
    flat = photographs.flat()
    check_shape("wi", flat.wi, (None, 3))
    if len(flat.wi) < 4:
        raise InputError("hold at least four images", got=len(flat.wi), key="photographs")
    # Contiguous, whatever was selected: the kernels are compiled once.
    return np.ascontiguousarray(flat.wi, np.float64), np.ascontiguousarray(flat.value.mean(axis=2, dtype=np.float64))


def _ranked(values: Floats, cut: int) -> NDArray[np.int64]:
    """Return the lights of each pixel (P, N - 2 cut) in the order of its values, without the `cut` lowest and highest."""
    return np.ascontiguousarray(np.argsort(values, axis=1)[:, cut : values.shape[1] - cut])


def _facing(normal: Floats) -> Floats:
    """Let normals that are undetermined or lean away face the camera: where a search can start."""
    out = normal.copy()
    out[out[:, 2] < 0.05] = (0.0, 0.0, 1.0)
    return out
