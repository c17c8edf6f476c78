"""Slow traffic is told from what stands by how its points lie in the next sweeps."""

from __future__ import annotations

import numpy as np
import pytest

from scene.reconstruction.slow_objects import slowly_moving

SWEEPS = 6
SCANNER = 1.7


def seen(scanner: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return what a scanner with rings 0.4 degrees and columns 0.3 degrees apart sees of an upright box: two of its sides."""
    azimuth = np.arctan2(*(np.array([low[:2], high[:2], (low[0], high[1]), (high[0], low[1])]) - scanner[:2]).T[::-1])
    turn, tilt = np.meshgrid(np.arange(azimuth.min(), azimuth.max(), np.radians(0.3)), np.radians(np.arange(-20, 3, 0.4)))
    rays = np.column_stack([(np.cos(tilt) * np.cos(turn)).ravel(), (np.cos(tilt) * np.sin(turn)).ravel(), np.sin(tilt).ravel()])
    with np.errstate(divide="ignore"):
        a, b = (low - scanner) / rays, (high - scanner) / rays
    near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    hit = (near > 0) & (near < far)
    return scanner + near[hit, None] * rays[hit]


def street(car_step: float, lorry_step: float, rng: np.random.Generator):
    """A car ahead and a lorry beside a scanner that drives 0.3 m per sweep, a parked car and a post; heights from z = 0."""
    things = {
        "car": (np.array([9.0, -0.9, 0.2]), np.array([13.0, 0.9, 1.5]), car_step),
        "lorry": (np.array([6.0, -5.0, 0.4]), np.array([17.0, -2.6, 3.4]), lorry_step),
        "parked": (np.array([8.0, 2.6, 0.2]), np.array([12.0, 4.4, 1.5]), 0.0),
        "post": (np.array([14.0, 6.0, 0.0]), np.array([14.3, 6.3, 4.0]), 0.0),
    }
    points, sweep, name, path = [], [], [], []
    for i in range(SWEEPS):
        scanner = np.array([0.3 * i, 0.0, SCANNER])
        path.append(scanner)
        for k, (low, high, step) in enumerate(things.values()):
            shift = np.array([step * i, 0, 0])
            p = seen(scanner, low + shift, high + shift)
            points.append(p + rng.normal(0, 0.01, p.shape))
            sweep.append(np.full(len(p), i))
            name.append(np.full(len(p), k))
    return tuple(np.concatenate(v) for v in (points, sweep, name)) + (np.array(path),)


@pytest.mark.parametrize(("car", "lorry"), [(0.15, 0.5), (0.5, -0.4), (0.0, 0.3), (0.0, 0.0)])
def test_what_moves_goes_from_all_sweeps_and_what_stands_stays(car, lorry):
    points, sweep, name, path = street(car, lorry, np.random.default_rng(1))
    moving = slowly_moving(points, sweep, points[:, 2], path)
    for k, step in enumerate((car, lorry, 0.0, 0.0)):
        share = moving[(name == k) & (points[:, 2] > 0.25)].mean()
        # Shreds at the rim of a moving thing, of fewer points than one can judge, may stay; of what stands nothing goes.
        assert share > 0.95 if step else share == 0


def test_too_few_sweeps_tell_nothing():
    points, sweep, _, path = street(0.5, 0.5, np.random.default_rng(1))
    two = sweep < 2
    assert not slowly_moving(points[two], sweep[two], points[two, 2], path[:2]).any()


def test_sweeps_from_far_apart_tell_nothing():
    points, sweep, _, path = street(0.5, 0.5, np.random.default_rng(1))
    shift = 5.0 * sweep[:, None] * (1.0, 0.0, 0.0)
    assert not slowly_moving(points + shift, sweep, points[:, 2], path + 5.0 * np.arange(SWEEPS)[:, None] * (1.0, 0, 0)).any()
