"""A surface that sends light back where it came from."""

from __future__ import annotations

from typing import Any

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State


class Retroreflection(Effect):
    id = "retroreflection"
    stage = "surface"
    title = "retroreflection"
    says = "surfaces are brighter the nearer the lamp is to the line of sight, whatever way they face"
    taken_for = ("rough_diffuse", "specular_lobe")
    decides = "move the lamp around the camera: only within the lobe's width does it show"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case))

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # Along wo = wi the lobe is `strength` [1/sr]; it falls as exp(-angle² / (2 width²)).
        return (
            Parameter("strength", 0.03, 0.0, 20.0, 0.003, "1/sr"),
            Parameter("width", 0.4, 0.02, 1.5, 0.02, "rad"),
        )

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return [{"width": 0.2}, {"width": 0.5}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        row = state.surfaces[shape_index(case, target)]
        row[shade.RETRO], row[shade.RETRO_WIDTH] = values["strength"], values["width"]
