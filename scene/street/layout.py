"""Where things stand in the street: metres, z up, the road along +x, the left-hand side at positive y."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Across the street. Right-hand traffic: the ego vehicle drives at negative y, beside a parking lane.
ROAD_LEFT, ROAD_RIGHT = 3.5, -5.6
GUTTER = 0.3
KERB_HEIGHT, KERB_WIDTH = 0.12, 0.17
PAVEMENT_RIGHT = (-8.2, ROAD_RIGHT - KERB_WIDTH)
GRASS = (ROAD_LEFT + KERB_WIDTH, 5.2)
PAVEMENT_LEFT = (5.2, 7.5)
WALL_LEFT, WALL_RIGHT = 7.5, -8.2
OUTER = 40.0

# Along the street: coarse behind, fine where the camera looks at its own feet, coarser ahead.
X_BACK, X_NEAR, X_FAR, X_END = -24.0, 0.0, 30.0, 86.0
ROW_END = 70.0

LANE_EGO, LANE_ONCOMING, PARKING = -1.75, 1.75, -4.45
ZEBRA = (17.0, 20.0)
LID = (11.5, -0.75, 0.31)
GULLIES = (
    (-6.0, ROAD_LEFT),
    (-2.0, ROAD_RIGHT),
    (14.2, ROAD_LEFT),
    (12.6, ROAD_RIGHT),
    (43.0, ROAD_LEFT),
    (41.0, ROAD_RIGHT),
    (62.0, ROAD_LEFT),
)
GULLY_SIZE = (0.5, 0.3)
PARKED = (13.6, 24.9, 30.8, 47.0)
TREES = ((6.5, 4.45), (15.8, 4.4), (25.0, 4.5), (34.2, 4.4), (44.0, 4.5), (54.0, 4.4), (-6.0, 4.4))
LAMPS = ((20.9, 4.0), (48.0, 4.0), (-8.0, 4.0))


@dataclass(frozen=True)
class Damage:
    """Wear of the carriageway: polylines of cracks, repaired rectangles, and hollows.

    Attributes
    ----------
    cracks : tuple of (N, 2)
        Corners [m].
    patches : tuple of (x0, y0, x1, y1)
    hollows : (N, 4)
        x, y, radius, depth [m].
    """

    cracks: tuple[NDArray[np.float64], ...]
    patches: tuple[tuple[float, float, float, float], ...]
    hollows: NDArray[np.float64]


def damage(rng: np.random.Generator) -> Damage:
    """Draw the wear: some of it by hand where the camera looks, the rest at random."""
    cracks = [_walk((8.0, -2.9), 0.05, 26, rng), _walk((13.2, 2.9), -1.3, 9, rng), _walk((21.0, -0.1), 0.0, 34, rng)]
    cracks += [_walk((10.2, -3.4), 1.45, 14, rng), _walk((15.6, -0.6), -0.9, 10, rng)]
    for _ in range(22):
        start = (rng.uniform(X_BACK, X_END), rng.uniform(ROAD_RIGHT + 0.5, ROAD_LEFT - 0.5))
        cracks.append(_walk(start, rng.choice([0.0, 1.57]) + rng.normal(0, 0.2), int(rng.integers(8, 30)), rng))
    patches = [(9.2, -3.35, 11.0, -2.3), (23.0, 0.55, 26.5, 1.6), (8.2, -5.2, 9.6, -3.7)]
    patches += [
        (x, y, x + rng.uniform(1, 3), y + rng.uniform(0.7, 1.4)) for x, y in zip((33, 44, 57), rng.uniform(-4, 1.5, 3), strict=True)
    ]
    hollows = [(13.6, -2.75, 1.5, 0.045), (9.4, 0.85, 1.2, 0.040), (16.4, -0.35, 1.2, 0.036), (20.2, -3.4, 1.6, 0.034)]
    hollows += [(12.4, 2.4, 1.3, 0.034), (9.2, -2.2, 1.1, 0.036), (11.6, -4.4, 1.3, 0.030), (18.6, 1.0, 1.2, 0.034)]
    hollows += [(23.2, -0.1, 1.3, 0.034), (10.5, -6.9, 1.0, 0.028), (17.5, -7.2, 1.1, 0.026), (14.0, 6.3, 1.0, 0.026)]
    hollows += [(20.6, -6.6, 0.9, 0.022)]
    for _ in range(36):
        hollows.append((rng.uniform(24, X_END), rng.uniform(-7.8, 3), rng.uniform(0.4, 1.1), rng.uniform(0.008, 0.022)))
    return Damage(tuple(cracks), tuple(patches), np.array(hollows))


def _walk(start: tuple[float, float], heading: float, steps: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a crack: a walk in steps of 12 cm whose heading wanders but keeps its trend."""
    wander = np.zeros(steps)
    for i in range(1, steps):
        wander[i] = 0.75 * wander[i - 1] + rng.normal(0, 0.45)
    angle = heading + wander
    return np.array(start) + np.cumsum(0.12 * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
