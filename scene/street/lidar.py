"""A spinning LiDAR on the roof: rings of rays, ranges with noise.

Modelled on a common 64-ring scanner (0.42 degrees between rings), with more rings on top up to +15 degrees, so that
facades are covered as well. What is left out:
the scanner does not move while it turns, there is no beam divergence, no drop-out on glass or dark paint, no intensity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range

from ..transforms import transform_points, transform_vectors
from .rays import RayScene

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class LidarSettings:
    """The scanner.

    Attributes
    ----------
    rings : int
        Rays above one another, evenly spaced in elevation.
    lowest_deg, highest_deg : float
        Elevation of the first and the last ring.
    step_deg : float
        Between two azimuths.
    shortest, longest : float
        Ranges kept [m]; what is closer belongs to the ego vehicle.
    range_sigma : float
        Standard deviation of a range [m].
    """

    rings: int = 96
    lowest_deg: float = -25.0
    highest_deg: float = 15.0
    step_deg: float = 0.2
    shortest: float = 2.0
    longest: float = 80.0
    range_sigma: float = 0.01

    def __post_init__(self) -> None:
        check_range("rings", self.rings, "[1, 1024]")
        check_range("step_deg", self.step_deg, "(0, 90]")
        check_range("range_sigma", self.range_sigma, "[0, 1]")

    def directions(self) -> NDArray[np.float64]:
        """Return unit vectors (N, 3) in the scanner's frame, ring by ring."""
        elevation = np.radians(np.linspace(self.lowest_deg, self.highest_deg, self.rings))
        azimuth = np.radians(np.arange(-180, 180, self.step_deg))
        e, a = (v.ravel() for v in np.meshgrid(elevation, azimuth, indexing="ij"))
        return np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


@dataclass(frozen=True)
class Sweep:
    """Points (N, 3) in the scanner's frame [m], and the instance each one lies on (0 = static)."""

    points: NDArray[np.float32]
    instance: NDArray[np.int32]


def sweep(scene: RayScene, T_world_scanner: Floats, rng: np.random.Generator, settings: LidarSettings | None = None) -> Sweep:
    """Return one turn of the scanner in a scene."""
    settings = settings or LidarSettings()
    d = settings.directions()
    hits = scene.cast(np.broadcast_to(T_world_scanner[:3, 3], d.shape), transform_vectors(T_world_scanner, d))
    # One draw per ray, hit or not, so that the noise of a ray does not depend on what the others meet.
    noise = rng.normal(0.0, settings.range_sigma, len(d))
    kept = (hits.distance >= settings.shortest) & (hits.distance <= settings.longest)
    points = d[kept] * (hits.distance[kept] + noise[kept])[:, None]
    return Sweep(points.astype(np.float32), hits.instance[kept])


def to_world(T_world_scanner: Floats, points: Floats) -> NDArray[np.float64]:
    """Return a sweep's points in the world."""
    return transform_points(T_world_scanner, points.astype(np.float64))
