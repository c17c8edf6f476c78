"""What a careful calibration leaves: cameras off by parts of a pixel, lamps by parts of a per cent. That is no mismatch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..effects.light_position import LightPosition
from ..effects.pose_error import PoseError
from .attribute import Model, assess, gain_of
from .case import Case
from .effect import Term
from .settle import prepared
from .solve import fit

# Of a camera, by its turn about and its shift along each axis [px]; of a lamp, along each axis, over its distance.
PIXELS, LAMPS = 0.06, 0.004
SAYS = f"cameras are off by no more than {PIXELS:g} px, and lamps by {LAMPS:.1%} of their distance"


def calibration_terms(case: Case, besides: list[Term]) -> list[Term]:
    """Return cameras and lamps that may be off by what is tolerated, but for those that the terms move already."""
    moved = {t.effect.id for t in besides}
    out = []
    pose, lamps = PoseError(), LightPosition()
    if pose.id not in moved:
        # Its steps are tenths of a pixel.
        limit = 10 * PIXELS
        out.append(
            Term(pose, None, None, tuple(replace(p, low=-limit * p.step, high=limit * p.step) for p in pose.parameters(case, None)))
        )
    targets = lamps.targets(case)
    if lamps.id not in moved and targets:
        # Of all lamps if there are several; they may go as far as they are away.
        own = tuple(replace(p, low=LAMPS * p.low, high=LAMPS * p.high) for p in lamps.parameters(case, targets[0]))
        out.append(Term(lamps, targets[0], None, own))
    return out


def is_tolerated(case: Case, term: Term) -> bool:
    """Return whether a term moves cameras or lamps by no more than is tolerated, on average over views or lamps."""
    if term.effect.id not in ("pose_error", "light_position"):
        return False
    # A step of a pose is a tenth of a pixel; a lamp may go as far as it is away.
    share = {p.name: (0.1 / PIXELS) / p.step if p.per else 1 / (LAMPS * p.high) for p in term.parameters}
    return all(np.sqrt(np.mean((np.asarray(term.values[name]) * s) ** 2)) <= 1 for name, s in share.items())


def calibrated_away(model: Model) -> Model:
    """Return the model with cameras and lamps moved within what is tolerated."""
    terms = [*model.terms, *calibration_terms(model.case, model.effects)]
    return assess(model.case, model.weight, fit(model.case, model.weight, terms, 6))


def gain_over_calibration(case: Case, base: Model, model: Model, term: Term, weigh) -> tuple[float, float]:
    """Return (gain per value, standard errors) of an effect over cameras and lamps moved within what is tolerated in its place."""
    others = [t for t in model.terms if t.key != term.key]
    around, weight = model.case, model.weight
    if term.effect.settles:
        around, weight = case, base.weight
        others = prepared(around, others, weigh)
    effects = [t for t in others if t.effect.id != "free"]
    rival = assess(around, weight, fit(around, weight, [*others, *calibration_terms(around, effects)], 6))
    return gain_of(case, model.weight, rival, model)
