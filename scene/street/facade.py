"""Houses: walls with recessed windows and doors, plinths, sills, gable roofs, chimneys."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..mesh import Mesh, join
from ..transforms import transform_points
from . import layout as at
from .solids import pose, quads
from .wall_textures import BRICK_TILE, PLASTER_TILE, ROOF_TILE

Floats = NDArray[np.floating]
Quads = list[list[tuple[float, float, float]]]
_BELOW = -0.6
_WALL_STYLES = ("plaster_cream", "brick_red", "plaster_white", "plaster_rose", "brick_brown", "plaster_sand", "plaster_green")
_DOORS = ("door_green", "door_red", "door_brown")


@dataclass(frozen=True)
class House:
    """One house in its own frame: the street front lies in y = 0 and looks to -y, x runs along it."""

    width: float
    depth: float
    floors: int
    style: str
    roof_pitch: float
    first_window: float
    bay: float
    door_bay: int
    door: str
    seed: int

    @property
    def eaves(self) -> float:
        return 0.45 + 2.9 * self.floors + 0.35


def houses(rng: np.random.Generator, base_left: float, base_right: float) -> dict[str, Mesh]:
    """Return the meshes of both rows and of the two houses that close the street, joined by material."""
    parts: dict[str, list[Mesh]] = {}
    rows = [
        (pose(0, at.WALL_LEFT, base_left), at.X_BACK + 4, at.ROW_END, 1.0),
        (pose(0, at.WALL_RIGHT, base_right, np.pi), -at.ROW_END, -(at.X_BACK + 4), -1.0),
        (pose(at.X_END - 2, 0, base_left, -np.pi / 2), -26.0, 26.0, 0.0),
        (pose(at.X_BACK, 0, base_left, np.pi / 2), -22.0, 22.0, 0.0),
    ]
    order = 0
    for T, start, end, _ in rows:
        x = start
        while x < end - 4:
            width = min(float(rng.uniform(8.0, 13.0)), end - x)
            if end - x - width < 6:
                width = end - x
            _build(_house(width, order, rng), T @ pose(x, 0, 0), parts)
            x += width
            order += 1
    return {name: join(meshes) for name, meshes in sorted(parts.items())}


def _house(width: float, order: int, rng: np.random.Generator) -> House:
    bays = max(2, int(width / 2.6))
    bay = width / bays
    return House(
        width,
        float(rng.uniform(8.5, 10.0)),
        int(rng.choice([2, 2, 3])),
        _WALL_STYLES[(order * 3 + int(rng.integers(2))) % len(_WALL_STYLES)],
        float(np.radians(rng.uniform(32, 42))),
        bay / 2,
        bay,
        int(rng.integers(bays)),
        _DOORS[int(rng.integers(len(_DOORS)))],
        int(rng.integers(1 << 30)),
    )


def _build(house: House, T: Floats, parts: dict[str, list[Mesh]]) -> None:
    rng = np.random.default_rng(house.seed)
    local: dict[str, Quads] = {}

    def add(material: str, *faces: list[tuple[float, float, float]]) -> None:
        local.setdefault(material, []).extend(faces)

    wall, w, d, h = house.style, house.width, house.depth, house.eaves
    openings = _openings(house, rng)
    _front(add, wall, house, openings)
    for kind, x0, x1, z0, z1, material in openings:
        _opening(add, wall, kind, x0, x1, z0, z1, material)
    ridge = h + np.tan(house.roof_pitch) * d / 2
    # Roof: two slopes 12 cm thick that overhang the front and the back by 40 cm; gables reach up to their top side.
    over, slope, t = 0.4, np.tan(house.roof_pitch), 0.12
    z0, g = h - over * slope, h + t
    top = ridge + t
    add(wall, [(0, d, _BELOW), (0, 0, _BELOW), (0, 0, g), (0, d, g)], [(w, 0, _BELOW), (w, d, _BELOW), (w, d, g), (w, 0, g)])
    add(wall, [(w, d, _BELOW), (0, d, _BELOW), (0, d, h), (w, d, h)])
    add(wall, [(0, d, g), (0, 0, g), (0, d / 2 - 0.01, top), (0, d / 2 + 0.01, top)])
    add(wall, [(w, 0, g), (w, d, g), (w, d / 2 + 0.01, top), (w, d / 2 - 0.01, top)])
    add("roof", [(0, -over, z0 + t), (w, -over, z0 + t), (w, d / 2, ridge + t), (0, d / 2, ridge + t)])
    add("roof", [(w, d + over, z0 + t), (0, d + over, z0 + t), (0, d / 2, ridge + t), (w, d / 2, ridge + t)])
    add("wood_white", [(0, 0.02, h), (w, 0.02, h), (w, -over, z0), (0, -over, z0)])
    _slab(add, "gutter_zinc", (0, -over - 0.10, z0 + 0.02), (w, -over, z0 + t))
    for x in (0.15, w - 0.21):
        _slab(add, "gutter_zinc", (x, -0.08, 0.0), (x + 0.07, -0.01, z0 + 0.05))
    chimney = float(rng.uniform(0.25, 0.7)) * w
    _slab(add, "brick_brown", (chimney, d / 2 - 0.9, ridge - 1.0), (chimney + 0.9, d / 2 - 0.4, ridge + 0.7))
    scale = {"roof": ROOF_TILE} | {wall: BRICK_TILE if wall.startswith("brick") else PLASTER_TILE, "brick_brown": BRICK_TILE}
    for material, faces in local.items():
        corners = transform_points(T, np.array(faces, float).reshape(-1, 3)).reshape(-1, 4, 3)
        parts.setdefault(material, []).append(quads(corners, scale.get(material, PLASTER_TILE)))


def _openings(house: House, rng: np.random.Generator) -> list[tuple[str, float, float, float, float, str]]:
    """Return doors and windows: kind, x0, x1, z0, z1, material of what fills them."""
    out = []
    half = min(0.62, 0.3 * house.bay)
    shop = house.floors == 3 and rng.random() < 0.5
    for floor in range(house.floors):
        base = 0.45 + 2.9 * floor
        for i in range(round(house.width / house.bay)):
            x = house.first_window + i * house.bay
            glass = "glass_curtain" if rng.random() < 0.3 else "glass"
            if floor == 0 and i == house.door_bay:
                out.append(("door", x - 0.52, x + 0.52, 0.12, 2.45, house.door))
            elif floor == 0 and shop:
                out.append(("window", x - 0.42 * house.bay, x + 0.42 * house.bay, base + 0.25, base + 2.25, "glass"))
            else:
                out.append(("window", x - half, x + half, base + 0.85, base + 2.35, glass))
    return out


def _front(add, wall: str, house: House, openings: list) -> None:
    """Fill the front around its openings, cell by cell of the grid that their edges make."""
    plinth = 0.45
    xs = np.unique(np.round([0, house.width] + [x for o in openings for x in o[1:3]], 4))
    zs = np.unique(np.round([_BELOW, plinth, house.eaves] + [z for o in openings for z in o[3:5]], 4))
    for x0, x1 in itertools.pairwise(xs):
        for z0, z1 in itertools.pairwise(zs):
            x, z = (x0 + x1) / 2, (z0 + z1) / 2
            if any(o[1] < x < o[2] and o[3] < z < o[4] for o in openings):
                continue
            if z < plinth:
                # The plinth stands 3 cm proud of the wall; its ends and its top close the step.
                y = -0.03
                add("plinth", [(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)])
                add(
                    "plinth",
                    [(x0, 0, z0), (x0, y, z0), (x0, y, z1), (x0, 0, z1)],
                    [(x1, y, z0), (x1, 0, z0), (x1, 0, z1), (x1, y, z1)],
                )
                if z1 >= plinth:
                    add("plinth", [(x0, y, z1), (x1, y, z1), (x1, 0, z1), (x0, 0, z1)])
            else:
                add(wall, [(x0, 0, z0), (x1, 0, z0), (x1, 0, z1), (x0, 0, z1)])


def _opening(add, wall: str, kind: str, x0: float, x1: float, z0: float, z1: float, material: str) -> None:
    r = 0.22 if kind == "door" else 0.14
    # Reveals: the four sides of the hole.
    add(wall, [(x0, 0, z0), (x0, r, z0), (x0, r, z1), (x0, 0, z1)], [(x1, r, z0), (x1, 0, z0), (x1, 0, z1), (x1, r, z1)])
    add(wall, [(x0, r, z1), (x1, r, z1), (x1, 0, z1), (x0, 0, z1)], [(x0, 0, z0), (x1, 0, z0), (x1, r, z0), (x0, r, z0)])
    if kind == "door":
        add(material, [(x0, r, z0), (x1, r, z0), (x1, r, z1), (x0, r, z1)])
        _slab(add, material, (x0 + 0.15, r - 0.03, z0 + 0.2), (x1 - 0.15, r, z0 + 1.0))
        _slab(add, "glass", (x0 + 0.2, r - 0.02, z0 + 1.2), (x1 - 0.2, r - 0.005, z1 - 0.2))
        _slab(add, "gutter_zinc", (x1 - 0.14, r - 0.08, z0 + 1.02), (x1 - 0.10, r, z0 + 1.14))
        _slab(add, "stone", (x0 - 0.1, -0.35, _BELOW), (x1 + 0.1, 0.0, z0))
        return
    add(material, [(x0, r, z0), (x1, r, z0), (x1, r, z1), (x0, r, z1)])
    frame, depth = 0.06, 0.05
    bars = [(x0, x0 + frame, z0, z1), (x1 - frame, x1, z0, z1), (x0, x1, z0, z0 + frame), (x0, x1, z1 - frame, z1)]
    bars.append(((x0 + x1) / 2 - 0.03, (x0 + x1) / 2 + 0.03, z0, z1))
    bars.append((x0, x1, z0 + 0.68 * (z1 - z0) - 0.025, z0 + 0.68 * (z1 - z0) + 0.025))
    for a, b, c, e in bars:
        _slab(add, "wood_white", (a, r - depth, c), (b, r - 0.004, e))
    _slab(add, "stone", (x0 - 0.08, -0.07, z0 - 0.07), (x1 + 0.08, r, z0 + 0.005))


def _slab(add, material: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
    (x0, y0, z0), (x1, y1, z1) = low, high
    add(
        material,
        [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
        [(x0, y1, z0), (x1, y1, z0), (x1, y0, z0), (x0, y0, z0)],
        [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        [(x1, y1, z0), (x0, y1, z0), (x0, y1, z1), (x1, y1, z1)],
        [(x0, y1, z0), (x0, y0, z0), (x0, y0, z1), (x0, y1, z1)],
        [(x1, y0, z0), (x1, y1, z0), (x1, y1, z1), (x1, y0, z1)],
    )
