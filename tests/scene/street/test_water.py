"""Water lies level in hollows of the true ground, runs to the gutters, and grows with the shower."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from scene.kernels import runoff
from scene.street import Street
from scene.street import layout as at
from scene.street.water import ABSTRACTION, SHOWER


def test_a_flooded_bowl_is_filled_to_its_lowest_rim():
    y, x = np.mgrid[-10:11, -10:11].astype(float)
    # A slight tilt, so that no two cells are equally high.
    z = np.where(np.hypot(x, y) < 8, 0.01 * (x**2 + y**2), 0.7) + 1e-4 * x + 1.7e-5 * y
    z[10, 18:] = 0.3
    outlet = np.zeros(z.shape, bool)
    outlet[[0, -1]] = outlet[:, [0, -1]] = True
    filled, _, hollow, order, count = runoff.priority_flood(z, outlet)
    inside = np.hypot(x, y) < 5
    # The only way out is the notch at 0.3, beyond the rim cell of 0.49 on the way to it.
    rim = z[10, 10:18].max()
    np.testing.assert_allclose(filled[inside], rim)
    assert count == 1 and (hollow[inside] == 1).all()
    assert len(order) == z.size


def test_a_flooded_field_never_lies_below_the_ground_and_always_drains():
    z = np.random.default_rng(0).random((40, 50))
    outlet = np.zeros(z.shape, bool)
    outlet[0] = True
    filled, parent, _, order, _ = runoff.priority_flood(z, outlet)
    assert (filled >= z).all()
    assert (filled.ravel()[parent] <= filled.ravel()).all()
    area = runoff.catchment(parent, order)
    roots = parent == np.arange(z.size)
    assert area[roots].sum() == z.size


def test_a_hollow_holds_the_volume_that_the_formula_gives_it():
    # A box one cell deep: capacity S = 1 m x 100 cells; its volume after a shower is S (1 - exp(-V / S)).
    z = np.ones((14, 14))
    z[2:12, 2:12] = 0.0
    # A grain of noise, so that no two cells are equally high; it moves volumes and levels by as little.
    z += 1e-7 * np.random.default_rng(0).random(z.shape)
    outlet = np.zeros(z.shape, bool)
    outlet[[0, -1]] = outlet[:, [0, -1]] = True
    filled, parent, hollow, order, count = runoff.priority_flood(z, outlet)
    area = runoff.catchment(parent, order)
    level = runoff.hollow_levels(z, filled, hollow, area, count, 0.5, 1.0)
    arriving = area.reshape(z.shape)[hollow > 0].max() * 0.5
    expected = 1 - np.exp(-arriving / 100)
    assert count == 1
    np.testing.assert_allclose(level[1], expected, atol=1e-6)


def test_no_rain_leaves_no_water(small_street: Street):
    water = small_street.water(0.0)
    assert water.standing.max() == 0 and water.sheet.max() == 0 and water.saturation == 0


def test_rain_that_pores_can_hold_makes_no_puddle(small_street: Street):
    assert small_street.water(0.99 * ABSTRACTION / SHOWER).standing.max() == 0


def test_water_grows_with_the_shower_everywhere(small_street: Street):
    waters = [small_street.water(w) for w in (0.25, 0.5, 0.75, 1.0)]
    for less, more in itertools.pairwise(waters):
        assert (more.standing >= less.standing - 1e-9).all()
        assert (more.sheet >= less.sheet).all()
        assert more.standing.sum() > less.standing.sum()


def test_standing_water_is_level_and_no_deeper_than_its_hollow(small_street: Street):
    water, hydrology = small_street.water(1.0), small_street._hydrology[0]
    stands = water.standing > 0
    assert 0.01 < stands.mean() < 0.3
    assert (water.level[stands] <= hydrology.filled[stands] + 1e-9).all()
    np.testing.assert_allclose(water.level[stands] - hydrology.z[stands], water.standing[stands], atol=1e-6)
    for number in np.unique(hydrology.hollow[stands])[:50]:
        assert np.ptp(water.level[stands & (hydrology.hollow == number)]) == 0


def test_gutters_carry_more_water_than_the_crown(small_street: Street):
    water = small_street.water(1.0)
    _X, Y = water.grid.centres()
    gutter = (Y < at.ROAD_LEFT) & (Y > at.ROAD_LEFT - at.GUTTER)
    crown = np.abs(Y) < 0.3
    assert np.median(water.sheet[gutter]) > 2 * np.median(water.sheet[crown])


def test_the_wet_ground_is_lifted_only_where_water_stands(small_street: Street):
    sheet = small_street.sheet
    water = small_street.water(1.0)
    lift = water.surface(sheet.x, sheet.y, sheet.z) - sheet.z
    assert lift.min() == 0
    assert lift.max() <= water.standing.max() + 0.02
    assert 0.005 < (lift > 0).mean() < 0.3


@pytest.mark.parametrize("name", ["road_near", "pavement_right_near", "grass_near"])
def test_wet_ground_is_never_brighter_below_its_gloss_than_dry(small_street: Street, name: str):
    dry = small_street.simulation(0).materials[name].albedo_texture
    wet = small_street.simulation(0, 1.0).materials[name].albedo_texture
    assert dry is not None and wet is not None
    # Rounding of float32.
    assert (wet <= dry * (1 + 1e-5)).all()
    assert wet.mean() < 0.95 * dry.mean()


def test_only_the_ground_gets_wet(small_street: Street):
    dry, wet = small_street.simulation(0), small_street.simulation(0, 1.0)
    for shape in dry.shapes:
        if shape.name not in small_street.looks:
            assert wet.materials[shape.material] is dry.materials[shape.material]
    films = [m.film for m in wet.materials.values() if m.film is not None]
    assert films
    for film in films:
        assert isinstance(film.coverage, np.ndarray) and film.coverage.min() >= 0 and film.coverage.max() <= 1
        assert isinstance(film.thickness, np.ndarray) and film.thickness.min() >= 0
