"""Every model and base recovered from its own noisy samples at 151 x 151 directions, within the intervals it states.

Some 800 deviations, of noise that is fixed, against 4 standard deviations: were all independent, one in 20 such runs would have a
larger one by noise alone.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from materials.abrdf import ABRDF, pairs
from materials.directions import even_directions
from materials.fit import FitSettings, fit_texel
from materials.svbrdf import SVBRDF

from .report import Report

_SIGMAS = 4.0
_NOISE = 0.005
_SEEDS = 4
_ONE, _TWO = (0.15, 0.3), (0.6, 0.8)
_TURN = 0.3


def run(report: Report) -> None:
    """Record per model, base and number of lobes the largest deviation in standard deviations, over seeds of noise."""
    dome = even_directions(151)
    wi, wo = pairs(dome, dome)
    for model, base, lobes in product(("ct", "ggx", "ward", "phong"), ("lambert", "oren_nayar"), (1, 2)):
        truth = _truth(model, base, lobes)
        clean = truth.reflect(wi, wo, np.zeros(len(wi), np.int64)) / wi[:, 2:]
        settings = FitSettings(model=model, base=base, lobes=lobes, constrained=False, free_angle_deg=75.1)
        deviations = [_deviation(wi, wo, clean, truth, settings, seed) for seed in range(_SEEDS)]
        count = f"{lobes} lobe{'s' if lobes > 1 else ''}"
        name = f"{model} on {base}, {count}: largest deviation of a parameter, of its standard deviation"
        value = float(np.max(deviations))
        report.proof(name=name, value=value, bound=_SIGMAS, holds=value < _SIGMAS)


def _truth(model: str, base: str, lobes: int) -> SVBRDF:
    """Return one texel; its widths and tangent are told apart by all models but Phong's, whose lobes are round."""
    scale = 0.05 if model in ("ward", "phong") else 1.0
    specular = scale * np.array([[(0.5, 0.5, 0.4), (0.3, 0.3, 0.3)]])[:, :lobes]
    alpha = np.array([[_ONE, _TWO]])[:, :lobes]
    turn = 0.0 if model == "phong" else _TURN
    if model == "phong":
        alpha = np.repeat(alpha[..., :1], 2, axis=-1)
    c, s = np.cos(turn), np.sin(turn)
    frame = np.array([[[c, -s, 0], [s, c, 0], [0, 0, 1]]])
    sigma = None if base == "lambert" else np.array([0.5])
    diffuse, none = np.array([[0.3, 0.2, 0.1]]), np.zeros(1)
    return SVBRDF(model, 1.5, np.ones((1, 1), bool), diffuse, specular, alpha, frame, none, none, sigma=sigma)


def _deviation(wi: NDArray, wo: NDArray, clean: NDArray, truth: SVBRDF, settings: FitSettings, seed: int) -> float:
    noisy = clean + _NOISE * np.random.default_rng(seed).standard_normal(clean.shape)
    abrdf = ABRDF(wi, wo, noisy.astype(np.float32), np.ones(len(wi), bool), np.ones(len(wi)))
    fit = fit_texel(abrdf, 0, settings)
    order = np.argsort(fit.alpha.prod(axis=1))  # a fit names its lobes as it likes
    lobes, rough = settings.lobes, settings.base == "oren_nayar"
    found = [fit.diffuse, fit.specular[order].ravel(), fit.alpha[order].ravel()]
    known = [truth.diffuse.ravel(), truth.specular.ravel(), truth.alpha.ravel()]
    places = np.arange(3 + 5 * lobes + rough)
    places[3 : 3 + 3 * lobes] = (3 + np.arange(3 * lobes).reshape(lobes, 3)[order]).ravel()
    places[3 + 3 * lobes : 3 + 5 * lobes] = (3 + 3 * lobes + np.arange(2 * lobes).reshape(lobes, 2)[order]).ravel()
    if rough:
        found.append(np.array([fit.sigma]))
        known.append(truth.spread)
    deviation = np.sqrt(np.diag(fit.covariance))[places]
    free = deviation > 0
    # Phong's second width is its first, and held: all else must be free, or nothing would be shown.
    assert free.sum() == len(free) - (lobes if settings.model == "phong" else 0), free
    return float(np.max(np.abs(np.concatenate(found) - np.concatenate(known))[free] / deviation[free]))
