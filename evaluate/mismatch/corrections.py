"""What an effect changes in the fields of a simulation, where there are fields for it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, zoom

from materials.foundation.errors import InputError
from scene.simulation import RGB, DirectionalLight, EnvironmentLight, Light, Material, PointLight, Simulation, SphereLight, Texture

from .case import Case, Floats
from .surface_map import BINS, bins, gathered, looked_up, pieces_of


def material_on(simulation: Simulation, shape: str) -> Material:
    """Return the material of a shape."""
    return simulation.materials[next(s.material for s in simulation.shapes if s.name == shape)]


def with_material(simulation: Simulation, shape: str, **changes: Any) -> Simulation:
    """Return the simulation with another material on a shape; what other shapes have of the same name stays."""
    own = next(s for s in simulation.shapes if s.name == shape)
    material = replace(simulation.materials[own.material], **changes)
    if sum(s.material == own.material for s in simulation.shapes) == 1:
        return replace(simulation, materials=simulation.materials | {own.material: material})
    name = f"{own.material}_{shape}"
    shapes = tuple(replace(s, material=name) if s.name == shape else s for s in simulation.shapes)
    return replace(simulation, shapes=shapes, materials=simulation.materials | {name: material})


def with_power(simulation: Simulation, factors: dict[str, NDArray]) -> Simulation:
    """Return the simulation with the light of lamps and skies times a factor a channel, by name."""
    return replace(simulation, lights=simulation.lights | {n: _scaled(simulation.lights[n], f) for n, f in factors.items()})


def _scaled(light: Light, factor: NDArray) -> Light:
    if isinstance(light, DirectionalLight):
        return replace(light, irradiance=rgb(np.array(light.irradiance) * factor))
    if isinstance(light, EnvironmentLight):
        return replace(light, radiance=rgb(np.array(light.radiance) * factor))
    assert isinstance(light, PointLight | SphereLight)
    return replace(light, intensity=rgb(np.array(light.intensity) * factor))


def rgb(values: NDArray) -> RGB:
    """Return an array (3,) as a tuple of plain numbers."""
    x, y, z = (float(v) for v in values)
    return x, y, z


def as_map(case: Case, shape: int, values: Floats) -> Texture:
    """Return values of pieces (N,) or (N, C) as a map over a shape's texture coordinates (BINS, BINS) or (BINS, BINS, C).

    Bins that no picture shows have the value of the nearest that one does.
    """
    rows = pieces_of(case, shape)
    columns = values[rows].reshape(len(rows), -1)
    sums = gathered(np.column_stack([columns, np.ones(len(rows))]), bins(case, rows), 0.0)
    seen = sums[-1] > 0
    if not seen.any():
        return np.zeros((BINS, BINS, *values.shape[1:]), np.float32)
    mean = sums[:-1] / np.maximum(sums[-1], 1)
    nearest = distance_transform_edt(~seen, return_distances=False, return_indices=True)
    filled = np.moveaxis(mean[:, nearest[0], nearest[1]], 0, -1).astype(np.float32)
    return filled[..., 0] if values.ndim == 1 else filled


def from_map(case: Case, shape: int, field: Texture | None, channels: int) -> Floats:
    """Return the first channels of a map (H, W) or (H, W, C) at the pieces of a shape (N, channels); 0 on other shapes."""
    if field is None:
        raise InputError("be given", key="map", remedy="This effect cannot be had without the map that was found with it.")
    layers = field[..., None] if field.ndim == 2 else field
    own = np.flatnonzero(case.pieces.shape == shape)
    out = np.zeros((len(case.pieces), channels), np.float32)
    for k in range(channels):
        out[own, k] = looked_up(resized(layers[..., k], BINS, BINS), case.pieces.uv[own])
    return out


def resized(field: Texture, height: int, width: int) -> Texture:
    """Return a map at another number of texels, with the same texture coordinates, bilinear."""
    factors = (height / field.shape[0], width / field.shape[1], *[1.0] * (field.ndim - 2))
    return zoom(field, factors, order=1, mode="grid-wrap", grid_mode=True).astype(np.float32)
