from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scene.grid import GroundGrid


@given(st.integers(0, 2**31), st.sampled_from([0.05, 0.1, 0.25, 1.0]), st.floats(0, 3))
def test_a_grid_covers_its_points_with_their_margin_and_hardly_more(seed, cell, margin):
    points = np.random.default_rng(seed).uniform(-50, 50, (30, 3))
    grid = GroundGrid.covering(points, cell, margin)
    low = np.array([grid.x_min, grid.y_min])
    high = low + cell * np.array([grid.cols, grid.rows])
    slack = 1e-8  # the end may lie a rounding beyond the last cell, which `covering` allows on purpose
    assert np.all(low <= points[:, :2].min(axis=0) - margin + slack) and np.all(high >= points[:, :2].max(axis=0) + margin - slack)
    assert np.all(points[:, :2].min(axis=0) - margin - low < cell + slack)
    assert np.all(high - points[:, :2].max(axis=0) - margin < cell + slack)


@pytest.mark.parametrize("shift", [0, 3, -17])
def test_grids_of_one_cell_size_line_up(shift):
    points = np.array([[0.03, 0.07, 0.0], [4.2, 3.1, 0.0]])
    a, b = GroundGrid.covering(points, 0.1), GroundGrid.covering(points + shift * 0.1 + 0.02, 0.1)
    offset = (b.x_min - a.x_min) / 0.1
    assert offset == pytest.approx(round(offset), abs=1e-9)


def test_rows_run_along_y_and_columns_along_x():
    grid = GroundGrid(10.0, 20.0, 0.5, rows=3, cols=4)
    x, y = grid.centres()
    assert x.shape == grid.shape == (3, 4)
    assert x[0].tolist() == [10.25, 10.75, 11.25, 11.75]
    assert y[:, 0].tolist() == [20.25, 20.75, 21.25]


def test_the_centre_of_a_cell_is_at_its_row_and_column():
    grid = GroundGrid(-3.0, 7.0, 0.1, rows=5, cols=6)
    x, y = grid.centres()
    position = grid.position(np.column_stack([x.ravel(), y.ravel()]))
    want = np.column_stack([a.ravel() for a in np.indices(grid.shape)])
    assert np.allclose(position, want, rtol=0, atol=1e-12)


@given(st.integers(0, 2**31))
def test_sampling_a_plane_returns_the_plane(seed):
    grid = GroundGrid(-3.0, 7.0, 0.1, rows=30, cols=40)
    x, y = grid.centres()
    points = np.random.default_rng(seed).uniform((-2.9, 7.1), (0.9, 9.9), (20, 2))
    # Bilinear interpolation is exact for a plane; values of some 10 m leave rounding of 1e-15 x 10 x a few.
    assert np.allclose(grid.sample(2 * x - y + 1, points), 2 * points[:, 0] - points[:, 1] + 1, rtol=0, atol=1e-12)


def test_beyond_the_border_the_last_cell_counts():
    grid = GroundGrid(0.0, 0.0, 1.0, rows=2, cols=2)
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert grid.sample(values, np.array([[-9.0, -9.0], [9.0, 9.0]])).tolist() == [1.0, 4.0]
