"""Measures of flow against hand-computed cases, brute force, and the published definitions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluate.flow_metrics import (
    DEFINITIONS,
    Score,
    angular_error_deg,
    difference,
    difference_of,
    endpoint_error,
    pooled,
    regions,
    score,
    score_regions,
    wauc,
)
from materials.foundation.errors import InputError
from scene.flow_files import Flow, as_flow


def field(*vectors: tuple[float, float]) -> Flow:
    return as_flow(np.array([vectors], float))


def test_end_point_error_is_the_length_of_the_difference_and_unknown_stays_unknown():
    error = endpoint_error(field((3, 4), (1, 1), (np.nan, 0)), field((0, 0), (1, 1e10), (0, 0)))
    assert error[0, 0] == 5 and np.isnan(error[0, 1:]).all()


def test_angular_error_of_one_pixel_against_none_is_45_degrees():
    angles = angular_error_deg(field((1, 0), (0, 0), (1e-4, 0)), field((0, 0), (0, 0), (0, 0)))
    np.testing.assert_allclose(angles, [[45, 0, np.degrees(np.arctan(1e-4))]], rtol=1e-6)


def test_fl_all_wants_three_pixels_and_five_percent():
    # 4 px off a vector of 100 px is within 5 %; off one of 10 px it is an outlier; 2.9 px never is.
    s = score(field((104, 0), (14, 0), (12.9, 0)), field((100, 0), (10, 0), (10, 0)))
    assert s.fl_all == pytest.approx(1 / 3) and s.over_3px == pytest.approx(2 / 3)
    assert s.over_1px == 1 and s.over_5px == 0
    assert s.epe == pytest.approx((4 + 4 + 2.9) / 3, rel=1e-6) and s.epe_median == 4


def test_every_number_of_a_score_has_a_definition():
    s = score(field((1, 0)), field((0, 0)), sigma=np.array([[0.4]], np.float32))
    assert set(s.as_dict()) <= set(DEFINITIONS) and len(s.as_dict()) == 14


def test_wauc_follows_its_definition_threshold_by_threshold():
    errors = np.random.default_rng(1).exponential(1.0, 500)
    errors[:3] = 0.05, 5.0, 7.0
    total = weight_sum = 0.0
    for i in range(1, 101):
        w = 1 - (i - 1) / 100
        total += w * np.mean(errors <= i / 20)
        weight_sum += w
    assert wauc(errors) == pytest.approx(total / weight_sum, rel=1e-12)
    assert wauc(np.zeros(4)) == pytest.approx(1) and wauc(np.full(4, 9.0)) == 0


def test_density_tells_how_much_was_left_out():
    s = score(field((0, 0), (np.nan, 0), (0, 0)), field((0, 0), (0, 0), (np.nan, 0)))
    assert s.pixels == 1 and s.density == 0.5


def test_a_region_without_pixels_scores_nothing():
    s = score(field((0, 0)), field((1, 0)), np.array([[False]]))
    assert s == Score(0) and s.as_dict() == {"pixels": 0}


def test_regions_part_the_frame():
    visible, moving = np.array([[True, False, True]]), np.array([[True, True, False]])
    estimate, truth = field((1, 0), (2, 0), (3, 0)), field((0, 0), (0, 0), (0, 0))
    scores = score_regions(estimate, truth, regions(visible, moving, {"puddle": moving}))
    assert {n: s.epe for n, s in scores.items()} == {
        "all": 2,
        "visible": 2,
        "occluded": 2,
        "moving": 1.5,
        "static": 3,
        "puddle": 1.5,
    }


def test_stated_uncertainty_excuses_as_much_as_it_says():
    sigma = np.array([[0.5, 1.0, 0.0]], np.float32)
    s = score(field((1, 0), (1, 0), (9, 0)), field((0, 0), (0, 0), (0, 0)), sigma=sigma)
    assert (s.within_1_sigma, s.within_3_sigma, s.epe_beyond_sigma) == (0.5, 1.0, 0.25)


@given(st.lists(st.integers(1, 30), min_size=1, max_size=4), st.integers(0, 99))
def test_pooled_means_are_those_of_all_pixels_at_once(sizes: list[int], seed: int):
    rng = np.random.default_rng(seed)
    pairs = [(as_flow(rng.normal(0, 3, (1, n, 2))), as_flow(rng.normal(0, 3, (1, n, 2)))) for n in sizes]
    together = score(*(as_flow(np.concatenate([p[k].flow for p in pairs], axis=1)) for k in (0, 1)))
    joined = pooled([score(a, b) for a, b in pairs])
    for name in ("pixels", "density", "epe", "epe_sd", "angular_error", "fl_all", "over_1px", "wauc"):
        assert getattr(joined, name) == pytest.approx(getattr(together, name), rel=1e-5, abs=1e-7), name


def test_the_five_classes_of_the_difference_have_the_bounds_of_the_thesis():
    e = np.array([0.05, 0.051, 0.2, 0.21, 0.5, 0.51, 0.99, 1.0, 3.0, 0.0])
    d = difference_of(e)
    assert d.classes == (0.2, 0.2, 0.2, 0.2, 0.2) and d.pixels == 10
    assert d.mean == pytest.approx(e.mean()) and d.sd == pytest.approx(e.std())


def test_difference_counts_where_both_are_known_and_the_object_is_seen():
    a, b = field((0, 0), (3, 4), (np.nan, 0), (9, 9)), field((0, 0), (0, 0), (0, 0), (0, 0))
    d = difference(a, b, np.array([[True, True, True, False]]))
    assert d.pixels == 2 and d.mean == 2.5 and d.classes == (0.5, 0, 0, 0, 0.5)


def test_sizes_that_differ_and_empty_masks_are_refused():
    with pytest.raises(InputError, match="the flow fields must have one size, got 1 x 1 and 2 x 1"):
        endpoint_error(field((0, 0)), field((0, 0), (0, 0)))
    with pytest.raises(InputError, match="known in both fields and inside the region, got none"):
        difference(field((0, 0)), field((0, 0)), np.array([[False]]))
    with pytest.raises(InputError, match=r"region must have shape \(1, 1\)"):
        score(field((0, 0)), field((0, 0)), np.ones((2, 1), bool))
