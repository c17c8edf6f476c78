"""A sensor that is not linear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..mismatch.case import Case
from ..mismatch.corrections import with_power
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State


class SensorResponse(Effect):
    id = "sensor_response"
    stage = "sensor"
    title = "a response that is not linear"
    says = "the recording is a fixed curve of the predicted radiance, whatever and wherever it is"
    taken_for = ("glare", "saturation", "participating_medium")
    decides = "photograph a grey card at several exposures"
    coordinates = "radiance"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("gamma", 1.0, 0.2, 5.0, 0.01),)

    def _middle(self, case: Case) -> float:
        if "middle" not in case.cache:
            case.cache["middle"] = float(np.median(case.pictures[case.valid])) + 1e-4
        return case.cache["middle"]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # radiance^gamma, held at a middle level so that it is not taken for a factor; albedos take up the rest.
        middle, gamma = self._middle(case), float(values["gamma"])
        floor = 1e-5 * middle
        state.sensor.append(lambda p: (middle * (np.maximum(p, floor) / middle) ** gamma).astype(np.float32))

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        if simulation.sensor.response != "linear":
            return None
        # middle (p / middle)^gamma = (c p)^gamma with c = middle^(1 / gamma - 1): lamps take up the factor.
        gamma = float(values["gamma"])
        power = np.full(3, self._middle(case) ** (1 / gamma - 1))
        lit = with_power(simulation, dict.fromkeys(simulation.lights, power))
        return replace(lit, sensor=replace(simulation.sensor, response="gamma", gamma=1 / gamma))


class PowerLaw(SensorResponse):
    """The response that a simulation believes: value ** gamma, held at 1."""

    def _middle(self, case: Case) -> float:
        return 1.0
