"""Lamps that are balls, not points: shadows have soft borders."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import PointLight, Simulation, SphereLight

from ..kernels import shadows
from ..kernels.fragments import LAMP_KIND, LAMP_PLACE, POINT
from ..mismatch.case import Case
from ..mismatch.effect import Context, Effect, Parameter, Values
from ..mismatch.formation import State, frame_of


class LightExtent(Effect):
    id = "light_extent"
    stage = "light"
    title = "lamps with an extent"
    says = "the borders of shadows are soft, the softer the farther they fall; all else is as predicted"
    taken_for = ("defocus", "glare")
    decides = "look at outlines of bodies: a lens blurs them too, an extended lamp does not"
    coordinates = "surface"
    approximation = 0.1

    def __init__(self, largest: float | None = None) -> None:
        """Take the largest radius that is thought of [m], by default a quarter of the lamps' distance."""
        self.largest = largest

    def targets(self, case: Case) -> list[str | None]:
        points = np.any(case.lamps[:, LAMP_KIND] == POINT)
        return [None] if points and case.simulation.transport.shadows and not spheres(case.simulation) else []

    def _reach(self, case: Case) -> float:
        return self.largest or 0.25 * float(np.median(np.linalg.norm(case.lamps[:, LAMP_PLACE : LAMP_PLACE + 3], axis=1)))

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        reach = self._reach(case)
        return (Parameter("radius", 0.15 * reach, 0.0, reach, 0.04 * reach, "m"),)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        # Only where the largest lamp is seen in part can a smaller one be.
        every = self._pieces(case)
        wide = [self._share(case, context.state.lamps, rows, lamp, self._reach(case), 6) for rows, lamp in every]
        # The same rays to a point say what they would say of the believed lamp: only the difference counts.
        return [
            (rows[partly], lamp[partly], self._share(case, context.state.lamps, rows[partly], lamp[partly], 0.0, 7))
            for (rows, lamp), share in zip(every, wide, strict=True)
            for partly in [(share > 0) & (share < 1)]
        ]

    def _pieces(self, case: Case) -> list[tuple[np.ndarray, np.ndarray]]:
        slots, out = case.slots[frame_of(case)], []
        for s in range(slots.shape[1]):
            rows = np.flatnonzero((slots[:, s] >= 0) & (case.pieces.shape >= 0))
            lamp = slots[rows, s]
            point = case.lamps[lamp, LAMP_KIND] == POINT
            out.append((rows[point], lamp[point]))
        return out

    def _share(self, case: Case, lamps, rows, lamp, radius: float, n: int) -> np.ndarray:
        p, out = case.pieces, np.zeros(len(rows))
        shadows.extent_share(case.world.arrays, rows, p.position, p.face_normal, p.across, p.down, lamp, lamps, radius, n, out)
        return out

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        state.visible = state.visible.copy()
        for s, (rows, lamp, point) in enumerate(aux):
            change = self._share(case, state.lamps, rows, lamp, values["radius"], 7) - point
            state.visible[rows, s] = np.clip(state.visible[rows, s] + change, 0, 1)

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        radius = float(values["radius"])
        lights = {
            name: SphereLight(light.position, radius, light.intensity) if isinstance(light, PointLight) else light
            for name, light in simulation.lights.items()
        }
        return replace(simulation, lights=lights)


def spheres(simulation: Simulation) -> dict[str, SphereLight]:
    """Return the lights of a simulation that are spheres."""
    return {name: light for name, light in simulation.lights.items() if isinstance(light, SphereLight)}
