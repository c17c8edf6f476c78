"""The command that renders a simulation: files whole or absent, nothing done twice, nothing of another run mixed in."""

from __future__ import annotations

import json

import numpy as np
import pytest

from evaluate.command import main
from scene.images import read_exr, write_exr
from scene.recording import camera_json
from scene.simulation import AddedEffect, DirectionalLight, EnvironmentLight, Material, Shape, Simulation
from scene.simulation_file import write_simulation
from tests.transport.worlds import ball, camera, floor, grey
from transport.render import Exposure

VIEW = camera((-6, 1, 2), (0, 0, 0.5), 20, 14, 30)


@pytest.fixture
def case(tmp_path):
    shapes = (Shape("floor", floor(8.0), "gloss"), Shape("ball", ball(1.0, (0, 0, 1), 3), "matte"))
    materials = {"gloss": Material("ggx", (0.3, 0.3, 0.3), alpha=0.2), "matte": grey(0.6)}
    lights = {"sky": EnvironmentLight((0.5, 0.5, 0.6)), "sun": DirectionalLight((0.6, 0.0, -0.8), (2.0, 2.0, 2.0))}
    write_simulation(tmp_path, Simulation(shapes, materials, lights, effects=(AddedEffect("glare", None, {"strength": 0.1}),)))
    frames = []
    for i, on in enumerate((["sky"], ["sky", "sun"])):
        pose = VIEW.T_world_camera.copy()
        pose[0, 3] += 0.1 * i
        write_exr(tmp_path / f"images/{i:04d}.exr", {c: np.zeros((14, 20), np.float32) for c in "RGB"})
        frame = {"image": f"images/{i:04d}.exr", "camera": camera_json(VIEW.moved_to(pose)), "exposure": 1.0 + i, "lights": on}
        frames.append(frame)
    (tmp_path / "recording.json").write_text(json.dumps({"format": "recording/1", "frames": frames}))
    return tmp_path


def render(case, *more: str, out: str = "out") -> int:
    words = ["render", str(case), "-o", str(case / out), "--recording", str(case), "--samples", "4", "--quiet", *more]
    return main(words)


def test_each_frame_gets_its_layers_its_lamps_its_exposure_and_its_preview(case):
    assert render(case) == 0
    names = sorted(p.name for p in (case / "out").iterdir())
    assert names == ["0000.exr", "0000.png", "0001.exr", "0001.png", "render.json"]
    first, second = (read_exr(case / "out" / f"{i:04d}.exr") for i in (0, 1))
    # The sky is seen at the top: exposed once, and twice.
    np.testing.assert_allclose([first["B"][0, 0], second["B"][0, 0]], [0.6, 1.2], rtol=1e-6)
    # Only the second frame has the sun: the lit ball is more than twice as bright.
    on_ball = first["id.shape"] == 2
    assert on_ball.sum() > 20
    assert second["diffuse.G"][on_ball].max() > 3 * first["diffuse.G"][on_ball].max()
    assert "flow.X" in first and "flow.X" not in second
    made = json.loads((case / "out" / "render.json").read_text())
    assert made["format"] == "rendering/1" and made["frames"]["0001"]["samples"] == 4
    assert made["not_rendered"] == ["effect glare"]


def test_what_is_done_is_kept_and_what_is_of_another_run_refused(case, capsys):
    assert render(case) == 0
    before = {p: p.stat().st_mtime_ns for p in (case / "out").iterdir()}
    assert render(case) == 0
    assert before == {p: p.stat().st_mtime_ns for p in (case / "out").iterdir()}
    assert render(case, "--seed", "1") == 2
    assert "0000.exr: seed must be 0, as when this frame was made, got 1." in capsys.readouterr().err
    assert before == {p: p.stat().st_mtime_ns for p in (case / "out").iterdir()}
    assert render(case, "--seed", "1", "--overwrite") == 0
    assert json.loads((case / "out" / "render.json").read_text())["frames"]["0000"]["made"]["seed"] == "1"


def test_an_interrupt_leaves_a_checkpoint_and_the_next_run_the_bits_of_an_uninterrupted_one(case, monkeypatch):
    assert render(case, out="whole") == 0
    monkeypatch.setattr("transport.render._PATHS_PER_STEP", 64 * VIEW.width)  # a sample per step
    taken, expose = [], Exposure.expose

    def interrupted(self, band, then):
        if len(taken) == 6:  # two samples into the second frame
            raise KeyboardInterrupt
        taken.append(band)
        expose(self, band, then)

    monkeypatch.setattr(Exposure, "expose", interrupted)
    assert render(case) == 130
    assert sorted(p.name for p in (case / "out").iterdir()) == ["0000.exr", "0000.png", "0001.checkpoint.npz", "render.json"]
    monkeypatch.setattr(Exposure, "expose", expose)
    assert render(case, "--seed", "1", "--frames", "1") == 2  # the checkpoint is of another seed
    assert render(case) == 0
    assert not list((case / "out").glob("*.npz"))
    for name in ("0000.exr", "0001.exr"):
        once, twice = read_exr(case / "whole" / name), read_exr(case / "out" / name)
        for channel, values in once.items():
            np.testing.assert_array_equal(values, twice[channel], err_msg=f"{name} {channel}")


def test_without_a_recording_everything_is_looked_at_from_aside(case):
    words = ["render", str(case), "-o", str(case / "aside"), "--samples", "1", "--width", "32", "--height", "24", "--quiet"]
    assert main(words) == 0
    seen = read_exr(case / "aside" / "view.exr")["id.shape"]
    assert seen.shape == (24, 32) and set(np.unique(seen)) == {0, 1, 2}
    # The border shows nothing but sky: all fits into the picture.
    assert not np.concatenate([seen[0], seen[-1], seen[:, 0], seen[:, -1]]).any()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--noise", "0"], "--noise must lie in (0, 10], got 0"),
        (["--frames", "7"], "--frames must be A:B within 0:2"),
        (["--max-bounces", "0"], "--max-bounces must lie in [1, 1024], got 0"),
    ],
)
def test_wrong_words_are_named(case, capsys, words, said):
    assert render(case, *words) == 2
    assert said in capsys.readouterr().err
    assert not (case / "out" / "render.json").exists()


def test_a_lamp_that_is_not_there_and_a_folder_of_other_things_are_named(case, capsys):
    recording = json.loads((case / "recording.json").read_text())
    recording["frames"][0]["lights"] = ["moon"]
    (case / "recording.json").write_text(json.dumps(recording))
    assert render(case) == 2
    assert "lights of frame 0000 must name lights of the simulation (sky, sun), got moon." in capsys.readouterr().err
    assert render(case, out="images") == 2
    assert "must be empty or hold renderings" in capsys.readouterr().err


def test_denoising_without_a_denoiser_says_how_to_get_one(case, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyoidn", None)
    assert render(case, "--denoise") == 2
    assert "Install it: .venv/bin/python -m pip install -r requirements-denoise.lock" in capsys.readouterr().err
    assert not list((case / "out").glob("*.exr"))
