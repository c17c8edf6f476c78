"""Pictures that grow: they stop where asked, and go on after an interrupt as if there had been none."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numba
import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.simulation import DirectionalLight, EnvironmentLight, Material, PointLight
from tests.transport.worlds import WHITE, ball, camera, floor, grey, world
from transport.checkpoint import load_checkpoint, save_checkpoint
from transport.progressive import Goal, develop, next_look, relative_noise, seconds_left
from transport.render import Exposure, Tracing, render
from transport.world import with_lights

# Higher than a band of rows, so that steps can fall apart.
VIEW = camera((-6, 1, 2), (0, 0, 0.5), 24, 80, 30)
LIGHTS = {"sky": EnvironmentLight(WHITE), "sun": DirectionalLight((0.5, 0.3, -0.8), (2.0, 2.0, 2.0), 0.01)}


@pytest.fixture(scope="module")
def lit():
    return world({"floor": (floor(), Material("ggx", (0.3, 0.2, 0.1), alpha=0.2)), "ball": (ball(), grey(0.7))}, LIGHTS)


def exposure(lit, seed=3) -> Exposure:
    return Exposure(lit, VIEW, Tracing(seed, 4))


def test_a_run_cut_in_two_anywhere_gives_the_bits_of_one_that_was_not(lit, tmp_path, monkeypatch):
    # Steps of two samples, so that the cut falls between two bands and within a look.
    monkeypatch.setattr("transport.render._PATHS_PER_STEP", 2 * 64 * VIEW.width)
    whole = exposure(lit)
    reference = develop(whole, Goal(noise=0.07))
    assert reference.reached == "noise" and reference.rendering.samples > 4
    total = len(exposure(lit).steps(reference.rendering.samples))
    for cut in (1, 3, total - 1):
        first = exposure(lit)
        taken = 0
        expose = first.expose

        def interrupted(band, then, limit=cut, expose=expose):
            nonlocal taken
            if taken == limit:
                raise KeyboardInterrupt
            taken += 1
            expose(band, then)

        monkeypatch.setattr(first, "expose", interrupted)
        file = tmp_path / "c.npz"
        with pytest.raises(KeyboardInterrupt):
            develop(first, Goal(noise=0.07), keep=lambda seconds, e=first: save_checkpoint(tmp_path / "c.npz", e, seconds))
        again = exposure(lit)
        spent = load_checkpoint(file, again)
        assert spent > 0 and again.samples <= reference.rendering.samples
        resumed = develop(again, Goal(noise=0.07), spent=spent)
        assert resumed.noise == reference.noise
        np.testing.assert_array_equal(again.sums, whole.sums)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread cannot be compared with two")  # type: ignore[attr-defined]
def test_threads_do_not_change_a_bit_of_any_sum(lit):
    before, sums = numba.get_num_threads(), []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            picture = exposure(lit)
            picture.advance(3)
            sums.append(picture.sums)
    finally:
        numba.set_num_threads(before)
    np.testing.assert_array_equal(*sums)


def test_memory_does_not_grow_with_samples_and_shares_add_up(lit):
    picture = exposure(lit)
    size = picture.sums.nbytes
    picture.advance(2)
    picture.advance(9)
    assert picture.sums.nbytes == size == VIEW.width * VIEW.height * 22 * 8
    whole = picture.rendering()
    parts = whole.diffuse + whole.specular + whole.seen + whole.scattered
    # Float32 rounding of five numbers.
    np.testing.assert_allclose(parts, whole.radiance, rtol=4e-7, atol=1e-7)
    np.testing.assert_array_equal(whole.radiance, render(lit, VIEW, 9, 3, 4).radiance)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda w: Exposure(w, VIEW, Tracing(4, 4)), "seed must be 3, as when the checkpoint was made, got 4"),
        (lambda w: Exposure(w, VIEW, Tracing(3, 5)), "max_bounces must be 4"),
        (lambda w: Exposure(w, replace(VIEW, fx=VIEW.fx + 1), Tracing(3, 4)), "the camera must be the one that"),
        (lambda w: Exposure(with_lights(w, {"p": PointLight((0, 0, 3), WHITE)}), VIEW, Tracing(3, 4)), "the lights must be"),
        (lambda w: Exposure(world({"f": (floor(), grey(0.5))}, LIGHTS), VIEW, Tracing(3, 4)), "the scene must be"),
    ],
)
def test_a_checkpoint_of_another_run_is_refused_by_what_differs(lit, tmp_path, change, words):
    file = tmp_path / "c.npz"
    save_checkpoint(file, exposure(lit), 1.0)
    other = change(lit)
    with pytest.raises(InputError, match=words):
        load_checkpoint(file, other)
    assert not other.sums.any()


def test_a_torn_checkpoint_is_refused(lit, tmp_path):
    file = tmp_path / "c.npz"
    save_checkpoint(file, exposure(lit), 1.0)
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(InputError, match="must be a whole checkpoint, got a damaged one"):
        load_checkpoint(file, exposure(lit))


def test_a_time_limit_ends_a_run_with_every_pixel_exposed(lit):
    outcome = develop(exposure(lit), Goal(seconds=1e-9))
    assert outcome.reached == "seconds"
    assert outcome.rendering.samples >= 1 and outcome.rendering.radiance.min() > 0


def test_the_noise_is_that_of_the_pictures_of_many_seeds(lit):
    pictures = [render(lit, VIEW, 8, seed, 4) for seed in range(12)]
    light = np.array([p.radiance.mean(axis=-1) for p in pictures], float)
    mean = light.mean(axis=0)
    true = np.sqrt(np.mean(light.var(axis=0, ddof=1) / (mean**2 + (0.1 * mean.mean()) ** 2)))
    claimed = np.mean([relative_noise(p) for p in pictures])
    # An upper estimate: Sobol samples do better than independent ones, and channels do not err alike. Not by more than
    # stratification by 8 samples can gain, and never less than 5 % below (1920 pixels of 11 degrees of freedom: 1 %).
    assert 0.95 * true < claimed < 3 * true


def test_looks_depend_on_samples_alone_and_grow_by_a_quarter():
    n, looks = 0, []
    while n < 1000:
        n = next_look(n)
        looks.append(n)
    assert looks[:4] == [4, 8, 12, 16] and all(b - a <= max(4, a // 4) for a, b in itertools.pairwise(looks))


def test_the_time_left_follows_the_root_of_the_samples():
    assert seconds_left(Goal(100), 25, math.inf, 5, 0.2) == pytest.approx(15)
    # Half the noise needs four times the samples: 75 more.
    assert seconds_left(Goal(noise=0.1), 25, 0.2, 5, 0.2) == pytest.approx(15)
    assert seconds_left(Goal(seconds=12), 25, 0.2, 5, None) == pytest.approx(7)
    assert seconds_left(Goal(1000, 0.1, 6.0), 25, 0.2, 5, 0.2) == pytest.approx(1)
    assert seconds_left(Goal(100), 0, math.inf, 5, None) is None


@pytest.mark.parametrize(
    ("goal", "words"), [({"samples": 0}, "samples must"), ({"noise": 0.0}, "noise must"), ({"seconds": -1.0}, "seconds must")]
)
def test_goals_that_cannot_be_reached_are_refused(goal, words):
    with pytest.raises(InputError, match=words):
        Goal(**goal)
