"""Which effects a measurement needs: tried one on top of another, against decoys, and taken out again."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations
from typing import Protocol

import numpy as np

from materials.foundation.progress import tracked

from ..attribute import SearchSettings
from ..effect import Effect
from .fit import World
from .judge import Decoy, Model, assess, decoys, gain_over
from .locate import located

logger = logging.getLogger("meniscus")
# An effect has to explain at least this share of what any function of its own coordinate explains.
_SHARE_OF_OWN = 0.5
_SHARE_OF_REST = 0.05


class Candidates(World, Protocol):
    """A world that knows which effects have a place in it."""

    untested: list[str]

    def applicable(self, have: tuple[str, ...]) -> list[Effect]: ...
    def starts(self, effect: Effect, have: tuple[str, ...], values: dict[str, float]) -> list[dict[str, float]]: ...
    def own_coordinate(self, id: str) -> str: ...


@dataclass
class Trial:
    """Something that was tried on top of a model.

    Attributes
    ----------
    verdict : str
        Why it was taken or not, in a few words.
    """

    id: str
    on_top_of: tuple[str, ...]
    gain: float
    sigmas: float
    excess: float
    verdict: str
    is_decoy: bool = False
    model: Model | None = None


@dataclass
class Found:
    """The outcome of a search."""

    base: Model
    best: Model
    trials: list[Trial]
    # (gain, sigmas) of each effect over a model without it.
    losses: dict[str, tuple[float, float]] = field(default_factory=dict)
    ambiguous: dict[str, list[str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def search(world: Candidates, base: Model, settings: SearchSettings, say: Callable[[str], None] = logger.info) -> Found:
    """Add effects one at a time, as long as one gains enough on held-out blocks and beats every decoy in the wrong coordinates."""
    found = Found(base, base, [])
    cache: dict[frozenset[str], Model] = {frozenset(): base}
    for depth in range(settings.most):
        model = found.best
        if model.ids and model.excess < settings.least_gain and not located(world.samples, model.z).any():
            break
        step = _step(world, model, base, settings, found, cache, depth)
        if step is None:
            break
        found.best = step
        say("  " + " + ".join(step.ids) + f": held-out chi-square {step.per_value:.4g} a value")
    _prune(world, found, settings, cache)
    _drop_foreign(world, found)
    _ambiguities(world, found, cache)
    return found


def _step(
    world: Candidates, model: Model, base: Model, settings: SearchSettings, found: Found, cache: dict, depth: int
) -> Model | None:  # fmt: skip
    """Return the best model with one effect more, or two where none alone will do; None where nothing is worth it."""
    s = world.samples
    false = decoys(model)
    top = model.ids or ("nothing",)
    for d in false:
        gain, sigmas = gain_over(model, d, s)
        found.trials.append(Trial(d.name, top, gain, sigmas, d.total / s.value.size - 1, "no physics", True))
    effects = world.applicable(model.ids)
    words = "trying effects" if depth == 0 else f"trying effect {depth + 1}"
    alone = [_extended(world, model, e, cache) for e in tracked(effects, words)]
    best = _judged(world, model, alone, false, settings, found)
    if best is None and len(model.ids) + 2 <= settings.most:
        # Two that stand for one thing, such as a second lobe and how lobes rise, may be worth nothing one by one.
        helping = [m for m in alone if gain_over(model, m, s)[0] > settings.least_gain]
        pairs = [_joined(world, a, b, cache) for a, b in combinations(helping, 2)]
        best = _judged(world, model, pairs, false, settings, found)
    return best


def _judged(
    world: Candidates, model: Model, candidates: list[Model], false: list[Decoy], settings: SearchSettings, found: Found
) -> Model | None:  # fmt: skip
    """Return the best of those that gain enough and beat every decoy in the wrong coordinates."""
    s = world.samples
    # A further effect must explain a share of what the model before leaves over.
    least = settings.least_gain if not model.ids else max(settings.least_gain, _SHARE_OF_REST * model.excess)
    good: list[tuple[Model, list[Decoy], Trial]] = []
    for candidate in candidates:
        new = candidate.ids[len(model.ids) :]
        gain, sigmas = gain_over(model, candidate, s)
        trial = Trial(" + ".join(new), model.ids or ("nothing",), gain, sigmas, candidate.excess, "possible", model=candidate)
        found.trials.append(trial)
        own = {world.own_coordinate(id) for id in new}
        better = [d for d in false if d.coordinate not in own and d.total < candidate.total]
        if gain < least or sigmas < settings.sigmas:
            trial.verdict = "gains too little"
        elif better:
            trial.verdict = f"{better[0].name} does better"
        else:
            alike = [d for d in false if d.coordinate in own and gain_over(candidate, d, s)[1] > 1]
            good.append((candidate, alike, trial))
    if not good:
        return None
    best, beaten_by, trial = min(good, key=lambda g: g[0].total)
    trial.verdict = "taken"
    for d in beaten_by:
        rest = gain_over(best, d, s)[0]
        found.notes.append(
            f"With {trial.id}, {d.name} would still do better (by {rest:.3g} in held-out chi-square a value): the form of "
            "what is missing is not quite the one that the effect has."
        )
    return best


def _extended(world: Candidates, model: Model, effect: Effect, cache: dict) -> Model:
    """Return the model with an effect more, fitted from all of its first guesses."""
    ids = (*model.ids, effect.id)
    key = frozenset(ids)
    if key not in cache:
        cache[key] = assess(world, ids, world.starts(effect, model.ids, model.fit.values))
    return cache[key]


def _joined(world: Candidates, a: Model, b: Model, cache: dict) -> Model:
    """Return the model with the last effects of both."""
    ids = (*a.ids, b.ids[-1])
    key = frozenset(ids)
    if key not in cache:
        cache[key] = assess(world, ids, [a.fit.values | b.fit.values, b.fit.values | a.fit.values])
    return cache[key]


def _prune(world: Candidates, found: Found, settings: SearchSettings, cache: dict) -> None:
    """Take effects out again that are not needed, and note what each one gains."""
    while True:
        model = found.best
        found.losses = {}
        for id in model.ids:
            less = _of_ids(world, tuple(i for i in model.ids if i != id), model, cache)
            if less is None:
                # What another effect stands on cannot go before it.
                found.losses[id] = gain_over(found.base, model, world.samples)
                continue
            found.losses[id] = gain_over(less, model, world.samples)
        weak = [id for id, (gain, sigmas) in found.losses.items() if gain < settings.least_gain or sigmas < settings.sigmas]
        removable = [i for i in weak if _of_ids(world, tuple(k for k in model.ids if k != i), model, cache) is not None]
        if not removable or len(model.ids) < 2:
            return
        worst = min(removable, key=lambda i: found.losses[i][0])
        found.notes.append(f"{worst} was taken out again: the others do as well without it.")
        less = _of_ids(world, tuple(i for i in model.ids if i != worst), model, cache)
        assert less is not None
        found.best = less


def _drop_foreign(world: Candidates, found: Found) -> None:
    """Take back everything where any function of the effects' coordinate explains more than twice as much: it is something else."""
    s, best = world.samples, found.best
    if not best.ids:
        return
    gain = gain_over(found.base, best, s)[0]
    own = {world.own_coordinate(id) for id in best.ids}
    for d in decoys(found.base):
        other = gain_over(found.base, d, s)[0]
        if d.coordinate in own and gain < _SHARE_OF_OWN * other:
            found.notes.append(
                f"{' and '.join(best.ids)} explained {gain:.3g} of held-out chi-square a value, {d.name} {other:.3g}: what is "
                "missing depends on that coordinate, but is none of the effects."
            )
            found.best, found.losses = found.base, {}
            return


def _of_ids(world: Candidates, ids: tuple[str, ...], like: Model, cache: dict) -> Model | None:
    """Return the model of these effects, or None if one has no place there."""
    for i, id in enumerate(ids):
        if id not in {e.id for e in world.applicable(ids[:i])}:
            return None
    key = frozenset(ids)
    if key not in cache:
        cache[key] = assess(world, ids, [like.fit.values])
    return cache[key]


def _ambiguities(world: Candidates, found: Found, cache: dict) -> None:
    """Name what does as well in the place of each effect: within one standard error."""
    model = found.best
    for at, id in enumerate(model.ids):
        found.ambiguous[id] = []
        for effect in world.applicable(tuple(i for i in model.ids if i != id)):
            if effect.id in model.ids:
                continue
            ids = (*model.ids[:at], effect.id, *model.ids[at + 1 :])
            other = _of_ids(world, ids, model, cache)
            if other is None:
                continue
            # As blocks differ: where one does better in some and the other in others, these data do not part them.
            better = other.score - model.score
            spread = np.std(better, ddof=1) * np.sqrt(len(better)) if len(better) > 1 else 0.0
            if better.sum() <= spread or gain_over(other, model, world.samples)[1] < 1:
                found.ambiguous[id].append(effect.id)
