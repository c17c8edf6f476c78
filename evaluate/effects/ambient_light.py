"""Light from all around that nobody believed in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import EnvironmentLight, Simulation

from ..mismatch.case import Case
from ..mismatch.corrections import rgb
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

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        radiance = np.array([values[f"radiance.{c}"] for c in "rgb"])
        lights, name = dict(simulation.lights), "ambient"
        for known, light in lights.items():
            if isinstance(light, EnvironmentLight):
                name, radiance = known, radiance + light.radiance
        # A frame that names its lamps would not have a new one among them.
        named = [f.lights for f in case.recording.frames if f.lights is not None]
        if any(name not in on for on in named):
            return None
        return replace(simulation, lights=lights | {name: EnvironmentLight(rgb(radiance))})
