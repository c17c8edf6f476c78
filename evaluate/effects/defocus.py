"""A lens with an aperture: what is out of focus is blurred."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from scene.simulation import Simulation

from ..mismatch.case import Case, Floats
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State
from ..mismatch.sensor_plane import disc
from ..mismatch.warp import first_piece

# Blurs at these radii [px] are mixed to any in between.
LEVELS = (0.0, 0.5, 0.8, 1.2, 1.8, 2.6, 3.8, 5.5, 8.0)


class Defocus(Effect):
    id = "defocus"
    stage = "lens"
    title = "a lens out of focus"
    says = "outlines and textures are blurred alike in all directions, the more the farther from one distance"
    taken_for = ("motion_blur", "light_extent", "subsurface")
    decides = "stop the lens down"
    coordinates = "depth"
    approximation = 0.15
    on_picture = True

    def targets(self, case: Case) -> list[str | None]:
        return [None] if case.cameras[0].model != "ORTHOGRAPHIC" else []

    def _depth(self, case: Case) -> np.ndarray:
        if "depth" not in case.cache:
            k = first_piece(case)
            axis = np.array([c.T_world_camera[:3, 2] for c in case.gathered_cameras])
            size = case.size[0] * case.size[1]
            cosine = -np.einsum("pc,pc->p", case.pieces.view[k], np.repeat(axis, size, axis=0))
            depth = np.where(case.pieces.shape[k] >= 0, case.pieces.distance[k] * cosine, np.inf)
            case.cache["depth"] = depth.reshape(case.num_frames, *case.size)
        return case.cache["depth"]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        depth = self._depth(case)
        near, middle = np.quantile(depth[np.isfinite(depth)], [0.02, 0.5])
        focal = case.cameras[0].fx
        # Blurred by two pixels if focused at infinity: a start that the data can see.
        unit = 2.0 * middle / focal
        return (
            Parameter("aperture_radius", unit, 0.0, 20 * unit, 0.05 * unit, "m"),
            Parameter("inverse_focus", 0.8 / middle, 0.0, 3.0 / near, 0.02 / middle, "1/m"),
        )

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        depth = self._depth(case)
        near, middle, far = np.quantile(depth[np.isfinite(depth)], [0.05, 0.5, 0.95])
        unit = middle / case.cameras[0].fx
        return [
            {"inverse_focus": 1 / d, "aperture_radius": unit * a}
            for d, a in ((0.6 * near, 3.0), (near, 4.0), (far, 4.0), (2 * far, 3.0))
        ]

    def circle(self, case: Case, values: Values) -> np.ndarray:
        """Return the radius of the circle of confusion (F, H, W) [px]."""
        return case.cameras[0].fx * values["aperture_radius"] * np.abs(1 / self._depth(case) - values["inverse_focus"])

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        radius = np.minimum(self.circle(case, values), LEVELS[-1] * 0.999).astype(np.float32)
        state.lens.append(lambda pictures: blurred(pictures, radius))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"focus_distance": {"value": 1 / max(float(values["inverse_focus"]), 1e-9), "unit": "m"}}

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        focus = 1 / max(float(values["inverse_focus"]), 1e-9)
        lens = replace(simulation.lens, model="thin_lens", aperture_radius=float(values["aperture_radius"]), focus_distance=focus)
        return replace(simulation, lens=lens)


def blurred(pictures: Floats, radius: Floats) -> Floats:
    """Return pictures (F, H, W, 3) blurred by discs of a radius (F, H, W) [px] below the last of `LEVELS`."""
    out = np.zeros_like(pictures)
    for low, high in itertools.pairwise(LEVELS):
        used = np.any((radius > low) & (radius < high))
        if not used and low > 0:
            continue
        for level, share in ((low, (high - radius) / (high - low)), (high, (radius - low) / (high - low))):
            mixed = np.where((radius >= low) & (radius < high), share, 0)[..., None].astype(np.float32)
            for f in np.flatnonzero(np.any(mixed > 0, axis=(1, 2, 3))):
                out[f] += mixed[f] * (pictures[f] if level == 0 else _disc(pictures[f], level))
    return out


def _disc(picture, level: float):
    return cv2.filter2D(picture, -1, disc(level), borderType=cv2.BORDER_REPLICATE)
