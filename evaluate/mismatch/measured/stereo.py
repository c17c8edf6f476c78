"""Photometric stereo as a model: normals and albedos per pixel, and what a belief in matte surfaces and direct light leaves out.

Each pixel has a matte term of its own, b = albedo times normal, found by least squares; what is added has a few numbers for
the whole object: a GGX lobe (scale, alpha), shadows of the relief that the normals make, light that this relief sends to
itself, and light from all around.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from materials.kernels.fresnel import normal_reflectance

from .relief import Relief, integrate

Floats = NDArray[np.float64]
IDS = ("cast_shadow", "specular_lobe", "interreflection", "ambient_light")
_ALPHAS, _NEAR = np.geomspace(0.04, 0.7, 8), np.geomspace(0.75, 1.33, 5)
_ROUNDS, _INNER, _QUICK = 2, 4, 2
_ETA = 1.5
_MAD = 1.4826


@dataclass
class StereoFit:
    """A model of the photographs.

    Attributes
    ----------
    normal : (P, 3) float64
        Unit, x right, y up, z to the camera.
    albedo : (P,) float64
        Of the matte term, over the unit of the photographs.
    prediction : (P, N) float64
        Of all lights, those that it was fitted to and the others.
    values : dict
        Numbers by "effect.parameter".
    shadow : (P, N) float64
        1 where the relief hides no light.
    """

    ids: tuple[str, ...]
    normal: Floats
    albedo: Floats
    prediction: Floats
    values: dict[str, float] = field(default_factory=dict)
    shadow: Floats | None = None


def fit_stereo(
    ids: tuple[str, ...],
    mask: NDArray[np.bool_],
    lights: Floats,
    value: Floats,
    use: NDArray[np.bool_],
    start: dict[str, float] | None = None,
) -> StereoFit:
    """Fit a model to the photographs of some lights, and predict all.

    Parameters
    ----------
    ids : tuple of str
        Some of `IDS`.
    mask : (H, W) bool
        The object; its pixels in row order are those of `value`.
    lights : (N, 3) float64
        Unit directions towards the lights.
    value : (P, N) float64
        Photographs over the lights' intensity.
    use : (N,) bool
        The lights to be fitted to.
    start : dict, optional
        Values of a fit to other lights, near which these are sought.
    """
    y, L = value[:, use], lights[use]
    out = StereoFit(ids, *_matte(y, L, np.ones_like(y)), np.zeros(0))
    indirect, gloss = np.zeros_like(value), np.zeros_like(value)
    shadow = np.ones_like(value)
    alpha = None if start is None else start.get("specular_lobe.alpha")
    for _ in range(_ROUNDS):
        relief = None
        if {"cast_shadow", "interreflection"} & set(ids):
            relief = integrate(mask, out.normal)
        if relief is not None and "cast_shadow" in ids:
            shadow = relief.visible(lights)
        if "specular_lobe" in ids:
            alpha = _best_alpha(out, y, L, shadow[:, use], indirect[:, use], alpha)
        for _ in range(_INNER):
            if alpha is not None:
                gloss = _lobe(out.normal, lights, alpha)
                scale = _scale(y - indirect[:, use], shadow[:, use] * gloss[:, use], out, L, shadow[:, use])
                out.values |= {"specular_lobe.specular_scale": scale, "specular_lobe.alpha": alpha}
                gloss = scale * gloss
            lit = shadow[:, use] * ((_dot(out.normal, L) > 0) | ("cast_shadow" not in ids))
            left = y - shadow[:, use] * gloss[:, use] - indirect[:, use]
            out.normal, out.albedo = _matte(left, L, lit * _robust(left - _cosine(out, L)))
        lit = shadow[:, use] * ((_dot(out.normal, L) > 0) | ("cast_shadow" not in ids))
        if {"interreflection", "ambient_light"} & set(ids):
            indirect = _indirect(out, ids, relief, lights, y, use, shadow, gloss, lit)
        left = y - shadow[:, use] * gloss[:, use] - indirect[:, use]
        out.normal, out.albedo = _matte(left, L, lit * _robust(left - _cosine(out, L)))
    out.prediction = shadow * (_cosine(out, lights) + gloss) + indirect
    out.shadow = shadow
    return out


def _matte(y: Floats, L: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return (normal (P, 3), albedo (P,)) of b . l = y by weighted least squares; where that fails they face the viewer."""
    gram = np.einsum("pn,ni,nj->pij", weight, L, L, optimize=True) + 1e-9 * np.eye(3)
    right = np.einsum("pn,pn,ni->pi", weight, y, L, optimize=True)
    b = np.linalg.solve(gram, right[..., None])[..., 0]
    length = np.linalg.norm(b, axis=1)
    good = (length > 1e-12) & (b[:, 2] > 0)
    normal = np.where(good[:, None], b / np.maximum(length, 1e-12)[:, None], (0.0, 0.0, 1.0))
    return np.asarray(normal, np.float64), np.where(good, length, 0.0)


def _scale(rest: Floats, part: Floats, f: StereoFit, L: Floats, lit: Floats) -> float:
    """Return the scale of what is added to a matte term, from what no matte term of the pixel explains of it."""
    weight = lit * (_dot(f.normal, L) > 0)
    return _positive(weight * _beside(rest, L, weight), weight * _beside(part, L, weight))


def _beside(x: Floats, L: Floats, weight: Floats) -> Floats:
    """Return what of values (P, N) no matte term of the pixel can be."""
    gram = np.einsum("pn,ni,nj->pij", weight, L, L, optimize=True) + 1e-9 * np.eye(3)
    right = np.einsum("pn,pn,ni->pi", weight, x, L, optimize=True)
    return x - np.linalg.solve(gram, right[..., None])[..., 0] @ L.T


def _robust(residual: Floats) -> Floats:
    """Return weights by Cauchy's loss: what is not modelled is to drag a pixel's normal along as little as can be."""
    spread = _MAD * np.median(np.abs(residual), axis=1, keepdims=True) + 1e-12
    return 1 / (1 + (residual / (2 * spread)) ** 2)


def _cosine(f: StereoFit, L: Floats) -> Floats:
    return f.albedo[:, None] * np.maximum(_dot(f.normal, L), 0)


def _dot(normal: Floats, L: Floats) -> Floats:
    return np.asarray(normal @ L.T, np.float64)


def _lobe(normal: Floats, lights: Floats, alpha: float) -> Floats:
    """Return GGX times the cosine of the light (P, N), seen along z: height-correlated Smith, Schlick's Fresnel."""
    h = lights + (0.0, 0.0, 1.0)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    n_h, n_l, n_v = _dot(normal, h), np.maximum(_dot(normal, lights), 1e-4), np.maximum(normal[:, 2:], 1e-3)
    a2 = alpha**2
    d = a2 / (np.pi * (n_h**2 * (a2 - 1) + 1) ** 2)
    smith = n_l * np.sqrt(a2 + (1 - a2) * n_v**2) + n_v * np.sqrt(a2 + (1 - a2) * n_l**2)
    f0 = float(normal_reflectance(_ETA))
    f = f0 + (1 - f0) * (1 - h[:, 2]) ** 5
    return np.where(_dot(normal, lights) > 0, d * f / (2 * smith) * n_l, 0.0)


def _best_alpha(f: StereoFit, y: Floats, L: Floats, shadow: Floats, indirect: Floats, known: float | None) -> float:
    """Return the width of the lobe with which normals and one scale leave the least (Cauchy's loss)."""
    tried = _ALPHAS if known is None else known * _NEAR
    losses = []
    spread = _MAD * np.median(np.abs(y - _cosine(f, L)), axis=1, keepdims=True) + 1e-12
    for alpha in tried:
        trial = StereoFit((), f.normal, f.albedo, np.zeros(0))
        left = np.zeros(0)
        for _ in range(_QUICK):
            gloss = shadow * _lobe(trial.normal, L, alpha)
            gloss = _scale(y - indirect, gloss, trial, L, shadow) * gloss
            left = y - gloss - indirect
            trial.normal, trial.albedo = _matte(left, L, shadow * _robust(left - _cosine(trial, L)))
        losses.append(np.log1p(((left - shadow * _cosine(trial, L)) / spread) ** 2).sum())
    return float(tried[int(np.argmin(losses))])


def _indirect(
    f: StereoFit, ids: tuple[str, ...], relief: Relief | None, lights: Floats, y: Floats, use: NDArray[np.bool_], shadow: Floats,
    gloss: Floats, lit: Floats,
) -> Floats:  # fmt: skip
    """Return what arrives by other ways than straight from the lamp (P, N), its scales fitted to the lights in use.

    Most of it could as well be a brighter and turned surface: only what no normal of the pixel explains tells the scale.
    """
    parts, names, L = [], [], lights[use]
    direct = shadow * (_cosine(f, lights) + gloss)
    if "interreflection" in ids and relief is not None:
        parts.append(f.albedo[:, None] * (relief.exchange(f.normal) @ direct))
        names.append("interreflection.gain")
    if "ambient_light" in ids:
        sky = 0.5 * (1 + f.normal[:, 2:])
        parts.append(np.broadcast_to(f.albedo[:, None] * sky, direct.shape))
        names.append("ambient_light.share")
    total = np.zeros_like(direct)
    for part, name in zip(parts, names):
        rest = y - shadow[:, use] * gloss[:, use] - total[:, use]
        scale = _scale(rest, part[:, use], f, L, lit)
        f.values[name] = scale
        total = total + scale * part
    return total


def _positive(y: Floats, x: Floats) -> float:
    """Return the scale of x, at least 0, that explains y best; residuals beyond what is usual count less (Cauchy)."""
    scale = max(float((x * y).sum()) / max(float((x * x).sum()), 1e-30), 0.0)
    for _ in range(3):
        r = y - scale * x
        spread = _MAD * float(np.median(np.abs(r))) + 1e-12
        w = 1 / (1 + (r / (3 * spread)) ** 2)
        scale = max(float((w * x * y).sum()) / max(float((w * x * x).sum()), 1e-30), 0.0)
    return scale
