"""A sensor whose noise is not what was stated."""

from __future__ import annotations

from ..mismatch.case import Case
from ..mismatch.effect import Effect


class NoiseModel(Effect):
    """Changes no noise-free pixel; the diagnosis finds it in the size of a residual without structure, never by a fit."""

    id = "noise_model"
    stage = "sensor"
    title = "another noise than stated"
    says = "the residual has no structure, but not the size that the noise model gives it"
    taken_for = ()
    decides = "photograph one scene twice and take the difference"
    coordinates = "radiance"
    on_picture = True

    def targets(self, case: Case) -> list[str | None]:
        return []
