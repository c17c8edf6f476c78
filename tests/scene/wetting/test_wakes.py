"""Spray behind tyres: how much water, where, and how its light is lost."""

from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.grid import GroundGrid
from scene.kernels import wakes as kernel
from scene.wetting.spray import Spray, spray_over
from scene.wetting.spray_settings import SpraySettings
from scene.wetting.wakes import MovingVehicle, airborne_flow, droplet_diameter, lifetime, wakes_of

GRID = GroundGrid(-40.0, -40.0, 0.5, 160, 160)
LEVEL = np.zeros(GRID.shape, np.float32)
EVEN = SpraySettings(contrast=0)
SIZE = np.array([4.3, 1.8, 1.5])


def vehicle(speed: float = 25.0, yaw: float = 0.4, centre: tuple[float, float] = (3.0, -2.0)) -> MovingVehicle:
    return MovingVehicle("7", np.array(centre), speed * np.array([np.cos(yaw), np.sin(yaw)]), SIZE)


def behind(car: MovingVehicle, m: float = 0.0, settings: SpraySettings = EVEN, depth: float = 0.001) -> Spray:
    return spray_over(LEVEL, GRID, m, settings, 0, wakes_of(car, depth))


def integral(spray: Spray, step: float) -> float:
    """Return the extinction summed over the box of the wakes [m^2], by midpoints."""
    low, high = spray.box()
    axes = [
        a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, np.ceil((high - low) / step).astype(int), strict=True)
    ]
    cell = float(np.prod([a[1] - a[0] for a in axes]))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return float(spray.extinction(points).sum()) * cell


def test_the_water_in_the_air_is_what_the_tyres_throw_up_while_it_lives():
    spray = behind(vehicle(12.0))
    mass = integral(spray, 0.08) * 1000.0 * droplet_diameter(12.0) / 1.5
    # Cut off are e^-6 of the length, and what lies beyond 4 standard deviations: 6e-5 on each side of three.
    expected = 2 * airborne_flow(12.0, 0.001) * lifetime(12.0, 1.5) * (1 - np.exp(-6.0))
    assert mass == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("s", [0.5, 4.0, 15.0])
def test_a_cross_section_holds_what_is_left_at_its_distance(s):
    wakes = wakes_of(vehicle(yaw=0.0), 0.001)[:1]
    spray = Spray(LEVEL, GRID, 0.0, EVEN, 0, wakes)
    y, z = np.meshgrid(wakes[0, kernel.Y] + np.linspace(-6, 6, 601), 0.005 + 0.01 * np.arange(600), indexing="ij")
    points = np.column_stack([np.full(y.size, wakes[0, kernel.X] - s), y.ravel(), z.ravel()])
    left = wakes[0, kernel.AMOUNT] * np.exp(-s / wakes[0, kernel.FADES])
    assert spray.extinction(points).sum() * 0.02 * 0.01 == pytest.approx(left, rel=5e-4)


def test_drops_get_finer_and_live_longer_with_speed_and_light_loses_with_its_third_power():
    assert droplet_diameter(24.0) == pytest.approx(0.5 * droplet_diameter(12.0))
    assert lifetime(24.0, 1.5) == pytest.approx(2 * lifetime(12.0, 1.5))
    total = [float((w[:, kernel.AMOUNT] * w[:, kernel.FADES]).sum()) for w in (wakes_of(vehicle(v), 0.001) for v in (12.0, 24.0))]
    assert total[1] == pytest.approx(8 * total[0])


def test_the_water_in_the_air_of_a_fast_car_is_of_the_order_that_the_assessment_tool_predicts():
    car = vehicle(yaw=0.0)
    tail = car.centre[0] - 0.5 * SIZE[0]
    water = behind(car).extinction([[tail - 2.0, -2.0, 0.3]])[0] * 1000.0 * droplet_diameter(25.0) / 1.5
    assert 0.003 < water < 0.03  # [kg/m^3]


def test_spray_thins_behind_above_and_beside_a_tyre_and_none_is_before_it():
    car = vehicle(yaw=0.0)
    x, y = wakes_of(car, 0.001)[0, :2]
    spray = behind(car)
    line = spray.extinction([[x - s, y, 0.1] for s in (0.5, 2.0, 8.0, 20.0)])
    assert np.all(np.diff(line) < 0) and line[-1] > 0
    column = spray.extinction([[x - 2.0, y, z] for z in (0.0, 0.5, 1.0, 2.0)])
    assert np.all(np.diff(column) < 0)
    assert np.all(spray.extinction([[x + 0.05, y, 0.1], [x + 3.0, y, 0.1]]) == 0)


def test_what_stands_or_runs_on_no_water_throws_up_nothing():
    assert (
        len(wakes_of(vehicle(speed=0.0), 0.001)) == len(wakes_of(vehicle(speed=1.9), 0.001)) == len(wakes_of(vehicle(), 0.0)) == 0
    )
    assert len(wakes_of(vehicle(), 0.001, amount=0.0)) == 0
    p = np.random.default_rng(0).uniform((-20, -20, 0), (20, 20, 3), (500, 3))
    misty = spray_over(LEVEL, GRID, 1.0)
    np.testing.assert_array_equal(behind(vehicle(speed=0.0), 1.0, SpraySettings()).extinction(p), misty.extinction(p))
    with pytest.raises(InputError, match="depth must lie in"):
        wakes_of(vehicle(), -0.001)


def test_a_wake_moves_with_its_vehicle_and_the_noise_stays_in_the_world():
    step = np.array([2.5, 0.0, 0.0])
    p = np.random.default_rng(1).uniform((-12, -6, 0), (0, 2, 1), (2000, 3))
    here, there = vehicle(yaw=0.0), vehicle(yaw=0.0, centre=(5.5, -2.0))
    even = behind(here).extinction(p)
    np.testing.assert_allclose(behind(there).extinction(p + step), even, rtol=1e-9, atol=1e-15)
    uneven = [behind(car, settings=SpraySettings()).extinction(p) for car in (here, there)]
    seen = (even > 1e-6) & (behind(there).extinction(p) > 1e-6)
    noise = [u[seen] / behind(car).extinction(p)[seen] for u, car in zip(uneven, (here, there), strict=True)]
    np.testing.assert_allclose(noise[0], noise[1], rtol=1e-9)
    assert noise[0].std() > 0.2


@pytest.mark.parametrize("m", [0.0, 1.0])
def test_no_point_of_a_cell_exceeds_the_bound_of_the_cell_in_a_wake(m):
    x, y = GRID.centres()
    hilly = (0.05 * x + 0.2 * np.sin(y)).astype(np.float32)
    wakes = np.concatenate([wakes_of(vehicle(yaw=yaw), 0.001) for yaw in (0.4, 2.0)])
    spray = Spray(hilly, GRID, m, SpraySettings(contrast=1.0, margin=20), 0, wakes)
    low, high = spray.box()
    bounds = spray.upper_bounds()
    rng = np.random.default_rng(2)
    # Half of the points close behind the tyres, where the density is steep.
    near = wakes[rng.integers(len(wakes), size=100_000)]
    s = rng.exponential(1.0, 100_000)[:, None]
    at = near[:, :2] + s * near[:, 2:4] + rng.normal(0, 0.3, (100_000, 2))
    at = np.column_stack([at, spray.grid.sample(hilly, at) + rng.exponential(0.3, 100_000)])
    p = np.concatenate([rng.uniform(low, high, (100_000, 3)), at[np.all((at > low) & (at < high), axis=1)]])
    cell = ((p - low) / (high - low) * bounds.shape[::-1]).astype(int)
    assert np.all(spray.extinction(p) <= bounds[cell[:, 2], cell[:, 1], cell[:, 0]])
