"""A virtual dome about a body: the reflectance field of each texel of its scan, as a dome measures objects (thesis, 4.3.1).

What is lit and seen is the body itself, with all its relief, its interior, and the light it sends to itself. What the
reflectance is told of are the texels of a smoother mesh, the scan: directions are in its frames, and relief moves in parallax
within them. As in the thesis, light comes from any direction above the scan's surface; the body floats free.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from materials.abrdf import ABRDF, pairs
from materials.btf import BTF
from materials.btf_tiles import compress_tiles
from materials.directions import even_directions, solid_angles
from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from materials.foundation.settings import check_settings, setting
from materials.kernels import kinds
from scene.mesh import Mesh
from scene.simulation import Medium, Shape, Simulation

from .embree import EmbreeScene
from .kernels import measured as rays
from .kernels import mesh_dome as kernel
from .measured import surface_frames
from .media import both_or_none, compile_medium
from .world import World, compile_world

Floats = NDArray[np.float64]
_TILE_BYTES = 64 << 20


@dataclass(frozen=True)
class MeshDomeSettings:
    """How the dome measures a body."""

    lights: int = setting(151, "directions of light", within="[4, 4096]")
    views: int = setting(151, "directions of view", within="[4, 4096]")
    rim_deg: float = setting(75.0, "largest elevation angle of both", within="(0, 80]")
    samples: int = setting(1, "paths per texel and view; each serves all lights", within="[1, 65536]")
    bounces: int = setting(4, "scattering events per path; 1 is direct light", within="[1, 1024]")
    stride: int = setting(8, "vertices after the first join one light in so many", within="[1, 4096]")
    rank: int = setting(32, "factors kept", within="[1, 1024]")
    some: int = setting(512, "texels that the factors are taken from", within="[1, 65536]")
    seed: int = setting(0, "seed of the paths", within="[0, 4294967295]")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class Texels:
    """Places on a mesh, texel by texel in row order.

    Attributes
    ----------
    places : (T, 3) float64
        [unit of the mesh]
    frames : (T, 3, 3) float64
        Rows x (along dp/du), y, n.
    edges : (T, 2, 3) float64
        How the place moves over the width, and over the height, of the texel.
    """

    places: Floats
    frames: Floats
    edges: Floats


def texels_of(mesh: Mesh, width: int, height: int) -> Texels:
    """Return the texels of a mesh; those that lie outside its charts take the place of the nearest one within.

    Raises
    ------
    InputError
        If the mesh has no normals or u, v, or no texel's centre lies within its charts.
    """
    if mesh.normals is None or mesh.uv is None:
        raise InputError("have normals and u, v", key="mesh")
    # The charts are a flat mesh of their own; a ray that falls on it finds face and place.
    flat = np.column_stack([mesh.uv, np.zeros(len(mesh.uv), np.float32)])
    scene = EmbreeScene(flat, mesh.faces)
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    origins = np.column_stack([u.ravel(), v.ravel(), np.ones(u.size)])
    faces, found = np.empty(u.size, np.int64), np.empty((u.size, 3))
    rays.nearest(scene.handle, origins, np.tile([0.0, 0.0, -1.0], (u.size, 1)), faces, found)
    known = faces.reshape(height, width) >= 0
    if not known.any():
        raise InputError("cover the centre of a texel with its u, v", key="mesh")
    near = distance_transform_edt(~known, return_distances=False, return_indices=True)
    source = (near[0] * width + near[1]).ravel()
    corners = mesh.faces[faces[source]].astype(np.int64)
    b1, b2 = found[source, 0], found[source, 1]
    shares = np.stack([1 - b1 - b2, b1, b2], axis=1)
    p = mesh.vertices[corners].astype(np.float64)
    frames, _ = surface_frames(mesh, corners, shares)
    d = np.diff(mesh.uv[corners].astype(np.float64), axis=1, append=mesh.uv[corners][:, :1])  # uv along two edges, then back
    e = np.diff(p, axis=1, append=p[:, :1])
    det = d[:, 0, 0] * d[:, 1, 1] - d[:, 0, 1] * d[:, 1, 0]
    along = (d[:, 1, 1:] * e[:, 0] - d[:, 0, 1:] * e[:, 1]) / det[:, None]
    down = (d[:, 0, :1] * e[:, 1] - d[:, 1, :1] * e[:, 0]) / det[:, None]
    places = np.einsum("tk,tkc->tc", shares, p)
    return Texels(places, np.ascontiguousarray(frames.transpose(0, 2, 1)), np.stack([along / width, down / height], axis=1))


class MeshDome:
    """A body in the dome.

    Parameters
    ----------
    body : Simulation
        Shapes and materials, closed bodies with their faces outwards: opaque, or index-matched (`dielectric`, eta 1) around
        a medium. Its lights are passed over.
    reach : float
        How far above the scan a view begins: more than the relief, less than the way to other parts [unit of the meshes].

    Raises
    ------
    InputError
        If a surface bends light, or glows.
    """

    def __init__(self, body: Simulation, reach: float, settings: MeshDomeSettings = MeshDomeSettings()) -> None:
        check_range("reach", reach, "(0, inf)")
        self.settings, self.reach = settings, float(reach)
        still = tuple(Shape(s.name, s.mesh, s.material) for s in body.shapes)
        self.world: World = compile_world(Simulation(still, body.materials))
        arrays, bodies = self.world.arrays, self.world.bodies
        for i, name in enumerate(body.materials):
            kind, matched = arrays.material_kind[i], bodies is not None and bodies.matched[i]
            if kind == kinds.EMISSION or (kind in (kinds.DIELECTRIC, kinds.ROUGH_DIELECTRIC) and not matched):
                raise InputError(
                    "be opaque, or index-matched around a medium", got=body.materials[name].model, key=f"materials.{name}"
                )
        self.wi = even_directions(settings.lights, settings.rim_deg)
        self.wo = even_directions(settings.views, settings.rim_deg)
        self._weight = np.outer(solid_angles(self.wi), solid_angles(self.wo)).reshape(-1)

    def measure(self, texels: Texels, which: NDArray[np.int64]) -> ABRDF:
        """Return the reflectance of some texels, not normalised; each the same whatever others are asked for."""
        s, w = self.settings, self.world
        out = np.zeros((len(which), len(self.wi), len(self.wo), 3), np.float32)
        # Always with media, though empty, so that one compiled kernel serves all bodies.
        medium, bodies = both_or_none(w.medium or compile_medium(Medium(0.0)), w.bodies, len(w.arrays.material_kind))
        given = (w.arrays, w.tables, medium, bodies, w.bodies is not None, which, texels.places[which], texels.frames[which])
        how = (self.reach, s.samples, s.bounces, s.stride, s.seed)
        kernel.acquire(*given, texels.edges[which], self.wi, self.wo, *how, out)
        value, grid = out.reshape(len(which), -1, 3), (len(self.wi), len(self.wo))
        valid = np.ones(value.shape[:2], bool)
        return ABRDF(*pairs(self.wi, self.wo), value, valid, self._weight, normalised=False, grid=grid)

    def btf(self, scan: Mesh, width: int, height: int, label: str = "dome") -> BTF:
        """Return the compressed BTF of all texels of a scan of the body, measured tile by tile.

        Raises
        ------
        InputError
            As `texels_of`.
        """
        s, texels, num = self.settings, texels_of(scan, width, height), width * height
        some = np.sort(np.random.default_rng([s.seed, 43]).permutation(num)[: s.some])
        step = max(_TILE_BYTES // (len(self.wi) * len(self.wo) * 12), 1)

        def tiles() -> Iterator[ABRDF]:
            for first in tracked(range(0, num, step), label, -(-num // step)):
                yield self.measure(texels, np.arange(first, min(first + step, num)))

        return compress_tiles(self.measure(texels, some), tiles(), np.ones((height, width), bool), s.rank, s.seed)
