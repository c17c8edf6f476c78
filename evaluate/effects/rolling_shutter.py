"""Rows that were exposed one after the other while the camera moved."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Values
from ..mismatch.formation import State
from ..mismatch.warp import TWIST, twisted
from .pose_error import PoseError


class RollingShutter(PoseError):
    id = "rolling_shutter"
    stage = "sensor"
    title = "a rolling shutter"
    says = "upper and lower rows are displaced in opposite directions: the picture is sheared or stretched by the camera's motion"
    taken_for = ("pose_error", "lens_distortion")
    decides = "photograph the same with a still camera"
    coordinates = "time"
    # Between pixels a picture of averages is not known: at outlines close to half of a shift by part of a pixel stays.
    approximation = 0.4
    settles = False
    per = "frame"

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        twist = np.stack([values[n] for n in TWIST], axis=1)
        rows = case.size[0]
        time = (np.arange(rows) + 0.5) / rows - 0.5
        state.lens.append(lambda picture: twisted(case, picture, twist, time))
