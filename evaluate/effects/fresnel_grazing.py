"""A reflectance that rises towards grazing angles otherwise than believed."""

from __future__ import annotations

from typing import Any

from materials.fresnel import normal_reflectance
from scene.simulation import Simulation

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.corrections import material_on, with_material
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State


class FresnelGrazing(Effect):
    id = "fresnel_grazing"
    stage = "surface"
    title = "a reflectance that rises with angle"
    says = "highlights at grazing angles are off while those near the normal fit"
    taken_for = ("specular_lobe", "long_tail_lobe")
    decides = "photograph the mirror direction at 10 and at 80 degrees"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in shapes_seen(case) if case.material_of(shape_index(case, n)).model == "ggx"]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("eta", case.material_of(shape_index(case, target)).eta, 1.02, 6.0, 0.01),)

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        believed = case.material_of(shape_index(case, target)).eta
        return [{"eta": max(1.05, believed - 0.2)}, {"eta": believed + 0.3}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # The reflectance along the normal stays what it was: the scale takes back what eta does to it.
        row = state.surfaces[shape_index(case, target)]
        before, after = (float(normal_reflectance(e)) for e in (row[shade.ETA], values["eta"]))
        row[shade.ETA] = values["eta"]
        row[shade.LOBE] *= before / after

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        assert target is not None
        material, eta = material_on(simulation, target), float(values["eta"])
        before, after = (float(normal_reflectance(e)) for e in (material.eta, eta))
        return with_material(simulation, target, eta=eta, specular_scale=material.specular_scale * before / after)
