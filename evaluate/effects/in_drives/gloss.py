"""Gloss of what was reconstructed: other frames saw other light mirrored in the same place."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mismatch.case import Case
from ...mismatch.effect import Parameter, Values, shape_index
from ...mismatch.formation import State
from ...mismatch.pictures.case import PictureCase
from ..specular_lobe import SpecularLobe

_MESHES = ("ground", "environment")


class DriveGloss(SpecularLobe):
    """A share of what a smooth surface of refractive index 1.5 would mirror of sky and surroundings (Schlick 1994)."""

    title = "gloss that changes with the view"
    says = "a surface mirrors the sky, the more the flatter it is seen, so that each frame sees it in another colour"
    taken_for = ("exposure_drift", "vignetting")
    decides = "photograph it through a polariser"
    on_picture = True
    stage = "lens"

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in _MESHES if n in case.shape_names]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("specular_scale", 0.0, 0.0, 5.0, 0.02),)

    def prepare(self, case: Case, target: str | None, context: Any) -> Any:
        """Return what each pixel would mirror more than the others did (pixels, 3)."""
        assert isinstance(case, PictureCase)
        own = case.pieces.shape == shape_index(case, target)
        return np.where(own[:, None], np.concatenate(case.layer("gloss")), 0).astype(np.float32)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        added = np.float32(values["specular_scale"]) * aux.reshape(case.pictures.shape)
        state.lens.append(lambda picture: picture + added)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {}
