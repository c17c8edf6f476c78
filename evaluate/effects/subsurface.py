"""Light that leaves a body elsewhere than where it entered."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..kernels import diffused, fragments, shade
from ..mismatch.case import Case
from ..mismatch.effect import Context, Effect, Parameter, Values, shape_index, shapes_seen
from ..mismatch.formation import State, frame_of

_SAMPLES = 1200


class Subsurface(Effect):
    id = "subsurface"
    stage = "surface"
    title = "light that travels below the surface"
    says = "shading on one body is blurred along its surface: light bleeds into its shadows, and thin parts glow"
    taken_for = ("defocus", "interreflection", "rough_diffuse")
    decides = "project a sharp edge of light onto the body"
    coordinates = "surface"
    approximation = 0.25

    def targets(self, case: Case) -> list[str | None]:
        return list(shapes_seen(case, 0.01)) if len(case.lamps) else []

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        size = self._size(case, target)
        colour = tuple(Parameter(f"factor.{c}", 1.0, 0.05, 20.0, 0.02) for c in "rgb")
        return (
            Parameter("diffusion_length", 0.1 * size, 0.005 * size, 2 * size, 0.01 * size, "m"),
            Parameter("local_share", 0.2, 0.0, 1.0, 0.02),
            *colour,
        )

    def _size(self, case: Case, target: str | None) -> float:
        v = case.world.shapes[shape_index(case, target)].mesh.vertices
        return float(np.linalg.norm(v.max(axis=0) - v.min(axis=0)))

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Irradiance at places spread over the body under each lamp, their distances, and who is near which piece."""
        shape = shape_index(case, target)
        mesh = case.world.shapes[shape].mesh
        assert mesh.normals is not None
        rng = np.random.default_rng(3)
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        face = np.sort(rng.choice(len(area), _SAMPLES, p=area / area.sum()))
        u, v = rng.random((2, _SAMPLES))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        share = np.stack([1 - u - v, u, v], 1)[..., None]
        at = (corners[face] * share).sum(axis=1)
        n = (mesh.normals[mesh.faces[face]].astype(np.float64) * share).sum(axis=1)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        rows, none = np.arange(_SAMPLES), np.zeros((_SAMPLES, 3), np.float32)
        irradiance = []
        for i, lamp in enumerate(context.state.lamps):
            lit = np.zeros(_SAMPLES)
            lamp_of = np.full(_SAMPLES, i)
            fragments.visibility(case.world.arrays, rows, at, n, none, none, lamp_of, context.state.lamps, 1, lit)
            if lamp[0] == fragments.POINT:
                d = lamp[1:4] - at
                r2 = (d**2).sum(axis=1)
                cos = (d * n).sum(axis=1) / np.sqrt(r2)
            else:
                r2, cos = 1.0, n @ lamp[1:4]
            irradiance.append(lit * np.maximum(cos, 0) / r2)
        own = np.flatnonzero(case.pieces.shape == shape)
        distance, near = cKDTree(at).query(case.pieces.position[own], k=6)
        weight = 1 / (distance + 1e-6) ** 2
        apart = np.linalg.norm(at[:, None] - at[None], axis=-1).astype(np.float32)
        return {
            "E": np.float32(np.array(irradiance).T), "apart": apart, "own": own, "near": near,
            "weight": weight / weight.sum(axis=1, keepdims=True), "shape": shape,
        }  # fmt: skip

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        own, slots = aux["own"], case.slots[frame_of(case)[aux["own"]]]
        row = state.surfaces[aux["shape"]]
        irradiance = np.empty((len(own), 3))
        spread = self._spread(aux, float(values["diffusion_length"]))
        diffused.irradiance(spread, aux["near"], aux["weight"], slots, state.lamps, irradiance)
        factor = np.array([values[f"factor.{c}"] for c in "rgb"])
        share = values["local_share"]
        added = np.zeros((len(case.pieces), 3), np.float32)
        added[own] = irradiance * factor * (1 - share) / (np.pi * max(share, 1e-3))
        row[shade.SCALE : shade.SCALE + 3] *= max(share, 1e-3)
        state.add_ambient(added)

    def _spread(self, aux: Any, length: float) -> NDArray[np.float32]:
        """Return what comes to each place from all others, per lamp; the last is kept, as most derivatives leave it as it is."""
        if aux.get("length") != length:
            # An exponential stands for the dipole's profile (H. W. Jensen et al., 2001): one length, no peak at its centre.
            kernel = np.exp(aux["apart"] / np.float32(-length))
            aux["length"], aux["spread"] = length, kernel @ aux["E"] / kernel.sum(axis=1, keepdims=True)
        return aux["spread"]
