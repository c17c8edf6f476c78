"""A lens that is darker towards the corners."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.sensor_plane import radius2


class Vignetting(Effect):
    id = "vignetting"
    stage = "lens"
    title = "vignetting"
    says = "a factor that depends on the distance from the image's centre alone, the same in all frames"
    taken_for = ("near_field_light", "glare")
    decides = "photograph an even grey wall"
    coordinates = "sensor"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # (1 + r²)^-power exp(-more r⁴), r in units of the focal length: power 2 is the cosine's fourth power.
        return (Parameter("power", 0.0, -2.0, 40.0, 0.05), Parameter("more", 0.0, -200.0, 200.0, 0.1, spread=20.0))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        r2 = radius2(case)
        gain = ((1 + r2) ** -values["power"] * np.exp(-values["more"] * r2**2)).astype(np.float32)[..., None]
        state.lens.append(lambda picture: picture * gain)
