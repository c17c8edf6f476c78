"""The local frame, the mirror and Snell's law."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from materials.kernels import frames


@st.composite
def unit_vectors(draw):
    z, phi = draw(st.floats(-1, 1)), draw(st.floats(0, 2 * math.pi))
    r = math.sqrt(1 - z * z)
    return (r * math.cos(phi), r * math.sin(phi), z)


@given(unit_vectors())
def test_the_basis_is_orthonormal_and_right_handed(n):
    t, b = frames.basis(n)
    matrix = np.array([t, b, n])
    assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_the_basis_is_sound_at_the_poles(z):
    t, b = frames.basis((0.0, 0.0, z))
    assert np.allclose(np.cross(t, b), (0, 0, z))


@given(unit_vectors(), unit_vectors())
def test_going_to_the_local_frame_and_back_changes_nothing(n, w):
    t, b = frames.basis(n)
    assert np.allclose(frames.to_world(frames.to_local(w, t, b, n), t, b, n), w, atol=1e-12)


@given(unit_vectors(), unit_vectors())
def test_the_mirror_keeps_the_angle_and_the_plane(w, h):
    r = frames.reflect(w, h)
    assert np.dot(r, h) == pytest.approx(np.dot(w, h), abs=1e-12)
    assert np.dot(np.cross(w, h), r) == pytest.approx(0, abs=1e-12)


@given(unit_vectors(), unit_vectors(), st.floats(0.4, 2.5))
def test_refraction_obeys_snell_and_stays_in_the_plane(w, h, eta):
    if np.dot(w, h) < 0:
        h = (-h[0], -h[1], -h[2])
    t, cos_t = frames.refract(w, h, eta)
    sin_i = np.linalg.norm(np.cross(w, h))
    if cos_t == 0:
        assert sin_i >= eta * (1 - 1e-12)
        return
    assert np.linalg.norm(t) == pytest.approx(1, abs=1e-9)
    assert np.linalg.norm(np.cross(t, h)) == pytest.approx(sin_i / eta, abs=1e-9)
    assert np.dot(t, h) == pytest.approx(-cos_t, abs=1e-9)
    assert np.dot(np.cross(w, h), t) == pytest.approx(0, abs=1e-9)


def test_a_null_vector_has_a_direction_all_the_same():
    assert frames.normalize((0.0, 0.0, 0.0)) == (0.0, 0.0, 1.0)
