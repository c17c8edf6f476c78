"""A surface that was believed matte, and shines."""

from __future__ import annotations

from typing import Any

from scene.simulation import Simulation

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.corrections import with_material
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

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        lobe = {"model": "ggx", "specular_scale": float(values["specular_scale"]), "alpha": float(values["alpha"])}
        assert target is not None
        return with_material(simulation, target, **lobe, alpha_u=None, alpha_v=None)
