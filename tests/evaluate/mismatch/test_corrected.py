"""What a diagnosis writes back is a simulation that explains the recording: read again, it leaves nothing to find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from evaluate.effects import catalogue
from evaluate.effects.given import with_given
from evaluate.effects.light_extent import LightExtent
from evaluate.mismatch.calibrate import calibrate
from evaluate.mismatch.case import build
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.outputs import write_diagnosis
from materials.foundation.errors import InputError
from scene.simulation import AddedEffect, Lens, Medium, Sensor, SphereLight, Transport
from scene.simulation_file import read_simulation

from .worlds import recorded, simulation


def chi2(case) -> float:
    """Of a calibrated case, per value."""
    case = with_given(case, {e.id: e for e in catalogue()})
    fitted, weight = calibrate(case)
    return fitted.total / float((weight > 0).sum())


@pytest.mark.parametrize(
    ("effect", "values", "field"),
    [
        ("vignetting", {"power": 1.5}, lambda s: s.effects[0].id == "vignetting"),
        (
            "specular_lobe.ball",
            {"specular_scale": 2.0, "alpha": 0.25},
            lambda s: not s.effects and s.materials["ball"].model == "ggx",
        ),
        ("sensor_response", {"gamma": 0.8}, lambda s: not s.effects and 1.2 < s.sensor.gamma < 1.3),
    ],
)
def test_a_corrected_simulation_explains_the_recording(tmp_path, effect, values, field):
    case = recorded(tmp_path / "recording", simulation(), {effect: values})
    only = [e for e in catalogue() if e.id == effect.split(".")[0]]
    write_diagnosis(tmp_path / "out", diagnose(case, only))
    corrected = read_simulation(tmp_path / "out" / "corrected")
    assert field(corrected)
    before, after = chi2(case), chi2(build(case.recording, corrected))
    assert before > 1.1
    assert 0.9 < after < 1.05


def test_lamps_that_have_an_extent_are_written_back_as_spheres_of_one_size(tmp_path):
    case = recorded(tmp_path, simulation(), {})
    corrected = LightExtent().corrected(case, case.simulation, {"radius": 0.1}, None, None)
    assert corrected is not None
    given = with_given(build(case.recording, corrected), {})
    assert [(t.effect.id, t.values) for t in given.believed] == [("light_extent", {"radius": 0.1})]
    # What is believed is not looked for again.
    assert LightExtent().targets(given) == []
    (name, first), *_ = corrected.lights.items()
    assert isinstance(first, SphereLight)
    mixed = replace(corrected, lights=corrected.lights | {name: replace(first, radius=0.2)})
    with pytest.raises(InputError, match=r"lights.lamp1 must have the radius of lamp0, 0.2 m, to be diagnosed, got 0.1"):
        with_given(build(case.recording, mixed), {})


def test_a_bent_lens_is_traced_and_written_back(tmp_path):
    # Photographed through rays that bend, not by bending a picture.
    made = recorded(tmp_path / "recording", replace(simulation(), lens=Lens(k1=0.2)), {})
    d = diagnose(
        build(made.recording, simulation()), [e for e in catalogue() if e.id in ("lens_distortion", "chromatic_aberration")]
    )
    assert ([f.id for f in d.findings], d.verdict) == (["lens_distortion"], "explained")
    assert abs(d.findings[0].parameters["k1"]["value"] - 0.2) < 0.02
    write_diagnosis(tmp_path / "out", d)
    corrected = read_simulation(tmp_path / "out" / "corrected")
    assert not corrected.effects
    assert chi2(build(made.recording, corrected)) < 1.05


def test_what_is_believed_of_lens_and_sensor_is_predicted(tmp_path):
    believed = replace(simulation(), sensor=Sensor("gamma", 1.25, 0.6), lens=Lens(k1=0.1))
    made = recorded(tmp_path, replace(simulation(), lens=Lens(k1=0.1)), {})
    plain = with_given(build(made.recording, simulation()), {})
    given = with_given(build(made.recording, believed), {})
    assert plain.believed == ()
    assert [t.effect.id for t in given.believed] == ["sensor_response", "saturation"]
    assert given.cameras[0].k1 == 0.1
    assert chi2(build(made.recording, replace(simulation(), lens=Lens(k1=0.1)))) < 1.05


def test_believed_bounces_are_in_the_picture(tmp_path):
    made = recorded(tmp_path, simulation(), {})
    direct = build(made.recording, simulation())
    bounced = with_given(build(made.recording, replace(simulation(), transport=Transport(4))), {})
    pictures = [calibrate(c)[0].picture for c in (direct, bounced)]
    assert bounced.believed[0].effect.id == "interreflection"
    assert np.all(np.isfinite(pictures[1]))
    assert float(np.abs(pictures[1] - pictures[0]).max()) > 1e-3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"medium": Medium(0.1)}, "medium must be null"),
        ({"effects": (AddedEffect("nonsense"),)}, r"effects\[0\].id must be one of"),
        ({"effects": (AddedEffect("vignetting", None, {"power": 1.0}),)}, r"effects\[0\].parameters.more must be given"),
        ({"effects": (AddedEffect("specular_lobe", "nobody", {}),)}, r"effects\[0\].target must name"),
    ],
)
def test_a_belief_that_cannot_be_predicted_is_refused(tmp_path, change, words):
    made = recorded(tmp_path, simulation(), {})
    with pytest.raises(InputError, match=words):
        with_given(build(made.recording, replace(simulation(), **change)), {e.id: e for e in catalogue()})
