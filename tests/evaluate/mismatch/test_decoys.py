"""An effect has to explain more than smooth gains in coordinates that are wrong for it."""

from __future__ import annotations

import numpy as np

from evaluate.effects import CATALOGUE, catalogue
from evaluate.mismatch.decoys import decoys_for
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.effect import Effect, Parameter
from evaluate.mismatch.outputs import as_json

from .worlds import SIZE, recorded, simulation


def some(*ids: str):
    return [e for e in catalogue() if e.id in ids]


def test_every_effect_has_decoys_in_coordinates_other_than_its_own():
    for effect in CATALOGUE:
        wrong = {d.coordinates for d in decoys_for(effect())}
        assert wrong
        assert effect.coordinates not in wrong


def test_a_true_effect_explains_more_than_its_decoys(tmp_path):
    case = recorded(tmp_path, simulation(), {"specular_lobe.ball": {"specular_scale": 2.0, "alpha": 0.25}})
    d = diagnose(case, some("specular_lobe", "rough_diffuse"))
    (finding,) = d.findings
    assert {r.title for r in finding.decoys} == {
        "a smooth gain over the sensor", "a gain and an offset of each frame", "a mixing of the colour channels",
    }  # fmt: skip
    assert all(r.gain > 0 and r.sigmas > 3 for r in finding.decoys)
    assert as_json(d)["effects"][0]["decoys"][0]["gain_over"] > 0


class HalfTilt(Effect):
    """Calls itself an effect of surfaces, and is half of a gain over the sensor."""

    id = "half_tilt"
    stage = "surface"
    title = "half a tilt"
    says = "brighter to the left"
    coordinates = "surface"
    on_picture = True

    def parameters(self, case, target):
        return (Parameter("slope", 0.0, -1.0, 1.0, 0.01),)

    def change(self, case, state, values, target, aux):
        ramp = np.maximum(np.linspace(1, -1, SIZE[0], dtype=np.float32), 0)[:, None]
        state.lens.append(lambda picture: picture * (1 + np.float32(values["slope"]) * ramp))


def test_what_a_gain_over_the_sensor_explains_better_is_not_named(tmp_path):
    gain = np.linspace(1.25, 0.75, SIZE[0], dtype=np.float32)[:, None]
    case = recorded(tmp_path, simulation(), {}, lambda p: p * gain)
    d = diagnose(case, [*some("specular_lobe"), HalfTilt()])
    assert d.findings == []
    assert d.verdict == "unexplained"
    assert d.notes == ["half_tilt lowered the residual, but a smooth gain over the sensor lowers it more: it is not shown."]


def test_what_a_mixing_of_colours_explains_better_is_not_named(tmp_path):
    mix = np.array([[0.94, 0.05, 0.01], [0.04, 0.92, 0.04], [0.0, 0.06, 0.94]], np.float32)
    case = recorded(tmp_path, simulation(), {}, lambda p: p @ mix.T)
    d = diagnose(case, some("albedo_error", "sensor_response", "subsurface"))
    assert d.findings == []
    assert d.verdict == "unexplained"
    assert d.notes
    assert all("a mixing of the colour channels lowers it more" in note for note in d.notes)
