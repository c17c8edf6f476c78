import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from materials.foundation.errors import InputError
from scene.grid import GroundGrid
from scene.wetting.hollows import hollow_maps
from scene.wetting.map_filters import fill_holes, fit_local_plane, gaussian_taps, wide_slopes
from scene.wetting.water import WaterSettings, height_factor, hillside_slope, relief, water_depth, water_level
from scene.wetting.wetting_patterns import moisture_pattern, puddle_pattern

GRID = GroundGrid(-3.0, -4.0, 0.05, 160, 240)
BOUNDED = WaterSettings(model="bounded")
THESIS = WaterSettings(model="thesis")


def street(x, y):
    """A cambered road along x: crown at y = 0, gutters 3 cm wide-angled dips at |y| = 3, kerbs of 12 cm beyond."""
    camber = -0.025 * np.abs(y)
    gutter = -0.02 * np.exp(-0.5 * ((np.abs(y) - 2.9) / 0.1) ** 2)
    kerb = 0.12 / (1 + np.exp(-(np.abs(y) - 3.1) / 0.02))
    return camber + gutter + kerb


def maps_of(height, grid=GRID, mask=1.0, coverage=None, seed=3):
    x, y = grid.centres()
    covered = np.ones(grid.shape, np.float32) if coverage is None else coverage
    return {
        "height": height(x, y).astype(np.float32),
        "coverage": covered,
        "mask": np.full(grid.shape, mask, np.float32),
        "moisture": moisture_pattern(x, y, seed),
        "puddles": puddle_pattern(x, y, seed),
    }


def test_a_dry_street_is_exactly_dry():
    assert not water_level(maps_of(street), GRID, 0.0).any()


@settings(max_examples=15)
@given(w=st.floats(0, 1), model_seed=st.integers(0, 3))
def test_water_levels_lie_between_dry_and_covered(w, model_seed):
    grid = GroundGrid(0.0, -4.0, 0.1, 80, 12)
    W = water_level(maps_of(street, grid, seed=model_seed), grid, w)
    assert W.min() >= 0 and W.max() <= 1


def test_the_printed_equations_leave_the_unit_interval_on_a_kerb():
    W = water_level(maps_of(street), GRID, 1.0, THESIS)
    assert W.min() < 0 and W.max() > 1


def test_the_printed_equations_are_computed_as_printed():
    maps = maps_of(street)
    w = 2 / 3
    d = relief(maps, GRID, w / 2).astype(np.float64)
    S = (maps["moisture"] * (1 - 0.75 * w) + 0.5 * 0.75 * w) * (1 + 2 * d)
    A = (maps["puddles"] * (1 - 0.5 * w) + 0.5 * 0.5 * w) * (1 + 100 * d)
    W = w * (S * (1 - 0.5 * w) + A * 0.5 * w)
    # Single precision: a few ulp of A, which reaches 5.
    assert np.allclose(water_level(maps, GRID, w, THESIS), W, atol=5e-6)


def test_on_flat_ground_both_models_agree_and_water_rises_everywhere_with_wetness():
    maps = maps_of(lambda x, y: 0 * x + 7.0)
    last = np.zeros(GRID.shape)
    for w in np.linspace(0.1, 1, 10):
        W = water_level(maps, GRID, w, BOUNDED)
        assert np.allclose(W, water_level(maps, GRID, w, THESIS), atol=1e-6)
        assert np.min(W - last) >= -1e-6
        last = W


def test_standing_water_covers_a_third_of_flat_ground_at_most_and_rises_everywhere_with_wetness():
    wide = GroundGrid(0.0, 0.0, 0.2, 300, 300)
    maps = maps_of(lambda x, y: 0 * x, wide)
    last = np.zeros(wide.shape)
    for w, share in ((1 / 3, 0.0), (2 / 3, 0.2), (1.0, 1 / 3)):
        W = water_level(maps, wide, w, WaterSettings(pattern_share=1.0, moisture_blend=1.0))
        # 60 m of puddles of 2 m are 900 independent ones: a standard deviation of 0.016 of the share, allowed 4 times.
        assert abs(np.mean(W > 0.5) - share) < 0.065
        assert np.min(W - last) >= -1e-6
        last = W
    assert last.max() > 0.99  # a puddle's middle is covered


def test_hollows_fill_from_below_and_run_off_at_the_edge():
    # A basin 4 cm deep with a lip, and a valley that opens at the border and so holds nothing.
    def ground(x, y):
        return np.minimum(0.04 * ((x - 4) ** 2 + y**2), 0.04) - 0.04 * np.exp(-0.5 * ((x - 8) / 0.5) ** 2) - 0.01 * y * (x > 6)

    maps = maps_of(ground)
    maps |= hollow_maps(maps["height"], maps["coverage"], GRID)
    maps["puddles"] = np.zeros(GRID.shape, np.float32)
    x, y = GRID.centres()
    r = np.hypot(x - 4, y)
    # A blur of 0.1 m over a paraboloid of curvature 0.08 / m lifts its bottom by 0.08 * 0.1^2 = 0.8 mm.
    assert abs(maps["hollow"].max() - 0.04) < 0.002
    for w in (0.3, 1.0):
        W = water_level(maps, GRID, w)
        # Filled to (1 - w) D below the lip: water where 0.04 r^2 < 0.04 w, covered once 3 mm deep.
        assert np.all(W[r < np.sqrt(w) - 0.15] > 0.9)
        # The blur rounds the lip as far as it reaches, 4 * 0.1 m; beyond, single precision leaves a micrometre of depth.
        assert np.all(W[(r > np.sqrt(w) + 0.4) & (x < 6)] < 0.5 + 1e-5)
    assert water_level(maps, GRID, 1.0)[x > 6.5].max() <= 0.5


def test_a_little_rain_stands_only_in_hollows():
    maps = maps_of(lambda x, y: -0.03 * np.exp(-0.5 * (x**2 + y**2) / 0.1**2))
    maps["puddles"] = np.ones(GRID.shape, np.float32)
    W = water_level(maps, GRID, 0.4, WaterSettings(pattern_share=1.0))
    row, col = np.rint(GRID.position(np.array([[0.0, 0.0]]))[0]).astype(int)
    assert W[row, col] > 0.9 and np.mean(W > 0.5) < 0.05


def test_on_a_street_the_mean_water_rises_with_wetness():
    maps = maps_of(street)
    means = [water_level(maps, GRID, w).mean() for w in np.linspace(0, 1, 11)]
    assert np.all(np.diff(means) > 0)


@pytest.mark.parametrize("w", [0.3, 1.0])
def test_soil_never_takes_more_water_than_saturates_it(w):
    assert water_level(maps_of(street, mask=0.5), GRID, w).max() <= 0.5


def test_a_gutter_holds_more_water_than_the_crown():
    maps = maps_of(street)
    _, y = GRID.centres()
    W = water_level(maps, GRID, 1.0)
    gutter, crown = W[np.abs(np.abs(y) - 2.9) < 0.1], W[np.abs(y) < 0.5]
    assert gutter.mean() > crown.mean() + 0.1
    assert water_depth(W, maps, GRID, 1.0)[np.abs(np.abs(y) - 2.9) < 0.1].mean() > 0.003


def test_accumulation_doubles_for_a_hollow_of_one_centimetre():
    # A narrow bowl of depth 1 cm in flat ground, far narrower than the filter: G * H - H is nearly its depth.
    maps = maps_of(lambda x, y: -0.0101 * np.exp(-0.5 * (x**2 + y**2) / 0.1**2))
    centre = np.rint(GRID.position(np.array([[0.0, 0.0]]))[0]).astype(int)
    F = height_factor(maps, GRID, 1.0, 100.0, THESIS)[tuple(centre)]
    # Convolved with sigma 0.5 the bowl keeps 0.01 / 0.26 of its depth, and the cell's centre is 3.5 cm off: 6 %.
    expected = 1 + 100 * 0.0101 * (np.exp(-0.5 * 2 * 0.025**2 / 0.01) - 0.01 / 0.26)
    assert abs(F - expected) < 0.01


@settings(max_examples=15)
@given(gx=st.floats(-0.2, 0.2), gy=st.floats(-0.2, 0.2), w=st.floats(0.05, 1))
def test_a_plane_slope_has_no_relief_even_at_the_edge_of_the_measured(gx, gy, w):
    grid = GroundGrid(0.0, 0.0, 0.05, 60, 60)
    x, y = grid.centres()
    coverage = (x < 2.0).astype(np.float32)
    maps = {"height": (gx * x + gy * y).astype(np.float32), "coverage": coverage}
    sigma = w / 2
    # At a straight edge the weights are half a Gaussian, 0.8 sigma off with 0.36 of its variance left (0.34 where it is
    # also cut at 4 sigma of the far side); the ridge of 1 % of the variance keeps 0.01 / 0.35 of the bias of a plain blur.
    bound = 0.01 / 0.35 * 0.8 * sigma * (abs(gx) + abs(gy)) + 2e-6
    assert np.abs(relief(maps, grid, sigma)).max() <= bound
    # Where the kernel, 4 sigma wide, sees only measured ground, symmetry leaves nothing but rounding.
    reach = 4 * sigma + 0.1
    inner = (x > reach) & (x < 2.0 - reach) & (y > reach) & (y < 3.0 - reach)
    assert np.abs(relief(maps, grid, sigma)[inner]).max(initial=0) < 2e-6


def test_the_water_stands_still_in_the_world_when_the_grid_grows():
    wide = GroundGrid(-3.0, -4.0, 0.05, 160, 400)
    narrow = GroundGrid(2.0, -4.0, 0.05, 160, 200)
    hilly = lambda x, y: street(x, y) + 0.03 * np.sin(x)  # noqa: E731
    a = water_level(maps_of(hilly, wide), wide, 0.3)[:, 100:300]
    b = water_level(maps_of(hilly, narrow), narrow, 0.3)
    # Apart from where the filters (4 x 0.15 m, and 4 x 2 m for the slope, here below 5 % anyway) see the border. Heights
    # about another mean round differently, by 1e-7 m: 1e-5 of F at k = 100/m.
    inner = slice(20, -20)
    assert np.abs(a[:, inner] - b[:, inner]).max() < 1e-4


def test_no_puddle_stays_on_a_hillside_but_gutters_do_not_count_as_one():
    hill = water_level(maps_of(lambda x, y: 0.2 * x), GRID, 1.0)
    flat = water_level(maps_of(lambda x, y: 0 * x), GRID, 1.0)
    assert hill.max() <= 0.5 < flat.max()
    slope = hillside_slope(maps_of(street), GRID, 2.0)
    _, y = GRID.centres()
    assert slope[np.abs(y) < 3].max() < WaterSettings().slope_end


def test_hillside_slope_is_the_slope_of_a_plane():
    slope = hillside_slope(maps_of(lambda x, y: 0.06 * x - 0.08 * y), GRID, 2.0)
    # The ridge of 1 % of the variance shrinks it by up to 1 %; more at corners, where less variance is left.
    assert abs(slope[80, 120] - 0.1) < 0.002
    assert abs(slope - 0.1).max() < 0.01


def test_water_has_no_depth_up_to_saturation_and_its_texture_depth_when_covered():
    maps = maps_of(lambda x, y: 0 * x)
    for level, depth in [(0.0, 0.0), (0.5, 0.0), (1.0, 0.001)]:
        assert np.allclose(water_depth(np.full(GRID.shape, level, np.float32), maps, GRID, 1.0), depth, atol=1e-8)


def test_taps_of_a_gaussian_have_its_variance():
    for sigma in (1.0, 3.0, 10.0):
        g = gaussian_taps(sigma)
        t = np.arange(len(g)) - len(g) // 2
        # Integrating over cells adds 1/12; cutting at 4 sigma loses 0.1 %.
        assert abs((g * t * t).sum() - sigma**2 - 1 / 12) < 0.002 * sigma**2


def test_local_planes_match_a_plain_weighted_least_squares():
    rng = np.random.default_rng(0)
    values, weight = rng.normal(size=(23, 31)), (rng.random((23, 31)) < 0.6).astype(float)
    plane = fit_local_plane(values, weight, 0.3, 0.1)
    g = gaussian_taps(3.0)
    t = np.arange(len(g)) - len(g) // 2
    ridge = 0.01 * (g * t * t).sum()
    for row, col in [(0, 0), (11, 15), (22, 3)]:
        r, c = np.mgrid[0:23, 0:31]
        near = (abs(r - row) <= 12) & (abs(c - col) <= 12) & (weight > 0)
        k = g[(r[near] - row) + 12] * g[(c[near] - col) + 12]
        X = np.column_stack([c[near] - col, r[near] - row]).astype(float)
        mean, h = (k @ X) / k.sum(), values[near]
        C = ((X - mean) * k[:, None]).T @ (X - mean) / k.sum() + ridge * np.eye(2)
        slope = np.linalg.solve(C, ((X - mean) * k[:, None]).T @ (h - k @ h / k.sum()) / k.sum())
        level = k @ h / k.sum() - slope @ mean
        # Moments are kept in single precision.
        assert abs(plane.level[row, col] - level) < 1e-4
        assert abs(plane.slope_x[row, col] * 0.1 - slope[0]) < 1e-4


def test_slopes_fitted_on_blocks_are_those_fitted_on_cells():
    cell, sigma, k = 0.1, 2.4, 2 * np.pi / 12.0
    x = (np.arange(241) + 0.5) * cell
    values = np.tile(0.05 * np.sin(k * x), (200, 1))
    weight = np.ones_like(values)
    fine = fit_local_plane(values, weight, sigma, cell).slope_x
    coarse, across = wide_slopes(values, weight, sigma, cell, (1, 2))
    # Blocks of 3 cells, an eighth of sigma: lines between their centres are off by h^2 k^2 / 8 of the greatest slope. A
    # block adds 1 / 768 to the variance of the Gaussian, which acts on the fit through exp(-k^2 sigma^2 / 2) and through the
    # variance that divides it; twice that covers the second order. Both are wrong alike near the border, not to be compared.
    error = (0.3**2 * k**2 / 8 + 2 * (k**2 * sigma**2 / 2 + 1) / 768) * np.abs(fine).max()
    inner = (slice(None), slice(96, -96))
    assert np.abs(coarse - fine)[inner].max() < error
    assert np.abs(across).max() < 1e-6


def test_a_hole_in_a_slope_is_filled_by_the_slope():
    x, y = np.meshgrid(np.arange(60.0), np.arange(50.0))
    plane = 0.3 * x - 0.1 * y
    known = np.ones(plane.shape, bool)
    known[10:40, 20:45] = False
    filled = fill_holes(np.where(known, plane, np.nan), known, sweeps=200)
    # A membrane over a hole with a straight rim is the plane itself; the iteration stops within a part of the step of 0.3.
    assert np.abs(filled - plane).max() < 0.3
    assert np.array_equal(filled[known], plane[known].astype(np.float32))


@pytest.mark.parametrize(
    ("change", "words"), [({"w": 1.5}, r"w must lie in \[0, 1\], got 1.5"), ({"drop": "mask"}, "maps\\['mask'\\]")]
)
def test_bad_wetness_and_missing_maps_are_refused(change, words):
    maps = maps_of(street)
    maps.pop(change.get("drop", ""), None)
    with pytest.raises(InputError, match=words):
        water_level(maps, GRID, change.get("w", 0.5))
