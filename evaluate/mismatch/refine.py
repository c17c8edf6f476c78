"""Refine the model that the search has found: fit it to the end, exchange, take out and hold against decoys what is in it."""

from __future__ import annotations

from .attribute import Model, SearchSettings, Trial, assess, gain_of, key_of, least_gain, names, roughness
from .calibrate import weigh
from .case import Case, Floats
from .decoys import DecoyResult, decoy_term, decoys_for
from .effect import Effect, Term
from .settle import needs_settling, prepared, settle
from .solve import context, fit
from .tolerance import SAYS, gain_over_calibration, is_tolerated
from .trying import screen, try_effect

Key = tuple[str, str | None]
# (gain, sigmas) of each effect over a model without it.
Losses = dict[Key, tuple[float, float]]

# Gain in chi-square a value that nothing within a calibration's tolerance has.
_PLAIN = 0.3
# What each parameter has to pay for itself where one effect is put in another's place, of the least gain of an effect.
_PAY = 0.1
_EXCHANGES = 3
# What is to take the place of an effect must gain this share of what that gains, on a few frames.
_NEAR = 0.8
# Share of what an effect gains that its freedom may owe to the roughness of others.
_MAKES_UP = 0.005


def polished(model: Model) -> Model:
    """Return the model fitted to the end."""
    if not model.effects:
        return model
    if needs_settling(model.terms):
        return assess(*settle(model.case, model.terms, weigh, 2))
    return assess(model.case, model.weight, fit(model.case, model.weight, model.terms, 15, 1e-6))


def exchanged(case: Case, base: Model, model: Model, effects: list[Effect], settings: SearchSettings, trials: list[Trial]) -> Model:
    """Return the model with effects exchanged for what is taken for them, where that does better, or as well with less freedom.

    The search goes on from what gains most: fog, which can lift shadows and blur lights as well. Once the rest is known,
    light from all around or glare may do all that is left of it. What was tried joins `trials`.
    """
    seen = {key_of(model)}
    for _ in range(_EXCHANGES):
        best, worth = None, _cost(model, settings) - _PAY * settings.least_gain
        for t in model.effects:
            candidates = [c for c in _rivals(case, base, model, t, effects, settings, trials) if key_of(c) not in seen]
            slack = _slack(base, model, t) if candidates else 0.0
            for c in candidates:
                cost = _cost(c, settings) - (slack if _freedom(c) < _freedom(model) else 0.0)
                if cost < worth:
                    best, worth = c, cost
        if best is None:
            break
        model = best
        seen.add(key_of(model))
    return model


def _freedom(model: Model) -> int:
    return sum(len(t.parameters) for t in model.effects)


def _cost(model: Model, settings: SearchSettings) -> float:
    return model.total / (model.weight > 0).sum() + _PAY * settings.least_gain * _freedom(model)


def _slack(base: Model, model: Model, term: Term) -> float:
    """Return what a term's freedom may gain without being needed: it makes up for what the other effects are rough by."""
    n = float((model.weight > 0).sum())
    others = [t for t in model.terms if t.key != term.key]
    less = assess(model.case, model.weight, fit(model.case, model.weight, others, 3))
    return max(min(roughness(less) ** 2 * (base.total - less.total), _MAKES_UP * (less.total - model.total)) / n, 0.0)


def _rivals(
    case: Case, base: Model, model: Model, term: Term, effects: list[Effect], settings: SearchSettings, trials: list[Trial]
) -> list[Model]:
    """Return the models with an effect that is taken for a term's in its place, as far as they come near."""
    rest = frozenset(t.key for t in model.effects if t.key != term.key)
    rivals = {
        rest | {(e.id, target)}: (e, target)
        for e in effects
        if e.id != term.effect.id and (e.id in term.effect.taken_for or term.effect.id in e.taken_for)
        for targets in [e.targets(case)]
        for target in ([term.target] if term.target in targets else targets)
        if (e.id, target) not in rest
    }
    # What the search has fitted already is not fitted anew.
    known = {key_of(trial.model): trial.model for trial in trials if trial.model is not None}
    near = [known[key] for key in rivals if key in known]
    fresh = [pair for key, pair in rivals.items() if key not in known]
    if fresh:
        others, around, weight = _others(case, base, model, term)
        less = assess(around, weight, fit(around, weight, others, 6))
        about = context(around, weight, less.fit)
        small = screen(around, weight, less.terms, settings.screen_frames)
        goal = small.tried(term.effect, term.target, 0.0)
        for effect, target in fresh:
            found = small.tried(effect, target, _NEAR * (goal[0] if goal else 0.0) * small.num_values)
            if found is None or (goal and found[0] < _NEAR * goal[0]):
                continue
            fitted = try_effect(around, weight, less.fit, about, effect, target, 10, found[1].terms[-1])
            if fitted is not None:
                rival = assess(around, weight, fitted)
                gain = gain_of(case, weight, less, rival)
                trials.append(Trial(effect.id, target, tuple(names(less)), *gain, True, rival))
                near.append(rival)
    close = 0.03 * (base.total - model.total)
    return [polished(m) for m in near if needs_settling(m.terms) or m.total < model.total + close]


def pruned(case: Case, base: Model, model: Model, settings: SearchSettings) -> tuple[Model, Losses]:
    """Take out again what is not needed; return the model, and (gain, sigmas) of each effect over a model without it."""
    while True:
        losses, needless = {}, []
        for t in model.effects:
            others = [o for o in model.terms if o.key != t.key]
            if len(model.effects) == 1:
                less = base
            elif t.effect.settles:
                less = assess(case, base.weight, fit(case, base.weight, others, 8))
            else:
                less = assess(model.case, model.weight, fit(model.case, model.weight, others, 8))
            gain, sigmas = losses[t.key] = gain_of(case, model.weight, less, model)
            # Whatever order they were found in: what an effect gains has to be more than the others are rough by.
            if gain < least_gain(base, less, settings) or sigmas < settings.sigmas:
                needless.append(t.key)
        if not needless or len(model.effects) < 2:
            return model, losses
        worst = min(needless, key=lambda k: losses[k][0])
        kept = [t for t in model.terms if t.key != worst]
        model = assess(model.case, model.weight, fit(model.case, model.weight, kept, 10))


def shown(
    case: Case, base: Model, model: Model, losses: Losses, settings: SearchSettings
) -> tuple[Model, Losses, dict[Key, list[DecoyResult]], list[str]]:
    """Drop what a decoy in wrong coordinates does better; return (model, losses, results of decoys by effect, notes)."""
    notes: list[str] = []
    while True:
        model, losses, within = _beyond_tolerance(case, base, model, losses, settings)
        notes += within
        results = {t.key: _against_decoys(case, base, model, t) for t in model.effects}
        beaten = [(t, r) for t in model.effects for r in results[t.key] if r.sigmas < -settings.sigmas]
        if not beaten:
            return model, losses, results, notes
        term, rival = min(beaten, key=lambda b: b[1].gain)
        place = f" on {term.target}" if term.target else ""
        notes.append(f"{term.effect.id}{place} lowered the residual, but {rival.title} lowers it more: it is not shown.")
        model, losses = _without(case, base, model, term, settings)


def _beyond_tolerance(
    case: Case, base: Model, model: Model, losses: Losses, settings: SearchSettings
) -> tuple[Model, Losses, list[str]]:
    """Drop what cameras and lamps explain as well that are off by no more than a calibration leaves."""
    notes: list[str] = []
    while case.traced:
        for t in sorted(model.effects, key=lambda t: losses[t.key][0]):
            if is_tolerated(case, t):
                break
            # What is plain to see was not left by a calibration.
            if losses[t.key][0] > _PLAIN and t.effect.id not in ("pose_error", "light_position"):
                continue
            gain, sigmas = gain_over_calibration(case, base, model, t, weigh)
            if gain < settings.least_gain or sigmas < settings.sigmas:
                break
        else:
            return model, losses, notes
        notes.append(f"{t.effect.id} is no more, or explains no more, than what a calibration leaves ({SAYS}): it is not named.")
        model, losses = _without(case, base, model, t, settings)
    return model, losses, notes


def _without(case: Case, base: Model, model: Model, term: Term, settings: SearchSettings) -> tuple[Model, Losses]:
    """Return the model without one of its effects, fitted and pruned again."""
    kept = [t for t in model.terms if t.key != term.key]
    less = base if len(kept) == 1 else assess(case, base.weight, fit(case, base.weight, prepared(case, kept, weigh), 10))
    return pruned(case, base, polished(less), settings)


def _against_decoys(case: Case, base: Model, model: Model, term: Term) -> list[DecoyResult]:
    """Put each decoy into the place of an effect, and see what that costs on held-out frames."""
    others, around, weight = _others(case, base, model, term)
    about = context(around, weight, fit(around, weight, others, 0))
    out = []
    for decoy in decoys_for(term.effect):
        rival = assess(around, weight, fit(around, weight, [*others, decoy_term(around, decoy, about)], 6))
        gain, sigmas = gain_of(case, model.weight, rival, model)
        if gain < 0:
            # Losses in some blocks speak against what is judged: now that is the decoy.
            sigmas = -gain_of(case, model.weight, model, rival)[1]
        out.append(DecoyResult(decoy.title, gain, sigmas))
    return out


def _others(case: Case, base: Model, model: Model, term: Term) -> tuple[list[Term], Case, Floats]:
    """Return (the terms without one, case, weight) to put something else in its place: where things were if it moved them."""
    others = [t for t in model.terms if t.key != term.key]
    if not term.effect.settles:
        return others, model.case, model.weight
    return prepared(case, others, weigh), case, base.weight
