"""Exposure that was not the same for all frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State


class ExposureDrift(Effect):
    id = "exposure_drift"
    stage = "lens"
    title = "an exposure that drifts from frame to frame"
    says = "each frame is brighter or darker as a whole, by a factor of its own, whatever it shows"
    taken_for = ("light_colour",)
    decides = "photograph a grey card under one lamp several times: a lamp's power repeats, an exposure does not"
    coordinates = "frame"
    on_picture = True

    def targets(self, case: Case) -> list[str | None]:
        return [None] if case.num_frames > 2 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # The mean of all gains cannot be told from the albedo: the spread holds it near 1.
        return (Parameter("log_gain", 0.0, -3.0, 3.0, 0.01, per="frame", spread=0.3),)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        gain = np.exp(values["log_gain"]).astype(np.float32)[:, None, None, None]
        state.lens.append(lambda picture: picture * gain)
