"""The diagnosis, from a recording and what was believed of it to a verdict: calibrate, locate, attribute, prove."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ..effects.catalogue import catalogue
from ..effects.given import with_given
from .attribute import Model, SearchSettings, Trial, assess, is_noise, search
from .calibrate import calibrate, free_term, quiet_level, weigh
from .case import Case, Floats, with_noise_times
from .decoys import DecoyResult
from .effect import Effect, Term
from .locate import Dependence, dependences, located
from .prove import HeldOut, prove
from .refine import exchanged, polished, pruned, shown
from .solve import Fit, by_frame, covariance, fit, predict
from .tolerance import SAYS, calibrated_away

logger = logging.getLogger("meniscus")
_SIGMAS = 3.0
# Where found noise differs from what is stated by the first share, it is what everything is judged by; by the second, it is
# called a mismatch: what renders the recording adds its own, a third of the noise at most.
_NOISE_SHARE, _NOISE_NAMED = 0.06, 0.09


@dataclass
class Finding:
    """An effect that was found.

    Attributes
    ----------
    parameters : dict
        By name: value, unit and ci90; of parameters per frame or pose lists.
    gain : float
        What held-out chi-square a value gains by it, all other effects being there.
    p_value : float
        Of that gain being chance, over blocks of repeats.
    decoys : list of DecoyResult
        What it gains over smooth corrections in wrong coordinates.
    """

    id: str
    title: str
    says: str
    where: str | None
    parameters: dict[str, Any]
    gain: float
    p_value: float
    ambiguous_with: list[str] = field(default_factory=list)
    decides: str = ""
    decoys: list[DecoyResult] = field(default_factory=list)


@dataclass
class Diagnosis:
    """What was found, and all that it rests on."""

    case: Case
    seed: int
    verdict: str
    findings: list[Finding]
    base: Model
    best: Model
    trials: list[Trial]
    held_out: HeldOut
    located: NDArray[np.bool_]
    affected: NDArray[np.bool_]
    noise_factor: float
    depends_on: list[Dependence]
    tested: list[str]
    notes: list[str]

    @property
    def predicted(self) -> Floats:
        """What the final model predicts (F, H, W, 3), divided by exposures."""
        return self.best.fit.picture


def diagnose(
    case: Case,
    effects: list[Effect],
    seed: int = 0,
    settings: SearchSettings | None = None,
    say: Callable[[str], None] = logger.info,
) -> Diagnosis:
    """Find out which of the effects were left out of the simulation.

    Parameters
    ----------
    effects : list of Effect
        The catalogue to choose from.
    seed : int
        Of the choice of held-out views and lights.
    say : function
        Told what is going on, line by line.
    """
    settings = settings or SearchSettings()
    case = with_given(case, {e.id: e for e in (*catalogue(), *effects)})
    say(f"{case.num_frames} frames, {len(np.unique(case.pose))} views, {len(np.unique(case.lit))} lights")
    stated = not case.noise_estimated and "noise_model" in {e.id for e in effects}
    as_stated = case
    case, fitted, weight, level = _calibrated(case, stated, say)
    first = assess(case, weight, fitted)
    z = (case.pictures - fitted.picture) * np.sqrt(weight)
    found = located(case, z, max(first.white, 1.0))
    say(f"calibrated: chi-square {first.total / (weight > 0).sum():.4f} a value, {found.mean():.1%} of the pixels located")
    # Even where nothing is located: fine and weak effects (blur) show in no average.
    base, best, trials = search(case, weight, fitted, effects, settings, say)
    best = exchanged(case, base, polished(best), effects, settings, trials)
    best, losses = pruned(case, base, best, settings)
    say("holding what was found against smooth gains that are no physics")
    best, losses, decoys, unshown = shown(case, base, best, losses, settings)
    findings = [_finding(case, best, t, *losses[t.key]) for t in best.effects]
    for finding in findings:
        finding.decoys = decoys[finding.id, finding.where]
    _name_ambiguities(best, findings, trials)
    notes = [*case.notes, *unshown]
    if case.noise_estimated:
        notes.append(
            f"The recording states no noise; it was estimated from the finest differences: read_sigma "
            f"{case.noise.read_sigma:.3g}, shot_gain {case.noise.shot_gain:.3g}."
        )
    if case.num_frames == 1:
        notes.append("One frame only: nothing could be held out, and what changes between frames cannot be seen.")
    noise_factor = level * best.white
    noisy = stated and abs(noise_factor - 1) > _NOISE_NAMED and best.structure < 0.03 * best.white**2 + 0.01
    if noisy:
        findings.append(_noise_finding(best, noise_factor))
    # Another noise that the catalogue has no name for is left over all the same.
    nameless = not (case.noise_estimated or stated) and "noise_model" not in case.untestable
    clean = is_noise(best)
    if not clean and case.traced and is_noise(calibrated_away(best)):
        clean = True
        notes.append(f"What remains is what a calibration leaves: {SAYS}.")
    clean = clean and not (nameless and abs(noise_factor - 1) > _NOISE_NAMED)
    if findings:
        verdict = "explained" if clean else "partly_explained"
    else:
        verdict = "consistent" if clean else "unexplained"
    residual = (best.case.pictures - best.fit.picture) * np.sqrt(best.weight)
    affected = _affected(as_stated, best) if findings else (found if verdict == "unexplained" else np.zeros_like(found))
    if noisy:
        # Noise is everywhere, though no noise-free pixel is changed by it.
        notes.append(f"The noise is {noise_factor:.2f} times what the recording states.")
    depends = [] if clean else dependences(best.case, residual, best.fit.picture, best.white)
    say("proving on held-out views and lights")
    proof = prove(case, base, best, seed)
    # Noise that was found to be another is part of what is modelled; before, there was what is stated.
    after = 1.0 if noisy else level**2
    proof = replace(proof, chi2_before=proof.chi2_before * level**2, chi2_after=proof.chi2_after * after)
    tested = [e.id for e in effects]
    return Diagnosis(
        case, seed, verdict, findings, base, best, trials, proof, found, affected, noise_factor, depends, tested, notes
    )  # fmt: skip


def _calibrated(case: Case, stated: bool, say: Callable[[str], None]) -> tuple[Case, Fit, Floats, float]:
    """Return (case, fit of the free parameters, weight, noise over what is stated); the case has the noise that was found."""
    fitted, weight = calibrate(case)
    fitted = fit(case, weight, fitted.terms, 8)
    level = quiet_level(case, weight, fitted.picture) if stated else 1.0
    if abs(level - 1) < _NOISE_SHARE:
        return case, fitted, weight, 1.0
    # In noise that is too small, everything would seem to gain.
    say(f"noise: {level:.3f} times what is stated, by which everything is judged from here on")
    case = with_noise_times(case, level)
    weight = weigh(case, fitted.picture)
    return case, fit(case, weight, fitted.terms, 8), weight, level


def _finding(case: Case, model: Model, t: Term, gain: float, sigmas: float) -> Finding:
    sigma = covariance(model.case, model.fit)
    parameters: dict[str, Any] = {}
    for p in t.parameters:
        value, s = np.atleast_1d(t.values[p.name]), np.atleast_1d(sigma[(*t.key, p.name)])
        low, high = np.clip(value - 1.645 * s, p.low, p.high), np.clip(value + 1.645 * s, p.low, p.high)
        one = p.per == ""
        parameters[p.name] = {
            "value": float(value[0]) if one else value.tolist(),
            "unit": p.unit,
            "ci90": [float(low[0]), float(high[0])] if one else np.stack([low, high], 1).tolist(),
        } | ({} if one else {"per": p.per})
    parameters |= t.effect.summary(model.case, by_frame(model.case, t), t.target, t.aux)
    e = t.effect
    return Finding(e.id, e.title, e.says, t.target, parameters, gain, float(norm.sf(min(sigmas, 37.0))), [], e.decides)


def _noise_finding(model: Model, factor: float) -> Finding:
    n = max(int((model.weight > 0).sum()) // 4, 1)
    s = factor * np.sqrt(1.36 / n)  # a median of absolute values is worth 37 % of the values
    return Finding(
        "noise_model", "another noise than stated", "the residual has no structure, but not the size that the noise model gives it",
        None, {"sigma_factor": {"value": factor, "unit": "1", "ci90": [factor - 1.645 * s, factor + 1.645 * s]}},
        0.0, float(norm.sf(min(abs(factor - 1) / s, 37.0))), [], "photograph one scene twice and take the difference",
    )  # fmt: skip


def _name_ambiguities(best: Model, findings: list[Finding], trials: list[Trial]) -> None:
    """Name what does as well in the place of each finding: within one standard error, or so little worse that it is no matter."""
    others = {f.id for f in findings}
    for finding in findings:
        rest = {f.id for f in findings if f is not finding}
        for trial in sorted(trials, key=lambda t: -t.gain):
            if trial.model is None or trial.id in others or trial.id in finding.ambiguous_with:
                continue
            ids = {t.effect.id for t in trial.model.effects}
            if ids != rest | {trial.id}:
                continue
            if trial.model.excess < best.excess + max(0.002, 0.1 * abs(best.excess + 0.03)) and len(finding.ambiguous_with) < 2:
                finding.ambiguous_with.append(trial.id)


def _affected(case: Case, best: Model) -> NDArray[np.bool_]:
    """Return where the effects change the noise-free pixel by more than three standard deviations (F, H, W).

    Those of the sensor's noise on the picture without the effects, which is what the sender would have gone by.
    """
    free = free_term(case)
    free.values = {k: np.copy(v) for k, v in best.terms[0].values.items()}
    without = predict(case, [free])[2]
    change = np.abs(best.fit.picture - without) / np.sqrt(case.noise_of(without))
    return np.any(change > _SIGMAS, axis=-1)
