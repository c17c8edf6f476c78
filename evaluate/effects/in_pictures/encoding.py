"""Factors and curves: exposure, white balance, response."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mismatch.case import Case
from ...mismatch.effect import Context, Parameter, Values
from ...mismatch.formation import State
from ..exposure_drift import ExposureDrift
from ..light_colour import LightColour
from ..sensor_response import SensorResponse


class PictureExposure(ExposureDrift):
    """One factor for all frames, which no albedo hides here, and from three frames on another one for each."""

    title = "another exposure"
    says = "the frames are brighter or darker as a whole, all by one factor or each by one of its own, whatever they show"

    def targets(self, case: Case) -> list[str | None]:
        return [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        common = Parameter("log_gain", 0.0, -5.0, 5.0, 0.01)
        # Only the spread tells the drift's mean from the common factor: the fit starts where all of it is common.
        drift = Parameter("log_drift", 0.0, -3.0, 3.0, 0.01, per="frame", spread=0.3)
        return (common, drift) if case.num_frames > 2 else (common,)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return the logarithm of the one factor that fits best."""
        P, R, w = context.picture, context.picture + context.residual, context.weight
        gain = float((w * P * R).sum(dtype=np.float64) / max(float((w * P * P).sum(dtype=np.float64)), 1e-30))
        return float(np.log(np.clip(gain, np.exp(-5), np.exp(5))))

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        return [{"log_gain": aux}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        log = values["log_gain"] + np.asarray(values.get("log_drift", np.zeros(case.num_frames)))
        gain = np.exp(log).astype(np.float32)[:, None, None, None]
        state.lens.append(lambda picture: picture * gain)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        # The data leave open how much of what is common to all frames is written down as drift: their sum counts.
        common = float(values["log_gain"]) + float(np.mean(values.get("log_drift", 0.0)))
        return {"gain": {"value": float(np.exp(common)), "unit": "1"}}


class WhiteBalance(LightColour):
    """Red and blue against green, the same in all frames: of one light or of the camera."""

    stage = "lens"
    title = "another colour of the light"
    says = "red and blue differ from what was predicted by a factor each, the same everywhere and in all frames"
    taken_for = ("exposure_drift", "participating_medium")
    decides = "photograph a grey card: lamp and white balance of the camera cannot be told apart in pictures alone"
    on_picture = True

    def targets(self, case: Case) -> list[str | None]:
        return [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"log_{c}", 0.0, -3.0, 3.0, 0.01) for c in ("red", "blue"))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        gain = np.exp([values["log_red"], 0.0, values["log_blue"]]).astype(np.float32)
        state.lens.append(lambda picture: picture * gain)


class PictureResponse(SensorResponse):
    """A power of the predicted values that leaves 1 as it is, as encodings of pictures do."""

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        gamma = float(values["gamma"])
        floor = np.float32(1e-5 * (float(np.median(case.pictures[case.valid])) + 1e-4))
        state.sensor.append(lambda p: (np.maximum(p, floor) ** gamma).astype(np.float32))
