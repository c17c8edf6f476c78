"""A second, wider lobe below the one that was believed."""

from __future__ import annotations

from typing import Any

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State


class LongTailLobe(Effect):
    id = "long_tail_lobe"
    stage = "surface"
    title = "a second, wider lobe"
    says = "highlights have a wide skirt around a core that fits"
    taken_for = ("glare", "fresnel_grazing")
    decides = "cover the core of the highlight: glare goes with it, the skirt stays"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in shapes_seen(case) if case.material_of(shape_index(case, n)).model == "ggx"]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (
            Parameter("specular_scale", 0.3, 0.0, 50.0, 0.02),
            Parameter("alpha", 0.6, 0.2, 1.0, 0.01),
        )

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        row = state.surfaces[shape_index(case, target)]
        row[shade.LOBE2], row[shade.ALPHA2] = values["specular_scale"], values["alpha"]
