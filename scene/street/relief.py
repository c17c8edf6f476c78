"""The height of the ground everywhere: camber, gutters, kerbs, undulation, ruts, cracks, patches and hollows."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..grid import GroundGrid
from . import layout as at
from .patterns import Pattern, slab_joints, smoothstep

Floats = NDArray[np.floating]
_CELL = 0.025


class Relief:
    """The true height field.

    A profile across the street (`np.interp` over its corners, so that the kerb's face is the one slope between two
    of them) plus an undulation along it plus a map of details. `height` is the exact surface; meshes sample it.
    """

    def __init__(self, wear: at.Damage, rng: np.random.Generator) -> None:
        self._y, self._z = _profile()
        self.grid = GroundGrid(
            at.X_BACK,
            at.WALL_RIGHT,
            _CELL,
            int(np.ceil((at.WALL_LEFT - at.WALL_RIGHT) / _CELL)),
            int((at.X_END - at.X_BACK) / _CELL),
        )
        self.crack_map = _crack_map(self.grid, wear)
        self.detail = _detail(self.grid, wear, self.crack_map, rng)

    @property
    def lines_y(self) -> NDArray[np.float64]:
        """Corners of the profile, which a mesh must not miss (ascending)."""
        return self._y

    def along(self, x: Floats) -> Floats:
        """Return the undulation along the street [m]: a few centimetres over ten metres, so that gutters have sags."""
        return 0.030 * np.sin(2 * np.pi * (x - 3.5) / 26.0) + 0.012 * np.sin(2 * np.pi * (x + 1.0) / 9.7) + 0.0015 * x

    def height(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Return z of the ground at world x, y of any common shape [m]."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        points = np.column_stack([x.ravel(), y.ravel()])
        inside = (y >= at.WALL_RIGHT) & (y <= at.WALL_LEFT)
        detail = np.where(inside, self.grid.sample(self.detail, points).reshape(x.shape), 0.0)
        return np.interp(y, self._y, self._z) + self.along(x) + detail


def _profile() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners (y, z) of the cross-section; crown 7 cm above the left edge of the carriageway."""
    road_y = np.linspace(at.ROAD_RIGHT + at.GUTTER, at.ROAD_LEFT - at.GUTTER, 45)
    road_z = np.where(road_y > 0, -0.07 * (road_y / 3.5) ** 2, -0.12 * (np.abs(road_y) / 5.6) ** 1.7)
    corners = list(zip(road_y, road_z, strict=True))
    for side, edge in ((1, at.ROAD_LEFT), (-1, at.ROAD_RIGHT)):
        edge_z = -0.07 if side > 0 else -0.12
        floor = edge_z - 0.012
        # Gutter: a shallow dish of concrete, lowest 10 cm from the kerb.
        corners += [(edge - side * 0.2, floor + 0.004), (edge - side * 0.1, floor), (edge, floor + 0.004)]
        top = floor + 0.004 + at.KERB_HEIGHT
        # Face leaning by 5 mm, a 2 cm bevel, the top falling 2 % towards the road.
        corners += [(edge + side * 0.005, top - 0.02), (edge + side * 0.025, top), (edge + side * at.KERB_WIDTH, top + 0.003)]
        wall = at.WALL_LEFT if side > 0 else at.WALL_RIGHT
        inner = edge + side * at.KERB_WIDTH
        if side > 0:
            corners += [
                (inner + 0.03, top - 0.01),
                (0.5 * (at.GRASS[0] + at.GRASS[1]), top + 0.02),
                (at.GRASS[1] - 0.03, top + 0.03),
            ]
            corners += [(at.GRASS[1], top + 0.04)]
            inner = at.GRASS[1]
        base = corners[-1][1]
        corners += [(wall, base + 0.02 * abs(wall - inner)), (side * at.OUTER, base + 0.02 * abs(wall - inner))]
    corners.sort()
    y, z = np.array(corners).T
    return y, z


def _crack_map(grid: GroundGrid, wear: at.Damage) -> NDArray[np.float32]:
    """Return how close the nearest crack is: 1 on it, falling as a Gaussian of 2 cm."""
    lines = np.zeros(grid.shape, np.uint8)
    for crack in wear.cracks:
        col_row = (crack - (grid.x_min, grid.y_min)) / grid.cell - 0.5
        cv2.polylines(lines, [np.round(col_row * 16).astype(np.int32)], False, 255, 1, cv2.LINE_8, shift=4)
    distance = cv2.distanceTransform(255 - lines, cv2.DIST_L2, 5) * grid.cell
    return np.exp(-0.5 * (distance / 0.02) ** 2).astype(np.float32)


def _detail(grid: GroundGrid, wear: at.Damage, cracks: NDArray, rng: np.random.Generator) -> NDArray[np.float32]:
    x = grid.x_min + (np.arange(grid.cols) + 0.5) * grid.cell
    y = grid.y_min + (np.arange(grid.rows) + 0.5) * grid.cell
    # The kerb and its face stay exact, so that 12 cm are 12 cm.
    left, right = at.ROAD_LEFT - 0.03, at.ROAD_RIGHT + 0.03
    on_road = (smoothstep(right, right + 0.05, y) * smoothstep(-left, -left + 0.05, -y))[:, None]
    on_side = (
        smoothstep(at.GRASS[0], at.GRASS[0] + 0.06, y) + smoothstep(-at.PAVEMENT_RIGHT[1], -at.PAVEMENT_RIGHT[1] + 0.06, -y)
    )[:, None]
    on_grass = ((y > at.GRASS[0]) & (y < at.GRASS[1]))[:, None] * on_side
    waves = Pattern(16.0, _CELL, 0.25, 5.0, rng, slope=1.6).at(x, y)
    grain = Pattern(8.0, _CELL, 0.05, 0.25, rng, slope=1.0).at(x, y)
    blades = Pattern(8.0, _CELL, 0.06, 0.6, rng, slope=0.7).at(x, y)
    wheel_lines = [lane + side * 0.75 for lane in (at.LANE_EGO, at.LANE_ONCOMING) for side in (-1, 1)]
    ruts = np.exp(-0.5 * ((y[:, None] - wheel_lines) / 0.22) ** 2).sum(axis=1)
    wander = 0.65 + 0.35 * np.sin(2 * np.pi * x / 17.3 + 1.0)
    road = 0.0035 * waves + 0.0006 * grain - 0.012 * ruts[:, None] * wander - 0.004 * cracks
    for x0, y0, x1, y1 in wear.patches:
        patch = smoothstep(x0 - 0.03, x0 + 0.03, x) * smoothstep(-x1 - 0.03, -x1 + 0.03, -x)
        road -= 0.006 * np.outer(smoothstep(y0 - 0.03, y0 + 0.03, y) * smoothstep(-y1 - 0.03, -y1 + 0.03, -y), patch)
    near = slice(*np.searchsorted(x, [at.LID[0] - 0.6, at.LID[0] + 0.6]))
    lid_r = np.hypot(x[near] - at.LID[0], (y - at.LID[1])[:, None])
    road[:, near] -= 0.012 * np.exp(-0.5 * ((lid_r - at.LID[2]) / 0.02) ** 2) + 0.004 * (lid_r < at.LID[2])
    for gx, edge in at.GULLIES:
        side = np.sign(edge)
        near = smoothstep(-0.5, -0.2, -np.abs(x - gx))[None] * smoothstep(0.0, 0.2, side * (y - edge) + 0.5)[:, None]
        road -= 0.02 * near
    slabs, _ = slab_joints(x, y, width=0.03)
    side_detail = 0.0025 * waves + 0.0003 * grain - 0.003 * slabs
    detail = road * on_road + side_detail * on_side * (1 - on_grass) + (0.012 * blades + 0.01 * waves) * on_grass
    paved = on_road + on_side * (1 - on_grass)
    for hx, hy, radius, depth in wear.hollows:
        # An oval bowl, longer along the traffic; separable, and nothing beyond four of its widths.
        near = slice(*np.searchsorted(x, [hx - 4 * radius, hx + 4 * radius]))
        bowl = np.exp(-(((y - hy) / (0.6 * radius)) ** 2))[:, None] * np.exp(-(((x[near] - hx) / (1.3 * radius)) ** 2))[None]
        detail[:, near] -= depth * bowl * paved
    return detail.astype(np.float32)
