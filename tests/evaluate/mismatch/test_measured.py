"""What was believed of a measurement is believed if it is right, and what it lacks is named."""

from __future__ import annotations

import json

import numpy as np
import pytest

from evaluate.diagnose_cli import main
from evaluate.effects import catalogue
from evaluate.mismatch.measured.diagnose import diagnose_file
from evaluate.mismatch.measured.fit import Columns, solve_scales
from evaluate.mismatch.measured.locate import located
from evaluate.mismatch.measured.noise import of_directions
from evaluate.mismatch.measured.outputs import as_json, write_measured_diagnosis
from evaluate.mismatch.measured.samples import Samples
from materials.foundation.errors import InputError

from .measurements import LAMBERT, NM, brdf, directions, write_brdf, write_ground, write_table

GGX = {"model": "ggx", "albedo": 0.2, "alpha": 0.25, "specular_scale": 1.0, "free": ["albedo", "alpha", "specular_scale"]}


def _diagnose(folder, without: tuple[str, ...] = ()):
    return diagnose_file(folder, catalogue(without=without), say=lambda _: None)


@pytest.mark.parametrize("seed", range(4))
def test_a_matte_surface_that_was_believed_matte_is_consistent(tmp_path, seed):
    d = _diagnose(write_brdf(tmp_path, brdf(), seed=seed))
    assert d.verdict == "consistent", d.findings
    assert not d.located.any()


def test_a_glossy_surface_that_was_believed_as_glossy_is_consistent(tmp_path):
    assert _diagnose(write_brdf(tmp_path, brdf(1.0, 0.3), GGX)).verdict == "consistent"


def test_a_missing_lobe_is_named_with_its_width_and_foreseen_at_angles_that_were_held_out(tmp_path):
    d = _diagnose(write_brdf(tmp_path, brdf(0.8, 0.3)))
    assert [f.id for f in d.findings] == ["specular_lobe"]
    assert d.verdict == "explained"
    p = d.findings[0].parameters
    assert p["alpha"]["value"] == pytest.approx(0.3, abs=0.01)
    assert p["specular_scale"]["value"] == pytest.approx([0.8, 0.8], rel=0.05)
    assert d.proof.chi2_before > 5 * d.proof.chi2_after
    # Chi-square a value of noise alone, over some thousand values.
    assert d.proof.chi2_after == pytest.approx(1.0, abs=0.15)


def test_a_second_lobe_is_named_on_top_of_one_that_was_believed(tmp_path):
    d = _diagnose(write_brdf(tmp_path, brdf(1.0, 0.12, 1.0, 0.6), GGX, noise=0.01))
    assert [f.id for f in d.findings] == ["long_tail_lobe"]
    assert d.findings[0].parameters["alpha"]["value"] == pytest.approx(0.6, abs=0.05)


def test_a_rough_matte_surface_is_named(tmp_path):
    d = _diagnose(write_brdf(tmp_path, brdf(sigma=0.5)))
    assert [f.id for f in d.findings] == ["rough_diffuse"]
    assert d.findings[0].parameters["sigma"]["value"] == pytest.approx(0.5, abs=0.05)


def test_a_shape_that_no_effect_has_is_unexplained(tmp_path):
    # Brightest at one viewing angle wherever the light stands, as a grating under diffuse light would be.
    theta_o = np.degrees(np.arccos(directions()[1][:, 2]))
    value = brdf() * (1 + 1.5 * np.exp(-0.5 * ((theta_o - 40) / 10) ** 2))[:, None]
    d = _diagnose(write_brdf(tmp_path, value))
    assert d.verdict == "unexplained"
    assert "viewing angle" in [x.name for x in d.depends_on][:3]


def test_an_effect_that_is_not_in_the_catalogue_is_not_replaced_by_another(tmp_path):
    d = _diagnose(write_brdf(tmp_path, brdf(0.8, 0.3)), without=("specular_lobe",))
    assert d.verdict == "unexplained"


def test_noise_that_is_not_stated_is_estimated_and_said_so(tmp_path):
    d = _diagnose(write_brdf(tmp_path, brdf(0.8, 0.4), told=False))
    assert not d.noise_stated
    assert any("states no noise" in note for note in d.notes)
    wi, wo = directions()
    value = brdf()
    noisy = value + 0.03 * value * np.random.default_rng(0).normal(size=value.shape)
    # A share that a few hundred values tell to some 10 %.
    assert of_directions(wi, wo, noisy)[0].mean() == pytest.approx(0.03 * value.mean(), rel=0.25)


@pytest.mark.parametrize(("formula", "id"), [("twomey", "surface_wetness"), ("lekner_dorf", "water_film"), (None, None)])
def test_water_in_the_ground_is_named(tmp_path, formula, id):
    d = _diagnose(write_ground(tmp_path, formula))
    if id is None:
        assert d.verdict == "consistent"
        return
    assert len(d.findings) == 1
    assert id in [d.findings[0].id, *d.findings[0].ambiguous_with]
    assert d.proof.chi2_before > 5 * d.proof.chi2_after


def test_what_no_sample_shows_alone_is_located_in_means_of_few_samples_too(tmp_path):
    elevation = np.linspace(20, 80, 40)
    one, where = np.ones((40, 25)), {"elevation": elevation}
    s = Samples("photographs", "few", tmp_path, one, one, np.arange(40) % 5, (), where, (), {}, False)
    noise = np.clip(np.random.default_rng(0).normal(size=(40, 25)), -2, 2)
    assert not located(s, noise).any()
    # 2 sigma more below 35 degrees: no value beyond 4, but 6 standard errors for the mean of ten.
    z = noise + 2.0 * (elevation < 35)[:, None]
    found = located(s, z)
    assert np.abs(z).max() <= 4
    assert found[elevation < 35].mean() > 0.9 and not found[elevation > 36].any()


def test_a_wrong_spectrum_is_no_water(tmp_path):
    folder = write_ground(tmp_path, None)
    head = json.loads((folder / "measurement.json").read_text())
    head["model"]["albedo"] = np.linspace(0.35, 0.1, 10).tolist()
    (folder / "measurement.json").write_text(json.dumps(head))
    d = _diagnose(folder)
    assert [f.id for f in d.findings] == ["albedo_error"]


def test_the_command_writes_a_diagnosis_that_another_program_can_read(tmp_path, capsys):
    folder = write_brdf(tmp_path / "m", brdf(0.8, 0.3))
    assert main([str(folder), "-o", str(tmp_path / "out")]) == 0
    assert "specular_lobe" in capsys.readouterr().out
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert told["format"] == "diagnosis/1" and told["effects"][0]["id"] == "specular_lobe"
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png") == 3 and "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "")
    with np.load(tmp_path / "out" / "affected.npz") as masks:
        assert masks["located"].shape == masks["affected"].shape == (540, 2)
    # Each column has a name of its own: none hides another.
    rows = json.loads((tmp_path / "out" / "metrics.json").read_text())["held_out"]
    assert all(r["chi-square before"] > 5 * r["chi-square after"] and r["rmse before"] > 2 * r["rmse after"] for r in rows)


def test_the_same_measurement_gives_the_same_diagnosis(tmp_path):
    folder = write_brdf(tmp_path, brdf(0.8, 0.3))
    assert as_json(_diagnose(folder)) == as_json(_diagnose(folder))


def test_names_of_folders_and_samples_say_nothing(tmp_path):
    a = write_brdf(tmp_path / "specular_lobe", brdf())
    head = json.loads((a / "measurement.json").read_text()) | {"name": "glossy"}
    (a / "measurement.json").write_text(json.dumps(head))
    (a / "answers.json").write_text(json.dumps({"effects": ["specular_lobe"]}))
    assert as_json(_diagnose(a)) == as_json(_diagnose(write_brdf(tmp_path / "m", brdf())))


def test_one_level_only_is_fitted_but_not_held_out(tmp_path):
    wi, wo = directions()
    one = np.arange(len(wi)) < 108
    value = np.maximum(brdf(0.8, 0.3)[one], 0)
    table = {"wi": np.repeat(wi[one], 2, axis=0), "wo": np.repeat(wo[one], 2, axis=0), "wavelength": np.tile(NM, 108)}
    d = _diagnose(write_table(tmp_path, table | {"value": value.ravel(), "sigma": 0.01 * value.ravel()}, LAMBERT))
    assert any("viewing angles were held out" in note for note in d.notes)
    write_measured_diagnosis(tmp_path / "out", d)


def _spoilt(tmp_path, **change):
    value = brdf()
    wi, wo = directions()
    table = {
        "wi": np.repeat(wi, 2, axis=0),
        "wo": np.repeat(wo, 2, axis=0),
        "wavelength": np.tile(NM, len(wi)),
        "value": value.ravel(),
    }
    table["sigma"] = np.full(value.size, 0.01)
    for key, (row, number) in change.items():
        table[key] = table[key].copy()
        table[key][row] = number
    return write_table(tmp_path, table, LAMBERT)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"value": (3, np.nan)}, "value, row 4 must be finite"),
        ({"sigma": (3, -1.0)}, "sigma, row 4 must not be negative"),
        ({"sigma": (3, 0.0)}, "sigma must be positive"),
        ({"wo": (slice(2, 4), [0.6, 0.0, -0.8])}, "directions' z must lie in"),
        ({"wi": (slice(2, 4), [0.6, 0.0, 0.9])}, "must have unit length"),
    ],
)
def test_a_bad_table_is_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        _diagnose(_spoilt(tmp_path, **change))


@pytest.mark.parametrize(
    ("model", "words"),
    [
        ({"model": "phong"}, r"model.model must be one of lambert, ggx, got phong"),
        ({"model": "lambert", "albedo": -1}, "model.albedo must be a number"),
        ({"model": "lambert", "albedo": [0.1, 0.2, 0.3]}, "model.albedo must be a number"),
        ({"model": "lambert", "free": ["alpha"]}, "model.free must list some of"),
        ({"model": "lambert", "colour": 1}, "model.colour must be a known key"),
    ],
)
def test_a_model_that_is_not_known_is_refused(tmp_path, model, words):
    with pytest.raises(InputError, match=words):
        _diagnose(write_brdf(tmp_path, brdf(), model))


def test_a_measurement_without_a_model_or_a_table_is_refused(tmp_path):
    folder = write_brdf(tmp_path, brdf())
    head = json.loads((folder / "measurement.json").read_text())
    (folder / "measurement.json").write_text(json.dumps({k: v for k, v in head.items() if k != "model"}))
    with pytest.raises(InputError, match="model must be given"):
        _diagnose(folder)
    (folder / "samples.npz").unlink()
    with pytest.raises(InputError, match="must exist"):
        _diagnose(folder)


def test_scales_are_the_best_that_are_not_negative():
    rng = np.random.default_rng(0)
    A, truth = rng.uniform(size=(3, 50, 1)), np.array([[0.5], [0.0], [2.0]])
    value = (A * truth[:, None]).sum(axis=0) - 0.01 * A[1]
    columns = Columns(list(A), ["a", "b", "c"], [None] * 3)
    found = solve_scales(columns, value, np.ones_like(value))
    assert found[1, 0] == 0 and (found >= 0).all()
    assert found[[0, 2], 0] == pytest.approx(truth[[0, 2], 0], abs=0.02)
