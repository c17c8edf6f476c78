from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bench_growth import deviation


def test_points_on_a_line_deviate_by_nothing():
    x = np.array([1.0, 10.0, 100.0, 1000.0])
    assert deviation(x, 3 + 0.2 * x) == pytest.approx(0, abs=1e-12)


def test_what_grows_with_the_square_deviates():
    x = np.array([1.0, 10.0, 100.0, 1000.0])
    assert deviation(x, 1e-3 * x**2 + 1) > 0.3
    # One point that is 10 % off a line through many: nearly by so much.
    y = np.linspace(1, 2, 21)
    y[10] *= 1.1
    assert 0.05 < deviation(np.linspace(1, 2, 21), y) < 0.1
