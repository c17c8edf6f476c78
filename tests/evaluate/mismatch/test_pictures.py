from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from evaluate.effects import catalogue
from evaluate.effects.in_pictures import choose
from evaluate.mismatch.diagnose import Diagnosis, diagnose
from evaluate.mismatch.pictures.case import Given, build
from evaluate.mismatch.pictures.noise import noise_of_pair
from scene.recording import Noise
from transport.render import render
from transport.world import compile_world

from .collages import READ, SHOT, collage, noisy, red_spread, shifted, softened, veiled, vignetted
from .worlds import NOISE, recorded, simulation

FOG = ("participating_medium", "height_fog", "glare", "sensor_response", "exposure_drift", "vignetting")


def diagnosed(recorded, simulated, noise: Noise | None = None, without: tuple[str, ...] = (), **given) -> Diagnosis:
    valid = np.all(np.isfinite(recorded) & np.isfinite(simulated), axis=-1)
    found = noise or noise_of_pair(np.nan_to_num(recorded), np.nan_to_num(simulated), valid)
    names = [f"{i}.exr" for i in range(len(recorded))]
    case, effects = choose(build(Given(recorded, simulated, names, **given), found, noise is None), catalogue(without=without))
    return diagnose(case, effects, say=lambda _: None)


@pytest.mark.parametrize("seed", range(8))
def test_pictures_that_differ_by_noise_are_consistent(seed):
    S = collage(4, seed=seed)
    d = diagnosed(noisy(S, 100 + seed), S)
    assert (d.verdict, d.findings) == ("consistent", [])


@pytest.mark.parametrize(
    ("change", "id", "parameter", "value", "within"),
    [
        (vignetted, "vignetting", "power", 1.0, 0.1),
        (lambda p: np.maximum(p, 1e-5) ** 0.95, "sensor_response", "gamma", 0.95, 0.003),
        (lambda p: 1.03 * p, "exposure_drift", "gain", 1.03, 0.002),
        (veiled, "glare", "strength", 0.05, 0.01),
        (shifted, "pose_error", "rms_shift", np.hypot(0.6, 0.4), 0.02),
        (softened, "defocus", "radius", None, None),
        (lambda p: np.minimum(p, 0.6), "saturation", "level", 0.6, 0.003),
        (lambda p: p * np.float32([1.03, 1, 0.97]), "light_colour", "log_red", np.log(1.03), 0.003),
        (red_spread, "chromatic_aberration", "scale_red", 1.01, 0.001),
    ],
)
def test_what_a_camera_did_is_named_and_measured(change, id, parameter, value, within):
    S = collage(4)
    d = diagnosed(noisy(change(S)), S)
    assert ([f.id for f in d.findings], d.verdict) == ([id], "explained")
    if value is not None:
        assert abs(d.findings[0].parameters[parameter]["value"] - value) < within
    assert d.held_out.chi2_after < 1.1 < d.held_out.chi2_before


def test_exposures_that_drift_are_told_frame_by_frame():
    S = collage(5)
    gains = np.array([0.95, 1.02, 1.0, 1.05, 0.98])
    d = diagnosed(noisy((S * gains[:, None, None, None]).astype(np.float32)), S)
    assert [f.id for f in d.findings] == ["exposure_drift"]
    p = d.findings[0].parameters
    found = np.exp(p["log_gain"]["value"] + np.array(p["log_drift"]["value"]))
    assert np.abs(found - gains).max() < 0.003


def test_fog_is_found_with_depth_and_not_tested_without():
    S = collage(3)
    frames, height, width = S.shape[:3]
    depth = np.broadcast_to(np.linspace(40, 5, height)[:, None], S.shape[:3]).astype(np.float32)
    y, x = np.mgrid[:height, :width] + 0.5
    distance = depth * np.sqrt(1 + ((x - width / 2) ** 2 + (y - height / 2) ** 2) / width**2)
    share = np.exp(-0.02 * distance)[..., None]
    R = noisy((share * S + (1 - share) * 0.5).astype(np.float32))
    d = diagnosed(R, S, depth=depth, without=tuple(e.id for e in catalogue() if e.id not in FOG))
    (found,) = d.findings
    assert found.id in ("participating_medium", "height_fog")
    assert abs(found.parameters["sigma_t"]["value"] - 0.02) < 0.002
    assert d.verdict == "explained"
    names = [str(i) for i in range(frames)]
    without, usable = choose(build(Given(R, S, names), Noise(READ, SHOT), False), catalogue())
    assert without.untestable["participating_medium"] == "needs depth: give --depth"
    assert not {"participating_medium", "height_fog"} & {e.id for e in usable}


def test_a_body_that_was_moved_is_named_by_its_mask():
    ground, body = collage(4, seed=3), collage(4, seed=8)
    inside = np.zeros(ground.shape[:3], np.float32)
    inside[:, 20:50, 30:65] = 1
    inside = np.stack([cv2.GaussianBlur(m, (0, 0), 0.7) for m in inside])
    S = ground + inside[..., None] * (body - ground)
    there = np.repeat(inside[..., None], 3, 3)
    there, moved = (shifted(v.astype(np.float32), 2.5, 0.5) for v in (there, body))
    R = noisy((ground + there * (moved - ground)).astype(np.float32))
    d = diagnosed(R, S.astype(np.float32), labels=np.where(inside > 0.5, 7, 0))
    assert (d.findings[0].id, d.findings[0].where) == ("moved_object", "body 7")
    assert abs(d.findings[0].parameters["shift"]["value"] - np.hypot(2.5, 0.5)) < 0.2


def test_pictures_that_are_pixels_apart_are_brought_together():
    S = collage(3)
    d = diagnosed(noisy(shifted(S, 5.3, -3.8)), S)
    assert d.findings[0].id == "pose_error"
    assert np.allclose(d.findings[0].parameters["shift_x"]["value"], 5.3, atol=0.05)


def test_drops_on_the_glass_are_found_in_few_frames_too():
    rng = np.random.default_rng(1)
    S = np.clip(collage(2, 96, 128) + 0.1 * rng.standard_normal((2, 96, 128, 3)), 0.02, None).astype(np.float32)
    y, x = np.mgrid[:96, :128]
    cover = np.zeros((2, 96, 128), np.float32)
    for f in range(2):
        for cx, cy, r in rng.uniform([15, 15, 8], [113, 81, 14], (5, 3)):
            cover[f] = np.maximum(cover[f], np.clip((r - np.hypot(x - cx, y - cy)) / 2 + 0.5, 0, 1))
    around = np.stack([cv2.GaussianBlur(p, (0, 0), 10) for p in S])
    d = diagnosed(noisy((S + cover[..., None] * (1.1 * around - S)).astype(np.float32)), S)
    assert d.findings[0].id == "lens_droplets"
    aux = next(t.aux for t in d.best.effects if t.effect.id == "lens_droplets").reshape(cover.shape)
    both, either = (aux > 0.5) & (cover > 0.5), (aux > 0.5) | (cover > 0.5)
    assert both.sum() > 0.6 * either.sum()
    assert d.held_out.chi2_after < 0.5 * d.held_out.chi2_before


def test_what_no_effect_makes_is_not_explained():
    S = collage(4)
    d = diagnosed(noisy((S + 0.15 * S[:, ::-1, ::-1]).astype(np.float32)), S, Noise(READ, SHOT))
    assert d.verdict in ("unexplained", "partly_explained")
    assert d.depends_on


def test_what_needs_a_world_is_said_not_to_have_been_tested():
    S = collage(2)
    d = diagnosed(noisy(S), S)
    assert set(d.case.untestable) | set(d.tested) == {e.id for e in catalogue()}
    assert {"specular_lobe", "cast_shadow", "albedo_error", "moved_object"} <= set(d.case.untestable)
    assert not set(d.case.untestable) & set(d.tested)


def test_pixels_that_are_no_numbers_are_left_out_and_counted():
    S = collage(3)
    R = noisy(S)
    R[0, 5:9, 5:9] = np.nan
    S[1, 0, 0] = np.inf
    d = diagnosed(R, S)
    assert d.verdict == "consistent"
    assert "17 pixels are NaN or infinite and were left out." in d.notes
    assert not d.case.valid[0, 5:9, 5:9].any()


def test_one_frame_can_be_explained_but_nothing_held_out():
    S = collage(1)
    d = diagnosed(noisy(vignetted(S)), S)
    assert [f.id for f in d.findings] == ["vignetting"]
    assert not d.held_out.frames
    assert any("One frame only" in note for note in d.notes)


def test_noise_is_estimated_about_right_though_pictures_have_texture():
    S = collage(4)
    found = noise_of_pair(noisy(S), S, np.ones(S.shape[:3], bool))
    for level in (0.1, 0.3, 0.7):
        true = READ**2 + SHOT * level
        assert abs(found.read_sigma**2 + found.shot_gain * level - true) < 0.15 * true


def test_vignetting_is_found_beside_pictures_of_another_renderer(tmp_path):
    world = simulation()
    case = recorded(tmp_path, world, {"vignetting": {"power": 1.5}})
    traced = [
        render(compile_world(replace(world, lights={f"lamp{i % 3}": world.lights[f"lamp{i % 3}"]})), c, 64, max_bounces=1).radiance
        for i, c in enumerate(case.cameras)
    ]
    # Radiance where the sender's albedo scale is true; the focal length is that of the studio's camera.
    d = diagnosed(case.pictures, np.stack(traced), NOISE, cameras=case.cameras)
    assert [f.id for f in d.findings] == ["vignetting"]
    assert abs(d.findings[0].parameters["power"]["value"] - 1.5) < 0.2
