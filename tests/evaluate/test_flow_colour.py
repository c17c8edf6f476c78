"""The colours are those of the published wheel, and the legend says how long a vector is."""

from __future__ import annotations

import numpy as np
import pytest

from evaluate.flow_colour import _wheel, colour, legend, scale_of, with_legend
from materials.foundation.errors import InputError
from scene.flow_files import as_flow


def test_no_motion_is_white_and_unknown_is_black():
    picture = colour(as_flow([[[0.0, 0.0], [np.nan, 0.0]]]), 1.0)
    assert picture[0, 0].tolist() == [255, 255, 255] and picture[0, 1].tolist() == [0, 0, 0]


def test_directions_have_the_hues_of_the_benchmark():
    # Baker et al. (2011), figure 3: right is red, down yellow, left green to cyan, up blue to violet.
    right, down, left, up = (colour(as_flow([[v]]), 1.0)[0, 0].astype(int) for v in ([1, 0], [0, 1], [-1, 0], [0, -1]))
    assert right[0] > 200 and right[1] < 60 and right[2] < 60
    assert min(down[:2]) > 150 and down[2] < 60
    assert left[1] > 200 and left[0] < 60
    assert up[2] > 200 and up[1] < 60


def test_the_wheel_has_55_colours_from_red_round_to_red():
    wheel = _wheel()
    assert wheel.shape == (55, 3)
    np.testing.assert_array_equal(
        wheel[[0, 15, 21, 25, 36, 49]], np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]])
    )


@pytest.mark.parametrize("coding", ["middlebury", "hsv"])
def test_half_the_length_is_half_as_saturated(coding: str):
    full, half = colour(as_flow([[[2.0, 0.0], [1.0, 0.0]]]), 2.0, coding)[0].astype(int)
    np.testing.assert_allclose(255 - half, (255 - full) / 2, atol=1)


def test_the_legend_shows_the_field_of_all_directions():
    key = legend(4.0, size=64)
    assert key.shape == (82, 64, 3)
    # Just left of the rim: the colour of leftward motion at full length.
    assert key[32, 1, 1] > 200 and key[32, 1, 0] < 80
    framed = with_legend(as_flow(np.zeros((20, 30, 2))), 4.0)
    assert framed.shape == (114, 30 + 8 + 96, 3)


def test_the_scale_ignores_what_is_unknown():
    assert scale_of(as_flow([[[3.0, 4.0], [np.nan, 0.0]]])) == 5.0
    assert scale_of(as_flow([[[np.nan, 0.0]]])) == 1.0


def test_an_unknown_coding_is_refused():
    with pytest.raises(InputError, match="coding must be one of middlebury, hsv, got rainbow"):
        colour(as_flow([[[1.0, 0.0]]]), 1.0, "rainbow")
