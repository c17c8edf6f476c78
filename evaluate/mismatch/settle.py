"""Trace anew what the pixels see, where a model has moved lamps, cameras or bodies; then the model fits on from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .case import Case, Floats, Settled, with_believed
from .effect import Term
from .solve import Fit, by_frame, context, fit, predict
from .warp import TWIST


def needs_settling(terms: list[Term]) -> bool:
    """Return whether a model moves anything."""
    return any(t.effect.settles for t in terms)


def settled_case(case: Case, terms: list[Term]) -> Case:
    """Return the case with its pieces gathered where the terms have moved things to; given pictures stay what they are."""
    if not case.traced:
        return case
    lamps = predict(case, terms)[0].lamps
    twist, moves, bend = None, {}, None
    for t in terms:
        if t.effect.id == "pose_error":
            values = by_frame(case, t)
            twist = np.stack([values[n] for n in TWIST], axis=1)
        elif t.effect.id == "moved_object" and t.target is not None:
            moves[t.target] = np.array([float(t.values[n]) for n in TWIST])
        elif t.effect.id == "lens_distortion":
            bend = np.array([float(t.values[n]) for n in ("k1", "k2")])
    moved = replace(case, settled=Settled(lamps, twist, moves, bend), believed=(), cache={})
    given: list[Term] = []
    for t in case.believed:
        moved = with_believed(moved, tuple(given))
        about = context(moved, moved.variance * 0, fit(moved, moved.variance * 0, [], 0))
        given.append(replace(t, aux=t.effect.restored(moved, t.target, about, t.effect.stored(case, t.target, t.aux))))
    return with_believed(moved, tuple(given))


def settle(case: Case, terms: list[Term], weigh, rounds: int = 3) -> tuple[Case, Floats, Fit]:
    """Return (case, weight, fit) of a model on pieces gathered where it puts things.

    Parameters
    ----------
    weigh : function
        Of a case and a picture, returns the weights of its pixels.
    """
    previous = np.inf
    while True:
        case = settled_case(case, terms)
        ready = prepared(case, terms, weigh)
        weight = weigh(case, predict(case, ready)[2])
        fitted = fit(case, weight, ready, 6)
        terms, rounds = fitted.terms, rounds - 1
        if rounds == 0 or fitted.total > 0.98 * previous:
            return case, weight, fitted
        previous = fitted.total


def prepared(case: Case, terms: list[Term], weigh) -> list[Term]:
    """Return the terms with what they prepare found anew, each on top of those before it."""
    out: list[Term] = []
    for t in terms:
        t = t.copy()
        if t.aux is not None:
            weight = weigh(case, predict(case, out)[2])
            aux = t.effect.prepare(case, t.target, context(case, weight, fit(case, weight, out, 0)))
            # What no longer finds itself keeps what it had, if that still fits the pieces.
            if aux is False:
                continue
            t.aux = aux
            if t.effect.completes:
                t = completed(case, weight, [*out, t])
        out.append(t)
    return out


def completed(case: Case, weight: Floats, terms: list[Term]) -> Term:
    """Return the last term with what can be found of it only now that the others, and its own values, are known."""
    *others, t = terms
    t = t.copy()
    t.aux = t.effect.completed(case, t.target, t.aux, t.values, context(case, weight, fit(case, weight, others, 0)))
    return t
