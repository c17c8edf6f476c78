"""Relief below the mesh: normals that the simulation did not have."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from scene.simulation import Texture

from ..mismatch.case import Case
from ..mismatch.corrections import as_map, from_map
from ..mismatch.effect import Context, Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State, develop, radiance
from ..mismatch.surface_map import BINS, bins, gathered, looked_up, pieces_of


class MesoscopicNormals(Effect):
    id = "mesoscopic_normals"
    stage = "surface"
    title = "relief below the mesh"
    says = "each place of a surface is brighter under lamps on one side and darker under those on the other"
    taken_for = ("albedo_error", "anisotropy")
    decides = "light the surface from opposite sides: relief turns its sign, paint does not"
    coordinates = "surface"
    approximation = 0.2

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case, 0.02)) if len(np.unique(case.lit)) > 2 else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("strength", 1.0, 0.0, 4.0, 0.02),)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Solve for the two slopes of each bin: their derivatives of the picture against its residual, over all frames."""
        shape, eps = shape_index(case, target), 0.02
        rows = pieces_of(case, shape)
        pixel = case.pieces.pixel[rows]
        root = np.sqrt(context.weight.reshape(-1, 3)[pixel])
        slopes = []
        for axis in (0, 1):
            bend = np.zeros((len(case.pieces), 2), np.float32)
            bend[:, axis] = eps
            state = replace(context.state, bend=bend)
            changed = develop(state, radiance(case, state))
            slopes.append(root * ((changed - context.picture) / eps).reshape(-1, 3)[pixel])
        r = root * context.residual.reshape(-1, 3)[pixel]
        a, b = slopes
        index = bins(case, rows)
        sums = np.stack([(x * y).sum(axis=1) for x, y in ((a, a), (a, b), (b, b), (a, r), (b, r))], axis=1)
        # Blur by half a bin; weak bins are held towards flat by a slope of 0.3 rad at 1 sigma.
        aa, ab, bb, ar, br = gathered(sums, index, 0.6)
        ridge = 1 / 0.3**2
        det = (aa + ridge) * (bb + ridge) - ab**2
        x, y = ((bb + ridge) * ar - ab * br) / det, ((aa + ridge) * br - ab * ar) / det
        gain = float((x * ar + y * br).sum())
        # On pure noise each bin's two slopes gain 2 units.
        if gain < 4 * 2 * BINS * BINS / (4 * np.pi * 0.36):
            return False
        field = np.zeros((len(case.pieces), 2), np.float32)
        own = np.flatnonzero(case.pieces.shape == shape)
        field[own] = np.stack([looked_up(v, case.pieces.uv[own]) for v in (x, y)], axis=1)
        return field

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        bend = np.float32(values["strength"]) * aux
        state.bend = bend if not len(state.bend) else state.bend + bend

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        own = np.any(aux != 0, axis=1)
        slope = float(values["strength"]) * float(np.sqrt((aux[own] ** 2).mean())) if own.any() else 0.0
        return {"rms_slope": {"value": slope, "unit": "1"}}

    def stored(self, case: Case, target: str | None, aux: Any) -> Texture | None:
        return as_map(case, shape_index(case, target), aux)

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        return from_map(case, shape_index(case, target), field, 2)
