"""A lens that shows each colour at a scale of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.sensor_plane import offsets, resampled


class ChromaticAberration(Effect):
    id = "chromatic_aberration"
    stage = "lens"
    title = "chromatic aberration"
    says = "red and blue are displaced radially against green: coloured seams that grow towards the corners"
    taken_for = ("lens_distortion",)
    decides = "photograph a black edge near a corner"
    coordinates = "sensor"
    # Between pixels a picture of averages is not known: at outlines close to half of a shift by part of a pixel stays.
    approximation = 0.4
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"scale_{c}", 1.0, 0.9, 1.1, 0.001) for c in ("red", "blue"))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        x, y, _ = offsets(case)
        camera = case.cameras[0]

        def spread(pictures):
            out = pictures.copy()
            for c, scale in ((0, values["scale_red"]), (2, values["scale_blue"])):
                at = x / scale + camera.cx - 0.5, y / scale + camera.cy - 0.5
                out[..., c] = resampled(np.ascontiguousarray(pictures[..., c]), *at)
            return out

        state.lens.append(spread)
