"""Where the water is: the water level W of thesis 6.3.3 (eqs 6.1-6.5) on the ground's grid.

W = 0.5 is ground saturated with water, W = 1 ground covered by it; `w` is the global wetness. The thesis's equations leave
[0, 1] once heights differ by centimetres (F = 1 + 100 * 0.06 = 7); `model="bounded"` keeps each factor within its meaning.
`model="thesis"` computes them as printed. `model="standing"`, the default, is bounded and lets puddles fill.

| | thesis | bounded |
|---|---|---|
| F, eq 6.2 | 1 + k d | max(0, 1 + k d) |
| S, A, eqs 6.3, 6.4 | as printed | clamped to [0, 1] |
| W, eq 6.5 | w M lerp(S, A, w / 2) | M clamp(w lerp(S, A, w / 2)), so that M = 0.5 never exceeds saturation |
| d, eq 6.2 | G * H - H | shrunk by d^2 / (d^2 + n^2), with the noise n of the height map |
| hillsides | nothing | A fades out as the slope at the scale of metres passes from 5 % to 12 % |

Bounded, the composite of eq 6.5 cannot exceed lerp(S, 1, 0.5) = 0.75 where S = 0.5, which is a damp patch, no puddle: the
printed one covers ground with water only through the values above 1 that it should not have. What 6.3.3 describes in
words is that pores fill first, then puddles, at low places. So `standing` has

    W = M lerp(w_sat / 2, 1, w_acc),  w_sat = clamp(2 w S),  w_acc = max(hollows, pattern_share * smoothstep(P; t, t + 1/2))

with P = A0 F stays and t = 1 / (2 w). Since A0 > 1/2 on a third of flat ground, the pattern reaches that third at w = 1 (the
thesis's maximum), the fifth where A0 > 3/4 at w = 2/3, and only low places at w = 1/3. It stands for unevenness that no height
map resolves; `pattern_share=0` leaves it out. The hollows are the closed depressions that `hollows.py` finds: filled from
below, a hollow of depth D holds water up to (1 - w) D below its spill level. Against the true wet street the hollows alone
come nearest (`make proof` compares): a random puddle is a wrong one. At w = 1 pores are full (w_sat is 1 on average, within a
fourth). M multiplies last, so M = 0.5 never exceeds saturation, and W rises with w on flat ground.

The noise: at k = 100/m the ripples that a scanner's rings leave, 2 mm high, would show as stripes of water.

Monotone in w: with F = 1 (flat ground) W rises with w at every place, since W / M is affine in S0 and A0 and its derivative
is positive for all four corners of [0, 1]^2. On relief it need not: a place on a crest 10 cm wide is level ground at the
scale of w = 0.1 and a crest at w = 1. The mean over a street rises.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range, check_shape
from materials.foundation.errors import InputError

from ..grid import GroundGrid
from .map_filters import fit_local_plane, wide_slopes
from .water_settings import MODELS, WaterSettings

Maps = Mapping[str, NDArray[np.float32]]


def relief(maps: Maps, grid: GroundGrid, sigma: float) -> NDArray[np.float32]:
    """Return how far each cell lies below its surroundings, `G(sigma) * H - H` [m] (rows, cols): positive in a gutter.

    A plane slope gives 0, also at the edge of what was measured; so does ground never measured, and sigma = 0.
    """
    height, coverage = maps["height"], maps["coverage"]
    check_shape("maps['height']", height, grid.shape)
    if sigma <= 0:
        return np.zeros(grid.shape, np.float32)
    level = fit_local_plane(height, coverage, sigma, grid.cell).level
    return np.where(np.isfinite(level) & (coverage > 0), level - height, 0).astype(np.float32)


def height_factor(
    maps: Maps, grid: GroundGrid, w: float, k: float, settings: WaterSettings = WaterSettings()
) -> NDArray[np.float32]:
    """Return F of eq 6.2: above 1 where water gathers, below where it leaves.

    Parameters
    ----------
    maps : mapping
        `height` [m] and `coverage` (rows, cols).
    grid : GroundGrid
        Where their cells lie.
    w : float
        Global wetness, in [0, 1].
    k : float
        Weight of height differences [1/m].
    settings : WaterSettings
        `model` and `sigma_per_wetness`.

    Raises
    ------
    InputError
        If `w` is outside [0, 1] or a map has another shape than the grid.
    """
    check_range("w", w, "[0, 1]")
    return _factor(relief(maps, grid, settings.sigma_per_wetness * w), k, settings)


def water_level(maps: Maps, grid: GroundGrid, w: float, settings: WaterSettings = WaterSettings()) -> NDArray[np.float32]:
    """Return the water level W of eq 6.5 on the grid.

    Parameters
    ----------
    maps : mapping of (rows, cols) float32
        `height` [m], `coverage`, `mask` (M), `moisture` (S0) and `puddles` (A0), as `terrain.ground_maps` makes them; and,
        if there, `hollow` and `hollow_deepest` [m] of `hollows.hollow_maps`.
    grid : GroundGrid
        Where their cells lie.
    w : float
        Global wetness, in [0, 1].
    settings : WaterSettings
        Constants, and the model.

    Returns
    -------
    W : (rows, cols) float32
        0 dry, 0.5 saturated, 1 covered; at w = 0 exactly 0. `model="thesis"` may leave [0, 1].

    Raises
    ------
    InputError
        If `w` is outside [0, 1], or a map is missing or has another shape than the grid.
    """
    check_range("w", w, "[0, 1]")
    if settings.model not in MODELS:
        raise InputError(f"be one of {', '.join(MODELS)}", got=settings.model, key="model")
    for name in ("height", "coverage", "mask", "moisture", "puddles"):
        if name not in maps:
            raise InputError("hold the map", got=list(maps), key=f"maps['{name}']")
        check_shape(f"maps['{name}']", maps[name], grid.shape)
    if w == 0:
        return np.zeros(grid.shape, np.float32)
    d = relief(maps, grid, settings.sigma_per_wetness * w)
    S = _lerp(maps["moisture"], 0.5, settings.moisture_blend * w) * _factor(d, settings.k_sat, settings)
    A = _lerp(maps["puddles"], 0.5, settings.puddle_blend * w) * _factor(d, settings.k_acc, settings)
    if settings.model == "thesis":
        return (w * maps["mask"] * _lerp(S, A, settings.accumulation_share * w)).astype(np.float32)
    S = np.clip(S, 0, 1)
    stays = _stays(maps, grid, settings)
    if settings.model == "standing":
        filled = _standing(maps, d, stays, w, settings)
        level = np.minimum(w * S, 0.5) * (1 - filled) + filled
    else:
        level = np.clip(w * _lerp(S, np.clip(A, 0, 1) * stays, settings.accumulation_share * w), 0, 1)
    return (maps["mask"] * level).astype(np.float32)


def water_depth(
    W: NDArray[np.float32], maps: Maps, grid: GroundGrid, w: float, settings: WaterSettings = WaterSettings()
) -> NDArray[np.float32]:
    """Return how thick the water stands above the ground [m], for its absorption.

    Up to saturation (W = 0.5) all water is in the pores. Above, the accumulation `2 W - 1` is the share of what would drown
    the ground's texture (`texture_depth`, about 1 mm for asphalt by the sand patch test) and fill the hollow that the height
    map shows at this wetness: `depth = (2 W - 1) (texture_depth + max(0, G * H - H))`. A model of ours: the thesis has
    none.
    """
    hollow = np.maximum(relief(maps, grid, settings.sigma_per_wetness * w), 0)
    return (np.clip(2 * W - 1, 0, 1) * (settings.texture_depth + hollow)).astype(np.float32)


def _standing(
    maps: Maps, d: NDArray[np.float32], stays: NDArray[np.float32] | float, w: float, settings: WaterSettings
) -> NDArray[np.float32]:
    """Return w_acc of the model `standing`: how far water covers the ground."""
    potential = maps["puddles"] * _factor(d, settings.k_acc, settings) * stays
    filled = settings.pattern_share * _smoothstep((potential - settings.puddle_threshold / w) / np.float32(0.5))
    if "hollow" in maps:
        deepest = maps["hollow_deepest"]
        depth = (maps["hollow"] - (1 - np.float32(w)) * deepest) * (deepest > settings.hollow_noise)
        filled = np.maximum(filled, _smoothstep((depth / settings.hollow_film).astype(np.float32)))
    return filled.astype(np.float32)


def _smoothstep(t: NDArray[np.float32]) -> NDArray[np.float32]:
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


def _factor(d: NDArray[np.float32], k: float, settings: WaterSettings) -> NDArray[np.float32]:
    if settings.model == "thesis":
        return (1 + np.float32(k) * d).astype(np.float32)
    n2 = np.float32(settings.relief_noise) ** 2
    believed = d * (d * d / np.maximum(d * d + n2, np.float32(1e-20)))
    return np.maximum(1 + np.float32(k) * believed, 0).astype(np.float32)


def _lerp(a: NDArray[np.float32], b: NDArray[np.float32] | float, t: float) -> NDArray[np.float32]:
    return ((1 - np.float32(t)) * a + np.float32(t) * np.asarray(b, np.float32)).astype(np.float32)


def _stays(maps: Maps, grid: GroundGrid, settings: WaterSettings) -> NDArray[np.float32] | float:
    """Return the share of standing water that a slope leaves: 1 on the flat, 0 on a hillside."""
    slope = hillside_slope(maps, grid, settings.slope_scale)
    t = (slope - settings.slope_start) / max(settings.slope_end - settings.slope_start, 1e-9)
    return (1 - _smoothstep(t)).astype(np.float32)


def hillside_slope(maps: Maps, grid: GroundGrid, scale: float) -> NDArray[np.float32]:
    """Return the slope (rise over run) of the ground at a scale of metres, blind to kerbs and gutters.

    Another extent of the grid gives the same slopes (see `map_filters.wide_slopes`).
    """
    origin = (round(grid.y_min / grid.cell), round(grid.x_min / grid.cell))
    slope_x, slope_y = wide_slopes(maps["height"], maps["coverage"], scale, grid.cell, origin)
    return np.hypot(slope_x, slope_y)
