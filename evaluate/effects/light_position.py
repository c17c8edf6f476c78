"""A lamp that was not where it was believed to be."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import DirectionalLight, PointLight, Simulation, SphereLight

from ..kernels.fragments import LAMP_KIND, LAMP_PLACE, POINT
from ..mismatch.case import Case
from ..mismatch.corrections import rgb
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, relight


class LightPosition(Effect):
    id = "light_position"
    stage = "light"
    title = "a lamp in another place"
    says = "under one lamp shadows are shifted and shading is tilted, from all viewpoints alike"
    taken_for = ("near_field_light", "pose_error")
    decides = "measure the lamp's place, or photograph a mirror ball under it"
    coordinates = "lamp"
    settles = True

    def targets(self, case: Case) -> list[str | None]:
        used = [i for i in np.unique(case.slots[case.slots >= 0]) if case.lamps[i, LAMP_KIND] == POINT]
        single = [case.lamp_names[i] for i in used]
        return [None, *single] if len(single) > 1 else [*single]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        names = [target] if target is not None else [t for t in self.targets(case) if t is not None]
        out = []
        for name in names:
            reach = float(np.linalg.norm(case.lamps[case.lamp_names.index(name), LAMP_PLACE : LAMP_PLACE + 3]))
            # A shadow must move by a good part of a pixel to be seen to move.
            out += [Parameter(f"{a}.{name}", 0.0, -reach, reach, 0.006 * reach, "m") for a in ("dx", "dy", "dz")]
        return tuple(out)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        for i, name in enumerate(case.lamp_names):
            d = [values.get(f"{a}.{name}", 0.0) for a in ("dx", "dy", "dz")]
            state.lamps[i, LAMP_PLACE : LAMP_PLACE + 3] += d
        relight(case, state)

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        lights = dict(simulation.lights)
        for name in case.lamp_names:
            light, d = lights[name], np.array([values.get(f"{a}.{name}", 0.0) for a in ("dx", "dy", "dz")])
            if isinstance(light, PointLight | SphereLight):
                lights[name] = replace(light, position=rgb(np.array(light.position) + d))
            elif isinstance(light, DirectionalLight):
                lights[name] = replace(light, direction=rgb(np.array(light.direction) - d))
        return replace(simulation, lights=lights)
