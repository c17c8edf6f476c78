"""Fog between pictures and camera, through depth that was given."""

from __future__ import annotations

import numpy as np

from ...mismatch.case import Case
from ...mismatch.effect import Parameter
from ..height_fog import HeightFog
from ..participating_medium import ParticipatingMedium


class PictureFog(ParticipatingMedium):
    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return self.by_distance(case, case.pieces.distance[np.isfinite(case.pieces.distance)])

    def _beyond(self, case: Case) -> np.ndarray:
        return ~np.isfinite(case.pieces.distance)


class PictureHeightFog(PictureFog, HeightFog):
    """Height is above the lowest that is seen, under a camera that is taken to be level unless its pose is known."""

    def targets(self, case: Case) -> list[str | None]:
        return [None] if self._height_range(case)[1] > 0.5 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        _, height = self._height_range(case)
        scale = Parameter("scale_height", 0.7 * height, 0.05 * height, 20 * height, 0.03 * height, "m")
        return (*super().parameters(case, target), scale)

    def _height_range(self, case: Case) -> tuple[float, float]:
        z = case.pieces.position[np.isfinite(case.pieces.distance), 2]
        low, high = np.quantile(z, [0.02, 0.98]) if len(z) else (0.0, 0.0)
        return float(low), float(high - low) + 1e-3
