"""What is in the air of a frame: mist over the ground, and spray behind the wheels of moving vehicles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.scene_file import Scene
from scene.wetting.spray import spray_over
from scene.wetting.vehicle_motion import moving_vehicles
from scene.wetting.wakes import MovingVehicle, wakes_of

from .augment_settings import AugmentSettings
from .kernels.media import MediumArrays
from .media import compile_spray
from .projected_world import vehicle_footprint

# Over this length behind a tyre the water that it ran through is averaged, at so many places [m].
_TRACK, _PLACES = 4.0, 17


@dataclass(frozen=True)
class Air:
    """What drifts over a scene's drive: `vehicles` per frame, none where no spray is asked for."""

    scene: Scene
    settings: AugmentSettings
    vehicles: list[list[MovingVehicle]]

    @property
    def is_clear(self) -> bool:
        return self.settings.mist <= 0 and self.settings.wheel_spray <= 0

    def at(self, frame: int, water: NDArray[np.float32]) -> MediumArrays | None:
        """Return the air of a frame over a water level W (rows, cols) on the scene's grid; None if it is always clear."""
        if self.is_clear:
            return None
        s = self.settings
        wakes = [wakes_of(v, self.depth_behind(v, water), s.wheel_spray, s.wakes) for v in self.vehicles[frame]]
        return _air(self.scene, s, np.concatenate(wakes) if wakes else None)

    def depth_behind(self, vehicle: MovingVehicle, water: NDArray[np.float32]) -> float:
        """Return the mean depth of the water [m] in the tracks that a vehicle's tyres have just left.

        The lower half of W fills pores and throws up nothing; its upper half, accumulation, stands on the street.
        """
        back = -_TRACK * np.linspace(0, 1, _PLACES)[:, None] * vehicle.velocity / vehicle.speed
        places = (vehicle.tyres(self.settings.wakes)[:, None] + back).reshape(-1, 2)
        level = self.scene.grid.sample(np.clip(water, 0, 1), places)
        return self.settings.wakes.film_depth * float(np.clip(2 * level - 1, 0, 1).mean())

    def figures(self, frame: int, water: NDArray[np.float32]) -> list[dict[str, Any]]:
        """Return, for the record, how fast each vehicle of a frame was taken to be, and how deep the water behind it."""
        return [{"track": v.name, "speed": v.speed, "water_depth": self.depth_behind(v, water)} for v in self.vehicles[frame]]


def mist_over(scene: Scene, settings: AugmentSettings) -> MediumArrays | None:
    """Return the mist over a scene's ground, without wheel spray, or None if the settings have none."""
    return _air(scene, settings, None) if settings.mist > 0 else None


def _air(scene: Scene, settings: AugmentSettings, wakes: NDArray[np.float64] | None) -> MediumArrays:
    return compile_spray(spray_over(scene.maps["height"], scene.grid, settings.mist, settings.spray, settings.seed, wakes))


def air_over(scene: Scene, settings: AugmentSettings) -> Air:
    """Return the air over a scene's drive."""
    asked = settings.wheel_spray > 0
    empty: list[list[MovingVehicle]] = [[] for _ in scene.recording.frames]
    return Air(scene, settings, moving_vehicles(scene, vehicle_footprint, settings.wakes) if asked else empty)
