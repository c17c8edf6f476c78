"""Gloss that depends on the azimuth about the normal: brushed, woven or grained surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.corrections import material_on, with_material
from ..mismatch.effect import Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State

# So near [rad] the grain is called along dp/du.
_ALONG = 0.05


class Anisotropy(Effect):
    id = "anisotropy"
    stage = "surface"
    title = "anisotropic gloss"
    says = "highlights are longer across the grain than along it"
    taken_for = ("mesoscopic_normals", "long_tail_lobe")
    decides = "turn the body about its normal under a fixed lamp"
    coordinates = "half vector"
    on_patch = True

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in shapes_seen(case) if case.material_of(shape_index(case, n)).model == "ggx"]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (
            Parameter("log_ratio", 0.5, -4.0, 4.0, 0.03),
            Parameter("tangent_angle", 0.0, -np.pi / 2, np.pi / 2, 0.03, "rad"),
        )

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return [{"log_ratio": 0.7}, {"log_ratio": -0.7}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        # Widths alpha_u = alpha / sqrt(ratio), alpha_v = alpha sqrt(ratio): their geometric mean is the believed parameter.
        row = state.surfaces[shape_index(case, target)]
        row[shade.ALPHA_U] *= np.exp(-0.5 * values["log_ratio"])
        row[shade.ALPHA_V] *= np.exp(0.5 * values["log_ratio"])
        row[shade.ANGLE] += values["tangent_angle"]

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"alpha_v_over_alpha_u": {"value": float(np.exp(values["log_ratio"])), "unit": "1"}}

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        # The format has widths along and across dp/du, and no angle between.
        turn, ratio = float(values["tangent_angle"]) % np.pi, float(np.exp(0.5 * values["log_ratio"]))
        if min(turn, np.pi - turn) > _ALONG:
            return None
        assert target is not None
        material = material_on(simulation, target)
        u, v = (material.alpha if a is None else a for a in (material.alpha_u, material.alpha_v))
        return with_material(simulation, target, alpha_u=u / ratio, alpha_v=v * ratio)
