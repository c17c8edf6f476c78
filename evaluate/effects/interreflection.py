"""Light that other surfaces send on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..kernels import shade
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
    approximation = 0.1
    prepares_again = True

    def __init__(self, first: int | None = None) -> None:
        # How many scattering events are in the picture without it; None: as many as the simulation believes.
        self._first = first

    def _believed(self, case: Case) -> int:
        return case.simulation.transport.max_bounces if self._first is None else self._first

    def targets(self, case: Case) -> list[str | None]:
        return [None] if case.simulation.transport.max_bounces < 8 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        believed = self._believed(case)
        return (Parameter("bounces", believed + 1.5, believed, 1 + _BOUNCES, 0.25),)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        scale = context.state.surfaces[:, shade.SCALE : shade.SCALE + 3].copy()
        return {"orders": bounced(case, context.state, _BOUNCES), "scale": scale, "share": self._share(case)}

    def _share(self, case: Case) -> np.ndarray:
        """Return the share of the world's area that each shape has: as often is light thrown back by it."""
        area = np.array([_area(s.mesh.vertices, s.mesh.faces) for s in case.world.shapes])
        return area / area.sum()

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # Light that has met k surfaces goes with the k-th power of their albedos, which are being fitted.
        now = state.surfaces[:, shade.SCALE : shade.SCALE + 3]
        ratio = (aux["share"][:, None] * now / np.maximum(aux["scale"], 1e-9)).sum(axis=0)
        # Between whole numbers the next bounce comes in by its share.
        order = np.arange(_BOUNCES)
        shares = np.clip(values["bounces"] - 1 - order, 0, 1) - np.clip(self._believed(case) - 1 - order, 0, 1)
        weights = (shares[:, None] * ratio ** np.arange(1, _BOUNCES + 1)[:, None]).astype(np.float32)
        state.add_ambient(np.einsum("nkc,kc->nc", aux["orders"], weights))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"max_bounces": {"value": int(np.ceil(values["bounces"] - 0.25)), "unit": "1"}}

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        bounces = int(np.ceil(values["bounces"] - 0.25))
        return replace(simulation, transport=replace(simulation.transport, max_bounces=bounces))


def _area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
