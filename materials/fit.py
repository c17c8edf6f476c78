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
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
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
        Of the parameters in the order diffuse, specular, alpha (u, v per lobe), tangent angle; 0 for those held or at a
        bound. Robust to unequal noise (White's sandwich).
    """

    diffuse: Floats
    specular: Floats
    alpha: Floats
    frame: Floats
    cost: float
    relative_variance: float
    covariance: Floats

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
    done = _over_texels(lambda t: _fit(flat, t, settings), flat.num_texels, settings)
    return list(tracked(done, "fitting texels", flat.num_texels))


def fit_where_possible(abrdf: ABRDF, settings: FitSettings, frames: Floats | None = None) -> list[TexelFit | None]:
    """As `fit`, with None for a texel that has too few valid samples.

    Parameters
    ----------
    abrdf : ABRDF
    settings : FitSettings
    frames : (T, 3, 3) float, optional
        Frames (tangent, bitangent, normal as columns) to fit about, instead of those that `settings.normals` would estimate.
    """
    flat = abrdf.normalise().flat()

    def one(t: int) -> TexelFit | None:
        try:
            return _fit(flat, t, settings, None if frames is None else frames[t])
        except InputError:
            return None

    return list(_over_texels(one, flat.num_texels, settings))


def _over_texels(one: Callable[[int], Fitted], count: int, settings: FitSettings) -> Iterator[Fitted]:
    if settings.threads == 1 or count == 1:
        yield from (one(t) for t in range(count))
        return
    # Threads, as all that takes long is compiled and lets go of the interpreter.
    with ThreadPoolExecutor(settings.threads or None) as pool:
        yield from pool.map(one, range(count))


def estimate_normal(abrdf: ABRDF, texel: int = 0, settings: FitSettings = FitSettings()) -> Floats:
    """Return the frame (3, 3) of the half-vector lobe of eq. 5.3 that fits best: tangent, bitangent, normal."""
    return _normal(abrdf.normalise().flat(), texel, settings)


def _normal(flat: ABRDF, texel: int, settings: FitSettings) -> Floats:
    problem = _problem(flat, texel, settings, settings.full_angle_deg, "half_vector", 1)
    x, _ = _minimise(problem, [(0.2,), (0.5,)], problem.bounds([(0.1, 0.95)], tilt=_MAX_TILT), settings)
    return problem.frame(x)


def _fit(flat: ABRDF, texel: int, settings: FitSettings, base: Floats | None = None) -> TexelFit:
    if base is None:
        base = _normal(flat, texel, settings) if settings.normals else np.eye(3)
    if not settings.constrained:
        problem = _problem(flat, texel, settings, settings.free_angle_deg, settings.model, settings.lobes, base)
        widths = [(0.1,), (0.3,)] if settings.lobes == 1 else [(0.1, 0.5), (0.3, 0.8)]
        return _best(problem, widths, problem.bounds([_ANY] * settings.lobes), settings)
    first = _problem(flat, texel, settings, settings.first_angle_deg, settings.model, 1, base)
    one = _best(first, [(0.15,), (0.35,)], first.bounds([_MAIN]), settings)
    problem = _problem(flat, texel, settings, settings.full_angle_deg, settings.model, settings.lobes, base)
    main = float(np.sqrt(one.alpha[0].prod()))
    widths = [(main,)] if settings.lobes == 1 else [(main, 0.6), (main, 0.85)]
    top = np.maximum(one.diffuse, 1e-6)
    bounds = problem.bounds([_MAIN, _OFF][: settings.lobes], diffuse=(settings.diffuse_share * top, top))
    return _best(problem, widths, bounds, settings)


def _minimise(
    problem: Problem, widths: list[tuple[float, ...]], bounds: tuple[Floats, Floats], settings: FitSettings
) -> tuple[Floats, float]:
    """Minimise from several widths, as the landscape over them has several valleys, and keep the lowest."""
    starts = [problem.start(w) for w in widths]
    if settings.solver == "levenberg":
        return problem.minimise(starts, bounds)
    return min((problem.minimise_slsqp(s, bounds) for s in starts), key=lambda found: found[1])


def _best(problem: Problem, widths: list[tuple[float, ...]], bounds: tuple[Floats, Floats], settings: FitSettings) -> TexelFit:
    x, value = _minimise(problem, widths, bounds, settings)
    diffuse, specular, alpha, _ = problem.split(x)
    covariance, relative = problem.statistics(x, bounds)
    return TexelFit(diffuse.copy(), specular.copy(), alpha.copy(), problem.frame(x), value, relative, covariance)


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
    return Problem(wi, wo, value, KINDS[model], f0, base, lobes, settings.loss_scale, flat.isotropic)
