"""A body that is not where it was drawn."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scene.simulation import Simulation

from ..mismatch.case import Case, moved_mesh
from ..mismatch.effect import Context, Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State
from ..mismatch.warp import TWIST, first_piece, moved, typical_distance

_REACH = 6.0  # [px]: as far beyond its outline the body's motion is carried on


class MovedObject(Effect):
    id = "moved_object"
    stage = "geometry"
    title = "a body out of place"
    says = "one body and its shadow are displaced, by the same rigid motion in all frames, and all else fits"
    taken_for = ("pose_error", "missing_occluder")
    decides = "measure where the body stands"
    coordinates = "surface"
    approximation = 0.05
    settles = True

    def targets(self, case: Case) -> list[str | None]:
        # What fills most of the picture is what all else stands on.
        p = case.pieces
        area = np.bincount(p.shape[p.shape >= 0], p.weight[p.shape >= 0], len(case.shape_names))
        return [n for n in shapes_seen(case) if area[shape_index(case, n)] < 0.6 * area.sum()] if len(area) > 1 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        mesh = case.world.shapes[shape_index(case, target)].mesh
        size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
        pixel = typical_distance(case) / max(case.cameras[0].fx, 1.0)
        turn = [Parameter(n, 0.0, -1.0, 1.0, 0.3 * pixel / size, "rad") for n in TWIST[:3]]
        shift = [Parameter(n, 0.0, -size, size, 0.1 * pixel, "m") for n in TWIST[3:]]
        return (*turn, *shift)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return how the body's pixels move per unit of each parameter (6, F, H, W, 2), carried on beyond its outline."""
        shape, (height, width) = shape_index(case, target), case.size
        first = first_piece(case).reshape(case.num_frames, height, width)
        mesh = case.world.shapes[shape].mesh
        centre = mesh.vertices.mean(axis=0, dtype=np.float64)
        flow = np.zeros((6, case.num_frames, height, width, 2), np.float32)
        for f, camera in enumerate(case.gathered_cameras):
            own = case.pieces.shape[first[f]] == shape
            if not own.any():
                continue
            p = case.pieces.position[first[f][own]].astype(np.float64)
            here, _ = camera.project(p)
            distance, nearest = distance_transform_edt(~own, return_indices=True)
            inside = distance < _REACH
            for i in range(6):
                unit, eps = np.zeros(3), 1e-3 * typical_distance(case)
                unit[i % 3] = 1.0
                move = (np.cross(unit, p - centre) if i < 3 else np.broadcast_to(unit, p.shape)).astype(np.float64)
                there, _ = camera.project(p + eps * move)
                full = np.zeros((height, width, 2), np.float32)
                full[own] = np.nan_to_num((there - here) / eps)
                flow[i, f] = np.where(inside[..., None], full[tuple(nearest)], 0)
        return {"flow": flow} if np.any(flow) else False

    def of_frames(self, aux: Any, frames: NDArray[np.int64]) -> Any:
        return {"flow": aux["flow"][:, frames]}

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        twist = np.array([values[n] for n in TWIST])
        assert target is not None
        rest = (twist - case.settled.moves.get(target, 0.0)).astype(np.float32)
        if not np.any(np.abs(rest) > 1e-9):
            return
        flow = np.tensordot(rest, aux["flow"], 1)
        state.lens.insert(0, lambda pictures: np.stack([moved(p, d) for p, d in zip(pictures, flow, strict=True)]))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        shift = float(np.linalg.norm([values[n] for n in TWIST[3:]]))
        return {"shift": {"value": shift, "unit": "m"}}

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        twist = np.array([float(values[n]) for n in TWIST])
        moved = (replace(s, mesh=moved_mesh(s.mesh, twist)) if s.name == target else s for s in simulation.shapes)
        return replace(simulation, shapes=tuple(moved))
