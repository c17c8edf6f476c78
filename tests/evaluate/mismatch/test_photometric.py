"""Photographs under many lamps that were believed matte and lit directly."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from evaluate.diagnose_cli import main
from evaluate.effects import catalogue
from evaluate.kernels import height_field
from evaluate.mismatch.measured.photographs import diagnose_photographs, stereo_of
from evaluate.mismatch.measured.relief import integrate
from evaluate.mismatch.measured.stereo import _lobe, fit_stereo
from materials import ggx
from materials.abrdf import ABRDF
from materials.directions import even_directions
from materials.foundation.errors import InputError
from materials.measured.photographs import Photographs
from materials.photometric_stereo import angular_error_deg

SIZE, RADIUS = 23, 10.0


def _cap(size: int = SIZE, radius: float = RADIUS) -> tuple[np.ndarray, np.ndarray]:
    """Return the mask (H, W) and normals (P, 3) of a cap of a ball that all lamps reach."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    n = np.stack([x, -y], axis=-1) / (1.45 * radius)
    mask = np.hypot(x, y) < radius
    n = n[mask]
    return mask, np.column_stack([n, np.sqrt(1 - (n**2).sum(axis=1))])


def _photographs(gloss: float = 0.0, alpha: float = 0.25, seed: int = 0) -> Photographs:
    mask, normal = _cap()
    lights = even_directions(30, 40.0)
    value = 0.2 * np.maximum(normal @ lights.T, 0) + gloss * _lobe(normal, lights, alpha)
    value = np.maximum(value + np.hypot(0.005 * value, 0.0005) * np.random.default_rng(seed).normal(size=value.shape), 0)
    rgb = np.repeat(value[..., None], 3, axis=2).astype(np.float32)
    wo = np.tile([0.0, 0.0, 1.0], (len(lights), 1))
    valid = np.ones(value.shape, bool)
    abrdf = ABRDF(lights, wo, rgb, valid, np.ones(len(lights)), unit="relative", normalised=False, mask=mask, name="cap")
    truth = np.zeros((*mask.shape, 3))
    truth[mask] = normal
    return Photographs(abrdf, mask, tuple(str(i) for i in range(len(lights))), truth)


def _diagnose(photographs: Photographs, tmp_path):
    return diagnose_photographs(stereo_of(photographs, tmp_path), catalogue(), say=lambda _: None)


@pytest.mark.parametrize("seed", range(3))
def test_a_matte_cap_is_consistent(tmp_path, seed):
    d = _diagnose(_photographs(seed=seed), tmp_path)
    assert d.verdict == "consistent", d.findings


@pytest.fixture(scope="module")
def glossy(tmp_path_factory):
    return _diagnose(_photographs(0.5), tmp_path_factory.mktemp("glossy"))


def test_gloss_is_named_and_brings_normals_nearer_to_those_that_no_fit_was_given(glossy):
    d = glossy
    assert [f.id for f in d.findings] == ["specular_lobe"]
    # Widths that are tried lie 15 % apart.
    assert d.findings[0].parameters["alpha"]["value"] == pytest.approx(0.25, rel=0.15)
    assert d.proof.chi2_after < 0.5 * d.proof.chi2_before
    told = d.extra["held_out"]
    assert told["normal_error_deg_after"] < 0.5 * told["normal_error_deg_before"]


def test_normals_of_the_truth_change_nothing_in_the_fit(glossy, tmp_path):
    a, b = glossy, _diagnose(replace(_photographs(0.5), normal=None), tmp_path)
    assert a.proof == b.proof and [f.parameters for f in a.findings] == [f.parameters for f in b.findings]


def test_the_lobe_is_that_of_the_materials():
    normal = np.array([[0.0, 0.0, 1.0]])
    lights = even_directions(5, 60.0)
    surface = ggx.surface((0.0, 0.0, 0.0), 0.3, eta=1.5)
    wo = np.tile([0.0, 0.0, 1.0], (len(lights), 1))
    # Schlick's Fresnel in one, the exact one in the other: alike within 1 % of what is reflected near the normal.
    from materials.scattering import evaluate

    expected = evaluate(surface, wo, lights)[:, 0] * lights[:, 2]
    assert _lobe(normal, lights, 0.3)[0] == pytest.approx(expected, rel=0.15)


def test_a_lamp_behind_a_step_is_hidden_and_one_above_it_is_not():
    height = np.zeros((5, 20))
    height[:, 12:] = 6.0
    low, high = np.array([[0.9, 0.0, np.sqrt(1 - 0.81)]]), np.array([[0.2, 0.0, np.sqrt(1 - 0.04)]])
    rows, cols = np.array([2, 2]), np.array([8, 15])
    assert height_field.visible(height, rows, cols, low, 0.5)[:, 0].tolist() == [0.0, 1.0]
    assert height_field.visible(height, rows, cols, high, 0.5)[:, 0].tolist() == [1.0, 1.0]


def test_two_patches_that_face_each_other_exchange_what_the_formula_says():
    normal = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    share = height_field.exchange(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]), normal)
    # Area of a patch whose normal lies across the view is held at ten pixels; 1 / (pi r²) times it, at right angles.
    assert share[0, 1] == pytest.approx(10 / (np.pi * 100), rel=1e-5)
    assert share[0, 0] == 0


def test_normals_of_a_ball_are_integrated_to_its_height():
    mask, normal = _cap(33, 15.0)
    relief = integrate(mask, normal)
    y, x = np.mgrid[:33, :33] - 16
    ball = np.sqrt((1.45 * 15) ** 2 - (x**2 + y**2)[mask])
    found = relief.height[mask]
    # The mean slope of two pixels for that between them: at the rim, where it bends most, wrong by a hundredth a pixel.
    assert found - found.mean() == pytest.approx(ball - ball.mean(), abs=0.1)


def test_lights_that_were_not_used_are_foreseen():
    mask, normal = _cap()
    photographs = _photographs()
    value = photographs.abrdf.value.mean(axis=2, dtype=np.float64)
    use = np.arange(30) % 2 == 0
    f = fit_stereo((), mask, photographs.lights, value, use)
    assert angular_error_deg(f.normal, normal).mean() < 0.5
    assert f.prediction[:, ~use] == pytest.approx(value[:, ~use], abs=0.01)


def test_too_few_photographs_are_refused(tmp_path):
    p = _photographs()
    few = Photographs(p.abrdf.select(np.arange(6)), p.mask, p.files[:6], p.normal)
    with pytest.raises(InputError, match="at least 12 photographs"):
        stereo_of(few, tmp_path)


def test_the_command_reads_a_folder_in_the_layout_of_diligent(tmp_path, capsys):
    p = _photographs(0.5)
    folder = tmp_path / "cap"
    folder.mkdir()
    for k, name in enumerate(p.files):
        picture = np.zeros((SIZE, SIZE), np.uint16)
        picture[p.mask] = np.clip(p.abrdf.value[:, k, 0] * 60000, 0, 65535).round()
        cv2.imwrite(str(folder / f"{int(name):03d}.png"), np.repeat(picture[..., None], 3, axis=2))
    cv2.imwrite(str(folder / "mask.png"), p.mask.astype(np.uint8) * 255)
    np.savetxt(folder / "light_directions.txt", p.lights)
    np.save(folder / "normal_gt.npy", p.normal)
    assert main([str(folder), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [e["id"] for e in told["effects"]] == ["specular_lobe"]
    assert told["held_out"]["normal_error_deg_after"] < told["held_out"]["normal_error_deg_before"]
    assert (tmp_path / "out" / "report.html").read_text().count("data:image/png") == 3


def test_the_command_reads_a_recording_of_one_normal_map(tmp_path):
    p = _photographs(0.5)
    # The camera looks down: its x is the world's, its y and z are turned round.
    camera = {"model": "ORTHOGRAPHIC", "width": SIZE, "height": SIZE, "pixel_size": 0.001}
    camera["T_world_camera"] = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]]
    frames, lights = [], {}
    for k, name in enumerate(p.files):
        picture = np.zeros((SIZE, SIZE), np.uint16)
        picture[p.mask] = np.clip(p.abrdf.value[:, k, 0] * 60000, 0, 65535).round()
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.repeat(picture[..., None], 3, axis=2))
        frames.append({"image": f"{name}.png", "response": "linear", "lights": [name], "camera": camera})
        lights[name] = {"type": "directional", "direction": (-p.lights[k]).tolist(), "irradiance": [1, 1, 1]}
    normal = np.rint((p.normal + 1) / 2 * 65535).astype(np.uint16) * p.mask[..., None].astype(np.uint16)
    cv2.imwrite(str(tmp_path / "normal.png"), normal[..., ::-1])
    (tmp_path / "recording.json").write_text(json.dumps({"format": "recording/1", "frames": frames}))
    shapes = [{"name": "cap", "normal_map": "normal.png", "material": "cap"}]
    told = {"format": "simulation/1", "shapes": shapes, "lights": lights}
    (tmp_path / "simulation.json").write_text(json.dumps(told | {"materials": {"cap": {"model": "lambert", "albedo": 0.5}}}))
    assert main([str(tmp_path), "-o", str(tmp_path / "out"), "--quiet"]) == 0
    assert [e["id"] for e in json.loads((tmp_path / "out" / "diagnosis.json").read_text())["effects"]] == ["specular_lobe"]
