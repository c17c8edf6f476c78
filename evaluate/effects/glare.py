"""Light that the lens scatters widely: a veil around what is bright."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.sensor_plane import wide_blur


class Glare(Effect):
    id = "glare"
    stage = "lens"
    title = "glare"
    says = "dark parts near bright ones are lifted by a wide blur of the picture itself"
    taken_for = ("participating_medium", "ambient_light", "sensor_response")
    decides = "hide the bright part with a card held close to the lens"
    coordinates = "sensor"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # I + strength (K * I - I), K = (1 - wide_share) Gauss(sigma) + wide_share Gauss(ratio sigma).
        unit = case.size[1] / 160
        return (
            Parameter("strength", 0.02, 0.0, 0.7, 0.003),
            Parameter("sigma", 9.0 * unit, 2.5 * unit, 50.0 * unit, 0.5 * unit, "px"),
            Parameter("wide_share", 0.4, 0.0, 1.0, 0.03, spread=0.5),
            Parameter("ratio", 3.5, 1.5, 10.0, 0.2, spread=2.0),
        )

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        s, sigma, share, ratio = (float(values[n]) for n in ("strength", "sigma", "wide_share", "ratio"))

        def veil(pictures):
            wide = np.float32(1 - share) * wide_blur(pictures, sigma) + np.float32(share) * wide_blur(pictures, ratio * sigma)
            return pictures + np.float32(s) * (wide - pictures)

        state.lens.append(veil)
