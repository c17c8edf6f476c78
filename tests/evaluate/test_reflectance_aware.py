"""Angles from known geometry; columns of a heat map add up to one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluate.plots import jet, save_box_plot, save_class_bars, save_difference_histogram, save_error_map, save_heat_maps
from evaluate.reflectance_aware import angles_of_scene, heat_map, mirror_angle_deg, view_angle_deg
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.images import read_raw
from scene.transforms import look_at

UP = np.array([0.0, 0.0, 1.0])


def direction(elevation_deg: float, azimuth_deg: float = 0.0) -> np.ndarray:
    t, p = np.radians([elevation_deg, azimuth_deg])
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])


def test_the_mirrored_lamp_is_at_zero_degrees():
    assert mirror_angle_deg(UP, direction(30, 180), direction(30)) == pytest.approx(0, abs=1e-5)
    assert mirror_angle_deg(UP, direction(50, 180), direction(30)) == pytest.approx(20, abs=1e-4)
    assert view_angle_deg(UP, direction(75)) == pytest.approx(75, abs=1e-4)


def test_light_from_below_has_no_mirror_direction():
    assert np.isnan(mirror_angle_deg(UP, direction(10), direction(120)))


def test_a_pixel_below_camera_and_lamp_sees_the_mirror_straight_on():
    camera = Camera("PINHOLE", 5, 5, look_at(np.array([0, 0, 1.0]), np.zeros(3), np.array([0, 1.0, 0])), 5.0, 5.0, 2.5, 2.5)
    position = np.zeros((5, 5, 3))
    position[2, 2] = 0.0, 0.0, 0.0
    position[0, 0] = np.nan
    normal = np.broadcast_to(UP, (5, 5, 3))
    mirror, view = angles_of_scene(position, normal, camera, np.array([0, 0, 3.0]))
    assert mirror[2, 2] == pytest.approx(0, abs=1e-4) and view[2, 2] == pytest.approx(0, abs=1e-4)
    assert np.isnan(mirror[0, 0]) and np.isnan(view[0, 0])


def test_columns_are_shares_of_their_own_angle():
    angle = np.array([1, 1, 1, 7, 90, np.nan, 200])
    error = np.array([0.06, 0.061, 99, 0.0, 0.12, 0.1, 0.1])
    counted = heat_map(angle, error, [0, 5, 10, 20, 90], [0.06, 0.12])
    np.testing.assert_array_equal(counted.counts, [[1, 1, 0, 0], [1, 0, 0, 1], [1, 0, 0, 0]])
    shares = counted.normalised()
    np.testing.assert_allclose(shares[:, 0], 1 / 3)
    assert np.isnan(shares[:, 2]).all() and shares[1, 3] == 1
    np.testing.assert_array_equal((counted + counted).counts, 2 * counted.counts)


def test_unlike_heat_maps_do_not_add_and_edges_must_rise():
    one = heat_map(np.ones(3), np.ones(3), [0, 5], [1.0, 2.0])
    with pytest.raises(InputError, match="same intervals"):
        _ = one + heat_map(np.ones(3), np.ones(3), [0, 6], [1.0, 2.0])
    with pytest.raises(InputError, match="angle_edges must be two or more rising numbers"):
        heat_map(np.ones(3), np.ones(3), [5, 0])
    with pytest.raises(InputError, match="angle and error must have one shape"):
        heat_map(np.ones(3), np.ones(4), [0, 5])


def test_error_maps_run_from_blue_to_red_with_black_for_unknown():
    picture = jet(np.array([[0.0, 1.0, np.nan]]), 1.0)
    assert picture[0, 0].tolist() == [0, 0, 128] and picture[0, 1].tolist() == [128, 0, 0] and picture[0, 2].tolist() == [0, 0, 0]


def test_plots_are_pictures(tmp_path: Path):
    rng = np.random.default_rng(0)
    errors = {name: rng.exponential(scale, 2000) for name, scale in (("BTF", 0.1), ("TEX", 0.3))}
    save_box_plot(tmp_path / "box.png", errors, "boxes")
    save_difference_histogram(tmp_path / "histogram.png", errors, "histogram")
    save_class_bars(tmp_path / "classes.png", {"BTF": (0.2,) * 5, "TEX": (0, 0, 0, 0, 1.0)}, "classes")
    save_error_map(tmp_path / "map.png", errors["BTF"].reshape(40, 50), 1.0, "map")
    heat = heat_map(rng.uniform(0, 60, 2000), errors["BTF"], np.arange(0, 61, 5))
    save_heat_maps(tmp_path / "heat.png", {"BTF": heat, "TEX": heat}, "heat", "angle")
    for name in ("box", "histogram", "classes", "map", "heat"):
        picture = read_raw(tmp_path / f"{name}.png")
        assert picture.shape[0] > 100 and picture.std() > 5
