"""Light that other surfaces send on."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Context, Effect, Parameter, Values
from ..mismatch.formation import State, bounced

_BOUNCES = 7


class Interreflection(Effect):
    id = "interreflection"
    stage = "transport"
    title = "light bounced between surfaces"
    says = "shadows and creases are lifted, most near bright surfaces and in their colour"
    taken_for = ("ambient_light", "subsurface")
    decides = "cover the neighbouring surface with black cloth"
    coordinates = "surface"

    def targets(self, case: Case) -> list[str | None]:
        return [None] if case.simulation.transport.max_bounces < 8 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        believed = case.simulation.transport.max_bounces
        return (Parameter("bounces", believed + 1.5, believed, believed + _BOUNCES, 0.25),)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        orders = bounced(case, context.state, _BOUNCES)
        return np.concatenate([np.zeros_like(orders[:, :1]), np.cumsum(orders, axis=1)], axis=1)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # Between whole numbers the next bounce comes in by its share.
        b = float(np.clip(values["bounces"] - case.simulation.transport.max_bounces, 0, _BOUNCES))
        k = min(int(b), _BOUNCES - 1)
        state.add_ambient((1 - (b - k)) * aux[:, k] + (b - k) * aux[:, k + 1])

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"max_bounces": {"value": int(np.ceil(values["bounces"] - 0.25)), "unit": "1"}}
