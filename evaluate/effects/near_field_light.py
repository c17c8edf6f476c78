"""Lamps that were believed infinitely far, and are not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import DirectionalLight, PointLight, Simulation

from ..kernels.fragments import DIRECTIONAL, LAMP_KIND, LAMP_PLACE, LAMP_POWER, POINT
from ..mismatch.case import Case
from ..mismatch.corrections import rgb
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, relight


class NearFieldLight(Effect):
    id = "near_field_light"
    stage = "light"
    title = "lamps that stand near"
    says = "brightness falls off across the scene away from each lamp, and shadows spread"
    taken_for = ("vignetting", "light_colour")
    decides = "move a card towards and away from the lamp: the irradiance of a far one stays"
    coordinates = "lamp"
    settles = True

    def targets(self, case: Case) -> list[str | None]:
        return [None] if np.any(case.lamps[:, LAMP_KIND] == DIRECTIONAL) else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # Its inverse: 0 is what was believed.
        p = case.pieces.position[case.pieces.shape >= 0]
        size = float(np.linalg.norm(np.quantile(p, 0.95, axis=0) - np.quantile(p, 0.05, axis=0)))
        return (Parameter("inverse_distance", 0.2 / size, 0.0, 5.0 / size, 0.01 / size, "1/m"),)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        q = values["inverse_distance"]
        if q <= 1e-6:
            return
        far = state.lamps[:, LAMP_KIND] == DIRECTIONAL
        state.lamps[far, LAMP_PLACE : LAMP_PLACE + 3] /= q
        state.lamps[far, LAMP_POWER:] /= q * q
        state.lamps[far, LAMP_KIND] = POINT
        relight(case, state, points=2)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"distance": {"value": 1 / max(float(values["inverse_distance"]), 1e-9), "unit": "m"}}

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        distance, lights = 1 / max(float(values["inverse_distance"]), 1e-9), dict(simulation.lights)
        for name, light in lights.items():
            if isinstance(light, DirectionalLight):
                at = -distance * np.array(light.direction) / np.linalg.norm(light.direction)
                lights[name] = PointLight(rgb(at), rgb(distance**2 * np.array(light.irradiance)))
        return replace(simulation, lights=lights)
