"""Two objects for a turntable: a fissured pyramid of clay that light enters, and a finely sculpted figure of copper.

Each is a closed surface over u (about the axis) and v (from the middle of its foot to its top), with fine relief; and a
coarser mesh of the same u and v that has no relief below what a scan resolves, as measured objects have (thesis, table 4.1:
edges of 0.7 to 0.9 mm).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from materials.conductor import METALS
from scene.mesh import Mesh
from scene.simulation import Material, Medium

Floats = NDArray[np.float64]
# Of the surface: what v below this is the foot.
_FOOT = 0.12
# Cells of the coarse mesh each way, and of the fine one at detail 1.
_COARSE, _FINE = 160, 640


@dataclass(frozen=True)
class TurntableObject:
    """An object, as it is and as it was scanned.

    Attributes
    ----------
    fine, coarse : Mesh
        Closed, with normals and the same u and v; the z axis is the turntable's [m].
    material : Material
    reach : float
        How far the two lie apart at most [m].
    """

    name: str
    fine: Mesh
    coarse: Mesh
    material: Material
    reach: float


def pyramid(detail: float = 1.0, seed: int = 0) -> TurntableObject:
    """Return the pyramid: 12 cm wide, 9 cm high, matte through and through, with fissures up to 3 mm deep."""
    cells = max(round(_FINE * detail), 48)
    phi, v = _grid(cells)
    base = _revolved(v, phi, [(0.0, 0.0), (0.06, 0.0), (0.006, 0.088), (0.0, 0.09)], [0.0, _FOOT, 0.97, 1.0])
    base[..., :2] *= _rounded_square(phi)[..., None]
    fields = [_noise([seed, k], cells, power) for k, power in ((1, 2.4), (2, 2.4), (3, 1.6))]
    # Fissures run where two fields cross zero; the ground between them is grainy.
    cracks = sum(np.exp(-((f / 0.07) ** 2)) for f in fields[:2])
    relief = (-0.003 * np.clip(cracks, 0, 1) + 0.0002 * fields[2]) * _sides(v)
    clay = Medium(2000.0, (0.92, 0.82, 0.64), 0.0)
    return _object("pyramid", base, relief, Material("dielectric", eta=1.0, interior=clay))


def figure(detail: float = 1.0, seed: int = 0) -> TurntableObject:
    """Return the figure: 12 cm high, of copper with a gloss of alpha 0.2, with ears, a snout, and engraved lines of 0.3 mm."""
    cells = max(round(_FINE * detail), 48)
    phi, v = _grid(cells)
    radii = [(0.0, 0.0), (0.032, 0.0), (0.03, 0.006), (0.019, 0.02), (0.028, 0.045), (0.024, 0.065), (0.012, 0.08)]
    radii += [(0.02, 0.095), (0.019, 0.106), (0.008, 0.118), (0.0, 0.12)]
    base = _revolved(v, phi, radii, [0.0, _FOOT, 0.15, 0.27, 0.45, 0.57, 0.68, 0.8, 0.88, 0.97, 1.0])
    # The head: a snout in front, an ear to each side; the body: folds.
    bumps = 0.016 * _bump(phi, v, 0.0, 0.8, 0.35, 0.05) + 0.010 * _bump(phi, v, 1.9, 0.9, 0.22, 0.03)
    bumps += 0.010 * _bump(phi, v, -1.9, 0.9, 0.22, 0.03) + 0.002 * np.cos(5 * phi) * np.exp(-(((v - 0.42) / 0.12) ** 2))
    radial = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=-1)
    base = base + bumps[..., None] * radial
    lines = np.exp(-((_saw(40 * v + 1.5 * np.sin(6 * phi)) / 0.12) ** 2)) * (v > 0.3) * (v < 0.62)
    mane = np.sin(36 * phi + 4 * np.sin(30 * v)) * np.exp(-(((v - 0.78) / 0.1) ** 2)) * (np.cos(phi) < 0.3)
    relief = (-0.0003 * lines + 0.00025 * mane + 0.00004 * _noise([seed, 4], cells, 1.6)) * _sides(v)
    return _object("figure", base, relief, Material("conductor", alpha=0.2, metal=METALS["copper"]))


OBJECTS = {"pyramid": pyramid, "figure": figure}


def _grid(cells: int) -> tuple[Floats, Floats]:
    """Return phi and v (cells + 1, cells + 1), rows along v."""
    v, u = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    return 2 * np.pi * u, v


def _revolved(v: Floats, phi: Floats, profile: list[tuple[float, float]], at: list[float]) -> Floats:
    """Return points (H, W, 3) about the z axis whose radius and height are linear between places of v, slightly smoothed."""
    line = v[:, 0]
    curve = np.stack([np.interp(line, at, [p[k] for p in profile]) for k in (0, 1)])
    kept = curve.copy()
    curve = gaussian_filter(curve, (0, 0.015 * len(line)), mode="nearest")
    # The axis stays where it is: both ends are points.
    curve[0, [0, -1]], curve[1, [0, -1]] = 0.0, kept[1, [0, -1]]
    radius, height = curve[0][:, None], curve[1][:, None]
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.broadcast_to(height, phi.shape)], axis=-1)


def _rounded_square(phi: Floats) -> Floats:
    return (np.abs(np.cos(phi)) ** 7 + np.abs(np.sin(phi)) ** 7) ** (-1 / 7)


def _sides(v: Floats) -> Floats:
    """Return where relief is, fading out at foot and top."""
    return np.clip((v - _FOOT - 0.02) / 0.03, 0, 1) * np.clip((0.98 - v) / 0.03, 0, 1)


def _bump(phi: Floats, v: Floats, phi0: float, v0: float, width: float, height: float) -> Floats:
    away = (phi - phi0 + np.pi) % (2 * np.pi) - np.pi
    return np.exp(-((away / width) ** 2) - ((v - v0) / height) ** 2)


def _saw(x: Floats) -> Floats:
    return (x + 0.5) % 1.0 - 0.5


def _noise(seed: list[int], cells: int, power: float) -> Floats:
    """Return 1/f^power noise (cells + 1, cells + 1) of deviation 1 that goes on about the axis, alike at every detail."""
    rng = np.random.default_rng(seed)
    waves = 48
    spectrum = rng.standard_normal((waves, 2 * waves, 2)) @ (1, 1j)
    fu, fv = np.arange(waves)[:, None], np.arange(-waves, waves)[None, :]
    f = np.hypot(fu, 0.7 * fv)
    spectrum = spectrum * np.where(f > 2, np.maximum(f, 1.0) ** (-power / 2 - 0.5), 0)
    t = 2 * np.pi * np.linspace(0, 1, cells + 1)
    field = np.real(np.exp(0.7j * np.outer(t, fv[0])) @ spectrum.T @ np.exp(1j * np.outer(fu[:, 0], t)))
    return field / field.std()


def _object(name: str, base: Floats, relief: Floats, material: Material) -> TurntableObject:
    n = _normals(base)
    cells = len(base) - 1
    # A scan sees means over 1.2 mm or so; it has every few rows and columns.
    sigma = cells / _COARSE
    seen = gaussian_filter(relief, (sigma, sigma), mode=("nearest", "wrap"))
    step = max(cells // _COARSE, 1)
    kept = np.unique(np.append(np.arange(0, cells, step), cells))
    coarse = (base + seen[..., None] * n)[np.ix_(kept, kept)]
    apart = float(np.abs(relief - seen).max())
    return TurntableObject(name, _mesh(base + relief[..., None] * n), _mesh(coarse, kept / cells), material, 1.5 * apart + 0.0005)


def _normals(points: Floats) -> Floats:
    by_v, by_u = np.gradient(points, axis=0), np.gradient(points, axis=1)
    # Central differences across the seam: the last column is the first again.
    by_u[:, 0] = by_u[:, -1] = (points[:, 1] - points[:, -2]) / 2
    n = np.cross(by_u, by_v)
    length = np.linalg.norm(n, axis=-1, keepdims=True)
    n = np.divide(n, length, out=np.zeros_like(n), where=length > 1e-15)
    n[0], n[-1] = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
    return n


def _mesh(points: Floats, at: Floats | None = None) -> Mesh:
    """Return points (H, W, 3) over v and u as a mesh."""
    height, width = points.shape[:2]
    t = np.linspace(0, 1, height) if at is None else at
    v, u = np.meshgrid(t, t, indexing="ij")
    i = (np.arange(height - 1)[:, None] * width + np.arange(width - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + width + 1], axis=1), np.stack([i, i + width + 1, i + width], axis=1)])
    p = points.reshape(-1, 3)
    area = np.linalg.norm(np.cross(p[faces[:, 1]] - p[faces[:, 0]], p[faces[:, 2]] - p[faces[:, 0]]), axis=1)
    normals = _normals(points).reshape(-1, 3).astype(np.float32)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return Mesh(p.astype(np.float32), faces[area > 1e-14].astype(np.uint32), normals, uv)
