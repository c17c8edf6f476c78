"""Mist before a projected picture: what it lets through, what it adds, and what it must leave alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from materials.from_image import ImageRelief
from scene.scene_file import Scene
from scene.wetting.spray import Spray, spray_over
from scene.wetting.spray_settings import SpraySettings
from tests.transport import plain_street as street
from transport.media import compile_spray
from transport.mist import MistyFrame, misty_frame
from transport.projected_world import ProjectedFrame, project_frame
from transport.separate import Separation, separate, water_normals
from transport.wet import WetFrame, wet_frame

VIEW = street.camera(width=80, height=34)
LINEAR = street.Encoding(".exr", "float32", 3, "linear")
THICK = SpraySettings(view_distance=10.0)


def wetted(scene: Scene, level: float, samples: int = 16) -> tuple[ProjectedFrame, Separation, WetFrame, np.ndarray]:
    frame = project_frame(scene, 0)
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
    separation = separate(frame, scene.grid, normals, ImageRelief(bump_height=0.0), 1.63, 0.6, "lagarde", 0.95, samples, 0, 2)
    water = np.full(scene.grid.shape, level, np.float32)
    return frame, separation, wet_frame(frame, separation, water, 0, 2), water


def misty(scene: Scene, spray: Spray, level: float = 0.0, samples: int = 16, seed: int = 0) -> tuple[WetFrame, MistyFrame]:
    frame, separation, wet, water = wetted(scene, level)
    return wet, misty_frame(frame, separation, wet, water, compile_spray(spray), samples, seed, 2)


def over(scene: Scene, m: float, settings: SpraySettings) -> Spray:
    return spray_over(scene.maps["height"], scene.grid, m, settings)


def test_smoothing_along_surfaces_comes_nearer_to_many_samples(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW], LINEAR)
    frame, separation, wet, water = wetted(scene, 0.8)
    mist = compile_spray(over(scene, 1.0, THICK))
    # The noise of 256 samples adds to both errors, to the smaller one by more: the factor is met less easily.
    many = misty_frame(frame, separation, wet, water, mist, 256, 1, 2).scattered
    rough, smooth = (misty_frame(frame, separation, wet, water, mist, 16, 0, 2, width).scattered for width in (0.0, 2.0))
    error = [np.sqrt(np.mean((x - many) ** 2)) for x in (rough, smooth)]
    assert error[1] < 0.6 * error[0]


def test_without_mist_the_wet_picture_comes_back_to_the_bit(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW])
    wet, mist = misty(scene, over(scene, 0.0, THICK), level=0.8)
    np.testing.assert_array_equal(mist.image, wet.image)
    np.testing.assert_array_equal(mist.raw, wet.raw)


def even_street(folder, monkeypatch) -> Scene:
    """Return the plain street in which everything, the unseen too, has the radiance 0.4."""
    monkeypatch.setattr(street, "photograph", lambda view: np.full((view.height, view.width, 3), 0.4, np.float32))
    scene = street.plain_street(folder, [VIEW], LINEAR)
    panorama = scene.sky.panorama.copy()
    panorama[..., :3] = 0.4
    means = {name: np.full(3, 0.4, np.float32) for name in scene.class_means}
    return replace(scene, sky=replace(scene.sky, panorama=panorama), class_means=means)


def test_mist_that_absorbs_nothing_cannot_be_seen_in_a_street_of_one_colour(tmp_path, monkeypatch):
    scene = even_street(tmp_path, monkeypatch)
    wet, mist = misty(scene, over(scene, 1.0, THICK), level=0.0, samples=32)
    np.testing.assert_allclose(wet.image, 0.4, rtol=1e-6)
    assert mist.transmittance.min() < 0.35
    # The guess of what is scattered is right here, so all noise is that of paths that leave the world's mist.
    np.testing.assert_allclose(mist.image, 0.4, rtol=1e-5)


def test_drops_that_absorb_all_leave_the_share_that_beer_and_lambert_let_through(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW], LINEAR)
    spray = over(scene, 1.0, replace(THICK, contrast=0.0, albedo=0.0))
    _, mist = misty(scene, spray, samples=64)
    # Upright centre of the picture, on the wall: z from 1.6 m down to where the wall is met, by quadrature.
    origin, d = VIEW.rays(np.array([[40.5, 14.5]]))
    far = (street.WALL_Y - origin[0, 1]) / d[0, 1]
    z = 1.6 + (np.arange(20_000) + 0.5) / 20_000 * far * d[0, 2]
    exact = np.exp(-0.1 * np.mean(np.exp(-z)) * far)
    assert mist.transmittance[14, 40] == pytest.approx(exact, rel=3e-3)  # over the pixel: its rows see 9 cm of the wall each
    sky = mist.transmittance[0]
    assert np.all(sky > mist.transmittance[14, 40])
    np.testing.assert_allclose(mist.scattered.mean(), 0.0, atol=2e-3)


def test_the_transmittance_through_noise_has_the_mean_of_the_line_integral(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW], LINEAR)
    spray = over(scene, 1.0, replace(THICK, contrast=0.6))
    _, mist = misty(scene, spray, samples=256)
    origin, d = VIEW.rays(VIEW.pixel_centres())
    is_wall = np.zeros((34, 80), bool)
    is_wall[8:16] = True
    wall = is_wall.ravel()
    far = (street.WALL_Y - origin[wall, 1]) / d[wall, 1]
    t = (np.arange(2_000) + 0.5) / 2_000
    exact = np.array(
        [np.exp(-spray.extinction(o + (t * f)[:, None] * v).mean() * f) for o, v, f in zip(origin[wall], d[wall], far)]
    )
    ratio = mist.transmittance.ravel()[wall] / exact
    # Pixels are 8 cm wide there, narrower than the noise's smallest cell; the mean ratio over 640 pixels is 1.
    assert abs(ratio.mean() - 1) < norm.isf(0.005) * ratio.std() / np.sqrt(ratio.size) + 2e-3
    assert ratio.std() < 0.03


def test_the_guess_of_what_is_scattered_changes_the_noise_and_not_the_picture(tmp_path, monkeypatch):
    scene = street.plain_street(tmp_path, [VIEW], LINEAR)
    spray = over(scene, 1.0, THICK)
    _, guessed = misty(scene, spray, level=0.8, samples=128)
    monkeypatch.setattr("transport.mist.gaussian_filter", lambda image, *_, **__: np.zeros_like(image))
    _, blind = misty(scene, spray, level=0.8, samples=128, seed=1)
    z = (guessed.scattered - blind.scattered) / np.sqrt(guessed.variance + blind.variance + 1e-12)
    assert abs(z.mean()) < norm.isf(0.005) / np.sqrt(z.size / 3) + 0.01
    assert guessed.variance.mean() < 0.5 * blind.variance.mean()
