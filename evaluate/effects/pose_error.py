"""Cameras that were not where they were believed to be."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.warp import TWIST, twisted, typical_distance


class PoseError(Effect):
    id = "pose_error"
    stage = "lens"
    title = "cameras out of place"
    says = "outlines and textures are displaced, by a rigid motion of each camera, whatever the light"
    taken_for = ("lens_distortion", "moved_object", "rolling_shutter")
    decides = "calibrate the poses on targets that the simulation does not hold"
    coordinates = "frame"
    approximation = 0.03
    on_picture = True
    settles = True
    per = "pose"

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        focal = max(case.cameras[0].fx, 1.0) if case.cameras[0].model != "ORTHOGRAPHIC" else 100.0
        far = typical_distance(case)
        # A step moves the picture by a tenth of a pixel.
        turn = [Parameter(n, 0.0, -0.2, 0.2, 0.1 / focal, "rad", per=self.per) for n in TWIST[:3]]
        shift = [Parameter(n, 0.0, -0.2 * far, 0.2 * far, 0.1 * far / focal, "m", per=self.per) for n in TWIST[3:]]
        return (*turn, *shift)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        twist = np.stack([values[n] for n in TWIST], axis=1)
        # The pieces may have been gathered on the way already.
        rest = twist if case.settled.twist is None else twist - case.settled.twist
        if np.any(np.abs(rest) > 1e-9):
            state.lens.append(lambda picture: twisted(case, picture, rest))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        twist = np.stack([values[n] for n in TWIST], axis=1)
        turn, shift = (float(np.sqrt((v**2).sum(axis=1).mean())) for v in (twist[:, :3], twist[:, 3:]))
        return {"rms_turn": {"value": turn, "unit": "rad"}, "rms_shift": {"value": shift, "unit": "m"}}
