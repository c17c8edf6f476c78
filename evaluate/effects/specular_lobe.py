"""A surface that was believed matte, and shines."""

from __future__ import annotations

from typing import Any

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State


class SpecularLobe(Effect):
    id = "specular_lobe"
    stage = "surface"
    title = "gloss"
    says = "highlights about the mirror direction of the lamps that move with the viewpoint"
    taken_for = ("surface_wetness", "fresnel_grazing", "long_tail_lobe")
    decides = "photograph in the mirror direction of a small lamp"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in shapes_seen(case) if case.material_of(shape_index(case, n)).model == "lambert"]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (
            Parameter("specular_scale", 0.3, 0.0, 50.0, 0.02),
            Parameter("alpha", 0.25, 0.02, 0.9, 0.01),
        )

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return [{"alpha": 0.12}, {"alpha": 0.3}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        row = state.surfaces[shape_index(case, target)]
        row[shade.LOBE] = values["specular_scale"]
        row[shade.ALPHA_U] = row[shade.ALPHA_V] = values["alpha"]
