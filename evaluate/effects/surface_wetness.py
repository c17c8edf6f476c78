"""Pores filled with water on a part of a surface: it is darker there, and it shines."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from scene.simulation import Texture

from ..kernels import shade
from ..mismatch.case import Case
from ..mismatch.corrections import as_map, from_map
from ..mismatch.effect import Context, Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State
from ..mismatch.surface_map import region


class SurfaceWetness(Effect):
    id = "surface_wetness"
    stage = "surface"
    title = "a wet place"
    says = "one place of a surface is darker under all lamps, and shines where it mirrors one (thesis, eqs 2.17 and 2.18)"
    taken_for = ("albedo_error", "specular_lobe", "water_film")
    decides = "let it dry, or look along the mirror direction at grazing light"
    coordinates = "surface"
    approximation = 0.05
    on_region = True
    widths: ClassVar[tuple[float, float, float]] = (0.15, 0.08, 0.6)

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case, 0.01))

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        start, low, high = self.widths
        return (
            Parameter("diffuse_factor", 0.7, 0.02, 1.0, 0.01),
            Parameter("alpha", start, low, high, 0.01),
            Parameter("specular_scale", 1.0, 0.0, 3.0, 0.02),
        )

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        found = region(case, shape_index(case, target), context)
        return False if found is None or found[1] > 0 else found[0]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        state.scale_albedo(np.repeat(1 + aux[:, None] * (values["diffuse_factor"] - 1), 3, 1))
        state.mask = aux if not len(state.mask) else np.maximum(aux, state.mask)
        row = state.surfaces[shape_index(case, target)]
        # Water: 1.33 over air.
        row[shade.LOBE3], row[shade.ALPHA3], row[shade.ETA3] = values["specular_scale"], values["alpha"], 1.33

    def stored(self, case: Case, target: str | None, aux: Any) -> Texture | None:
        return as_map(case, shape_index(case, target), aux)

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        return from_map(case, shape_index(case, target), field, 1)[:, 0]
