"""Spray behind the wheels of moving vehicles, as an extinction that adds to the mist's.

How much: a tyre of width b on water of depth h meets rho b h kilograms on each metre (the form of Weir, Strange and Heffley 1978,
who part it into bow wave, side waves, tread pickup and film); `airborne_share` of it flies as spray. How coarse: the drops' mean
diameter is 0.8 mm at a Weber number of 2700 and falls with its root (Radovich's thesis, measured behind a grooved tyre), which is
with 1 / speed. How wide: length scales of a vehicle's wake grow with the fourth root of the distance (Eskridge and Hunt 1979),
and its air follows the vehicle, here at an even share of its speed. How long: drops of d fall at 4000 d per second (Rogers and
Yau 1989, 0.08 to 1.2 mm), out of a cloud that the wake's turbulence keeps mixed: its mass falls by 1/e in
`sigma_up sqrt(pi / 2) / fall`.

Light meets the drops' geometric cross-section, 1.5 M / (rho d) for M kg/m^3: what they diffract, as much again, leaves within
half a degree and cannot be told from light that was not scattered.

The optical amount of a wake, density times length, thus grows with the third power of the speed. Its total mass is
airborne flow x lifetime. What no source gives (`airborne_share`, `carried`, the spreads) is chosen, so that M behind a car at
90 km/h on 1 mm of water is about 0.01 kg/m^3: the FHWA's assessment tool (FHWA-HRT-15-062) predicts up to 0.03 in heavy rain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range

from ..kernels import wakes as kernel
from .wake_settings import WakeSettings

_WATER, _SURFACE_TENSION = 1000.0, 0.0728  # [kg/m^3], [N/m]
_DIAMETER, _WEBER = 0.0008, 2700.0
_FALL = 4000.0  # [1/s]
_LARGEST = 0.0012  # where that law ends [m]
# Where a wake is cut off, in lengths of 1/e.
_REACH = 6.0
# Rear axle before the tail, in lengths of the vehicle; height of a wheel's hub [m].
_OVERHANG, _HUB = 0.2, 0.3


@dataclass(frozen=True)
class MovingVehicle:
    """A vehicle of one frame.

    Attributes
    ----------
    name : str
        Of its track.
    centre : (2,) float64
        Middle of its footprint [m].
    velocity : (2,) float64
        Level [m/s].
    size : (3,) float64
        Length, width, height [m].
    """

    name: str
    centre: NDArray[np.float64]
    velocity: NDArray[np.float64]
    size: NDArray[np.float64]

    @property
    def speed(self) -> float:
        return float(np.hypot(*self.velocity))

    def tyres(self, settings: WakeSettings) -> NDArray[np.float64]:
        """Return where its rear tyres stand (2, 2): in their tracks the front ones have gone before."""
        ahead = self.velocity / self.speed
        left = np.array([-ahead[1], ahead[0]])
        axle = self.centre - (0.5 - _OVERHANG) * self.size[0] * ahead
        half = 0.5 * max(self.size[1] - settings.tyre_width, settings.tyre_width)
        return np.stack([axle + half * left, axle - half * left])


def droplet_diameter(speed: float, settings: WakeSettings = WakeSettings()) -> float:
    """Return the mean diameter of the drops that a tyre throws up at a speed [m/s] above 0 [m].

    Examples
    --------
    >>> [round(1e6 * droplet_diameter(v)) for v in (6.0, 12.0, 24.0)]
    [797, 399, 199]
    """
    check_range("speed", speed, "(0, inf)")
    weber = _WATER * speed**2 * settings.groove_width / _SURFACE_TENSION
    return min(_DIAMETER * (weber / _WEBER) ** -0.5, _LARGEST)


def lifetime(speed: float, height: float, settings: WakeSettings = WakeSettings()) -> float:
    """Return how long the spray behind a vehicle of some height [m] stays in the air, to 1/e [s]."""
    return settings.spread_up * height * float(np.sqrt(np.pi / 2)) / (_FALL * droplet_diameter(speed, settings))


def airborne_flow(speed: float, depth: float, settings: WakeSettings = WakeSettings()) -> float:
    """Return the water that one tyre throws into the air from a film of some depth [m] [kg/s]."""
    return settings.airborne_share * _WATER * settings.tyre_width * depth * speed


def wakes_of(
    vehicle: MovingVehicle, depth: float, amount: float = 1.0, settings: WakeSettings = WakeSettings()
) -> NDArray[np.float64]:
    """Return the wakes of a vehicle's tyres as the kernels take them.

    Parameters
    ----------
    depth : float
        Of the water that they run through [m].
    amount : float
        Factor on all of it.

    Returns
    -------
    wakes : (2 or 0, COLUMNS) float64
        None of a vehicle that is slower than `settings.slowest`, or on a road without water.
    """
    check_range("depth", depth, "[0, inf)")
    check_range("amount", amount, "[0, inf)")
    v = vehicle.speed
    if v < settings.slowest or depth * amount * settings.airborne_share == 0:
        return np.zeros((0, kernel.COLUMNS))
    height = float(vehicle.size[2])
    # The air takes the drops along: as they leave more slowly than the vehicle drives away, more of them are on a metre.
    away = (1 - settings.carried) * v
    per_metre = amount * airborne_flow(v, depth, settings) / away
    optical = 1.5 * per_metre / (_WATER * droplet_diameter(v, settings))
    fades = away * lifetime(v, height, settings)
    back = -vehicle.velocity / v
    widths = (0.5 * settings.tyre_width, _HUB, settings.spread_across * height, settings.spread_up * height, height)
    return np.array([(*tyre, *back, _REACH * fades, optical, fades, *widths) for tyre in vehicle.tyres(settings)])


def box_of(wakes: NDArray[np.float64], lowest: float, highest: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of the box of all wakes over ground from `lowest` to `highest`; high below low without any."""
    if len(wakes) == 0:
        return np.full(3, np.inf), np.full(3, -np.inf)
    start, reach = wakes[:, [kernel.X, kernel.Y]], wakes[:, kernel.REACH]
    end = start + reach[:, None] * wakes[:, [kernel.BACK_X, kernel.BACK_Y]]
    grown = np.sqrt(reach / wakes[:, kernel.VEHICLE])
    across = kernel.CUT * np.sqrt(wakes[:, kernel.WIDTH] ** 2 + wakes[:, kernel.ACROSS] ** 2 * grown)
    up = kernel.CUT * np.sqrt(wakes[:, kernel.HEIGHT] ** 2 + wakes[:, kernel.UP] ** 2 * grown)
    low = (np.minimum(start, end) - across[:, None]).min(axis=0)
    high = (np.maximum(start, end) + across[:, None]).max(axis=0)
    return np.array([*low, lowest]), np.array([*high, highest + up.max()])
