"""Drops on the windshield: where they are, that they keep their water, and the surface they have."""

from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.wetting.metaballs import drop_mesh
from scene.wetting.windshield import Drops, Windshield, glass_before, merged, run_down
from scene.wetting.windshield_settings import WindshieldSettings

VIEW = Camera("PINHOLE", 640, 240, np.eye(4), 500.0, 500.0, 320.0, 120.0)
SETTINGS = WindshieldSettings(density=3000.0, arrivals=300.0, radius_mm=1.2, sticks_mm=3.0)


def drops(*rows: tuple[float, float, float]) -> Drops:
    """Return drops from rows of (u, v, radius) in millimetres."""
    values = 1e-3 * np.array(rows)
    return Drops(values[:, :2], values[:, 2])


def test_the_glass_stands_20_cm_ahead_with_its_top_towards_the_camera_and_fills_the_picture():
    glass = glass_before(VIEW, SETTINGS)
    T = glass.T_camera_glass
    np.testing.assert_allclose(T[:3, 3], (0, 0, 0.2))
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-12)
    upper, lower = (T @ (0, v, 0, 1) for v in (-0.1, 0.1))
    assert upper[1] < 0 < lower[1] and upper[2] < 0.2 < lower[2]
    assert T[2, 2] > 0  # outwards is away from the camera
    # Every pixel looks through it: its corners, projected, lie outside of the picture.
    corners = np.array([[u, v, 0, 1] for u in (glass.low[0], glass.high[0]) for v in (glass.low[1], glass.high[1])])
    xy, _ = VIEW.project((T @ corners.T).T[:, :3])
    assert xy[:, 0].min() < 0 and xy[:, 0].max() > 640 and xy[:, 1].min() < 0 and xy[:, 1].max() > 240


def test_drops_that_touch_merge_without_loss_of_water_and_others_do_not():
    four = drops((0, 0, 1), (1.5, 0, 1), (3.0, 0, 1), (9, 0, 2))
    fewer = merged(four, 0.9)
    assert len(fewer.radii) == 2
    assert np.sum(fewer.radii**3) == pytest.approx(np.sum(four.radii**3))
    np.testing.assert_allclose(sorted(fewer.centres[:, 0]), [1.5e-3, 9e-3], atol=1e-12)


def test_small_drops_stick_and_large_ones_run_down_and_drink_what_they_meet():
    before = drops((0, 0, 5), (0, 10, 1), (20, 0, 1), (30, 0, 2.9))
    after = run_down(before, SETTINGS, 1.0, np.random.default_rng(0))
    assert np.sum(after.radii**3) == pytest.approx(np.sum(before.radii**3))
    for stuck in ((20e-3, 0, 1e-3), (30e-3, 0, 2.9e-3)):
        found = np.abs(np.column_stack([after.centres, after.radii]) - stuck).max(axis=1)
        assert found.min() == 0
    largest = np.argmax(after.radii)
    assert after.centres[largest, 1] > 0.02 and after.radii[largest] > 4e-3
    # The drop in its way is gone, and behind it lies a trail of small ones.
    assert not np.any(np.linalg.norm(after.centres - (0, 10e-3), axis=1) < 1e-5)
    assert np.sum(after.radii < 1.5e-3) >= 3


def test_drops_stay_on_the_glass_from_frame_to_frame_and_more_come():
    shield = Windshield(glass_before(VIEW, SETTINGS), 0.3, SETTINGS, seed=2)
    first, later = shield.at(0), shield.at(3)
    again = Windshield(glass_before(VIEW, SETTINGS), 0.3, SETTINGS, seed=2).at(3)
    np.testing.assert_array_equal(later.centres, again.centres)
    np.testing.assert_array_equal(shield.at(0).centres, first.centres)
    kept = {tuple(c) for c in first.centres} & {tuple(c) for c in later.centres}
    assert len(kept) > 0.8 * len(first.radii) and np.sum(later.radii**3) > np.sum(first.radii**3)
    # As many as was asked for, less those that merged: Poisson, 5 sigma.
    expected = 0.3 * SETTINGS.density * shield.glass.area
    assert 0.6 * expected - 5 * np.sqrt(expected) < len(first.radii) < expected + 5 * np.sqrt(expected)
    assert len(Windshield(shield.glass, 0.0).at(5).radii) == 0


@pytest.mark.parametrize("angle", [40.0, 60.0, 90.0])
def test_a_lone_drop_is_a_spherical_cap_of_the_contact_angle(angle):
    a = 2e-3
    mesh = drop_mesh(drops((1, 2, 2)), angle, 5e-5)
    p = mesh.vertices.astype(float) - (1e-3, 2e-3, 0)
    top = p[:, 2] > 1e-6
    rho, depth = a / np.sin(np.radians(angle)), a / np.tan(np.radians(angle))
    # Marching cubes are linear in cells of h: the surface is found to about h^2 / rho.
    np.testing.assert_allclose(np.linalg.norm(p[top] + (0, 0, depth), axis=1), rho, rtol=2e-3)
    assert p[:, 2].min() == 0 and p[:, 2].max() == pytest.approx(rho - depth, rel=5e-3)
    n = mesh.normals[top]
    np.testing.assert_allclose(n, (p[top] + (0, 0, depth)) / rho, atol=5e-3)
    # Closed and outwards: its volume by Gauss is that of the cap.
    c = mesh.vertices.astype(float)[mesh.faces]
    volume = np.einsum("fc,fc->f", c[:, 0], np.cross(c[:, 1], c[:, 2])).sum() / 6
    h = rho - depth
    assert volume == pytest.approx(np.pi * h * (3 * a * a + h * h) / 6, rel=0.01)


def test_near_drops_blend_into_one_surface_and_far_ones_do_not():
    near = drop_mesh(drops((0, 0, 2), (4.2, 0, 2)), 60.0, 1e-4)
    far = drop_mesh(drops((0, 0, 2), (12, 0, 2)), 60.0, 1e-4)
    between = np.abs(near.vertices[:, 0] - 2.1e-3) < 2e-4
    assert between.any() and near.vertices[between, 2].max() > 5e-5
    assert not np.any(np.abs(far.vertices[:, 0] - 6e-3) < 2e-3)


def test_no_drops_make_an_empty_mesh():
    assert drop_mesh(Drops(np.zeros((0, 2)), np.zeros(0)), 60.0, 1e-4).num_faces == 0


def test_glass_that_cannot_be_looked_through_is_refused():
    low = Camera("PINHOLE", 64, 64, np.eye(4), 20.0, 20.0, 32.0, 32.0)
    with pytest.raises(InputError, match=r"the picture must meet the glass, got a ray 1\.60 below the axis"):
        glass_before(low, SETTINGS)
    flat = Camera("ORTHOGRAPHIC", 64, 64, np.eye(4), pixel_size=0.1)
    with pytest.raises(InputError, match="camera must be a PINHOLE"):
        glass_before(flat, SETTINGS)
    with pytest.raises(InputError, match=r"amount must lie in \[0, 1\], got 2"):
        Windshield(glass_before(VIEW, SETTINGS), 2.0)
