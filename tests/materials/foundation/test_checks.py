from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from materials.foundation.checks import check_finite, check_range, check_shape, check_unit
from materials.foundation.errors import InputError


@given(st.floats(allow_nan=True, allow_infinity=True), st.sampled_from("[("), st.sampled_from("])"))
def test_an_interval_holds_its_closed_ends_and_not_its_open_ones(value, left, right):
    inside = (value > 0 or (value == 0 and left == "[")) and (value < 1 or (value == 1 and right == "]"))
    if inside:
        check_range("x", value, f"{left}0, 1{right}")
    else:
        with pytest.raises(InputError, match="x must lie in"):
            check_range("x", value, f"{left}0, 1{right}")


@pytest.mark.parametrize(("value", "interval"), [(0.0, "(0, 1]"), (1.0, "[0, 1)"), (np.inf, "(0, inf)"), (np.nan, "(-inf, inf)")])
def test_an_open_end_and_a_nan_are_outside(value, interval):
    with pytest.raises(InputError, match=re.escape(f"x must lie in {interval}, got {value:g}.")):
        check_range("x", value, interval)


def test_a_range_names_the_first_value_outside():
    with pytest.raises(InputError, match=r"x must lie in \[0, 1\], got 3 at index \(1, 0\)\."):
        check_range("x", [[0, 1], [3, -4]], "[0, 1]")


def test_a_word_is_no_number():
    with pytest.raises(InputError, match="x must be a number or an array of numbers, got 'wet'"):
        check_range("x", "wet", "[0, 1]")  # type: ignore[arg-type]


@pytest.mark.parametrize(("want", "words"), [((None, 3), "(any, 3)"), ((4,), "(4,)")])
def test_a_shape_is_named_as_numpy_writes_it(want, words):
    with pytest.raises(InputError, match=re.escape(f"p must have shape {words}, got (2, 2)")):
        check_shape("p", np.zeros((2, 2)), want)


def test_any_length_fits_a_free_axis():
    check_shape("p", np.zeros((7, 3)), (None, 3))


def test_the_first_value_that_is_not_finite_is_named():
    with pytest.raises(InputError, match=r"p must be finite, got nan at index 2\."):
        check_finite("p", [0, 1, np.nan, np.inf])


def test_a_vector_of_another_length_is_named_with_its_length():
    with pytest.raises(InputError, match=r"wi must have unit length, got 2 at index 1\. Normalise it first\."):
        check_unit("wi", [[0, 0, 1], [0, 0, 2]])
    check_unit("wi", np.array([0.6, 0.0, 0.8], np.float32))
