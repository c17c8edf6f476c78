from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import evaluate
from evaluate.diagnose_cli import main
from evaluate.effects import CATALOGUE, catalogue
from evaluate.mismatch.attribute import SearchSettings
from evaluate.mismatch.case import build, load
from evaluate.mismatch.diagnose import diagnose
from evaluate.mismatch.outputs import as_json, write_diagnosis
from materials.foundation.errors import InputError
from scene.images import write_exr
from scene.recording import Noise, write_recording
from scene.simulation import AddedEffect
from scene.simulation_file import read_simulation, write_simulation

from .worlds import SIZE, recorded, simulation

# What a camera's twist has besides its turns about x and y.
REST = ("turn_z", "shift_x", "shift_y", "shift_z")
# Enough for a race between right and wrong, few enough to be quick.
FEW = (
    "exposure_drift",
    "light_colour",
    "ambient_light",
    "specular_lobe",
    "rough_diffuse",
    "glare",
    "vignetting",
    "sensor_response",
)


def few():
    return [e for e in catalogue() if e.id in FEW or e.id == "noise_model"]


def test_nothing_is_found_where_nothing_is_missing(tmp_path):
    d = diagnose(recorded(tmp_path, simulation(), {}), few())
    assert (d.verdict, d.findings) == ("consistent", [])
    assert not d.affected.any()


@pytest.mark.parametrize(
    ("effect", "target", "values", "parameter"),
    [
        ("glare", "", {"strength": 0.1}, "strength"),
        ("specular_lobe", "ball", {"specular_scale": 2.0, "alpha": 0.25}, "specular_scale"),
        ("ambient_light", "", {f"radiance.{c}": 0.04 for c in "rgb"}, "radiance.g"),
    ],
)
def test_what_was_left_out_is_named_and_measured(tmp_path, effect, target, values, parameter):
    case = recorded(tmp_path, simulation(), {f"{effect}.{target}".rstrip("."): values})
    d = diagnose(case, few())
    assert [(f.id, f.where) for f in d.findings] == [(effect, target or None)]
    assert d.verdict == "explained"
    found = d.findings[0].parameters[parameter]
    assert abs(found["value"] - values[parameter]) < 0.15 * values[parameter]
    assert d.held_out.chi2_after < 1.1 < d.held_out.chi2_before
    assert d.affected.any()


def test_two_effects_are_both_found(tmp_path):
    case = recorded(tmp_path, simulation(), {"vignetting": {"power": 1.5}, "specular_lobe.ball": {"specular_scale": 2.0}})
    d = diagnose(case, few())
    assert {f.id for f in d.findings} == {"vignetting", "specular_lobe"}


def test_a_ghost_that_no_effect_makes_is_not_explained(tmp_path):
    case = recorded(tmp_path, simulation(), {}, lambda p: p + 0.15 * p[:, ::-1, ::-1])
    # A second effect may try to help the first; a third that both have let through adds nothing but time.
    d = diagnose(case, few(), settings=SearchSettings(most=2))
    assert d.verdict in ("unexplained", "partly_explained")
    assert d.depends_on
    assert d.located.any()


@pytest.mark.parametrize("gain", [0.7, 1.4])
def test_noise_of_another_size_is_named_as_such(tmp_path, gain):
    d = diagnose(recorded(tmp_path, simulation(), {}, gain=gain), few())
    assert [f.id for f in d.findings] == ["noise_model"]
    assert abs(d.findings[0].parameters["sigma_factor"]["value"] / gain - 1) < 0.03
    # Before in the stated noise, after in that which was found; outlines, of which less is asked, take some off.
    assert 0.85 < d.held_out.chi2_before / gain**2 < 1.05
    assert 0.85 < d.held_out.chi2_after < 1.05


def test_noise_that_has_no_name_is_left_over(tmp_path):
    d = diagnose(recorded(tmp_path, simulation(), {}, gain=1.4), [e for e in few() if e.id != "noise_model"])
    assert (d.verdict, d.findings) == ("unexplained", [])


def test_noise_that_is_believed_is_no_mismatch(tmp_path):
    believed = replace(simulation(), effects=(AddedEffect("noise_model", None, {"sigma_factor": 1.4}),))
    case = recorded(tmp_path, simulation(), {}, gain=1.4)
    d = diagnose(replace(case, simulation=believed), few())
    assert (d.verdict, d.findings) == ("consistent", [])


def test_a_believed_noise_has_a_size(tmp_path):
    believed = replace(simulation(), effects=(AddedEffect("noise_model", None, {"sigma_factor": 0.0}),))
    case = recorded(tmp_path, simulation(), {})
    with pytest.raises(InputError, match=r"effects\[0\].parameters.sigma_factor must be a number above 0, got 0"):
        diagnose(replace(case, simulation=believed), few())


@pytest.mark.parametrize(("pixels", "named"), [(0.04, []), (0.4, ["pose_error"])])
def test_cameras_are_out_of_place_only_beyond_what_a_calibration_leaves(tmp_path, pixels, named):
    # Focal length 80 px; three places.
    turn = np.array([1.0, -1.0, 0.8]) * pixels / 80
    case = recorded(
        tmp_path, simulation(), {"pose_error": {"turn_x": turn, "turn_y": -turn} | dict.fromkeys(REST, 0 * turn)}, gain=0.2
    )
    # In a fifth of the usual noise both can be seen.
    case = replace(case, variance=case.variance / 25, noise=Noise(0.0003, 0.000016))
    d = diagnose(case, [e for e in catalogue() if e.id in ("pose_error", "glare")])
    assert [f.id for f in d.findings] == named


def test_the_same_seed_gives_the_same_diagnosis(tmp_path):
    case = recorded(tmp_path, simulation(), {"vignetting": {"power": 1.5}})
    first, second = (as_json(diagnose(case, few(), seed=3)) for _ in range(2))
    assert first == second


@pytest.fixture(scope="module")
def on_disk(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    case = recorded(folder, simulation(), {"vignetting": {"power": 1.5}})
    write_recording(folder / "recording.json", case.recording)
    write_simulation(folder / "simulation.json", simulation())
    return folder


def test_a_diagnosis_leaves_all_its_files(on_disk, tmp_path):
    d = diagnose(load(on_disk), few())
    write_diagnosis(tmp_path / "out", d)
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert found["format"] == "diagnosis/1"
    assert [e["id"] for e in found["effects"]] == ["vignetting"]
    with np.load(tmp_path / "out" / "affected.npz") as masks:
        assert masks["affected"].shape == masks["located"].shape == (9, SIZE[1], SIZE[0])
        assert masks["affected"].dtype == bool
    corrected = read_simulation(tmp_path / "out" / "corrected")
    assert [e.id for e in corrected.effects] == ["vignetting"]
    assert len(list((tmp_path / "out" / "corrected" / "images").glob("*.exr"))) == 9
    page = (tmp_path / "out" / "report.html").read_text()
    assert "vignetting" in page
    # Everything is in the page: no picture, script or style comes from elsewhere.
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "http" not in page


def test_the_command_lists_its_effects(capsys):
    assert main(["--list-effects"]) == 0
    out = capsys.readouterr().out
    assert all(e.id in out for e in CATALOGUE)


def test_a_user_adds_an_effect_from_a_file(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "import numpy as np\n"
        "from evaluate.mismatch.effect import Effect, Parameter\n\n\n"
        "class Ghost(Effect):\n"
        "    id, stage, title = 'ghost', 'lens', 'a ghost'\n"
        "    says = 'the picture appears again, turned about its centre'\n"
        "    on_picture = True\n\n"
        "    def parameters(self, case, target):\n"
        "        return (Parameter('share', 0.0, -1.0, 1.0, 0.01),)\n\n"
        "    def change(self, case, state, values, target, aux):\n"
        "        state.lens.append(lambda p: p + np.float32(values['share']) * p[:, ::-1, ::-1])\n"
    )
    case = recorded(tmp_path, simulation(), {}, lambda p: p + 0.15 * p[:, ::-1, ::-1])
    d = diagnose(case, [e for e in catalogue((file,)) if e.id in (*FEW, "ghost")])
    assert [f.id for f in d.findings] == ["ghost"]
    assert abs(d.findings[0].parameters["share"]["value"] - 0.15) < 0.01


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "define a subclass"),
        ("import nothing_of_this_name", "ModuleNotFoundError"),
        ("from evaluate.mismatch.effect import Effect\nclass A(Effect):\n    id = 'a'", "A.stage must be given"),
        (
            "from evaluate.mismatch.effect import Effect\nclass A(Effect):\n    id, stage, title, says = 'a', 'lens', 'an a', 'as'",
            "A.change must be defined",
        ),
    ],
)
def test_a_file_without_a_usable_effect_is_refused(tmp_path, text, words):
    file = tmp_path / "mine.py"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        catalogue((file,))


def test_leaving_out_what_is_not_there_is_refused():
    with pytest.raises(InputError, match="--without must be one of"):
        catalogue(without=("nonsense",))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r, s: s["lights"].pop("lamp2"), "must name lights of simulation.json"),
        (lambda r, s: r["frames"][0]["camera"].update(width=60), "must be 60 x 48 as its camera, got 64 x 48"),
        (lambda r, s: r["frames"][0].update(image="none.exr"), "must name a file that exists"),
        (lambda r, s: s["shapes"][0].update(material="velvet"), "must name one of plate, ball, got velvet"),
    ],
)
def test_what_does_not_fit_together_is_refused(on_disk, tmp_path, capsys, change, words):
    import shutil

    folder = tmp_path / "broken"
    shutil.copytree(on_disk, folder)
    recording, believed = (json.loads((folder / f"{n}.json").read_text()) for n in ("recording", "simulation"))
    change(recording, believed)
    (folder / "recording.json").write_text(json.dumps(recording))
    (folder / "simulation.json").write_text(json.dumps(believed))
    assert main([str(folder), "-o", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out" / "diagnosis.json").exists()


def test_pixels_that_are_not_numbers_are_left_out_and_counted(on_disk, tmp_path):
    import shutil

    folder = tmp_path / "holes"
    shutil.copytree(on_disk, folder)
    picture = load(folder).pictures[0].copy()
    picture[10:14, 20:25] = np.nan
    write_exr(folder / "00.exr", dict(zip("RGB", np.moveaxis(picture, -1, 0), strict=True)))
    case = load(folder)
    assert (~case.valid).sum() == 20
    assert any("20 pixels" in note for note in case.notes)


def test_the_code_knows_no_answers():
    package = Path(evaluate.__file__).parent
    for file in package.rglob("*.py"):
        text = file.read_text()
        assert not re.search(r"answers?\.|trial-\d|sealed", text), file


def test_every_effect_of_the_design_is_there_and_speaks():
    ids = [e.id for e in CATALOGUE]
    assert len(ids) == len(set(ids)) == 35
    for e in CATALOGUE:
        assert e.title and e.says and e.decides
        assert set(e.taken_for) <= set(ids), e.id


def test_a_practice_recording_with_glare_is_explained(shared_data):
    folder = shared_data / "sealed-practice" / "trial-05"
    if not folder.is_dir():
        pytest.skip("the practice recordings are not here")
    whole = load(folder)
    # Half of the frames, to be quick.
    d = diagnose(build(replace(whole.recording, frames=whole.recording.frames[::2]), whole.simulation), few())
    assert [f.id for f in d.findings] == ["glare"]
    low, high = d.findings[0].parameters["strength"]["ci90"]
    assert low - 0.002 < 0.08 < high + 0.002
