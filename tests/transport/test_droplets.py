"""Drops on the windshield: refraction against Snell, pixels they must leave alone, and the world they show upside down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from scene.mesh import Mesh
from scene.wetting.windshield import Drops, glass_before
from scene.wetting.windshield_settings import WindshieldSettings
from tests.transport import plain_street as street
from tests.transport.test_mist import LINEAR, VIEW, even_street, wetted
from transport.droplets import DropletFrame, compile_drops, droplet_frame
from transport.kernels.droplets import lens_ray, refracted
from transport.kernels.rays import ray_buffer

# The view has few pixels: a drop of 5 cm is what 34 of them see.
SETTINGS = WindshieldSettings(resolution_mm=0.5)
SHARP = WindshieldSettings(resolution_mm=0.5, aperture_radius=0.0)
ONE = Drops(np.array([[0.0, 0.0]]), np.array([25e-3]))


def past(scene, drops: Drops, settings: WindshieldSettings = SETTINGS, samples: int = 64) -> tuple[np.ndarray, DropletFrame]:
    frame, separation, wet, water = wetted(scene, 0.0, samples=4)
    glass = glass_before(frame.camera, settings)
    seen = droplet_frame(frame, separation, wet.image, wet.raw, water, None, glass, drops, settings, samples, 0, 2)
    return frame.raw, seen


@njit
def _trace(drops, o, d, out):
    buffer, s = ray_buffer()
    for i in range(len(out)):
        met, p, w, weight = refracted(drops, buffer, s, np.uint32(i), (o[0], o[1], o[2]), (d[0], d[1], d[2]))
        out[i, 0], out[i, 1], out[i, 2] = met, weight, p[2]
        out[i, 3], out[i, 4], out[i, 5] = w


@njit
def _lens(drops, d, u0, u1):
    return lens_ray(drops, (d[0], d[1], d[2]), u0, u1)


def prism(apex: float) -> Mesh:
    """Return a wedge of water on the glass, thickest at the right, whose outer face is turned by `apex` about v."""
    w, h = 0.02, 0.02
    t = 2 * w * math.tan(apex)
    p = [(-w, -h, 0), (w, -h, 0), (w, h, 0), (-w, h, 0), (w, -h, t), (w, h, t)]
    faces = [(0, 3, 2), (0, 2, 1), (0, 4, 5), (0, 5, 3), (1, 2, 5), (1, 5, 4), (0, 1, 4), (3, 5, 2)]
    vertices = np.array(p, np.float32)
    mesh = Mesh(vertices, np.array(faces, np.uint32))
    out = (-math.sin(apex), 0.0, math.cos(apex))
    return Mesh(mesh.vertices, mesh.faces, np.tile(np.array(out, np.float32), (6, 1)))


def test_a_wedge_of_water_bends_light_by_snells_law_and_lets_fresnels_share_through():
    settings = WindshieldSettings(inclination_deg=90.0)
    apex = math.radians(20)
    glass = glass_before(VIEW, settings)
    tree, arrays = compile_drops(prism(apex), glass, np.eye(4), settings)
    out = np.zeros((4000, 6))
    _trace(arrays, np.zeros(3), np.array([0.0, 0.0, 1.0]), out)
    assert tree.handle
    # Upright through the glass, then at 20 degrees against the outer face, whose thick end is to the right.
    leaves = math.asin(1.33 * math.sin(apex))
    expected = np.array([math.sin(leaves - apex), 0.0, math.cos(leaves - apex)])
    through = np.isclose(out[:, 3:6], expected, atol=1e-5).all(axis=1)
    cos_i, cos_t = math.cos(apex), math.cos(leaves)
    r_s = (1.33 * cos_i - cos_t) / (1.33 * cos_i + cos_t)
    r_p = (cos_i - 1.33 * cos_t) / (cos_i + 1.33 * cos_t)
    share = 1 - 0.5 * (r_s**2 + r_p**2)
    assert abs(through.mean() - share) < 4 * math.sqrt(share * (1 - share) / len(out))
    assert np.all(out[through, 0] == 2) and np.all(out[through, 1] == 1)


def test_rays_of_the_lens_meet_in_the_plane_of_focus_and_start_on_the_aperture():
    _, arrays = compile_drops(prism(0.1), glass_before(VIEW, SETTINGS), np.eye(4), SETTINGS)
    d = np.array([0.2, -0.1, 1.0])
    d /= np.linalg.norm(d)
    rng = np.random.default_rng(0)
    for u0, u1 in rng.random((20, 2)):
        o, w = (np.array(x) for x in _lens(arrays, d, u0, u1))
        assert o[2] == 0 and np.linalg.norm(o) <= 0.003
        np.testing.assert_allclose(o + w * (100 - o[2]) / w[2], d * 100 / d[2], rtol=1e-9)


def test_pixels_without_a_drop_come_back_to_the_bit_and_the_label_says_which(tmp_path):
    raw, seen = past(street.plain_street(tmp_path, [VIEW]), ONE)
    clear = seen.covered == 0
    assert 0.05 < np.mean(~clear) < 0.5 and seen.covered.max() > 0.5
    np.testing.assert_array_equal(seen.raw[clear], raw[clear])
    assert np.mean(np.any(seen.raw != raw, axis=-1)[~clear]) > 0.5
    none_raw, none = past(street.plain_street(tmp_path, [VIEW]), Drops(np.zeros((0, 2)), np.zeros(0)))
    np.testing.assert_array_equal(none.raw, none_raw)


def test_a_drop_is_as_large_in_the_picture_as_its_width_at_20_cm_says(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW])
    _, sharp = past(scene, ONE, SHARP)
    # Within a row the drop is a chord at one distance; the widest is that of the glass's own axis or of what bulges nearer it.
    width = 0.05 / 0.2 * VIEW.fx
    assert sharp.covered.sum(axis=1).max() == pytest.approx(width, rel=0.06)
    # A lens of 6 mm widens it by as much, at its own distance.
    _, blurred = past(scene, ONE)
    widened = np.sum(blurred.covered > 0, axis=1).max() - np.sum(sharp.covered > 0, axis=1).max()
    assert widened == pytest.approx(0.006 / 0.2 * VIEW.fx, abs=2.0)


def test_drops_in_a_world_of_one_colour_only_lose_what_they_send_back(tmp_path, monkeypatch):
    _, seen = past(even_street(tmp_path, monkeypatch), ONE, samples=256)
    covered = seen.covered > 0.9
    assert covered.any()
    passed = seen.light[covered] / seen.covered[covered][:, None] / 0.4
    # Straight through it is some 2 %; near the rim total reflection sends more back into the car.
    assert np.all(passed <= 1 + 1e-5) and passed.max() > 0.9


def test_a_drop_shows_the_sky_below_and_the_road_above(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW], LINEAR)
    _, seen = past(scene, ONE, SHARP, samples=256)
    rows = np.flatnonzero(seen.covered[:, 40] > 0.99)
    light = seen.light[rows, 40]
    blue = light[:, 2] - light[:, 0]
    # The plain sky is bluer than anything else; the picture has it in its uppermost rows only.
    assert blue[len(rows) // 2 :].max() > 0.1 > blue[: len(rows) // 4].max()
