"""Analytical BRDFs fitted to apparent ones, texel by texel: the two-step fit of the thesis (5.3.2, 5.3.4), and a free one.

`fit_texel` fits one point, `fit` all of them on all cores. The cost is eq. 5.2 with Cauchy's loss, log(1 + s / 4). Normals
are estimated first with the half-vector cosine lobe of eq. 5.3; the model is then fitted about that normal, its tangent free.

References
----------
Ngan et al. (2005), Experimental Analysis of BRDF Models. Marquardt (1963), An algorithm for least-squares estimation of
nonlinear parameters. Kraft (1988), A Software Package for Sequential Quadratic Programming (the other solver, NLopt's).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from .abrdf import ABRDF
from .fit_problem import KINDS, Problem
from .fit_settings import FitSettings
from .foundation.errors import InputError
from .foundation.progress import tracked

__all__ = ["FitSettings", "TexelFit", "estimate_normal", "fit", "fit_texel", "fit_where_possible"]

Floats = NDArray[np.float64]
Fitted = TypeVar("Fitted")
_MAIN, _OFF, _ANY = (0.1, 0.5), (0.5, 0.95), (0.02, 1.0)
_MAX_TILT = math.radians(45)
_SEED_EVERY = 8
_LEAST_SIGMA = 0.1
_WARM_COST = 2.0
"""A texel that started from its neighbour and costs more than that many times as much also starts from scratch."""


@dataclass(frozen=True)
class TexelFit:
    """A fitted BRDF.

    Attributes
    ----------
    diffuse : (C,) float64
        Albedo d of d / pi.
    specular : (L, C) float64
        Scales s of the lobes.
    alpha : (L, 2) float64
        Widths along tangent and bitangent.
    frame : (3, 3) float64
        Columns tangent, bitangent, normal, in coordinates of the coarse surface.
    cost : float
        Mean of log(1 + s / 4) over samples and channels of the last step.
    relative_variance : float
        Mean squared weighted residual over mean squared weighted value, same samples.
    covariance : (P, P) float64
        Of the parameters in the order diffuse, specular, alpha (u, v per lobe), sigma (of an Oren-Nayar base only), tangent
        angle; 0 for those held or at a bound. Robust to unequal noise (White's sandwich).
    sigma : float
        Spread of the slopes of an Oren-Nayar base [rad], whose facets have the albedo d; 0 is Lambert's.
    """

    diffuse: Floats
    specular: Floats
    alpha: Floats
    frame: Floats
    cost: float
    relative_variance: float
    covariance: Floats
    sigma: float = 0.0

    @property
    def normal(self) -> Floats:
        """The unit normal, in coordinates of the coarse surface."""
        return self.frame[:, 2]


def fit_texel(abrdf: ABRDF, texel: int = 0, settings: FitSettings = FitSettings()) -> TexelFit:
    """Fit one texel.

    Parameters
    ----------
    abrdf : ABRDF
        Measured; normalised here (eq. 2.16) if it is not.
    texel : int
        Which one, counted through all leading axes.
    settings : FitSettings

    Returns
    -------
    fit : TexelFit

    Raises
    ------
    InputError
        If too few valid samples lie within a step's angles.
    """
    flat = abrdf.normalise().flat()
    if not 0 <= texel < flat.num_texels:
        raise InputError(f"lie in [0, {flat.num_texels})", got=texel, key="texel")
    return _fit(flat, texel, settings)


def fit(abrdf: ABRDF, settings: FitSettings = FitSettings()) -> list[TexelFit]:
    """Fit all texels, on all cores; each depends on itself alone, so that threads cannot change the result."""
    flat = abrdf.normalise().flat()
    done = _over_texels(lambda t: _fit(flat, t, settings), range(flat.num_texels), settings)
    return list(tracked(done, "fitting texels", flat.num_texels))


def fit_where_possible(abrdf: ABRDF, settings: FitSettings, frames: Floats | None = None) -> list[TexelFit | None]:
    """As `fit`, with None for a texel that has too few valid samples, and, if set, warm starts.

    Every eighth texel starts from scratch; the others start from the nearest of these, and from scratch too if they end at more
    than twice its cost.

    Parameters
    ----------
    abrdf : ABRDF
    settings : FitSettings
    frames : (T, 3, 3) float, optional
        Frames (tangent, bitangent, normal as columns) to fit about, instead of those that `settings.normals` would estimate.
    """
    flat = abrdf.normalise().flat()

    def one(t: int, near: TexelFit | None = None) -> TexelFit | None:
        try:
            return _fit(flat, t, settings, None if frames is None else frames[t], near)
        except InputError:
            return None

    count = flat.num_texels
    if not settings.warm_starts or count < 2 * _SEED_EVERY:
        return list(_over_texels(one, range(count), settings))
    # The same texels are seeds whatever the number of threads, so that threads cannot change the result.
    seeds = range(0, count, _SEED_EVERY)
    found = dict(zip(seeds, _over_texels(one, seeds, settings), strict=True))
    others = [t for t in range(count) if t not in found]
    nearest = {t: found[min(round(t / _SEED_EVERY), len(seeds) - 1) * _SEED_EVERY] for t in others}
    found |= dict(zip(others, _over_texels(lambda t: one(t, nearest[t]), others, settings), strict=True))
    return [found[t] for t in range(count)]


def _over_texels(one: Callable[[int], Fitted], texels: Sequence[int], settings: FitSettings) -> Iterator[Fitted]:
    if settings.threads == 1 or len(texels) == 1:
        yield from (one(t) for t in texels)
        return
    # Threads, as all that takes long is compiled and lets go of the interpreter.
    with ThreadPoolExecutor(settings.threads or None) as pool:
        yield from pool.map(one, texels)


def estimate_normal(abrdf: ABRDF, texel: int = 0, settings: FitSettings = FitSettings()) -> Floats:
    """Return the frame (3, 3) of the half-vector lobe of eq. 5.3 that fits best: tangent, bitangent, normal."""
    return _normal(abrdf.normalise().flat(), texel, settings)


def _normal(flat: ABRDF, texel: int, settings: FitSettings) -> Floats:
    problem = _problem(flat, texel, settings, settings.full_angle_deg, "half_vector", 1)
    x, _ = _minimise(problem, [(0.2,), (0.5,)], problem.bounds([(0.1, 0.95)], tilt=_MAX_TILT), settings)
    return problem.frame(x)


def _fit(flat: ABRDF, texel: int, settings: FitSettings, base: Floats | None = None, near: TexelFit | None = None) -> TexelFit:
    if base is None:
        base = _normal(flat, texel, settings) if settings.normals else np.eye(3)
    if near is not None:
        warm = _fit_about(flat, texel, settings, base, near)
        if warm.cost <= _WARM_COST * near.cost:
            return warm
        return min(warm, _fit_about(flat, texel, settings, base, None), key=lambda fit: fit.cost)
    return _fit_about(flat, texel, settings, base, None)


def _fit_about(flat: ABRDF, texel: int, settings: FitSettings, base: Floats, near: TexelFit | None) -> TexelFit:
    """Fit about a frame: from scratch, or from the fit of a neighbour."""
    if not settings.constrained:
        problem = _problem(flat, texel, settings, settings.free_angle_deg, settings.model, settings.lobes, base)
        widths = [(0.1,), (0.3,)] if settings.lobes == 1 else [(0.1, 0.5), (0.3, 0.8)]
        return _best(problem, widths, problem.bounds([_ANY] * settings.lobes), settings, near)
    first = _problem(flat, texel, settings, settings.first_angle_deg, settings.model, 1, base)
    narrow = [(0.15,), (0.35,)] if near is None else [(float(np.sqrt(near.alpha[0].prod())),)]
    x, _ = _minimise(first, narrow, first.bounds([_MAIN]), settings)
    one_diffuse, _, one_alpha, _ = first.split(x)
    problem = _problem(flat, texel, settings, settings.full_angle_deg, settings.model, settings.lobes, base)
    main = float(np.sqrt(one_alpha[0].prod()))
    widths = [(main,)] if settings.lobes == 1 else [(main, 0.6), (main, 0.85)]
    top = np.maximum(one_diffuse, 1e-6)
    bounds = problem.bounds([_MAIN, _OFF][: settings.lobes], diffuse=(settings.diffuse_share * top, top))
    return _best(problem, widths, bounds, settings, near)


def _minimise(
    problem: Problem,
    widths: list[tuple[float, ...]],
    bounds: tuple[Floats, Floats],
    settings: FitSettings,
    near: TexelFit | None = None,
) -> tuple[Floats, float]:
    """Minimise from several widths, as the landscape over them has several valleys, or from a neighbour; keep the lowest.

    A rough base also starts from the best smooth one, which it is never to fall behind.
    """
    starts = [problem.start(w) for w in widths] if near is None else [_start_near(problem, near)]
    if problem.rough_base and near is None:
        low, high = (np.delete(end, -4) for end in bounds)
        smooth, least = _minimise(replace(problem, rough_base=False), widths, (low, high), settings)
        found = _descend(problem, [*starts, np.insert(smooth, -3, _LEAST_SIGMA)], bounds, settings)
        return found if found[1] <= least else (np.insert(smooth, -3, 0.0), least)
    return _descend(problem, starts, bounds, settings)


def _descend(problem: Problem, starts: list[Floats], bounds: tuple[Floats, Floats], settings: FitSettings) -> tuple[Floats, float]:
    if settings.solver == "levenberg":
        return problem.minimise(starts, bounds)
    return min((problem.minimise_slsqp(s, bounds) for s in starts), key=lambda found: found[1])


def _start_near(problem: Problem, near: TexelFit) -> Floats:
    tangent = problem.base.T @ near.frame[:, 0]
    turn = 0.0 if problem.tied else math.atan2(tangent[1], tangent[0])
    # At exactly 0 sigma has no derivative.
    sigma = (max(near.sigma, _LEAST_SIGMA),) if problem.rough_base else ()
    return np.concatenate([near.diffuse, near.specular.ravel(), near.alpha.ravel(), sigma, (0.0, 0.0, turn)])


def _best(
    problem: Problem,
    widths: list[tuple[float, ...]],
    bounds: tuple[Floats, Floats],
    settings: FitSettings,
    near: TexelFit | None = None,
) -> TexelFit:
    x, value = _minimise(problem, widths, bounds, settings, near)
    diffuse, specular, alpha, _ = problem.split(x)
    covariance, relative = problem.statistics(x, bounds)
    found = (diffuse.copy(), specular.copy(), alpha.copy(), problem.frame(x), value, relative, covariance)
    return TexelFit(*found, problem.sigma(x))


def _problem(
    flat: ABRDF, texel: int, settings: FitSettings, angle_deg: float, model: str, lobes: int, frame: Floats | None = None
) -> Problem:
    low = math.cos(math.radians(angle_deg))
    keep = flat.valid[texel] & (flat.wi[:, 2] > low) & (flat.wo[:, 2] > low)
    needed = 4 * (lobes + 2)
    if int(keep.sum()) < needed:
        must = f"have {needed} valid samples within {angle_deg:g} degrees of the normal"
        raise InputError(must, got=int(keep.sum()), key=f"texel {texel}", remedy="Give more directions or a larger angle.")
    value = np.ascontiguousarray(flat.value[texel][keep], np.float64)
    f0 = ((settings.eta - 1) / (settings.eta + 1)) ** 2
    base = np.eye(3) if frame is None else frame
    wi, wo = (np.ascontiguousarray(w[keep], np.float64) for w in (flat.wi, flat.wo))
    # Eq. 5.3's lobe, which finds normals, keeps Lambert's base.
    rough = settings.base == "oren_nayar" and model != "half_vector"
    return Problem(wi, wo, value, KINDS[model], f0, base, lobes, settings.loss_scale, flat.isotropic, rough)
