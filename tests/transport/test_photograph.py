"""Pictures of the street become a recording; what is done is not done again."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.images import read_exr, read_image
from scene.recording import Noise
from scene.street import Street, StreetSettings, street
from transport.photograph import PhotographSettings, main, photograph, picture_name, with_noise

TINY = PhotographSettings(samples=2, max_bounces=2)


@pytest.fixture(scope="module")
def world() -> Street:
    return street(StreetSettings(frames=2, width=64, height=27, detail=0.15))


@pytest.fixture(scope="module")
def folder(world: Street, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("street") / "recording"
    photograph(world, out, TINY, (1.0,))
    return out


def test_the_recording_is_the_picture_with_noise_in_eight_bits(world: Street, folder: Path):
    recording = photograph(world, folder, TINY, (1.0,))
    assert len(recording.frames) == 2
    assert recording.noise == Noise(TINY.read_sigma, TINY.shot_gain)
    image, encoding = read_image(recording.frames[0].image)
    assert image.shape == (27, 64, 3) and encoding.dtype == "uint8" and encoding.response == "srgb"
    channels = read_exr(folder / picture_name(0))
    linear = np.stack([channels[c] for c in "RGB"], axis=-1)
    assert np.isfinite(linear).all() and linear.min() >= 0
    # Half a code at the top of sRGB is 0.0045 in linear units; noise has 0.002 to 0.01; five sigma of both.
    assert np.abs(image - np.clip(linear, 0, 1)).max() < 0.0045 + 5 * 0.0103


def test_a_finished_recording_is_not_rendered_again(world: Street, folder: Path):
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}
    photograph(world, folder, TINY, (1.0,))
    assert before == {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}


def test_a_lost_picture_is_rendered_again_to_the_same_bits(world: Street, folder: Path):
    file = folder / picture_name(1, 1.0)
    before = read_exr(file)
    file.unlink()
    photograph(world, folder, TINY, (1.0,))
    after = read_exr(file)
    for name, channel in before.items():
        np.testing.assert_array_equal(channel, after[name])


def test_wet_road_differs_from_dry_and_the_sky_does_not(world: Street, folder: Path):
    dry, wet = (read_exr(folder / picture_name(0, w))["G"] for w in (None, 1.0))
    assert np.abs(wet[20:] - dry[20:]).mean() > 0.005
    np.testing.assert_array_equal(wet[0, 35:38], dry[0, 35:38])


def test_a_folder_of_other_things_is_not_touched(world: Street, tmp_path: Path):
    (tmp_path / "holiday.jpg").write_bytes(b"x")
    with pytest.raises(InputError, match="be empty or a street made before"):
        photograph(world, tmp_path, TINY)
    assert [p.name for p in tmp_path.iterdir()] == ["holiday.jpg"]


def test_sensor_noise_has_the_stated_variance():
    noise = Noise(0.002, 0.0001)
    image = np.full((200, 200, 3), 0.25, np.float32)
    error = with_noise(image, noise, np.random.default_rng(0)) - image
    n = error.size
    # The variance of a sample variance of normal noise is 2 / n; five of its standard deviations.
    assert error.var() / (0.002**2 + 0.0001 * 0.25) == pytest.approx(1.0, abs=5 * np.sqrt(2 / n))


def test_the_command_names_a_wrong_wetness(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    code = main(["-o", str(tmp_path / "out"), "--wetness", "a lot", "--frames", "2", "--detail", "0.1", "--quiet"])
    assert code == 2
    assert "--wetness must be numbers with commas between, got a lot." in capsys.readouterr().err


def test_an_older_street_gets_its_boxes_without_new_pictures(world: Street, folder: Path):
    made = json.loads((folder / "made.json").read_text())
    made["done"] = ["measurements", *[name for name in made["done"] if name.endswith(".exr")]]
    (folder / "made.json").write_text(json.dumps(made))
    (folder / "recording.json").unlink()
    shutil.rmtree(folder / "truth" / "boxes")
    pictures = {p: p.stat().st_mtime_ns for p in [*folder.glob("images/*"), *folder.glob("truth/linear/*")]}
    recording = photograph(world, folder, TINY, (1.0,))
    assert all(frame.boxes is not None and frame.boxes.file.exists() for frame in recording.frames)
    assert pictures == {p: p.stat().st_mtime_ns for p in pictures}
