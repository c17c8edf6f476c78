"""The air of a frame: wheel spray in the augmentation, where there is none, and how it is seen."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from scene.images import read_exr
from scene.scene_file import Cardboard, Scene, write_scene
from scene.wetting.wakes import MovingVehicle, wakes_of
from tests.transport import plain_street as street
from tests.transport.test_mist import THICK, VIEW, over, wetted
from transport.air import air_over
from transport.augment import folder_name
from transport.augment_settings import AugmentSettings
from transport.cli import main
from transport.media import compile_spray
from transport.mist import misty_frame


def scene_with_a_car(folder) -> Scene:
    """Return the plain street with a car that drives away at 20 m/s in both frames."""
    boards, masks = [], []
    for y in (3.0, 5.0):
        corners = np.array([(-0.9, y, 0), (0.9, y, 0), (0.9, y, 1.5), (-0.9, y, 1.5)], float)
        boards.append((Cardboard(1, "vehicle", corners),))
        xy = VIEW.project(corners)[0]
        (x0, y0), (x1, y1) = np.floor(xy.min(axis=0)).astype(int), np.ceil(xy.max(axis=0)).astype(int)
        mask = np.zeros((VIEW.height, VIEW.width), np.uint8)
        mask[y0:y1, x0:x1] = 1
        masks.append(mask)
    return street.plain_street(folder, [VIEW, VIEW], street.PNG, masks, tuple(boards))


def test_spray_needs_water_that_stands_on_the_street(tmp_path):
    scene = scene_with_a_car(tmp_path)
    air = air_over(scene, AugmentSettings(wheel_spray=1.0))
    car = air.vehicles[0][0]
    assert car.speed == pytest.approx(20.0)
    for level, depth in ((0.0, 0.0), (0.5, 0.0), (0.75, 0.0005), (1.0, 0.001)):
        water = np.full(scene.grid.shape, level, np.float32)
        assert air.depth_behind(car, water) == pytest.approx(depth)
        medium = air.at(0, water)
        assert medium is not None and len(medium.wakes) == (2 if depth else 0)
    assert air_over(scene, AugmentSettings()).at(0, np.ones(scene.grid.shape, np.float32)) is None


def test_water_is_asked_for_in_the_tracks_that_the_tyres_have_left(tmp_path):
    scene = scene_with_a_car(tmp_path)
    air = air_over(scene, AugmentSettings(wheel_spray=1.0))
    car = air.vehicles[0][0]
    x, y = scene.grid.centres()
    right = ((np.abs(x - car.centre[0] - 0.8) < 0.4) & (y < car.centre[1])).astype(np.float32)
    assert air.depth_behind(car, right) == pytest.approx(0.0005, rel=0.02)  # one of two tracks
    assert air.depth_behind(car, (y > car.centre[1]).astype(np.float32)) == 0.0  # what lies ahead


def test_the_picture_on_a_dry_street_stays_to_the_bit_and_a_wet_one_gets_spray(tmp_path):
    scene = scene_with_a_car(tmp_path)
    write_scene(tmp_path, street.with_maps(scene, puddles=np.ones(scene.grid.shape)))
    common = [str(tmp_path), "--samples", "16", "--frames", "0", "--quiet", "--bounces", "1"]
    for w in ("0", "1"):
        assert main([*common, "-w", w, "-o", str(tmp_path / "clear")]) == 0
        assert main([*common, "-w", w, "-o", str(tmp_path / "spray"), "--wheel-spray", "5"]) == 0
    clear, spray = (
        [read_exr(tmp_path / name / f"w{w}.00{more}" / "layers" / "0000.exr") for w in (0, 1)]
        for name, more in (("clear", ""), ("spray", "_s5.00"))
    )
    for c in "RGB":
        np.testing.assert_array_equal(clear[0][c], spray[0][c])
    assert np.all(spray[0]["mist.transmittance"] == 1)
    assert spray[1]["mist.transmittance"].min() < 0.9
    assert (tmp_path / "spray" / "w1.00_s5.00" / "label" / "transmittance" / "0000.png").exists()
    report = json.loads((tmp_path / "spray" / "w1.00_s5.00" / "augment.json").read_text())
    assert report["wheel_spray"] == 5
    assert report["frames"][0]["wheel_spray"][0]["speed"] == pytest.approx(20.0)


def test_folders_name_the_amount_of_spray():
    assert folder_name(1.0, AugmentSettings(mist=0.5, wheel_spray=1.0, droplets=0.2)) == "w1.00_m0.50_s1.00_d0.20"


def test_the_transmittance_of_pixels_through_a_wake_is_the_line_integral(tmp_path):
    scene = street.plain_street(tmp_path, [VIEW], street.Encoding(".exr", "float32", 3, "linear"))
    car = MovingVehicle("1", np.array([1.0, 10.0]), np.array([3.0, 25.0]), np.array([4.3, 1.8, 1.5]))
    mist_alone = over(scene, 0.5, THICK)
    spray = replace(mist_alone, wakes=wakes_of(car, 0.001, 8.0))
    frame, separation, wet, water = wetted(scene, 0.0, samples=4)
    mist = misty_frame(frame, separation, wet, water, compile_spray(spray), 64, 0, 1)
    wall = np.zeros((VIEW.height, VIEW.width), bool)
    wall[10:16, 25:55] = True
    origin, d = VIEW.rays(VIEW.pixel_centres())
    origin, d = origin[wall.ravel()], d[wall.ravel()]
    far = (street.WALL_Y - origin[:, 1]) / d[:, 1]
    t = (np.arange(1_000) + 0.5) / 1_000
    exact, bare = (
        np.array([np.exp(-s.extinction(o + (t * f)[:, None] * v).mean() * f) for o, v, f in zip(origin, d, far, strict=True)])
        for s in (spray, mist_alone)
    )
    assert (exact / bare).min() < 0.5
    ratio = mist.transmittance[wall] / exact
    # Pixels are 8 cm wide at the wall, narrower than the noise's smallest cell; the mean over 180 of them is 1.
    assert abs(ratio.mean() - 1) < norm.isf(0.005) * ratio.std() / np.sqrt(ratio.size) + 2e-3
    assert ratio.std() < 0.05
