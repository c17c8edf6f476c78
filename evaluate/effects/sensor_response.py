"""A sensor that is not linear."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
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

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # radiance^gamma, held at a middle level so that it is not taken for a factor; albedos take up the rest.
        middle, gamma = float(np.median(case.pictures[case.valid])) + 1e-4, float(values["gamma"])
        floor = 1e-5 * middle
        state.sensor.append(lambda p: (middle * (np.maximum(p, floor) / middle) ** gamma).astype(np.float32))
