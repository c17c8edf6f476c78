"""Light from all around that nobody believed in."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, open_sky


class AmbientLight(Effect):
    id = "ambient_light"
    stage = "light"
    title = "light from all around"
    says = "shadows are lifted in proportion to albedo and to the open sky above them, and so is what lies beyond the world"
    taken_for = ("interreflection", "glare", "participating_medium")
    decides = "take a picture with all lamps off"
    coordinates = "surface"

    def targets(self, case: Case) -> list[str | None]:
        return [None] if not case.environment.any() else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        level = float(np.median(case.pictures[case.valid]))
        return tuple(Parameter(f"radiance.{c}", 0.0, 0.0, 100 * level + 1, 0.02 * level + 1e-4, "W/(m² sr)") for c in "rgb")

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        radiance = np.array([values[f"radiance.{c}"] for c in "rgb"])
        state.add_ambient(open_sky(case)[:, None] * radiance)
        state.sky = state.sky + radiance
