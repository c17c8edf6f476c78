"""Blurs of pictures: even or by depth, and along a motion in the image."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mismatch.case import Case
from ...mismatch.effect import Context, Parameter, Values
from ...mismatch.formation import State
from ...mismatch.pictures.case import PictureCase
from ...mismatch.warp import moved
from ..defocus import LEVELS, Defocus, blurred
from ..motion_blur import MotionBlur
from .displacement import SHIFT, shift_basis, shift_parameters

_STEPS = 7
_SOFT = (0.7, 1.3, 2.5)


class PictureDefocus(Defocus):
    """One radius for the whole picture, and with known depth what a thin lens adds to it."""

    def _has_depth(self, case: Case) -> bool:
        return isinstance(case, PictureCase) and case.has_depth

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        soft = Parameter("radius", 1.0, 0.0, LEVELS[-1], 0.05, "px")
        return (soft, *super().parameters(case, target)) if self._has_depth(case) else (soft,)

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        even = [{"radius": r} for r in _SOFT]
        if not self._has_depth(case):
            return even
        thin = super().starts(case, target, aux)
        least = 0.2 * min(s["aperture_radius"] for s in thin)
        return [s | {"aperture_radius": least} for s in even] + [s | {"radius": 0.4} for s in thin]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        radius = np.full(case.valid.shape, float(values["radius"]))
        if self._has_depth(case):
            radius = np.hypot(radius, self.circle(case, values))
        radius = np.minimum(radius, LEVELS[-1] * 0.999).astype(np.float32)
        state.lens.append(lambda pictures: blurred(pictures, radius))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return super().summary(case, values, target, aux) if self._has_depth(case) else {}


class PictureMotionBlur(MotionBlur):
    says = "each frame is blurred along one direction, or about its centre"

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return shift_parameters(case, "frame")

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        # A unit of each moves the picture by about a pixel.
        scale = np.array([1, 1, 2 / case.size[1]], np.float32)
        basis = shift_basis(case) * scale[:, None, None, None]
        guess = self.first_guess(case, context, np.repeat(basis[:, None], case.num_frames, axis=1))
        return guess if guess is False else guess * scale

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, Any]]:
        return [{name: aux[:, i] for i, name in enumerate(SHIFT)}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        by, basis = np.stack([values[n] for n in SHIFT], axis=1).astype(np.float32), shift_basis(case)

        def smear(pictures):
            out = np.zeros_like(pictures)
            for f in range(len(pictures)):
                flow = np.tensordot(by[f], basis, 1)
                for t in (np.arange(_STEPS) + 0.5) / _STEPS - 0.5:
                    out[f] += moved(pictures[f], flow * np.float32(t)) / _STEPS
            return out

        state.lens.append(smear)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        length = float(np.sqrt(np.mean(values["shift_x"] ** 2 + values["shift_y"] ** 2)))
        return {"rms_length": {"value": length, "unit": "px"}}
