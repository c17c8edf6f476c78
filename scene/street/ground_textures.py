"""Colour and roughness of the ground: asphalt with paint and repairs, kerbs, slabs, grass; in metres, nothing repeats.

Albedos are linear reflectances of dry materials: weathered asphalt 0.10-0.13, fresh asphalt 0.06, concrete 0.27-0.33,
thermoplastic paint 0.6 worn, mown grass (0.05, 0.10, 0.03). Cast iron is treated as a dark diffuse surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import layout as at
from .ground import Patch
from .patterns import Pattern, slab_joints, smoothstep
from .relief import Relief

Floats = NDArray[np.floating]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Textures of one patch of ground.

    Attributes
    ----------
    albedo : (H, W, 3) float32
        Linear reflectance.
    alpha : (H, W) float32
        GGX width.
    porosity : (H, W) float32
        Share of pores below the surface: what can soak up water.
    """

    albedo: NDArray[np.float32]
    alpha: NDArray[np.float32]
    porosity: NDArray[np.float32]


class GroundPaint:
    """Paints patches of ground; the patterns are fixed in the world, so neighbouring patches meet."""

    def __init__(self, wear: at.Damage, relief: Relief, detail: float, rng: np.random.Generator) -> None:
        self.wear, self.relief, self.detail = wear, relief, detail
        # Sizes of the tiles have no common multiple within the street: layered, they never show the same spot twice.
        self.stones = Pattern(4.1, 0.008, 0.016, 0.04, rng, slope=0.0)
        self.grit = Pattern(3.7, 0.008, 0.016, 0.10, rng, slope=0.6)
        self.blotch = Pattern(22.3, 0.05, 0.3, 8.0, rng, slope=1.2)
        self.streak = Pattern(19.7, 0.05, 0.15, 6.0, rng, slope=1.0, stretch=8.0)
        self.wear_off = Pattern(5.3, 0.01, 0.03, 0.6, rng, slope=0.9)
        self.blades = Pattern(3.1, 0.01, 0.02, 0.15, rng, slope=0.4)

    def cell(self, patch: Patch) -> float:
        """Return the size of a texel [m]: below a pixel's footprint at 1242 px where the camera looks closely."""
        near = patch.name.endswith("near")
        fine = {"road": 0.008, "kerb": 0.01, "pavement": 0.012, "grass": 0.016, "land": 0.25}[patch.strip]
        return (fine if near else max(3 * fine, 0.025)) / min(self.detail, 1.0)

    def look(self, patch: Patch) -> Look:
        """Return the textures of a patch."""
        cell = self.cell(patch)
        cols = max(2, round((patch.x1 - patch.x0) / cell))
        rows = max(2, round(abs(patch.y1 - patch.y0) / cell))
        x = patch.x0 + (np.arange(cols) + 0.5) * (patch.x1 - patch.x0) / cols
        y = patch.y0 + (np.arange(rows) + 0.5) * (patch.y1 - patch.y0) / rows
        # A texel larger than a stone shows the stones' mean: contrast falls with the number of stones it averages.
        contrast = min(1.0, 0.02 / cell)
        paint = {"road": self._road, "kerb": self._kerb, "pavement": self._slabs, "grass": self._grass, "land": self._land}
        return paint[patch.strip](x, y, contrast)

    def _road(self, x: Floats, y: Floats, contrast: float) -> Look:
        blotch, streak = self.blotch.at(x, y), self.streak.at(x, y)
        stones, grit = self.stones.at(x, y), self.grit.at(x, y)
        wheel_lines = [lane + side * 0.75 for lane in (at.LANE_EGO, at.LANE_ONCOMING) for side in (-1, 1)]
        tracks = np.exp(-0.5 * ((y[:, None] - wheel_lines) / 0.3) ** 2).sum(axis=1)
        centre = np.exp(-0.5 * ((y - at.LANE_EGO) / 0.25) ** 2) + np.exp(-0.5 * ((y - at.LANE_ONCOMING) / 0.25) ** 2)
        # Tyres polish the stones bare (lighter), oil drips between the tracks (darker).
        grey = 0.112 * (1 + 0.06 * blotch + 0.05 * streak + (0.10 * tracks - 0.10 * centre)[:, None])
        speckle = np.clip(1 + contrast * (0.30 * stones + 0.14 * grit), 0.25, 2.4)
        alpha = np.clip(0.66 - 0.10 * tracks[:, None] + 0.03 * blotch + 0.05 * contrast * grit, 0.5, 0.8)
        fresh = self._patches(x, y)
        grey = grey * (1 - 0.42 * fresh) * speckle
        crack = self._relief_map(self.relief.crack_map, x, y)
        grey = grey * (1 - 0.65 * crack)
        albedo = grey[..., None] * np.array([1.03, 1.0, 0.955], np.float32)
        porosity = np.full(grey.shape, 0.20, np.float32)
        white = self._paint(x, y) * np.clip(0.93 - 0.18 * smoothstep(0.3, 1.6, self.wear_off.at(x, y)) - 0.3 * crack, 0, 1)
        white *= 1 - 0.8 * smoothstep(1.1, 2.0, self.wear_off.at(x, y) + 0.3 * blotch)
        albedo = albedo * (1 - white[..., None]) + (white * (0.60 + 0.04 * contrast * grit))[..., None] * np.array(
            [1.0, 0.99, 0.95]
        )
        alpha = alpha * (1 - white) + 0.45 * white
        porosity = porosity * (1 - white) + 0.04 * white
        gutter = np.maximum(y - (at.ROAD_LEFT - at.GUTTER), (at.ROAD_RIGHT + at.GUTTER) - y) > 0
        stones_y = (gutter[:, None] & ((np.abs((x / 0.5) % 1 - 0.5) < 0.488)[None])).astype(np.float32)
        concrete = 0.25 * (1 + 0.08 * blotch + 0.06 * streak + 0.08 * contrast * grit)
        g = gutter[:, None].astype(np.float32)
        albedo = albedo * (1 - g[..., None]) + (g * (0.35 + 0.65 * stones_y) * concrete)[..., None] * np.array([1.02, 1.0, 0.95])
        porosity = porosity * (1 - g) + 0.15 * g
        iron = self._iron(x, y)
        shade = np.where(iron < 0, 0.0, iron)[..., None] * np.array([1.05, 1.0, 0.93])
        is_iron = iron >= 0
        albedo = np.where(is_iron[..., None], shade, albedo)
        alpha = np.where(is_iron, 0.4, alpha)
        porosity = np.where(is_iron, 0.0, porosity)
        return Look(np.clip(albedo, 0.01, 0.8).astype(np.float32), alpha.astype(np.float32), porosity.astype(np.float32))

    def _paint(self, x: Floats, y: Floats) -> NDArray[np.float64]:
        """Return 1 on lane paint: broken centre line, parking lane, zebra crossing."""
        in_zebra = (x > at.ZEBRA[0] - 1.2) & (x < at.ZEBRA[1] + 1.2)
        dashes = ((x % 6.0) < 3.0) & ~in_zebra
        centre = (np.abs(y) < 0.06)[:, None] & dashes[None]
        bay_line = (np.abs(y + 3.45) < 0.05)[:, None] & ((x % 1.5) < 0.75)[None] & ~in_zebra[None]
        bay_ends = (
            ((y < -3.45) & (y > at.ROAD_RIGHT + at.GUTTER))[:, None]
            & (np.abs((x - 3.3) % 6.1 - 3.05) < 0.05)[None]
            & ~in_zebra[None]
        )
        bars = ((y > at.ROAD_RIGHT + 0.5) & (y < at.ROAD_LEFT - 0.5) & ((y % 1.0) < 0.5))[:, None]
        zebra = bars & ((x > at.ZEBRA[0]) & (x < at.ZEBRA[1]))[None]
        stop = (np.abs(x - at.ZEBRA[0] + 1.0) < 0.15)[None] & ((y < -0.15) & (y > -3.4))[:, None]
        return (centre | bay_line | bay_ends | zebra | stop).astype(np.float64)

    def _patches(self, x: Floats, y: Floats) -> Floats:
        fresh = np.zeros((len(y), len(x)), np.float32)
        for x0, y0, x1, y1 in self.wear.patches:
            i, j = np.searchsorted(x, [x0 - 0.05, x1 + 0.05])
            edge_x, edge_y = np.minimum(x - x0, x1 - x)[i:j], np.minimum(y - y0, y1 - y)
            inside = np.minimum(edge_x[None], edge_y[:, None])
            # The seam is sealed with bitumen: darker still.
            fresh[:, i:j] = np.maximum(fresh[:, i:j], (inside > 0) * 0.7 + (np.abs(inside) < 0.03) * 0.75)
        return fresh

    def _iron(self, x: Floats, y: Floats) -> Floats:
        """Return the reflectance of the sewer lid and the gully grates, -1 elsewhere."""
        iron = np.full((len(y), len(x)), -1.0, np.float32)
        lid_x, lid_y, radius = at.LID
        near = slice(*np.searchsorted(x, [lid_x - radius, lid_x + radius]))
        X, Y = x[None, near] - lid_x, y[:, None] - lid_y
        r = np.hypot(X, Y)
        studs = ((np.floor(X / 0.035) + np.floor(Y / 0.035)) % 2) * 0.035
        lid = np.where(r < radius, 0.065 + np.where(r < 0.82 * radius, studs, 0.02), -1.0)
        iron[:, near] = np.where(np.abs(r - 0.985 * radius) < 0.012, 0.02, lid)
        for gully_x, edge in at.GULLIES:
            near = slice(*np.searchsorted(x, [gully_x - 0.3, gully_x + 0.3]))
            along = x[None, near] - gully_x
            across = ((y - edge) * -np.sign(edge))[:, None]
            inside = (np.abs(along) < at.GULLY_SIZE[0] / 2) & (across > 0.02) & (across < at.GULLY_SIZE[1])
            slots = (along / 0.05 % 1 < 0.5) & (across > 0.05) & (across < at.GULLY_SIZE[1] - 0.03) & (np.abs(along) < 0.22)
            iron[:, near] = np.where(inside, np.where(slots, 0.006, 0.085), iron[:, near])
        return iron

    def _kerb(self, x: Floats, y: Floats, contrast: float) -> Look:
        tone = 1 + 0.07 * self.blotch.at(x, y) + 0.05 * self.streak.at(x, y) + contrast * 0.10 * self.grit.at(x, y)
        stone_shade = 1 + 0.09 * (_hash(np.floor(x)) - 0.5)
        joint = np.where(np.abs(x - np.round(x)) < 0.006 / min(1, max(contrast, 0.3)), 0.45, 1.0)
        grey = 0.29 * tone * (stone_shade * joint)[None]
        return _uniform(grey[..., None] * np.array([1.02, 1.0, 0.96]), alpha=0.6, porosity=0.15)

    def _slabs(self, x: Floats, y: Floats, contrast: float) -> Look:
        joint, number = slab_joints(x, y, width=0.012 / max(contrast, 0.3))
        tone = 1 + 0.05 * self.blotch.at(x, y) + 0.04 * self.streak.at(x, y) + contrast * 0.13 * self.grit.at(x, y)
        shade = 1 + 0.16 * (_hash(number) - 0.5)
        grey = 0.30 * tone * shade * (1 - 0.55 * joint * max(contrast, 0.4))
        spots = smoothstep(1.9, 2.6, self.wear_off.at(x, y) + 0.5 * self.blotch.at(x, y))
        grey = grey * (1 - 0.35 * spots)
        return _uniform(grey[..., None] * np.array([1.04, 1.0, 0.93]), alpha=0.6, porosity=0.18)

    def _grass(self, x: Floats, y: Floats, contrast: float) -> Look:
        blades, patchy = self.blades.at(x, y), self.blotch.at(x, y)
        shade = np.clip(1 + 0.42 * max(contrast, 0.25) * blades + 0.10 * patchy, 0.25, 2.2)
        dry = smoothstep(0.6, 2.2, patchy + 0.4 * self.wear_off.at(x, y))[..., None]
        green, straw = np.array([0.050, 0.100, 0.030]), np.array([0.12, 0.11, 0.055])
        return _uniform(shade[..., None] * (green * (1 - dry) + straw * dry), alpha=0.8, porosity=0.5)

    def _land(self, x: Floats, y: Floats, contrast: float) -> Look:
        grey = 0.2 * (1 + 0.1 * self.blotch.at(x, y))
        return _uniform(grey[..., None] * np.array([1.03, 1.0, 0.94]), alpha=0.7, porosity=0.2)

    def _relief_map(self, values: NDArray[np.float32], x: Floats, y: Floats) -> NDArray[np.float32]:
        grid = self.relief.grid
        col = np.clip(((x - grid.x_min) / grid.cell).astype(int), 0, grid.cols - 1)
        row = np.clip(((y - grid.y_min) / grid.cell).astype(int), 0, grid.rows - 1)
        return values[row][:, col]


def _uniform(albedo: Floats, alpha: float, porosity: float) -> Look:
    shape = albedo.shape[:2]
    filled = np.full(shape, alpha, np.float32), np.full(shape, porosity, np.float32)
    return Look(np.clip(albedo, 0.01, 0.8).astype(np.float32), *filled)


def _hash(number: NDArray) -> NDArray[np.float64]:
    """Return a fixed number in [0, 1) per integer: the shade of one stone among many."""
    return np.modf(np.abs(np.sin(number.astype(np.float64) * 12.9898) * 43758.5453))[0]
