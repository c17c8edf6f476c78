"""How light leaves a surface, over arrays of directions: evaluate, pdf, sample and albedo of any `Surface`.

Surfaces come from `lambert`, `ggx`, `dielectric` and `water_film`. Directions are in the surface's frame, z = n: `wo`
towards the viewer, `wi` towards the light, both leaving the surface; `f` has no cosine. Opaque surfaces are black from
below. Weights of dielectrics are for radiance, which on entering the denser side is compressed by the index squared.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_finite, check_range, check_unit
from .foundation.errors import InputError
from .kernels import arrays as kernel
from .kernels.kinds import LAMBERT, PLAIN, Surface

Floats = NDArray[np.float64]
RGB = tuple[float, float, float]

__all__ = ["Sample", "Surface", "albedo", "evaluate", "pdf", "sample"]


class Sample(NamedTuple):
    """Directions drawn by `sample`, with what an estimator needs.

    Attributes
    ----------
    wi : (..., 3) float
    weight : (..., 3) float
        f |cos| / pdf per channel; 0 where light is absorbed.
    pdf : (...) float
        Per solid angle [1/sr]; of a delta lobe, the probability of the branch.
    is_delta : (...) bool
    """

    wi: Floats
    weight: Floats
    pdf: Floats
    is_delta: NDArray[np.bool_]


def evaluate(surface: Surface, wo: ArrayLike, wi: ArrayLike) -> Floats:
    """Return the BSDF without the cosine, per channel [1/sr]; delta lobes (mirrors, smooth interfaces) count 0.

    Parameters
    ----------
    surface : Surface
    wo, wi : (..., 3) float
        Unit directions, broadcast against each other.

    Returns
    -------
    f : (..., 3) float

    Raises
    ------
    InputError
        If a direction is not of unit length.

    Examples
    --------
    >>> from materials import lambert
    >>> up = np.array([0.0, 0.0, 1.0])
    >>> np.allclose(evaluate(lambert.surface((0.5, 0.5, 0.5)), up, up) * np.pi, 0.5)
    True
    """
    flat_o, flat_i, shape = _pair(wo, wi)
    return kernel.evaluate(surface, flat_o, flat_i).reshape(*shape, 3)


def pdf(surface: Surface, wo: ArrayLike, wi: ArrayLike) -> Floats:
    """Return the density with which `sample` draws wi [1/sr]; delta lobes count 0. Arguments as `evaluate`."""
    flat_o, flat_i, shape = _pair(wo, wi)
    return kernel.pdf(surface, flat_o, flat_i).reshape(shape)


def sample(surface: Surface, wo: ArrayLike, xi: ArrayLike) -> Sample:
    """Draw directions about in proportion to the light they bring.

    Parameters
    ----------
    surface : Surface
    wo : (..., 3) float
        Unit directions.
    xi : (..., 3) float
        Uniform variates in [0, 1); the third chooses the lobe.

    Raises
    ------
    InputError
        If a direction is not of unit length or a variate outside [0, 1).
    """
    check_range("xi", xi, "[0, 1)")
    flat_o, flat_xi, shape = _pair(wo, xi, names=("wo", "xi"))
    wi, weight, density, is_delta = kernel.sample(surface, flat_o, flat_xi)
    return Sample(wi.reshape(*shape, 3), weight.reshape(*shape, 3), density.reshape(shape), is_delta.reshape(shape))


def albedo(surface: Surface, cos_o: ArrayLike) -> Floats:
    """Return a cheap estimate (..., 3) of the share of light reflected (or passed) towards a viewer at cos_o.

    Exact for Lambert, mirrors and clear smooth films; else within some 0.2 (worst: wide lobes at grazing angles).
    """
    check_range("cos_o", cos_o, "[-1, 1]")
    cos = np.asarray(cos_o, dtype=np.float64)
    return kernel.albedo(surface, cos.ravel()).reshape(*cos.shape, 3)


def blank() -> Surface:
    """Return a black Lambertian surface: the others are this with their own fields replaced."""
    return Surface(LAMBERT, 0.0, 0.0, 0.0, 0.0, 1.5, 1.0, 1.0, 1.33, 0.0, 0.0, 0.0, 0.0, PLAIN)


def check_albedo(value: RGB, name: str = "albedo") -> RGB:
    """Return three floats in [0, 1], or refuse."""
    channels = np.asarray(value, dtype=np.float64)
    if channels.shape != (3,):
        raise InputError("have three channels", got=channels.shape, key=name)
    check_range(name, channels, "[0, 1]")
    return (float(channels[0]), float(channels[1]), float(channels[2]))


def _pair(a: ArrayLike, b: ArrayLike, names: tuple[str, str] = ("wo", "wi")) -> tuple[Floats, Floats, tuple[int, ...]]:
    arrays = []
    for name, value in zip(names, (a, b), strict=True):
        array = np.asarray(value, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != 3:
            raise InputError("have three components along its last axis", got=array.shape, key=name)
        check_finite(name, array)
        if name != "xi":
            check_unit(name, array)
        arrays.append(array)
    try:
        one, two = np.broadcast_arrays(*arrays)
    except ValueError as error:
        raise InputError(f"fit the shape of {names[1]}", got=f"{arrays[0].shape} and {arrays[1].shape}", key=names[0]) from error
    return np.ascontiguousarray(one).reshape(-1, 3), np.ascontiguousarray(two).reshape(-1, 3), one.shape[:-1]
