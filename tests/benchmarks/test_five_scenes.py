"""The five scenes and their race, as far as no other renderer is needed."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bench_five_scenes import relative_error, samples_for
from benchmarks.five_scenes import five_scenes
from transport.gbuffer import gbuffer
from transport.world import compile_world


def test_the_scenes_are_read_from_files_and_fill_their_pictures(tmp_path):
    scenes = five_scenes(tmp_path)
    assert len(scenes) == 5
    for name, scene in scenes.items():
        assert (tmp_path / name.replace(" ", "_") / "simulation.json").exists()
        seen = gbuffer(compile_world(scene.simulation), scene.camera)
        assert np.mean(seen.shape >= 0) > 0.4, name
    water = scenes["water in a pool"]
    seen = gbuffer(compile_world(water.simulation), water.camera)
    names = [s.name for s in compile_world(water.simulation).shapes]
    on_water = seen.shape == names.index("water")
    assert on_water.mean() > 0.2 and np.all(seen.normal[on_water][:, 2] > 0.8)


@pytest.mark.parametrize("power", [1.0, 1.4])
def test_the_samples_for_an_error_are_those_at_which_it_is_reached(power):
    truth = np.full((8, 8, 3), 0.5, np.float32)

    def picture(count, seed):
        return truth * (1 + np.float32(0.3) * np.float32(count) ** np.float32(-power / 2))

    # At 50 samples; from 32 and 128 on the same power law, so nothing but rounding up is lost.
    assert samples_for(relative_error(picture(50, 0), truth), picture, truth, 64) in (50, 51)


def test_the_relative_error_knows_no_unit_and_forgives_black():
    rng = np.random.default_rng(0)
    truth = rng.random((64, 64, 3)).astype(np.float32)
    truth[:32] = 0
    noisy = truth + 0.01 * rng.standard_normal(truth.shape).astype(np.float32)
    assert relative_error(100 * noisy, 100 * truth) == pytest.approx(relative_error(noisy, truth), rel=1e-4)
    light = truth.mean(axis=-1, dtype=np.float64)
    expected = np.mean(0.01**2 / (light**2 + (0.1 * light.mean()) ** 2))
    # Nearly all of it comes from the black half, 6144 squares of a normal deviate: five of their standard deviations.
    assert relative_error(noisy, truth) == pytest.approx(expected, rel=5 * np.sqrt(2 / 6144))
