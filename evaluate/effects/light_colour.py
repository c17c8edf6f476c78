"""Lamps whose power or colour differs from what was believed."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..kernels.fragments import LAMP_POWER
from ..mismatch.case import Case
from ..mismatch.corrections import with_power
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State


class LightColour(Effect):
    id = "light_colour"
    stage = "light"
    title = "lamps of differing power or colour"
    says = "pictures under one lamp are off by a factor per channel that is the same wherever the camera stands"
    taken_for = ("exposure_drift", "albedo_error")
    decides = "photograph a grey card under each lamp with a fixed exposure"
    coordinates = "lamp"

    def targets(self, case: Case) -> list[str | None]:
        return [None] if len(case.lamp_names) > 1 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        used = np.unique(case.slots[case.slots >= 0])
        return tuple(
            Parameter(f"log_factor.{case.lamp_names[i]}.{c}", 0.0, -3.0, 3.0, 0.01, spread=0.3) for i in used for c in "rgb"
        )

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        for i, name in enumerate(case.lamp_names):
            for k, c in enumerate("rgb"):
                state.lamps[i, LAMP_POWER + k] *= np.exp(values.get(f"log_factor.{name}.{c}", 0.0))

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        factors = {name: np.exp([values.get(f"log_factor.{name}.{c}", 0.0) for c in "rgb"]) for name in case.lamp_names}
        return with_power(simulation, factors)
