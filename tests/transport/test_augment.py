"""The command `augment`: what it writes, in which format, and what it says of bad input."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scene.boxes import Box, write_boxes
from scene.flow_files import write_flow
from scene.images import Encoding, decode, read_exr, read_raw, write_exr, write_raw
from scene.recording import BoxesFile, DepthFile, read_recording
from scene.scene_file import write_scene
from transport.augment import AugmentSettings, augment
from transport.cli import main

from .plain_street import camera, plain_street


@pytest.fixture(scope="module")
def scene_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    scene = plain_street(folder, views=[camera(width=80, height=34), camera(y=-4.5, width=80, height=34)])
    write_scene(folder, scene)
    return folder


def run(scene_folder, output, *flags: str) -> int:
    return main([str(scene_folder), "-o", str(output), "--samples", "4", "--quiet", *flags])


def test_each_wetness_gets_pictures_layers_labels_and_a_record(scene_folder, tmp_path):
    assert run(scene_folder, tmp_path, "--wetness", "0.5,1") == 0
    for name in ("w0.50", "w1.00"):
        for frame in ("0000", "0001"):
            raw = read_raw(tmp_path / name / "image" / f"{frame}.png")
            assert raw.shape == (34, 80, 3) and raw.dtype == np.uint8
            layers = read_exr(tmp_path / name / "layers" / f"{frame}.exr")
            wanted = {
                "R",
                "specular_dry.R",
                "specular_wet.R",
                "diffuse_wet.B",
                "water.level",
                "water.saturation",
                "water.accumulation",
            }
            assert wanted | {"roughness.Y", "normal.X", "depth.Z", "id.instance"} <= set(layers)
            for label in ("ground", "saturation", "accumulation", "changed"):
                assert read_raw(tmp_path / name / "label" / label / f"{frame}.png").shape == (34, 80)
        record = json.loads((tmp_path / name / "augment.json").read_text())
        assert record["wetness"] == float(name[1:]) and record["settings"]["samples"] == 4 and record["settings"]["seed"] == 0
        assert {row["frame"] for row in record["frames"]} == {"0000", "0001"} and record["versions"]["numpy"]
    assert (tmp_path / "contact_sheet.png").exists()


def test_mist_veils_the_wet_picture_and_says_by_how_much(scene_folder, tmp_path):
    assert run(scene_folder, tmp_path, "--wetness", "0,1", "--mist", "0.5", "--frames", "0") == 0
    for name in ("w0.00_m0.50", "w1.00_m0.50"):
        layers = read_exr(tmp_path / name / "layers" / "0000.exr")
        passed = layers["mist.transmittance"]
        assert 0 < passed.min() < passed.max() < 1 and layers["mist.scattered.R"].max() > 0
        label = read_raw(tmp_path / name / "label" / "transmittance" / "0000.png")
        np.testing.assert_array_equal(label, np.rint(255 * passed))
        record = json.loads((tmp_path / name / "augment.json").read_text())
        assert record["mist"] == 0.5 and 0 < record["frames"][0]["mean_transmittance"] < 1


def test_drops_lie_on_the_windshield_of_every_frame_and_are_labelled(scene_folder, tmp_path):
    assert run(scene_folder, tmp_path, "--wetness", "0", "--droplets", "0.25") == 0
    assert run(scene_folder, tmp_path / "alone", "--wetness", "0", "--droplets", "0.25", "--frames", "1") == 0
    folder, alone = tmp_path / "w0.00_d0.25", tmp_path / "alone" / "w0.00_d0.25"
    # The second frame has the same drops whether or not the first was asked for.
    second = read_raw(folder / "image" / "0001.png")
    np.testing.assert_array_equal(second, read_raw(alone / "image" / "0001.png"))
    label = read_raw(folder / "label" / "droplets" / "0001.png")
    covered = read_exr(folder / "layers" / "0001.exr")["droplets.A"]
    np.testing.assert_array_equal(label, np.rint(255 * covered))
    recorded = read_raw(scene_folder / "recording" / "0001.png")
    assert 0 < np.mean(covered > 0) < 1
    np.testing.assert_array_equal(second[covered == 0], recorded[covered == 0])
    record = json.loads((folder / "augment.json").read_text())
    assert record["droplets"] == 0.25 and record["frames"][1]["mean_droplet_cover"] > 0


def test_the_layers_sum_to_the_picture_on_the_ground(scene_folder, tmp_path):
    assert run(scene_folder, tmp_path, "--wetness", "1", "--frames", "0") == 0
    layers = read_exr(tmp_path / "w1.00" / "layers" / "0000.exr")
    ground = layers["ground.A"] == 1
    for c in "RGB":
        total = layers[f"diffuse_wet.{c}"] + layers[f"specular_wet.{c}"]
        assert np.allclose(total[ground], layers[c][ground], atol=5e-7)
    picture = decode(read_raw(tmp_path / "w1.00" / "image" / "0000.png"), "srgb")
    # Half an 8-bit level is at most 0.5 / 255 * 2.4 / 1.055 of linear light, at white.
    assert np.abs(picture[..., 0] - np.clip(layers["R"], 0, 1)).max() <= 0.5 / 255 * 2.4 / 1.055 + 1e-6


def test_dry_frames_are_the_input_to_the_bit(scene_folder, tmp_path):
    assert run(scene_folder, tmp_path, "--wetness", "0") == 0
    for frame in ("0000", "0001"):
        given = read_raw(scene_folder / "recording" / f"{frame}.png")
        assert np.array_equal(read_raw(tmp_path / "w0.00" / "image" / f"{frame}.png"), given)
        assert not read_raw(tmp_path / "w0.00" / "label" / "changed" / f"{frame}.png").any()


def test_the_same_seed_writes_the_same_bytes(scene_folder, tmp_path):
    for name in ("a", "b"):
        assert run(scene_folder, tmp_path / name, "--frames", "1", "--seed", "3") == 0
    for file in ("image/0001.png", "layers/0001.exr"):
        assert (tmp_path / "a" / "w1.00" / file).read_bytes() == (tmp_path / "b" / "w1.00" / file).read_bytes()


@pytest.mark.parametrize(
    "encoding",
    [Encoding(".png", "uint16", 3, "srgb"), Encoding(".png", "uint8", 1, "srgb"), Encoding(".exr", "float32", 3, "linear")],
)
def test_the_output_has_the_inputs_format_depth_and_channels(tmp_path, encoding):
    scene = plain_street(tmp_path / "in", views=[camera(width=80, height=34)], encoding=encoding)
    augment(scene, [0], [1.0], AugmentSettings(samples=2), tmp_path / "out")
    given = read_raw(scene.recording.frames[0].image)
    made = read_raw(tmp_path / "out" / "w1.00" / "image" / f"0000{encoding.suffix}")
    assert made.dtype == given.dtype and made.shape == given.shape
    assert not np.array_equal(made, given)


def test_a_noise_target_adds_samples_until_it_is_met(tmp_path):
    scene = plain_street(tmp_path / "in", views=[camera(width=80, height=34)])
    settings = AugmentSettings(samples=2, noise=0.15)
    row = augment(scene, [0], [1.0], settings, tmp_path / "out")[0]
    assert row["samples"] > 2
    coarse = augment(scene, [0], [1.0], AugmentSettings(samples=2), tmp_path / "out")[0]
    assert row["standard_error_levels"] < coarse["standard_error_levels"]


def test_masks_pass_through_unchanged(tmp_path):
    mask = np.zeros((34, 80), np.uint8)
    mask[10:14, 5:9] = 3
    scene = plain_street(tmp_path / "in", views=[camera(width=80, height=34)], masks=[mask])
    augment(scene, [0], [1.0], AugmentSettings(samples=2), tmp_path / "out")
    given = scene.recording.frames[0].masks
    assert given is not None
    assert (tmp_path / "out" / "w1.00" / "truth" / "mask" / "0000.png").read_bytes() == given.file.read_bytes()


def test_truth_passes_through_into_a_recording_of_the_wet_pictures(tmp_path):
    scene = plain_street(tmp_path / "in", views=[camera(width=80, height=34)])
    files = tmp_path / "in" / "recording"
    write_flow(files / "flow.flo", np.full((34, 80, 2), 1.5, np.float32))
    write_exr(files / "depth.exr", {"depth.Z": np.full((34, 80), 7.0, np.float32)})
    write_boxes(files / "boxes.json", (Box("1", "Car", np.eye(4), np.ones(3)),))
    T = np.eye(4)
    T[0, 3] = 5.0
    frame = replace(
        scene.recording.frames[0],
        flow=files / "flow.flo",
        depth=DepthFile(files / "depth.exr"),
        boxes=BoxesFile(files / "boxes.json", T),
    )
    scene = replace(scene, recording=replace(scene.recording, frames=(frame,)))
    augment(scene, [0], [1.0], AugmentSettings(samples=2), tmp_path / "out")
    wet = read_recording(tmp_path / "out" / "w1.00").frames[0]
    assert wet.image == tmp_path / "out" / "w1.00" / "image" / "0000.png" and wet.response == "srgb"
    assert wet.flow is not None and wet.depth is not None and wet.boxes is not None
    for old, new in ((frame.flow, wet.flow), (frame.depth.file, wet.depth.file), (frame.boxes.file, wet.boxes.file)):
        assert new.read_bytes() == old.read_bytes() and new.is_relative_to(tmp_path / "out" / "w1.00" / "truth")
    assert np.array_equal(wet.boxes.T_world_boxes, T)
    assert np.array_equal(wet.camera.T_world_camera, frame.camera.T_world_camera)


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (["--wetness", "1.5"], r"wetness must lie in \[0, 1\], got 1.5"),
        (["--wetness", "much"], "--wetness must be numbers separated by commas, got much"),
        (["--samples", "0"], r"samples must lie in \[1, 65536\], got 0"),
        (["--frames", "7"], "--frames must be A:B within 0:2, got 7"),
        (["--settings", "nowhere.toml"], "nowhere.toml: it must exist"),
    ],
)
def test_bad_options_are_named_and_nothing_is_written(scene_folder, tmp_path, capsys, flags, words):
    import re

    assert main([str(scene_folder), "-o", str(tmp_path / "out"), "--quiet", *flags]) == 2
    error = capsys.readouterr().err
    assert error.startswith("meniscus: ") and re.search(words, error), error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "flags",
    [
        ("--wetness", "0.331,0.334"),
        ("--wetness", "nan"),
        ("--frames", "0:1:1:1"),
        ("--frames", ""),
        ("--frames", "7"),
        ("--samples", "0"),
        ("--eta", "inf"),
        ("--seed", "-1"),
    ],
)
def test_a_bad_flag_is_one_line_and_makes_no_folder(scene_folder, tmp_path, capsys, flags):
    assert run(scene_folder, tmp_path / "out", *flags) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert error.startswith((f"meniscus: {flags[0]} must ", "meniscus: wetness must "))
    assert not (tmp_path / "out").exists()


def test_a_format_that_the_input_has_not_is_refused_before_work(tmp_path, capsys):
    write_scene(
        tmp_path / "scene", plain_street(tmp_path / "scene", [camera(width=40, height=17)], Encoding(".jpg", "uint8", 3, "srgb"))
    )
    assert run(tmp_path / "scene", tmp_path / "out", "--format", "png") == 2
    assert "--format must be same or exr, got png" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_dry_jpeg_is_the_same_file(tmp_path):
    write_scene(
        tmp_path / "scene", plain_street(tmp_path / "scene", [camera(width=40, height=17)], Encoding(".jpg", "uint8", 3, "srgb"))
    )
    assert run(tmp_path / "scene", tmp_path / "out", "--wetness", "0") == 0
    given = tmp_path / "scene" / "recording" / "0000.jpg"
    assert (tmp_path / "out" / "w0.00" / "image" / "0000.jpg").read_bytes() == given.read_bytes()


def test_a_folder_that_is_no_scene_says_how_to_make_one(tmp_path, capsys):
    assert main([str(tmp_path), "-o", str(tmp_path / "out"), "--quiet"]) == 2
    assert "Build it with scene-build RECORDING -o SCENE." in capsys.readouterr().err


def test_a_truncated_picture_is_named(tmp_path, capsys):
    scene = plain_street(tmp_path, views=[camera(width=80, height=34)])
    write_scene(tmp_path, scene)
    image = scene.recording.frames[0].image
    image.write_bytes(image.read_bytes()[:-40])
    assert run(tmp_path, tmp_path / "out") == 2
    assert "0000.png: it must be a whole PNG" in capsys.readouterr().err


def test_a_mask_of_another_size_is_refused(tmp_path, capsys):
    scene = plain_street(tmp_path, views=[camera(width=80, height=34)], masks=[np.zeros((34, 80), np.uint8)])
    write_scene(tmp_path, scene)
    given = scene.recording.frames[0].masks
    assert given is not None
    write_raw(given.file, np.zeros((30, 80), np.uint8))
    assert run(tmp_path, tmp_path / "out") == 2
    assert "the mask must have the size of its camera, 80 x 34, got 80 x 30" in capsys.readouterr().err


def test_an_unwritable_place_is_named(scene_folder, tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    assert run(scene_folder, tmp_path / "file") == 2
    assert "must be a folder, got a file" in capsys.readouterr().err


def test_settings_tables_reach_the_water_and_the_relief(scene_folder, tmp_path, capsys):
    (tmp_path / "s.toml").write_text("porosity = 0.5\n[water]\nk_acc = 50.0\n[relief]\nbump_height = 0.001\n")
    assert run(scene_folder, tmp_path / "out", "--settings", str(tmp_path / "s.toml"), "--frames", "0") == 0
    settings = json.loads((tmp_path / "out" / "w1.00" / "augment.json").read_text())["settings"]
    assert (settings["porosity"], settings["water"]["k_acc"], settings["relief"]["bump_height"]) == (0.5, 50.0, 0.001)
    (tmp_path / "s.toml").write_text("[water]\nk_ac = 50.0\n")
    assert run(scene_folder, tmp_path / "out", "--settings", str(tmp_path / "s.toml")) == 2
    assert "water.k_ac must be a known setting" in capsys.readouterr().err
