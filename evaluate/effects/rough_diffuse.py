"""A matte surface that is rough: flat in brightness towards its limb, brighter along the light."""

from __future__ import annotations

from typing import Any

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State


class RoughDiffuse(Effect):
    id = "rough_diffuse"
    stage = "surface"
    title = "a rough matte surface"
    says = "shading is flatter than Lambert's, and brighter where the light comes from behind the camera (Oren and Nayar 1994)"
    taken_for = ("retroreflection",)
    decides = "put the lamp beside the camera and turn the body: a retroreflector peaks, roughness fills in"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case))

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("sigma", 0.3, 0.0, 1.4, 0.02, "rad"),)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        state.surfaces[shape_index(case, target), shade.SIGMA] = values["sigma"]
