"""Models of wet ground fitted to spectra that were measured at known moistures.

The ground has a dry reflectance per wavelength, which need not have been measured, and darkens by `wetness.diffuse_attenuation`
while its water rises from one moisture (no effect yet) to another (pores full). Three numbers are fitted beside the dry
spectrum: these two moistures, and the porosity (Lagarde) or the refractive index of the solid (Lekner-Dorf, Twomey).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_finite, check_shape
from .foundation.errors import InputError
from .wetness import diffuse_attenuation

Floats = NDArray[np.float64]
MODELS = ("lagarde", "lekner_dorf", "twomey")
_ALBEDOS = np.linspace(0.002, 1.0, 500)
ETA_SOLID = (1.35, 1.9)
"""Refractive indices that a fit of the solid may take."""


@dataclass(frozen=True)
class WetnessFit:
    """A fitted model of wet ground.

    Attributes
    ----------
    model : str
        One of `MODELS`.
    dry : (K,) float64
        Reflectance without water, per wavelength.
    start, full : float
        Moistures where darkening starts (at or below the driest record: any water darkens) and where the pores are full.
    constant : float
        Porosity of `lagarde`, refractive index of the solid of the others.
    rms : float
        Root mean square of the residual over all records and wavelengths.
    """

    model: str
    dry: Floats
    start: float
    full: float
    constant: float
    rms: float

    def saturation(self, moisture: ArrayLike) -> Floats:
        """Return w_sat in [0, 1]."""
        return np.clip((np.asarray(moisture, np.float64) - self.start) / (self.full - self.start), 0, 1)

    def predict(self, moisture: ArrayLike) -> Floats:
        """Return the reflectance (..., K) at some moistures."""
        w = self.saturation(moisture)[..., None]
        return self.dry * (1 - w * (1 - full_factor(self.model, self.dry, self.constant)))


def full_factor(model: str, dry: Floats, constant: float) -> Floats:
    """Return how much of a dry reflectance is left where all pores are full; `constant` as in `WetnessFit`."""
    ones = np.ones_like(dry)
    if model == "lagarde":
        return np.asarray(diffuse_attenuation(dry, ones, constant * ones, "lagarde"), np.float64)
    if model == "lekner_dorf":
        return np.asarray(diffuse_attenuation(dry, ones, ones, "lekner_dorf", eta=constant), np.float64)
    if model == "twomey":
        return np.asarray(diffuse_attenuation(dry, ones, ones, "twomey", eta=constant), np.float64)
    raise InputError(f"be one of {', '.join(MODELS)}", got=model, key="model")


def fit_wetness(moisture: ArrayLike, reflectance: ArrayLike, model: str, dry: ArrayLike | None = None) -> WetnessFit:
    """Fit one model by least squares.

    Parameters
    ----------
    moisture : (N,) float
        Water content of each record, in any unit.
    reflectance : (N, K) float
        In [0, 1]; each row a spectrum.
    model : str
        One of `MODELS`.
    dry : (K,) float, optional
        The dry reflectance where it was measured; else it is fitted.

    Returns
    -------
    fit : WetnessFit
        Where no record is dry, `start` and the constant share a freedom: only their effect on what was measured is sure.

    Raises
    ------
    InputError
        If shapes disagree, values are not finite, or there are fewer than three moistures.
    """
    import nlopt

    m, r = np.asarray(moisture, np.float64), np.asarray(reflectance, np.float64)
    check_shape("reflectance", r, (len(m), None))
    check_finite("moisture", m)
    check_finite("reflectance", r)
    if len(np.unique(m)) < 3:
        raise InputError("hold three moistures or more", got=len(np.unique(m)), key="moisture")
    known = None if dry is None else np.asarray(dry, np.float64)
    low, high = float(m.min()), float(m.max())
    span = high - low
    bounds = (0.0, 1.0) if model == "lagarde" else ETA_SOLID
    # Sums over the records are all that the search needs: the misfit is a quadratic in saturation and reflectance.
    total, square, num = r.sum(axis=0), (r**2).sum(axis=0), len(m)

    least = min(0.0, low - span)

    def numbers(x: Floats) -> tuple[float, float, float]:
        start = least + float(x[0]) * (high - least)
        return start, start + float(x[1]) * span, bounds[0] + float(x[2]) * (bounds[1] - bounds[0])

    def solve(x: Floats) -> tuple[float, Floats]:
        start, full, constant = numbers(x)
        w = np.clip((m - start) / (full - start), 0, 1)
        sums = float(w.sum()), float((w**2).sum())
        by_w = w @ r
        a = _ALBEDOS if known is None else known
        b = -a * (1 - full_factor(model, a, constant))
        curve = num * a**2 + 2 * a * b * sums[0] + b**2 * sums[1]
        if known is not None:
            return float((square - 2 * a * total - 2 * b * by_w + curve).sum()), known
        misfit = square[:, None] - 2 * np.outer(total, a) - 2 * np.outer(by_w, b) + curve
        best = misfit.argmin(axis=1)
        return float(misfit[np.arange(len(best)), best].sum()), _between(misfit, best)

    found: tuple[float, Floats] | None = None
    for begin in (low - 0.5 * span, low - 0.05 * span):
        for length in (0.3, 0.9):
            search = nlopt.opt(nlopt.LN_BOBYQA, 3)
            search.set_min_objective(lambda x, _: solve(np.asarray(x))[0])
            search.set_lower_bounds([0.0, 0.02, 0.0])
            search.set_upper_bounds([(low - least) / (high - least), 3.0, 1.0])
            search.set_xtol_rel(1e-5)
            search.set_maxeval(400)
            x = search.optimize([max((begin - least) / (high - least), 0.0), length, 0.5])
            if found is None or search.last_optimum_value() < found[0]:
                found = (search.last_optimum_value(), np.asarray(x, np.float64))
    assert found is not None
    x = found[1]
    _, albedo = solve(x)
    start, full, constant = numbers(x)
    fit = WetnessFit(model, albedo, start, full, constant, 0.0)
    rms = float(np.sqrt(np.mean((fit.predict(m) - r) ** 2)))
    return WetnessFit(model, albedo, start, full, constant, rms)


@dataclass(frozen=True)
class HeldOut:
    """How a model meets levels of moisture that it was not fitted to.

    Attributes
    ----------
    name : str
        A model, or what it is compared with: `mean` (one spectrum for all), `linear` and `quadratic` (per wavelength).
    rms : float
        Root mean square over all held-out records and wavelengths.
    wettest : float
        The same of the mean spectrum of the wettest level, which is an extrapolation.
    """

    name: str
    rms: float
    wettest: float


def moisture_levels(moisture: ArrayLike, count: int = 8) -> NDArray[np.int64]:
    """Return the level (N,) of each record: 0 driest, levels of about equal size."""
    m = np.asarray(moisture, np.float64)
    edges = np.quantile(m, np.linspace(0, 1, count + 1))
    return np.clip(np.searchsorted(edges, m, "right") - 1, 0, count - 1)


def held_out(moisture: ArrayLike, reflectance: ArrayLike, count: int = 8) -> list[HeldOut]:
    """Fit all models without every third level of moisture, the wettest among them, and score them there.

    Beside the three models stand the mean spectrum of the others, and polynomials in moisture per wavelength: what needs no
    physics.
    """
    m, r = np.asarray(moisture, np.float64), np.asarray(reflectance, np.float64)
    level = moisture_levels(m, count)
    out = (count - 1 - level) % 3 == 0
    predictions = {model: fit_wetness(m[~out], r[~out], model).predict(m) for model in MODELS}
    for name, degree in (("mean", 0), ("linear", 1), ("quadratic", 2)):
        powers = np.vander((m - m.mean()) / max(m.std(), 1e-12), degree + 1)
        predictions[name] = np.asarray(powers @ np.linalg.lstsq(powers[~out], r[~out], rcond=None)[0], np.float64)
    wettest = level == count - 1
    return [
        HeldOut(
            name,
            float(np.sqrt(np.mean((p - r)[out] ** 2))),
            float(np.sqrt(np.mean((p[wettest].mean(axis=0) - r[wettest].mean(axis=0)) ** 2))),
        )
        for name, p in predictions.items()
    ]


def _between(misfit: Floats, best: NDArray) -> Floats:
    """Return the albedo per wavelength where a parabola through the least misfit and its neighbours has its bottom."""
    at = np.clip(best, 1, len(_ALBEDOS) - 2)
    row = np.arange(len(best))
    left, middle, right = (misfit[row, at + k] for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    shift = np.where(bend > 0, 0.5 * (left - right) / np.where(bend > 0, bend, 1), 0)
    return _ALBEDOS[at] + np.clip(shift, -1, 1) * (_ALBEDOS[1] - _ALBEDOS[0])
