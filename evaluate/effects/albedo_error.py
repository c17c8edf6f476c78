"""A part of a surface whose albedo is not that of its texture."""

from __future__ import annotations

from typing import Any

import numpy as np

from scene.simulation import Simulation

from ..mismatch.case import Case
from ..mismatch.corrections import as_map, material_on, resized, with_material
from ..mismatch.effect import Context, Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State
from ..mismatch.surface_map import region


class AlbedoError(Effect):
    id = "albedo_error"
    stage = "surface"
    title = "a texture that is wrong in one place"
    says = "one place of a surface is off by the same factor under all lamps and from all viewpoints"
    taken_for = ("surface_wetness", "missing_occluder", "light_colour")
    decides = "look at the place towards a lamp's mirror direction: water shines there, paint does not"
    coordinates = "surface"
    approximation = 0.08
    on_region = True

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case, 0.01))

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"factor.{c}", 1.0, 0.0, 10.0, 0.01) for c in "rgb")

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        found = region(case, shape_index(case, target), context)
        return False if found is None else found[0]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        factor = np.array([values[f"factor.{c}"] for c in "rgb"])
        state.scale_albedo(1 + aux[:, None] * (factor - 1))

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        assert target is not None
        material, field = material_on(simulation, target), as_map(case, shape_index(case, target), aux)
        texture = material.albedo_texture
        if texture is None:
            texture = np.broadcast_to(np.array(material.albedo, np.float32), (*field.shape, 3))
        texture = texture if texture.ndim == 3 else np.repeat(texture[..., None], 3, axis=2)
        if texture.shape[0] < field.shape[0]:
            texture = resized(texture, *field.shape)
        factor = np.array([values[f"factor.{c}"] for c in "rgb"], np.float32)
        painted = texture * (1 + resized(field, *texture.shape[:2])[..., None] * (factor - 1))
        return with_material(simulation, target, albedo_texture=painted.astype(np.float32))
