"""What water does to a surface: pores that fill (saturation), then a film on top (accumulation).

After Lagarde's model as adapted in the thesis this toolkit follows (eqs. 2.17, 2.18, 6.12, 6.13). Where its printed form
contradicts its own words the corrected form is the default, and `model="thesis"` gives the printed one:

- eq. 2.17 printed darkens porous ground less than dense ground; here `rho = lerp(1, 0.2, porosity)`;
- eq. 6.12 printed multiplies the refractive index by `lerp(1, rho, w / 2)`, below 1 for porous ground; here the index
  moves by the same share towards that of water, and never past it.

References
----------
Lagarde, S. (2013), Water drop 3b: physically based wet surfaces. Lekner, J. and Dorf, M. C. (1988), Why some things are
darker when wet, Applied Optics 27, 1278. Twomey, S. A., Bohren, C. F. and Mergenthaler, J. L. (1986), Reflectance and
albedo differences between wet and dry surfaces, Applied Optics 25, 431. van de Hulst, H. C. (1980), Multiple Light
Scattering, ch. 11 (albedo of a semi-infinite medium). Roosen, G. (1979), La levitation optique de spheres, Can. J. Phys.
57, 1260 (the ray series of a sphere).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range, check_unit
from .foundation.errors import InputError
from .kernels import fresnel as kernel

Floats = NDArray[np.floating]
Model = Literal["lagarde", "thesis"]
DiffuseModel = Literal["lagarde", "lekner_dorf", "twomey", "thesis"]

ETA_WATER = 1.33
RHO_FULL = 0.2
"""Attenuation of the diffuse light of fully porous, fully wet ground (eq. 2.17)."""
ETA_TARMAC = 1.63


def water_levels(level: ArrayLike) -> tuple[Floats, Floats]:
    """Split a water level into saturation and accumulation (thesis, 6.4.4).

    Parameters
    ----------
    level : (...) float
        Water level W in [0, 1]; at 0.5 all pores are full, at 1 the film is complete.

    Returns
    -------
    w_sat, w_acc : (...) float
        `clamp(2 W)` and `clamp(2 W - 1)`.

    Raises
    ------
    InputError
        If a level is outside [0, 1].

    Examples
    --------
    >>> water_levels(np.array([0.25, 0.75]))
    (array([0.5, 1. ]), array([0. , 0.5]))
    """
    check_range("level", level, "[0, 1]")
    twice = 2 * _floats(level)
    return np.clip(twice, 0, 1), np.clip(twice - 1, 0, 1)


def porosity_attenuation(porosity: ArrayLike, model: Model = "lagarde") -> Floats:
    """Return the attenuation rho of fully wet ground (eq. 2.17).

    Parameters
    ----------
    porosity : (...) float
        Effective porosity in [0, 1]; asphalt and concrete 0.5 to 0.7, glass 0.
    model : {"lagarde", "thesis"}
        `lerp(1, 0.2, porosity)`, or the printed `lerp(0.2, 1, porosity)`.

    Returns
    -------
    rho : (...) float
        In [0.2, 1].

    Examples
    --------
    >>> porosity_attenuation(np.array([0.0, 1.0]))
    array([1. , 0.2])
    """
    _check_model(model, ("lagarde", "thesis"))
    check_range("porosity", porosity, "[0, 1]")
    p = _floats(porosity)
    return _lerp(1, RHO_FULL, p) if model == "lagarde" else _lerp(RHO_FULL, 1, p)


def saturate(
    eta: ArrayLike, roughness: ArrayLike, attenuation: ArrayLike, w_sat: ArrayLike, *, model: Model = "lagarde"
) -> tuple[Floats, Floats]:
    """Fill the pores: smoother, and optically nearer to water (eqs. 2.18 and 6.12).

    Parameters
    ----------
    eta : (...) float
        Refractive index of the dry surface, above 1.
    roughness : (...) float
        Its perceptual roughness, in [0, 1].
    attenuation : (...) float
        rho, from `porosity_attenuation`.
    w_sat : (...) float
        Saturation in [0, 1].
    model : {"lagarde", "thesis"}
        How eta changes: by the share `(1 - rho) w_sat / 2` of the way towards water, or the printed product.

    Returns
    -------
    eta, roughness : (...) float
        Of the wet surface; roughness is `lerp(r, rho r, w_sat / 2)`.

    Examples
    --------
    >>> eta, roughness = saturate(1.63, 0.8, 0.6, 1.0)
    >>> np.allclose([eta, roughness], [1.57, 0.64])
    True
    """
    _check_model(model, ("lagarde", "thesis"))
    check_range("eta", eta, "[1, inf)")
    check_range("roughness", roughness, "[0, 1]")
    check_range("attenuation", attenuation, "(0, 1]")
    check_range("w_sat", w_sat, "[0, 1]")
    e, r, rho, w = _floats(eta), _floats(roughness), _floats(attenuation), _floats(w_sat)
    keep = _lerp(1, rho, 0.5 * w)
    wet_eta = e * keep if model == "thesis" else e + (ETA_WATER - e) * (1 - keep)
    return wet_eta, r * keep


def accumulate(
    eta: ArrayLike,
    roughness: ArrayLike,
    normal: ArrayLike,
    w_acc: ArrayLike,
    *,
    strength: float = 0.95,
    up: tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> tuple[Floats, Floats, Floats]:
    """Cover the saturated surface with water: towards its index, smooth, and level (eq. 6.13).

    Parameters
    ----------
    eta, roughness : (...) float
        Of the saturated surface.
    normal : (..., 3) float
        Unit shading normals.
    w_acc : (...) float
        Accumulation in [0, 1].
    strength : float
        Share of the way that full accumulation goes; the thesis has 0.95, "to limit the specular boost".
    up : tuple of float
        Normal of still water.

    Returns
    -------
    eta, roughness : (...) float
    normal : (..., 3) float
        Unit length.
    """
    check_range("eta", eta, "[1, inf)")
    check_range("roughness", roughness, "[0, 1]")
    check_range("w_acc", w_acc, "[0, 1]")
    check_range("strength", strength, "[0, 1]")
    check_unit("normal", normal, 1e-3)
    check_unit("up", up)
    t = strength * _floats(w_acc)
    n = _floats(normal)
    blend = _lerp(n, np.asarray(up, dtype=n.dtype), t[..., None])
    length = np.linalg.norm(blend, axis=-1, keepdims=True)
    # only a normal that points straight down can meet its opposite half-way
    level = np.where(length > 1e-6, blend / np.maximum(length, 1e-6), np.asarray(up, dtype=n.dtype))
    level = np.where(t[..., None] > 0, level, n)  # without water, as given to the bit
    return _lerp(_floats(eta), ETA_WATER, t), _lerp(_floats(roughness), 0, t), level


def diffuse_attenuation(
    albedo: ArrayLike,
    w_sat: ArrayLike,
    porosity: ArrayLike,
    model: DiffuseModel = "lagarde",
    *,
    eta: float = ETA_TARMAC,
) -> Floats:
    """Return the factor by which water in the pores dims the diffuse light, per channel.

    Parameters
    ----------
    albedo : (..., 3) or (...) float
        Dry diffuse albedo, in [0, 1]. `lagarde` and `thesis` use only its shape.
    w_sat : (...) float
        Saturation in [0, 1], broadcast against `albedo`, or against its channels' shape without the last axis.
    porosity : (...) float
        Effective porosity in [0, 1], as `w_sat`. `lekner_dorf` and `twomey` know no porosity and ignore it.
    model : {"lagarde", "lekner_dorf", "twomey", "thesis"}
        Lagarde's grey factor (eq. 2.18); Lekner and Dorf, for solid ground such as asphalt and concrete; Twomey et al.,
        for grains such as sand and soil; eq. 2.17 as printed.
    eta : float
        Refractive index of the solid, for `lekner_dorf` and `twomey`; above water's.

    Returns
    -------
    factor : (...) float
        In (0, 1], shaped as `albedo` broadcast with `w_sat`; 1 at w_sat = 0, falling with w_sat.

    Raises
    ------
    InputError
        If a value is out of its range or the model is unknown.

    Notes
    -----
    Light reflected on top of the water is the specular layer's and not counted here. In between the factor is
    `lerp(1, factor of full saturation, w_sat)`. `lekner_dorf` and `twomey` depend on the albedo of the channel, which
    shifts the hue towards the brighter channels: wet soil is more red than dry.

    Examples
    --------
    >>> factor = diffuse_attenuation(np.array([0.3, 0.2, 0.1]), 1.0, 0.5, "lekner_dorf")
    >>> bool(factor[0] > factor[1] > factor[2])
    True
    """
    _check_model(model, ("lagarde", "lekner_dorf", "twomey", "thesis"))
    check_range("albedo", albedo, "[0, 1]")
    check_range("w_sat", w_sat, "[0, 1]")
    a = _floats(albedo)
    w = _per_channel(_floats(w_sat), a)
    if model in ("lagarde", "thesis"):
        full = _per_channel(porosity_attenuation(porosity, "lagarde" if model == "lagarde" else "thesis"), a)
        return _lerp(np.ones_like(a), full, w)
    check_range("eta", eta, f"({ETA_WATER}, 3]")
    full = _lekner_dorf(a, eta) if model == "lekner_dorf" else _twomey(a, eta)
    return _lerp(1, full, w)


def _lekner_dorf(albedo: Floats, eta: float) -> Floats:
    """Return wet over dry albedo of a rough solid under a thin film.

    Light that the base scatters up is sent back by the film's surface with probability p, each time to be absorbed with
    probability a_w: the diffuse albedo is (1 - p)(1 - a_w) / (1 - p (1 - a_w)). The base absorbs more below water than
    below air, since less is reflected on entering the solid: by the ratio r of what passes its surface where it absorbs
    little, and by none where it absorbs all: a_w = r a (1 - a) + a^2.
    """
    p = kernel.diffuse_internal(ETA_WATER)
    r = (1 - kernel.diffuse_external(eta / ETA_WATER)) / (1 - kernel.diffuse_external(eta))
    # a (1 - a) r + a^2 written for what is reflected: (1 - a)(1 - a (r - 1)), so that the ratio is finite at albedo 0
    dim = 1 - (1 - albedo) * (r - 1)
    return (1 - p) * dim / (1 - p * albedo * dim)


def _twomey(albedo: Floats, eta: float) -> Floats:
    """Return wet over dry albedo of a deep layer of transparent grains whose gaps fill with water.

    Water cuts the contrast of index, so that each grain turns light less (mean cosine g up), light goes deeper and
    meets more absorption. van de Hulst: albedo = (1 - s)(1 - 0.139 s) / (1 + 1.17 s), s^2 = (1 - omega) / (1 - g omega).
    """
    floor = 1e-6  # the ratio has a limit at albedo 0, where both albedos vanish
    a = np.maximum(albedo.astype(np.float64), floor)
    # invert: 0.139 s^2 - (1.139 + 1.17 a) s + (1 - a) = 0, the smaller root
    b = 1.139 + 1.17 * a
    s2 = (2 * (1 - a) / (b + np.sqrt(b * b - 4 * 0.139 * (1 - a)))) ** 2
    g_dry, g_wet = _grain_cosine(eta), _grain_cosine(eta / ETA_WATER)
    absorbed = (1 - g_dry) * s2 / (1 - g_dry * s2)  # 1 - omega, the same dry and wet
    s = np.sqrt(absorbed / (1 - g_wet + g_wet * absorbed))
    wet = (1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s)
    return (wet / a).astype(albedo.dtype)


@lru_cache(maxsize=64)
def _grain_cosine(eta: float) -> float:
    """Return the mean cosine of light turned by a large clear sphere, by its ray series (diffraction left out)."""
    nodes, weights = _quadrature()
    theta = 0.25 * math.pi * (nodes + 1)
    bent = np.arcsin(np.sin(theta) / eta)
    c, d = np.cos(theta), np.cos(bent)
    total = 0.0
    for r in (((c - eta * d) / (c + eta * d)) ** 2, ((eta * c - d) / (eta * c + d)) ** 2):
        # reflected: turned by pi - 2 theta; passed after k inner reflections: 2 (theta - bent) + k (pi - 2 bent)
        passed = (1 - r) ** 2 * (np.cos(2 * (theta - bent)) + r * np.cos(2 * theta)) / (1 + r * r + 2 * r * np.cos(2 * bent))
        total += float(np.sum(weights * (passed - r * np.cos(2 * theta)) * np.sin(2 * theta))) * 0.25 * math.pi
    return 0.5 * total


@lru_cache(maxsize=1)
def _quadrature() -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(400)
    return nodes, weights


def _per_channel(values: Floats, albedo: Floats) -> Floats:
    """Give maps (H, W) a channel axis where the albedo has one, (H, W, 3)."""
    is_map = values.ndim >= 1 and values.ndim == albedo.ndim - 1 and values.shape == albedo.shape[:-1]
    return values[..., None] if is_map else values


def _lerp(a: float | Floats, b: float | Floats, t: Floats) -> Floats:
    # exact at t = 0, where a dry surface must come back to the bit
    return np.asarray(a + (b - a) * t)


def _floats(value: ArrayLike) -> Floats:
    array = np.asarray(value)
    return array if array.dtype in (np.float32, np.float64) else array.astype(np.float64)


def _check_model(model: str, known: tuple[str, ...]) -> None:
    if model not in known:
        raise InputError(f"be one of {', '.join(known)}", got=repr(model), key="model")
