"""Spray and mist of eq 6.6."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from materials.foundation.errors import InputError
from scene.grid import GroundGrid
from scene.wetting.spray import Spray, spray_over
from scene.wetting.spray_settings import SpraySettings

GRID = GroundGrid(-4.0, 2.0, 0.5, 40, 60)
LEVEL = np.zeros(GRID.shape, np.float32)


def hilly() -> np.ndarray:
    x, y = GRID.centres()
    return (0.1 * x + 0.3 * np.sin(y)).astype(np.float32)


def points(rng, count=20_000, height=3.0):
    return rng.uniform((-20, -20, 0), (60, 60, height), (count, 3))


@pytest.mark.parametrize("m", [1 / 3, 2 / 3, 1.0])
def test_even_mist_is_eq_6_6_above_level_ground(m):
    spray = spray_over(LEVEL, GRID, m, SpraySettings(contrast=0))
    p = points(np.random.default_rng(0), 100)
    np.testing.assert_allclose(spray.extinction(p), m / 50 * np.exp(-p[:, 2]), rtol=1e-12)
    # 450, 225 and 150 m at a camera's height of 1.1 m
    assert 1 / spray.extinction([[0, 10, 1.1]])[0] == pytest.approx(150.2 / m, rel=1e-3)


def test_mist_follows_the_ground_and_fills_what_lies_below_it():
    spray = spray_over(hilly(), GRID, 1.0, SpraySettings(contrast=0))
    x, y = GRID.centres()
    on_ground = np.column_stack([x.ravel(), y.ravel(), hilly().ravel().astype(float)])
    np.testing.assert_allclose(spray.extinction(on_ground), 0.02, rtol=1e-6)
    np.testing.assert_allclose(spray.extinction(on_ground + (0, 0, 2.0)), 0.02 * np.exp(-2.0), rtol=1e-6)
    np.testing.assert_allclose(spray.extinction(on_ground - (0, 0, 2.0)), 0.02, rtol=1e-12)


def test_noise_keeps_the_mean_and_stays_between_nothing_and_twice_the_mean():
    for contrast in (0.3, 2.0):
        spray = spray_over(LEVEL, GRID, 1.0, SpraySettings(contrast=contrast), seed=4)
        # 2 m apart, four lattice cells of the largest octave: as good as independent
        at = 2.0 * np.stack(np.meshgrid(*[np.arange(28)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.123
        P = spray.extinction(at) / 0.02 * np.exp(at[:, 2])
        assert P.min() >= -1e-12 and P.max() <= 2 + 1e-9
        # Two values of contrast share 1 %.
        assert abs(P.mean() - 1) < norm.isf(0.005 / 2) * P.std() / np.sqrt(len(P))
        if contrast == 0.3:
            assert P.std() == pytest.approx(0.3, rel=0.02)


def test_another_seed_is_other_mist_and_the_same_seed_the_same():
    p = points(np.random.default_rng(1), 50)
    first, again, other = (spray_over(LEVEL, GRID, 1.0, seed=s).extinction(p) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.any(first == other)


def test_no_point_of_a_cell_exceeds_the_bound_of_the_cell():
    spray = Spray(hilly(), GRID, 1.0, SpraySettings(margin=30, contrast=1.0))
    low, high = spray.box()
    bounds = spray.upper_bounds()
    p = np.random.default_rng(2).uniform(low, high, (200_000, 3))
    cell = ((p - low) / (high - low) * bounds.shape[::-1]).astype(int)
    assert np.all(spray.extinction(p) <= bounds[cell[:, 2], cell[:, 1], cell[:, 0]])
    # and they are tight where the mist is dense: within e of one cell's height and the noise's 2
    assert bounds.max() < 0.02 * 2 * 1.001


def test_a_fine_map_is_averaged_and_keeps_its_place():
    fine = GroundGrid(-4.0, 2.0, 0.05, 400, 600)
    x, _ = fine.centres()
    spray = spray_over((0.1 * x).astype(np.float32), fine, 1.0)
    assert spray.grid.cell == pytest.approx(0.5) and spray.ground.shape == (40, 60)
    np.testing.assert_allclose(spray.ground, 0.1 * spray.grid.centres()[0], atol=1e-6)


def test_amounts_and_maps_that_cannot_be_are_refused():
    with pytest.raises(InputError, match=r"m must lie in \[0, 1\], got 1.5"):
        spray_over(LEVEL, GRID, 1.5)
    with pytest.raises(InputError, match="height must be finite"):
        spray_over(LEVEL + np.nan, GRID, 1.0)
    with pytest.raises(InputError, match=r"height must have shape \(40, 60\)"):
        spray_over(LEVEL[:3], GRID, 1.0)
