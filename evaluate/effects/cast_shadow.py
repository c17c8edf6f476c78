"""Shadows that the simulation did not cast."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scene.simulation import Simulation

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, open_sky


class CastShadow(Effect):
    id = "cast_shadow"
    stage = "light"
    title = "cast shadows"
    says = "places that other bodies hide from a lamp are dark"
    taken_for = ("missing_occluder", "albedo_error")
    decides = "take the body away"
    coordinates = "lamp"

    def targets(self, case: Case) -> list[str | None]:
        return [] if case.simulation.transport.shadows else [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # 1 is the physics; a fit that ends elsewhere says that something else is going on.
        return (Parameter("depth", 1.0, 0.0, 1.5, 0.02),)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        state.visible = 1 - values["depth"] * (1 - case.pieces.visible)
        if len(state.ambient) and case.environment.any():
            share = 1 - values["depth"] * (1 - open_sky(case))
            state.ambient = state.ambient * share[:, None].astype("float32")

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        if abs(values["depth"] - 1) > 0.1:
            return None
        return replace(simulation, transport=replace(simulation.transport, shadows=True))
