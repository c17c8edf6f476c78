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
# Of a single scattering, as it shows in how light leaves at which angle: from 0.9 to 1 that hardly changes.
_ALBEDO = 0.9


def without_surface(cosine_i: NDArray, cosine_o: NDArray) -> NDArray[np.float64]:
    """Return by how much more a deep medium without a surface reflects than a matte surface of the same albedo.

    Chandrasekhar (1960), with the function H of Hapke (1981), eqs 10 and 37.
    """
    gamma = np.sqrt(1 - _ALBEDO)
    h_i, h_o = ((1 + 2 * c) / (1 + 2 * c * gamma) for c in (cosine_i, cosine_o))
    reflected = (1 - gamma) / (1 + gamma) * (1 - gamma / (3 * (1 + gamma)))
    return _ALBEDO / 4 * h_i * h_o / np.maximum(cosine_i + cosine_o, 0.02) / reflected


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
        # A scale of the albedo that is free is that of green.
        free = "albedo_scale" in case.material_of(shape_index(case, target)).free
        near = tuple(Parameter(f"near.{c}", 1.0, 0.05, 20.0, 0.02) for c in ("rb" if free else "rgb"))
        far = tuple(Parameter(f"far.{c}", 0.3, 0.0, 20.0, 0.02) for c in "rgb")
        length = Parameter("diffusion_length", 0.1 * size, 0.005 * size, 2 * size, 0.01 * size, "m")
        return (length, *near, *far, Parameter("grazing", 0.5, 0.0, 1.0, 0.02))

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
        near, far = (np.array([values.get(f"{part}.{c}", 1.0) for c in "rgb"]) for part in ("near", "far"))
        # Ambient light is reflected by the near part's albedo.
        added = np.zeros((len(case.pieces), 3), np.float32)
        added[own] = irradiance * far / (np.pi * near)
        row[shade.SCALE : shade.SCALE + 3] *= near
        state.add_ambient(added)
        arriving = np.ones_like(state.visible)
        arriving[own] = 1 + np.float32(values["grazing"]) * (self._angles(case, state, own, slots) - 1)
        state.arriving = arriving if not len(state.arriving) else state.arriving * arriving

    def _angles(self, case: Case, state: State, own: NDArray, slots: NDArray) -> NDArray[np.float32]:
        """Return `without_surface` of the pieces' view and of each of their lamps (N, S)."""
        p, out = case.pieces, np.ones(slots.shape, np.float32)
        facing = np.clip((p.normal[own] * p.view[own]).sum(axis=1), 0, 1)
        for s in range(slots.shape[1]):
            lamp = state.lamps[slots[:, s]]
            to = np.where(lamp[:, :1] == fragments.POINT, lamp[:, 1:4] - p.position[own], lamp[:, 1:4])
            cosine = np.clip((to * p.normal[own]).sum(axis=1) / np.linalg.norm(to, axis=1), 0, 1)
            out[:, s] = np.where(slots[:, s] >= 0, without_surface(cosine, facing), 1.0)
        return out

    def _spread(self, aux: Any, length: float) -> NDArray[np.float32]:
        """Return what comes to each place from all others, per lamp; the last is kept, as most derivatives leave it as it is."""
        if aux.get("length") != length:
            # An exponential stands for the dipole's profile (H. W. Jensen et al., 2001): one length, no peak at its centre.
            kernel = np.exp(aux["apart"] / np.float32(-length))
            aux["length"], aux["spread"] = length, kernel @ aux["E"] / kernel.sum(axis=1, keepdims=True)
        return aux["spread"]
