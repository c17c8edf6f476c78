"""A virtual windshield before the camera, and the drops on it, which stay on the glass from frame to frame (6.3.5).

Glass coordinates [m]: u to the camera's right, v down along the glass, n off it, outwards; the origin lies on the camera's
axis. Drops are spherical caps of one contact angle, told by the radius of their base: they fall on the glass by chance,
merge where they meet, stick while they are small, and run down, drinking what they meet and leaving small drops behind,
when they are not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError

from ..camera import Camera
from .windshield_settings import WindshieldSettings

# Drops of the trail, and of what is left on the glass, in radii of the drop that leaves them; every so many radii.
_TRAIL_RADIUS, _TRAIL_STEP = 0.18, 2.5
# Beyond the picture's edge drops still count, as far as the lens sees round it, and above, where they come from [m].
_MARGIN = 0.015


@dataclass(frozen=True)
class Drops:
    """Drops on the glass.

    Attributes
    ----------
    centres : (N, 2) float64
        u and v [m].
    radii : (N,) float64
        Of their bases [m].
    """

    centres: NDArray[np.float64]
    radii: NDArray[np.float64]


@dataclass(frozen=True)
class Glass:
    """The part of the windshield that a camera looks through.

    Attributes
    ----------
    T_camera_glass : (4, 4) float64
        Glass coordinates to the camera's.
    low, high : (2,) float64
        Corners in u and v [m].
    """

    T_camera_glass: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def area(self) -> float:
        return float(np.prod(self.high - self.low))


def glass_before(camera: Camera, settings: WindshieldSettings) -> Glass:
    """Return the glass that a camera looks through.

    Raises
    ------
    InputError
        If the camera is no pinhole, or looks past the glass: its lowest ray must be steeper than the glass.
    """
    if camera.model != "PINHOLE":
        raise InputError("be a PINHOLE", got=camera.model, key="camera", remedy="Undistort the images first.")
    a = np.radians(settings.inclination_deg)
    T = np.eye(4)
    # n = u x v; upright glass (90 degrees) would have v = y and n = z
    T[:3, :3] = np.column_stack([(1, 0, 0), (0, np.sin(a), np.cos(a)), (0, -np.cos(a), np.sin(a))])
    T[:3, 3] = (0, 0, settings.distance)
    corners = np.array([(x, y) for x in (0, camera.width) for y in (0, camera.height)], float)
    d = np.column_stack([(corners - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(4)])
    towards = d @ T[:3, 2]
    if towards.min() <= 0.1:
        remedy = "Raise inclination_deg."
        raise InputError("meet the glass", got=f"a ray {d[:, 1].max():.2f} below the axis", key="the picture", remedy=remedy)
    hits = d * (settings.distance * T[2, 2] / towards)[:, None]
    uv = (hits - T[:3, 3]) @ T[:3, :2]
    margin = _MARGIN + 2 * settings.aperture_radius
    return Glass(T, uv.min(axis=0) - margin, uv.max(axis=0) + margin)


class Windshield:
    """The drops on a glass over time: frame by frame, the same for the same seed, whatever frames are asked for.

    Parameters
    ----------
    glass : Glass
    amount : float
        D, from 0 (none) to 1.
    settings : WindshieldSettings
    seed : int

    Examples
    --------
    >>> camera = Camera("PINHOLE", 64, 24, np.eye(4), 50.0, 50.0, 32.0, 12.0)
    >>> shield = Windshield(glass_before(camera, WindshieldSettings()), 0.5)
    >>> bool(len(shield.at(3).radii) > 10)
    True
    """

    def __init__(self, glass: Glass, amount: float, settings: WindshieldSettings = WindshieldSettings(), seed: int = 0) -> None:
        check_range("amount", amount, "[0, 1]")
        self.glass, self.amount, self.settings, self.seed = glass, amount, settings, seed
        self._frame = -1
        self._drops = Drops(np.zeros((0, 2)), np.zeros(0))

    def at(self, frame: int) -> Drops:
        """Return the drops at a frame of the drive; going on from the frame asked for last is cheap, going back is not."""
        check_range("frame", frame, "[0, inf)")
        if frame < self._frame:
            self._frame, self._drops = -1, Drops(np.zeros((0, 2)), np.zeros(0))
        while self._frame < frame:
            self._frame += 1
            self._step(np.random.default_rng([self.seed & 0xFFFFFFFF, self._frame]))
        return self._drops

    def _step(self, rng: np.random.Generator) -> None:
        s = self.settings
        per_area = s.density if self._frame == 0 else s.arrivals * s.frame_time
        count = rng.poisson(self.amount * per_area * self.glass.area)
        fresh = Drops(
            rng.uniform(self.glass.low, self.glass.high, (count, 2)),
            1e-3 * s.radius_mm * np.exp(s.spread * rng.standard_normal(count)),
        )
        drops = merged(_joined(self._drops, fresh), s.cohesion)
        drops = run_down(drops, s, s.frame_time, rng)
        gone = drops.centres[:, 1] > self.glass.high[1] + 0.01
        self._drops = Drops(drops.centres[~gone], drops.radii[~gone])


def merged(drops: Drops, cohesion: float) -> Drops:
    """Return the drops with those that touch made one, at their centre of mass, until none touch; no water is lost."""
    while len(drops.radii) > 1:
        pairs = cKDTree(drops.centres).query_pairs(2 * cohesion * float(drops.radii.max()), output_type="ndarray")
        i, j = pairs.T
        near = np.linalg.norm(drops.centres[i] - drops.centres[j], axis=1) < cohesion * (drops.radii[i] + drops.radii[j])
        if not near.any():
            break
        n = len(drops.radii)
        graph = coo_array((np.ones(near.sum()), (i[near], j[near])), shape=(n, n))
        count, label = connected_components(graph, directed=False)
        # Caps of one contact angle: the volume goes with the cube of the radius.
        volume = drops.radii**3
        total = np.bincount(label, volume, count)
        centres = np.column_stack([np.bincount(label, volume * drops.centres[:, k], count) / total for k in (0, 1)])
        drops = Drops(centres, np.cbrt(total))
    return drops


def run_down(drops: Drops, settings: WindshieldSettings, time: float, rng: np.random.Generator) -> Drops:
    """Return the drops after the large ones have run for a time [s], in short steps, with what they met and what they left."""
    left = time
    sticks = 1e-3 * settings.sticks_mm
    while left > 0:
        runs = drops.radii > sticks
        if not runs.any() or settings.speed == 0:
            break
        speed = settings.speed * (drops.radii / sticks - 1)
        # No drop passes over another, or farther than it leaves a trail.
        step = min(left, float((_TRAIL_STEP * drops.radii[runs] / np.maximum(speed[runs], 1e-9)).min()))
        left -= step
        trail = Drops(drops.centres[runs], _TRAIL_RADIUS * drops.radii[runs] * rng.uniform(0.6, 1.4, runs.sum()))
        moved = drops.centres.copy()
        moved[runs, 1] += speed[runs] * step
        moved[runs, 0] += 0.15 * speed[runs] * step * rng.standard_normal(runs.sum())
        radii = drops.radii.copy()
        # What stays behind where a drop has moved on by its trail's step, or by less in a share of the cases.
        leaves = rng.uniform(size=runs.sum()) < speed[runs] * step / (_TRAIL_STEP * drops.radii[runs])
        radii[np.flatnonzero(runs)[leaves]] = np.cbrt(radii[runs][leaves] ** 3 - trail.radii[leaves] ** 3)
        behind = trail.centres + rng.normal(0, 0.2, trail.centres.shape) * drops.radii[runs][:, None] * (1, 0)
        behind[:, 1] -= 1.2 * drops.radii[runs]
        drops = merged(Drops(moved, radii), settings.cohesion)
        drops = _joined(drops, Drops(behind[leaves], trail.radii[leaves]))
    return drops


def _joined(a: Drops, b: Drops) -> Drops:
    return replace(a, centres=np.concatenate([a.centres, b.centres]), radii=np.concatenate([a.radii, b.radii]))
