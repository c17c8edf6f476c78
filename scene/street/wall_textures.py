"""Textures of what stands beside the road: brick, plaster, roof tiles, bark. Each repeats without a seam.

Albedos are linear reflectances: plaster 0.4-0.6, fired brick (0.28, 0.11, 0.07), lime mortar 0.35, clay tiles
(0.26, 0.10, 0.06), bark 0.10-0.15.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .patterns import Pattern

BRICK_TILE, PLASTER_TILE, ROOF_TILE, BARK_TILE = 2.0, 4.0, 2.4, 1.0
Colour = tuple[float, float, float]


def brick(base: Colour, rng: np.random.Generator, size: int = 400) -> NDArray[np.float32]:
    """Return a wall of running-bond brick, 25 cm x 8.33 cm with 1 cm joints, on a tile of 2 m."""
    cell = BRICK_TILE / size
    x = (np.arange(size) + 0.5) * cell
    course_height = BRICK_TILE / 24
    course = np.floor(x / course_height).astype(int)
    shifted = x[None] / 0.25 + 0.5 * (course % 2)[:, None]
    number = (np.floor(shifted).astype(int) % 8) + 8 * course[:, None]
    fraction = np.abs(shifted - np.round(shifted)) * 0.25
    bed = np.abs(x / course_height - np.round(x / course_height)) * course_height
    mortar = (fraction < 0.005) | (bed < 0.005)[:, None]
    shade = 1 + 0.20 * rng.standard_normal(8 * 24)[number]
    grain = Pattern(BRICK_TILE, cell, 2.5 * cell, 0.2, rng, slope=0.6).tile
    face = np.array(base)[None, None] * np.clip(shade * (1 + 0.08 * grain), 0.35, 1.9)[..., None]
    joint = np.array([0.34, 0.31, 0.27]) * (1 + 0.06 * grain)[..., None]
    return np.clip(np.where(mortar[..., None], joint, face), 0.02, 0.8).astype(np.float32)


def plaster(base: Colour, rng: np.random.Generator, size: int = 512) -> NDArray[np.float32]:
    """Return rendered wall with fine grain and faint runs of weather, on a tile of 4 m."""
    cell = PLASTER_TILE / size
    grain = Pattern(PLASTER_TILE, cell, 2.5 * cell, 0.12, rng, slope=0.3).tile
    blotch = Pattern(PLASTER_TILE, cell, 0.2, 3.0, rng, slope=1.3).tile
    runs = Pattern(PLASTER_TILE, cell, 0.05, 2.0, rng, slope=1.0, stretch=0.12).tile
    tone = 1 + 0.05 * grain + 0.035 * blotch + 0.035 * runs
    return np.clip(np.array(base)[None, None] * tone[..., None], 0.02, 0.8).astype(np.float32)


def roof_tiles(base: Colour, rng: np.random.Generator, size: int = 320) -> NDArray[np.float32]:
    """Return courses of clay tiles, 20 cm x 30 cm, darker at their overlaps, on a tile of 2.4 m."""
    cell = ROOF_TILE / size
    x = (np.arange(size) + 0.5) * cell
    column, course = np.floor(x / 0.2).astype(int), np.floor(x / 0.3).astype(int)
    number = column[None] + 12 * course[:, None]
    shade = 1 + 0.16 * rng.standard_normal(12 * 8)[number]
    across = 0.75 + 0.25 * np.sin(np.pi * (x / 0.2 % 1))
    down = np.where(x / 0.3 % 1 > 0.88, 0.45, 1.0)
    grain = Pattern(ROOF_TILE, cell, 2.5 * cell, 0.3, rng, slope=0.6).tile
    tone = np.clip(shade * across[None] * down[:, None] * (1 + 0.07 * grain), 0.15, 1.8)
    return np.clip(np.array(base)[None, None] * tone[..., None], 0.01, 0.8).astype(np.float32)


def bark(base: Colour, rng: np.random.Generator, size: int = 128) -> NDArray[np.float32]:
    """Return bark furrowed along the trunk (v), on a tile of 1 m."""
    cell = BARK_TILE / size
    furrow = Pattern(BARK_TILE, cell, 3 * cell, 0.5, rng, slope=0.7, stretch=0.2).tile
    return np.clip(np.array(base)[None, None] * np.clip(1 + 0.35 * furrow, 0.2, 2)[..., None], 0.01, 0.8).astype(np.float32)


def foliage(base: Colour, rng: np.random.Generator, size: int = 64) -> NDArray[np.float32]:
    """Return shades of leaf: one texel a leaf, so that a leaf's uv picks its green."""
    shade = np.clip(1 + 0.28 * rng.standard_normal((size, size)), 0.35, 2.0)[..., None]
    warm = 0.25 * rng.standard_normal((size, size))
    tint = np.stack([1 + warm, np.ones_like(warm), 1 - 0.4 * warm], axis=-1)
    return np.clip(np.array(base)[None, None] * shade * tint, 0.008, 0.6).astype(np.float32)
