"""Sums over tiles against means over pixels, and intervals whose width theory gives."""

from __future__ import annotations

import numpy as np
import pytest

from evaluate.experiments.tiles import TileSums, is_outlier
from materials.foundation.errors import InputError


def test_sums_over_tiles_are_those_over_the_pixels_of_the_region():
    rng = np.random.default_rng(1)
    error, dry, length = rng.gamma(2, 2, (3, 50, 70))
    region = rng.random((50, 70)) < 0.3
    error[4, 5], region[4, 5] = np.nan, True
    known = region & np.isfinite(error)
    sums = TileSums()
    sums.add(error, dry, length, region)
    assert sums.pixels == known.sum()
    assert sums.epe() == pytest.approx(error[known].mean()) and sums.epe(dry=True) == pytest.approx(dry[known].mean())
    assert sums.fl_all() == pytest.approx(np.mean((error[known] > 3) & (error[known] > 0.05 * length[known])))
    assert sums.added() == pytest.approx((error - dry)[known].sum())
    epe, fl = sums.changes(rng)
    assert epe.low < epe.value < epe.high and epe.value == pytest.approx((error - dry)[known].mean())
    assert fl.value == pytest.approx(sums.fl_all() - sums.fl_all(dry=True))


def test_an_outlier_exceeds_both_bounds():
    assert is_outlier(np.array([3.0, 3.1, 3.1, 10.0]), np.array([1.0, 1.0, 100.0, 100.0])).tolist() == [False, True, False, True]


def test_the_interval_of_tiles_that_each_have_one_error_is_that_of_the_mean_over_tiles():
    rng = np.random.default_rng(2)
    sums, of_tiles = TileSums(), []
    for _ in range(40):
        of_tiles.append(rng.normal(1, 1, (6, 10)))
        error = np.kron(of_tiles[-1], np.ones((8, 8)))
        sums.add(error, np.zeros_like(error), np.ones_like(error), np.ones(error.shape, bool))
    epe = sums.changes(rng)[0]
    half = 1.96 * np.std(of_tiles) / np.sqrt(np.size(of_tiles))
    # 2000 draws know the ends to a few percent of the width: sd of a 2.5 % quantile is 2.67 sigma / sqrt(2000), or 3 % of `half`.
    assert (epe.high - epe.low) / 2 == pytest.approx(half, rel=0.12)


def test_where_too_few_tiles_are_there_is_no_interval_and_without_pixels_no_mean():
    sums = TileSums()
    one = np.ones((6, 6))
    region = np.zeros((6, 6), bool)
    sums.add(one, one, one, region)
    assert sums.pixels == 0 and np.isnan(sums.epe()) and np.isnan(sums.changes(np.random.default_rng(0))[0].value)
    region[0, :4] = True
    sums.add(2 * one, one, one, region)
    epe = sums.changes(np.random.default_rng(0))[0]
    assert epe.value == 1 and np.isnan(epe.low) and np.isnan(epe.high)
    with pytest.raises(InputError, match="errors and region must have one shape"):
        sums.add(one, one, one, region[:3])
