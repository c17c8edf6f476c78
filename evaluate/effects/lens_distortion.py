"""A lens that bends straight lines."""

from __future__ import annotations

from typing import Any

from ..mismatch.case import Case
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.sensor_plane import offsets, resampled


class LensDistortion(Effect):
    id = "lens_distortion"
    stage = "lens"
    title = "lens distortion"
    says = "everything is displaced radially, the more the farther from the image's centre, in all frames alike"
    taken_for = ("pose_error", "chromatic_aberration")
    decides = "photograph a chequered board"
    coordinates = "sensor"
    approximation = 0.05
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("k1", 0.0, -1.0, 1.0, 0.005), Parameter("k2", 0.0, -3.0, 3.0, 0.02, spread=0.3))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        x, y, focal = offsets(case)
        k1, k2 = float(values["k1"]), float(values["k2"])
        # What is recorded at x comes from u with x = u (1 + k1 |u|² + k2 |u|⁴) (Brown 1971), solved by iteration.
        u, v = x / focal, y / focal
        for _ in range(10):
            r2 = u * u + v * v
            bend = 1 + k1 * r2 + k2 * r2 * r2
            u, v = x / focal / bend, y / focal / bend
        camera = case.cameras[0]
        at = u * focal + camera.cx - 0.5, v * focal + camera.cy - 0.5
        state.lens.append(lambda pictures: resampled(pictures, *at))
