from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.reconstruction.ground import split_ground

from ..synthetic_street import HALF_ROAD, labelled_street


def test_ground_of_a_cambered_street_with_kerbs_slope_bridge_and_vehicles_is_found():
    points, truth, path = labelled_street()
    found = split_ground(points, path)
    iou = (found & truth).sum() / (found | truth).sum()
    # The feet of the boxes, 18 cm high gaps below vehicles included, are the only honest doubt: under 2 % of the points.
    assert iou > 0.96
    kerb = truth & (np.abs(np.abs(points[:, 1]) - HALF_ROAD) < 0.3) & (np.abs(points[:, 0] - 15) < 15)
    assert found[kerb].mean() > 0.95


def test_a_bridge_overhead_and_echoes_from_below_are_not_ground():
    points, truth, path = labelled_street()
    found = split_ground(points, path)
    assert not found[points[:, 2] > 5].any()
    assert not found[(points[:, 2] < -0.9) & ~truth].any()


def test_ground_is_found_without_a_path():
    points, truth, _ = labelled_street()
    found = split_ground(points, np.zeros((0, 3)))
    assert (found & truth).sum() / (found | truth).sum() > 0.9


def test_an_empty_cloud_is_refused():
    with pytest.raises(InputError, match="must hold points"):
        split_ground(np.zeros((0, 3)), np.zeros((0, 3)))


def test_a_cloud_that_floats_far_above_its_path_is_refused():
    points, _, path = labelled_street()
    with pytest.raises(InputError, match="show ground below the path"):
        split_ground(points + (0, 0, 100), path)
