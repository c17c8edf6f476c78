from __future__ import annotations

from dataclasses import replace

import pytest

from evaluate.effects import catalogue
from evaluate.mismatch.attribute import SearchSettings, assess, least_gain
from evaluate.mismatch.calibrate import calibrate
from evaluate.mismatch.refine import exchanged
from evaluate.mismatch.solve import context
from evaluate.mismatch.trying import try_effect

from .worlds import recorded, simulation

FOG = {"sigma_t": 0.15} | {f"airlight.{c}": 0.1 for c in "rgb"}
VEILS = {
    "glare": {"strength": 0.06, "sigma": 6.0},
    "ambient_light": {f"radiance.{c}": 0.02 for c in "rgb"},
    "participating_medium": FOG,
}


def wrongly(case, id):
    """Return (base model, model with one effect of this id) for a case, however little it explains."""
    fitted, weight = calibrate(case)
    effect = next(e for e in catalogue() if e.id == id)
    model = try_effect(case, weight, fitted, context(case, weight, fitted), effect, None, 10)
    assert model is not None
    return assess(case, weight, fitted), assess(case, weight, model)


@pytest.mark.parametrize(
    ("true", "taken"),
    [("glare", "participating_medium"), ("ambient_light", "participating_medium"), ("participating_medium", "ambient_light")],
)
def test_what_was_taken_for_another_effect_is_exchanged_for_it(tmp_path, true, taken):
    case = recorded(tmp_path, simulation(), {true: VEILS[true]})
    base, model = wrongly(case, taken)
    trials = []
    veils = [e for e in catalogue() if e.id in VEILS]
    better = exchanged(case, base, model, veils, SearchSettings(), trials)
    assert [t.effect.id for t in better.effects] == [true]
    assert better.total < model.total + 1
    assert true in {t.id for t in trials}


def test_what_is_right_stays(tmp_path):
    case = recorded(tmp_path, simulation(), {"participating_medium": FOG})
    base, model = wrongly(case, "participating_medium")
    assert exchanged(case, base, model, [e for e in catalogue() if e.id in VEILS], SearchSettings(), []) is model


def test_a_further_effect_counts_where_it_explains_most_of_what_an_approximation_leaves(tmp_path):
    case = recorded(tmp_path, simulation(), {"participating_medium": FOG})
    base, model = wrongly(case, "participating_medium")
    gained = (base.total - model.total) / float((model.weight > 0).sum())
    rough = 0.2**2 * gained
    assert rough > 0.01
    # Little is left over: most of it, and of what cannot be told from nothing. Much: the share that fog may be wrong by.
    assert least_gain(base, replace(model, excess=0.0), SearchSettings()) == pytest.approx(0.6 * 0.01)
    assert least_gain(base, replace(model, excess=100.0), SearchSettings()) == pytest.approx(rough)
