"""A sensor that clips."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State


class Saturation(Effect):
    id = "saturation"
    stage = "sensor"
    title = "a sensor that clips"
    says = "above one level the recording is flat, in all channels alike"
    taken_for = ("specular_lobe", "sensor_response")
    decides = "halve the exposure"
    coordinates = "radiance"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        top = float(np.quantile(case.pictures[case.valid], 0.999)) + 1e-3
        return (Parameter("level", top, 1e-3 * top, 10 * top, 0.01 * top),)

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        values = case.pictures[case.valid]
        return [{"level": float(np.quantile(values, q))} for q in (0.995, 0.97, 0.85)]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        level = np.float32(values["level"])
        state.sensor.append(lambda p: np.minimum(p, level))

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        exposures = {f.exposure for f in case.recording.frames}
        if len(exposures) > 1:
            return None
        level = float(values["level"]) * exposures.pop()
        return replace(simulation, sensor=replace(simulation.sensor, saturation=level))
