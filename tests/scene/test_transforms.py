from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from materials.foundation.errors import InputError
from scene.transforms import as_pose, invert, look_at, transform_points, transform_vectors

# Lengths of a drive: up to 1 km, so that float64 keeps 1e-12 relative.
numbers = st.floats(-1000, 1000, allow_nan=False)


@st.composite
def poses(draw):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", draw(st.tuples(*[st.floats(-3, 3)] * 3))).as_matrix()
    T[:3, 3] = draw(st.tuples(numbers, numbers, numbers))
    return T


@given(poses())
def test_a_pose_and_its_inverse_cancel(T_a_b):
    # Rounding: each entry sums products up to 1000 x 1 a handful of times, 1e3 x 2e-16 x 10.
    assert np.allclose(T_a_b @ invert(T_a_b), np.eye(4), rtol=0, atol=2e-12)


@given(poses(), poses(), st.tuples(numbers, numbers, numbers))
def test_moving_twice_is_moving_by_the_product(T_a_b, T_b_c, point):
    p = np.array([point])
    once = transform_points(T_a_b @ T_b_c, p)
    assert np.allclose(once, transform_points(T_a_b, transform_points(T_b_c, p)), rtol=0, atol=2e-11)


@given(poses())
def test_vectors_turn_but_do_not_move(T):
    v = np.array([[0.0, 0.0, 1.0]])
    assert np.allclose(transform_vectors(T, v), T[:3, 2], atol=1e-15)


@given(poses(), st.integers(0, 10_000))
def test_rounded_poses_become_exact_rotations(T, seed):
    noise = np.random.default_rng(seed).uniform(-1e-6, 1e-6, (3, 3))
    rounded = T.copy()
    rounded[:3, :3] += noise
    out = as_pose(rounded)
    assert np.allclose(out[:3, :3] @ out[:3, :3].T, np.eye(3), rtol=0, atol=1e-14)
    assert np.abs(out - T).max() < 3e-6  # the nearest rotation is no farther from T than twice the noise's norm
    assert np.array_equal(rounded[:3, :3], T[:3, :3] + noise)  # the argument is left alone


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.eye(3), r"T must be a 4 x 4 matrix, got shape \(3, 3\)"),
        ([[1, 0], [0]], "T must be a 4 x 4 matrix of numbers"),
        (np.full((4, 4), np.nan), "T must be finite, got NaN or infinity"),
        (np.diag([1, 1, 1, 2.0]), r"T must have the last row 0 0 0 1"),
        (np.diag([2, 2, 2, 1.0]), "T must be a rigid pose .* got determinant 8.* Remove scale, shear or mirroring"),
        (np.diag([1, 1, -1, 1.0]), "T must be a rigid pose .* got determinant -1"),
    ],
)
def test_what_is_no_rigid_pose_is_refused(matrix, words):
    with pytest.raises(InputError, match=words):
        as_pose(matrix, "T")


def test_a_camera_looks_at_its_target_with_the_sky_above():
    T = look_at((1, 2, 3), (5, 2, 3))
    assert np.allclose(T[:3, 2], (1, 0, 0))
    assert np.allclose(T[:3, 1], (0, 0, -1))  # y points down
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize(("target", "words"), [((0, 0, 0), "target must differ from eye"), ((0, 0, 5), "up must not be parallel")])
def test_a_view_without_direction_or_without_right_and_left_is_refused(target, words):
    with pytest.raises(InputError, match=words):
        look_at((0, 0, 0), target)
