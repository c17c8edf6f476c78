"""A lens that bends straight lines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from scene.simulation import Simulation

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
    settles = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("k1", 0.0, -1.0, 1.0, 0.005), Parameter("k2", 0.0, -3.0, 3.0, 0.02, spread=0.3))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        camera = case.cameras[0]
        x, y, focal = offsets(case)
        u, v = _undistorted(x / focal, y / focal, camera.k1 + float(values["k1"]), camera.k2 + float(values["k2"]))
        # The pieces may have been gathered through a lens that bends already.
        there = case.gathered_cameras[0]
        r2 = u * u + v * v
        bend = 1 + there.k1 * r2 + there.k2 * r2 * r2
        at = u * bend * focal + camera.cx - 0.5, v * bend * focal + camera.cy - 0.5
        state.lens.append(lambda pictures: resampled(pictures, *at))

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        k1, k2 = simulation.lens.k1 + float(values["k1"]), simulation.lens.k2 + float(values["k2"])
        return replace(simulation, lens=replace(simulation.lens, k1=k1, k2=k2))


def _undistorted(x: NDArray, y: NDArray, k1: float, k2: float) -> tuple[NDArray, NDArray]:
    """Return u with x = u (1 + k1 |u|² + k2 |u|⁴) (D. Brown, 1971), by iteration."""
    u, v = x, y
    for _ in range(20):
        r2 = u * u + v * v
        bend = 1 + k1 * r2 + k2 * r2 * r2
        u, v = x / bend, y / bend
    return u, v
