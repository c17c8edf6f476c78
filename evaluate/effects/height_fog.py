"""Fog that thins with height."""

from __future__ import annotations

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Parameter, Values
from .participating_medium import ParticipatingMedium


class HeightFog(ParticipatingMedium):
    id = "height_fog"
    title = "fog that thins with height"
    says = "what is far and low is veiled more than what is far and high"
    taken_for = ("participating_medium", "glare")

    def targets(self, case: Case) -> list[str | None]:
        z = case.pieces.position[case.pieces.shape >= 0][:, 2]
        return [None] if float(np.ptp(z)) > 0.5 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        z = case.pieces.position[case.pieces.shape >= 0][:, 2]
        height = float(np.quantile(z, 0.98) - np.quantile(z, 0.02)) + 1e-3
        return (
            *super().parameters(case, target),
            Parameter("scale_height", 0.7 * height, 0.05 * height, 20 * height, 0.03 * height, "m"),
        )

    def _height(self, values: Values) -> tuple[float, float]:
        return float(values["scale_height"]), 0.0
