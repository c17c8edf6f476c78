"""Which physics was left out: candidates are tried, judged on views and lights that they were not fitted to, and combined."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from materials.foundation.progress import tracked

from .blocks import surely
from .calibrate import weigh, white_level
from .case import Case, Floats
from .effect import Effect, Term
from .locate import largest_tile, structure
from .settle import needs_settling, settle
from .solve import Fit, context, held_out
from .trying import screen, try_effect

logger = logging.getLogger("meniscus")
# Of the excess: what edges and the weights' own noise take off chi-square where nothing is left.
_SLACK = 0.05
# What an approximation leaves over looks like no other effect: what explains this share of it was left out itself.
_TELLING = 0.6
_LEFT = 0.01
# Pixels that are off together where a simulation itself is uncertain (`Case.shared_variance`).
_TOGETHER = 25


@dataclass(frozen=True)
class SearchSettings:
    """How the search goes on.

    Attributes
    ----------
    screen_frames : int
        Frames on which all candidates are tried first.
    finalists : int
        How many are fitted to all frames.
    branches : int
        How many first effects are followed up.
    most : int
        Largest number of effects in a model.
    least_gain : float
        What an effect must gain on held-out frames, in chi-square a value.
    least_share : float
        What a further effect must explain of what the model before it leaves over.
    follow : float
        Share of the best candidate's gain that a candidate must promise to be followed up.
    sigmas : float
        How surely it must gain, over blocks.
    """

    screen_frames: int = 6
    finalists: int = 5
    branches: int = 2
    most: int = 3
    least_gain: float = 0.0015
    least_share: float = 0.25
    follow: float = 0.2
    sigmas: float = 3.0


@dataclass
class Model:
    """Effects with their fit, and how it does on what it was not fitted to.

    Attributes
    ----------
    score : (F,) float64
        Held-out chi-square of each frame.
    excess : float
        What is left over the noise, per value: held-out chi-square less the level of white noise.
    """

    case: Case
    weight: Floats
    terms: list[Term]
    fit: Fit
    score: NDArray[np.float64]
    excess: float
    white: float
    structure: float
    worst: float

    @property
    def effects(self) -> list[Term]:
        return [t for t in self.terms if t.effect.id != "free"]

    @property
    def total(self) -> float:
        return float(self.score.sum())


@dataclass
class Trial:
    """A candidate that was tried on top of a model, for the report."""

    id: str
    target: str | None
    on_top_of: tuple[str, ...]
    gain: float
    sigmas: float
    full: bool
    model: Model | None = None


def assess(case: Case, weight: Floats, fitted: Fit) -> Model:
    """Return a fit as a model with its score."""
    n = int((weight > 0).sum())
    score = held_out(case, fitted)
    z = (case.pictures - fitted.picture) * np.sqrt(weight)
    white = white_level(case, z)
    return Model(
        case, weight, fitted.terms, fitted, score, float(score.sum() / n - white**2), white, structure(case, z, white),
        largest_tile(case, z, white),
    )  # fmt: skip


def gain_of(case: Case, weight: Floats, before: Model, after: Model) -> tuple[float, float]:
    """Return (gain per value, how many standard errors) of one model over another, over blocks of repeats."""
    n = float((weight > 0).sum())
    change = (after.fit.picture - before.fit.picture) * np.sqrt(weight)
    square, size = (change**2).sum(axis=(1, 2, 3), dtype=np.float64), np.abs(change).sum(axis=(1, 2, 3), dtype=np.float64)
    # Where the simulation itself is uncertain, neighbours are off together, and noise counts for more.
    white = float(np.sqrt(after.white**2 + _TOGETHER * case.shared_variance))
    gain, sigmas = surely(before.score - after.score, square, size, case.block, white)
    return gain / n, sigmas


def search(
    case: Case, weight: Floats, base: Fit, effects: list[Effect], settings: SearchSettings, say: Callable[[str], None] = logger.info
) -> tuple[Model, Model, list[Trial]]:
    """Return (base model, best model, everything that was tried).

    From the base, and then from the best models found, every effect is tried: on a few frames first, the best on all. A
    model is done when nothing more gains enough; among finished models the one with the least left over wins, where each
    effect more has to pay for itself by `least_share` of it.
    """
    start = assess(case, weight, base)
    trials: list[Trial] = []
    front, finished = [start], [start]
    seen: set[frozenset] = set()
    for depth in range(settings.most):
        found: list[Model] = []
        before: dict[frozenset, float] = {}
        for model in front:
            more = _extend(model, start, effects, settings, trials, depth)
            found += more
            before |= {key_of(m): max(model.excess, before.get(key_of(m), 0.0)) for m in more}
        unique = []
        for model in sorted(found, key=lambda m: m.total):
            if key_of(model) not in seen:
                seen.add(key_of(model))
                unique.append(model)
        if not unique:
            break
        unique[: settings.branches] = [_settled(m) for m in unique[: settings.branches]]
        unique.sort(key=lambda m: m.total)
        finished += unique
        best = unique[0]
        say("  " + " + ".join(names(best)) + f": held-out chi-square {best.total / (weight > 0).sum():.4f}")
        # What does not pay for itself will not be chosen, and is no ground to build on.
        near = [m for m in unique[: settings.branches] if m.excess < 3 * max(best.excess, 0) + 0.01]
        front = [m for m in near if m.excess < (1 - settings.least_share) * before[key_of(m)]]
    return start, _choose(case, weight, finished, settings), trials


def is_noise(model: Model) -> bool:
    """Return whether nothing but noise is left of a model's residual."""
    # As large as structure comes out by chance among so many tiles of 4 x 4 values, in one of a hundred nulls.
    chance = 2.33 * model.white**2 / 16 * np.sqrt(2 / max((model.weight > 0).sum() / 16, 1))
    return model.structure < 0.004 + chance + model.case.shared_variance and model.worst < 6.5


def roughness(model: Model) -> float:
    """Return how much of the amplitude of a model's effects may be left over without being an effect: they are approximations."""
    return max((t.effect.approximation for t in model.effects), default=0.0)


def least_gain(start: Model, model: Model, settings: SearchSettings) -> float:
    """Return what an effect more must gain, in chi-square a value: more than those of the model may be wrong by."""
    return max(settings.least_gain, min(rough_by(start, model), _TELLING * (max(model.excess, 0.0) + _LEFT)))


def rough_by(start: Model, model: Model) -> float:
    """Return the chi-square a value that a model's effects may leave over for being approximations."""
    return roughness(model) ** 2 * (start.total - model.total) / float((model.weight > 0).sum())


def key_of(model: Model) -> frozenset[tuple[str, str | None]]:
    """Return which effects a model has, in whatever order they were found."""
    return frozenset(t.key for t in model.effects)


def names(model: Model) -> list[str]:
    """Return the effects of a model with their targets, for people."""
    return [t.effect.id + (f"({t.target})" if t.target else "") for t in model.effects] or ["nothing"]


def _settled(model: Model) -> Model:
    """Return the model on pieces gathered where it puts things, if it moves any."""
    if not needs_settling(model.terms):
        return model
    return assess(*settle(model.case, model.terms, weigh))


def _extend(
    model: Model, start: Model, effects: list[Effect], settings: SearchSettings, trials: list[Trial], depth: int
) -> list[Model]:
    """Return the models with one effect more that are better by enough."""
    case, weight = model.case, model.weight
    least = least_gain(start, model, settings)
    # Far less is left than the model's effects may be wrong by: nothing more could be told.
    if model.effects and model.excess + _SLACK < max(least, rough_by(start, model)):
        return []
    small = screen(case, weight, model.terms, settings.screen_frames)
    have = {t.key for t in model.effects}
    tried: list[tuple[float, Effect, str | None, Fit]] = []
    pairs = [(e, t) for e in effects for t in e.targets(case) if (e.id, t) not in have]
    joint: dict[str, float] = {}
    best = 0.0
    for effect, target in tracked(pairs, "trying effects" if depth == 0 else f"trying effect {depth + 1}"):
        # What all targets together cannot explain, one of them cannot.
        if effect.id in joint and joint[effect.id] < settings.follow * best:
            continue
        found = small.tried(effect, target, max(settings.follow * best, 0.3 * least) * small.num_values)
        gain = 0.0 if found is None else found[0]
        if target is None:
            joint[effect.id] = gain
        best = max(best, gain)
        if found is None:
            continue
        trials.append(Trial(effect.id, target, tuple(names(model)), gain, np.nan, False))
        if gain > 0.5 * least:
            tried.append((gain, effect, target, found[1]))
    tried.sort(key=lambda t: -t[0])
    out = []
    full = context(case, weight, model.fit)
    for gain, effect, target, small_fit in tried[: settings.finalists]:
        if gain < settings.follow * tried[0][0]:
            break
        fitted = try_effect(case, weight, model.fit, full, effect, target, 10, small_fit.terms[-1])
        if fitted is None:
            continue
        candidate = assess(case, weight, fitted)
        gain, sigmas = gain_of(case, weight, model, candidate)
        trials.append(Trial(effect.id, target, tuple(names(model)), gain, sigmas, True, candidate))
        if gain > least and sigmas > settings.sigmas:
            out.append(candidate)
    return out


def _choose(case: Case, weight: Floats, models: list[Model], settings: SearchSettings) -> Model:
    """Return the model with the least left over, where each effect has to pay for itself."""
    n = float((weight > 0).sum())
    floor = max(min(m.excess for m in models), 0.0)

    def cost(m: Model) -> float:
        return np.log(max(m.total / n - m_floor, 1e-3)) - len(m.effects) * np.log(1 - settings.least_share)

    m_floor = min(m.total / n for m in models) - floor - 0.004
    return min(models, key=cost)
