"""What the study of false alarms and power needs besides Mitsuba."""

from __future__ import annotations

import numpy as np

from benchmarks.proof_calibration import _logistic
from benchmarks.sealed.generate import Tolerance, _miscalibrated, _noisier
from benchmarks.sealed.worlds import random_world


def test_lamps_and_poses_are_off_by_what_is_tolerated():
    world = random_world(np.random.default_rng(1), "studio", (32, 24))
    off = _miscalibrated(np.random.default_rng(2), world, Tolerance(lamps=0.001, poses=0.02))
    shifts = [np.array(off.lights[n]["position"]) - world.lights[n]["position"] for n in world.lights]
    assert 0.0003 < np.std(shifts) < 0.002
    turns = [old[:3, :3].T @ new[:3, :3] for (old, _), (new, _) in zip(world.frames, off.frames, strict=True)]
    angles = [np.arccos(np.clip((np.trace(t) - 1) / 2, -1, 1)) * world.focal for t in turns]
    assert 0.005 < max(angles) < 0.1
    # Frames from one place share its error.
    assert len({new.tobytes() for new, _ in off.frames}) == len({old.tobytes() for old, _ in world.frames})


def test_without_tolerance_nothing_is_off():
    world = random_world(np.random.default_rng(1), "street", (32, 24))
    off = _miscalibrated(np.random.default_rng(2), world, Tolerance())
    assert off.lights == world.lights
    assert all(np.allclose(a, b, atol=1e-12) for (a, _), (b, _) in zip(world.frames, off.frames, strict=True))


def test_more_noise_is_more_of_both_kinds():
    world = random_world(np.random.default_rng(1), "corner", (32, 24))
    louder = _noisier(world, 2.0)
    # Twice the standard deviation at every signal.
    for signal in (0.0, 0.3):
        one, two = (w.noise["read_sigma"] ** 2 + w.noise["shot_gain"] * signal for w in (world, louder))
        assert np.isclose(two, 4 * one)


def test_a_power_curve_finds_where_half_are_right():
    rng = np.random.default_rng(3)
    x = rng.uniform(-3, 3, 400)
    y = (rng.random(400) < 1 / (1 + np.exp(-4 * (x - 0.5)))).astype(float)
    middle, slope = _logistic(x, y)
    assert abs(middle - 0.5) < 0.25
    assert 2 < slope < 7
