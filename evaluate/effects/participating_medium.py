"""Fog: what is far is dimmed, and veiled by light that the air scatters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..kernels import veil
from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, eyes, frame_of, sight


class ParticipatingMedium(Effect):
    id = "participating_medium"
    stage = "medium"
    title = "fog"
    says = "what is far loses contrast towards one colour, exponentially in its distance"
    taken_for = ("glare", "height_fog", "ambient_light")
    decides = "photograph dark targets at several distances, and above each other"
    coordinates = "depth"
    approximation = 0.2

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return self.by_distance(case, case.pieces.distance[case.pieces.shape >= 0])

    def by_distance(self, case: Case, distance: np.ndarray) -> tuple[Parameter, ...]:
        """Return what is to be fitted where surfaces are seen at these distances (N,)."""
        far = float(np.quantile(distance, 0.9))
        level = float(np.quantile(case.pictures[case.valid], 0.9)) + 1e-3
        air = tuple(Parameter(f"airlight.{c}", 0.5 * level, 0.0, 50 * level, 0.01 * level, "W/(m² sr)") for c in "rgb")
        out = (Parameter("sigma_t", 0.2 / far, 0.0, 20 / far, 0.01 / far, "1/m"), *air)
        if len(case.lamps):
            # What lamps send into the line of sight, once scattered; the rest has come from all around.
            out += (Parameter("single_albedo", 0.3, 0.0, 1.0, 0.02), Parameter("g", 0.4, -0.9, 0.95, 0.02))
        if self._beyond(case).any():
            out += (Parameter("reach", 1.3 * far, 0.2 * far, 50 * far, 0.05 * far, "m"),)
        return out

    def _beyond(self, case: Case) -> np.ndarray:
        return case.pieces.shape < 0

    def _height(self, values: Values) -> tuple[float, float]:
        return 0.0, 0.0  # scale height (0: even), base

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        p = case.pieces
        distance = p.distance.copy()
        beyond = self._beyond(case)
        if "reach" in values:
            distance[beyond] = values["reach"]
        scale_height, base = self._height(values)
        through, lamp_light = np.empty((len(p), 3), np.float32), np.zeros((len(p), 3), np.float32)
        veil.veil(
            eyes(case), frame_of(case), sight(case), distance, case.slots, state.lamps, float(values["sigma_t"]), scale_height,
            base, float(values.get("g", 0.0)), 8, through, lamp_light,
        )  # fmt: skip
        air = np.array([values[f"airlight.{c}"] for c in "rgb"], np.float32)
        single = np.float32(values.get("single_albedo", 0.0))
        state.veil(through, (1 - through) * air + single * lamp_light)
