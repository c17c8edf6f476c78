"""The street put together: what stands, what moves, who looks at it, dry and wet."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.kernels.fresnel import diffuse_internal
from materials.wetness import ETA_WATER, diffuse_attenuation

from ..camera import Camera
from ..mesh import Mesh
from ..simulation import Film, Light, Material, Shape, Simulation
from . import layout as at
from .drive import AHEAD, ONCOMING, WALKER, cameras, object_poses, on_wheels, scanner_pose
from .facade import houses
from .furniture import bin_, crossing_sign, lamp_post
from .ground import Sheet, sheet
from .ground_textures import GroundPaint, Look
from .materials import fixed_materials
from .pedestrian import pedestrian
from .relief import Relief
from .settings import StreetSettings
from .sky import lights
from .solids import moved
from .trees import tree
from .vehicles import HATCHBACK, SALOON, car
from .water import ASPHALT_TEXTURE, SLAB_TEXTURE, Hydrology, Water

ASPHALT_ETA = 1.63
_FILM_CELL = 0.04
# Width of the facets of asphalt whose stones carry a skin of water but stand out of the sheet: our choice, between the
# dry 0.5-0.8 and the 0 of still water.
_WET_ALPHA = 0.3


@dataclass(frozen=True)
class Street:
    """A world whose truth is known.

    Attributes
    ----------
    settings : StreetSettings
    relief : Relief
        The true height field.
    sheet : Sheet
        The ground's mesh lines.
    static : tuple of Shape
        All that stands still; the ground first.
    moving : dict of instance id to tuple of Shape
        In their own frames.
    poses : tuple of dict
        Per frame, `T_world_object` by instance id.
    cameras : tuple of Camera
        One per frame.
    scanner_poses : tuple of (4, 4)
        `T_world_scanner` of the LiDAR per frame.
    materials, lights
        By name; dry.
    looks : dict of Look
        Textures of the ground by patch name.
    """

    settings: StreetSettings
    relief: Relief
    sheet: Sheet
    static: tuple[Shape, ...]
    moving: dict[int, tuple[Shape, ...]]
    poses: tuple[dict[int, NDArray[np.float64]], ...]
    cameras: tuple[Camera, ...]
    scanner_poses: tuple[NDArray[np.float64], ...]
    materials: dict[str, Material]
    lights: dict[str, Light]
    looks: dict[str, Look]
    _wet: dict[float, tuple[tuple[Shape, ...], dict[str, Material]]] = field(default_factory=dict, repr=False, compare=False)
    _hydrology: list[Hydrology] = field(default_factory=list, repr=False, compare=False)

    def moving_shapes(self, frame: int) -> tuple[Shape, ...]:
        """Return the moving things where they are in a frame."""
        self._check_frame(frame)
        out = []
        for instance, shapes in self.moving.items():
            T = self.poses[frame][instance]
            out += [Shape(s.name, moved(s.mesh, T), s.material, instance, s.kind) for s in shapes]
        return tuple(out)

    def simulation(self, frame: int, wetness: float | None = None) -> Simulation:
        """Return the world of a frame: dry, or truly wet.

        Parameters
        ----------
        frame : int
        wetness : float, optional
            Strength of the shower in [0, 1] (`water.SHOWER` metres of rain at 1); None is dry.

        Raises
        ------
        InputError
            If there is no such frame or the wetness is out of range.
        """
        static, materials = self.static, self.materials
        if wetness is not None:
            check_range("wetness", wetness, "[0, 1]")
            static, materials = self._wet_ground(float(wetness))
        return Simulation((*static, *self.moving_shapes(frame)), materials, self.lights)

    def water(self, wetness: float) -> Water:
        """Return where the water is after a shower."""
        check_range("wetness", wetness, "[0, 1]")
        if not self._hydrology:
            self._hydrology.append(Hydrology(self.relief))
        return self._hydrology[0].after(wetness)

    def _check_frame(self, frame: int) -> None:
        if not 0 <= frame < self.settings.frames:
            raise InputError(f"lie in [0, {self.settings.frames - 1}]", got=frame, key="frame")

    def _wet_ground(self, w: float) -> tuple[tuple[Shape, ...], dict[str, Material]]:
        if w not in self._wet:
            water = self.water(w)
            # Standing water is a surface of its own: the ground's sheet is lifted to it where it stands, and the film's
            # interface then follows the sheet. What lies below is drawn at the surface, off by less than its 3 cm depth.
            meshes = self.sheet.meshes(water.surface(self.sheet.x, self.sheet.y, self.sheet.z))
            wet = {name: self._wet_material(name, water) for name in meshes}
            static = tuple(Shape(s.name, meshes.get(s.name, s.mesh), s.material, 0, s.kind) for s in self.static)
            self._wet[w] = (static, self.materials | wet)
        return self._wet[w]

    def _wet_material(self, name: str, water: Water) -> Material:
        patch = next(p for p in self.sheet.patches if p.name == name)
        look, dry = self.looks[name], self.materials[name]
        s = water.saturation
        # A dense, non-porous patch (paint, iron) soaks up little: full darkening from a porosity of 0.15 on.
        soak = s * np.clip(look.porosity / 0.15, 0, 1)
        factor = diffuse_attenuation(look.albedo, soak, look.porosity, "lekner_dorf").astype(np.float32)
        coverage = None
        film = None
        if patch.strip in ("road", "pavement"):
            texture = ASPHALT_TEXTURE if patch.strip == "road" else SLAB_TEXTURE
            rows = max(2, round((patch.y1 - patch.y0) / _FILM_CELL))
            cols = max(2, round((patch.x1 - patch.x0) / _FILM_CELL))
            x = patch.x0 + (np.arange(cols) + 0.5) * (patch.x1 - patch.x0) / cols
            y = patch.y0 + (np.arange(rows) + 0.5) * (patch.y1 - patch.y0) / rows
            coverage, thickness = water.coverage(x, y, texture)
            film = Film(coverage, thickness, eta=ETA_WATER, alpha=0.0, level=False)
        if coverage is not None:
            # Lekner and Dorf's factor has two parts: the base absorbs more below water, and the water's surface sends
            # light back to be absorbed again. Below a film the tracer does the second part itself.
            p = diffuse_internal(ETA_WATER)
            full = diffuse_attenuation(look.albedo, 1.0, look.porosity, "lekner_dorf")
            below = full / ((1 - p) + p * look.albedo * full)
            c = _resized(coverage, look.albedo.shape[:2])[..., None]
            factor = factor * (1 - c) + (1 + (below - 1) * soak[..., None]) * c
        # A skin of water around the grains smooths what stays uncovered.
        alpha = (look.alpha * (1 - s) + _WET_ALPHA * s).astype(np.float32)
        albedo = (look.albedo * factor).astype(np.float32)
        return Material(
            dry.model, albedo_texture=albedo, eta=dry.eta, alpha_texture=alpha if dry.model == "ggx" else None, film=film
        )


def street(settings: StreetSettings | None = None) -> Street:
    """Build the street. The same settings give the same street, to the bit."""
    settings = settings or StreetSettings()
    streams = [np.random.default_rng([settings.seed, k]) for k in range(8)]
    wear = at.damage(streams[0])
    relief = Relief(wear, streams[1])
    ground = sheet(relief, settings.detail)
    painter = GroundPaint(wear, relief, settings.detail, streams[2])
    looks = {patch.name: painter.look(patch) for patch in ground.patches}
    materials = fixed_materials(streams[3])
    kinds = {}
    for patch in ground.patches:
        look = looks[patch.name]
        kinds[patch.name] = patch.kind
        if patch.strip == "road":
            materials[patch.name] = Material("ggx", albedo_texture=look.albedo, eta=ASPHALT_ETA, alpha_texture=look.alpha)
        else:
            materials[patch.name] = Material("lambert", albedo_texture=look.albedo)
    static = [Shape(name, mesh, name, 0, kinds[name]) for name, mesh in ground.meshes().items()]
    static += _standing(relief, streams[4], streams[5])
    moving = {
        AHEAD: _shapes("car_ahead", car(HATCHBACK, "paint_red"), AHEAD, "vehicle"),
        ONCOMING: _shapes("car_oncoming", car(SALOON, "paint_blue"), ONCOMING, "vehicle"),
        WALKER: _shapes("pedestrian", pedestrian(), WALKER, "pedestrian"),
    }
    scanner = tuple(scanner_pose(settings, relief, frame) for frame in range(settings.frames))
    return Street(
        settings,
        relief,
        ground,
        tuple(static),
        moving,
        object_poses(settings, relief),
        cameras(settings, relief),
        scanner,
        materials,
        lights(settings.sky),
        looks,
    )


def _standing(relief: Relief, house_rng: np.random.Generator, tree_rng: np.random.Generator) -> list[Shape]:
    base = [float(relief.height(20.0, y)) for y in (at.WALL_LEFT - 0.01, at.WALL_RIGHT + 0.01)]
    out = [Shape(f"house_{name}", mesh, name, 0, "building") for name, mesh in houses(house_rng, *base).items()]
    for i, (x, y) in enumerate(at.TREES):
        foot = np.array([x, y, float(relief.height(x, y))])
        near = 1.0 if -10 < x < 40 else 0.6
        wood, leaves = tree(
            foot, tree_rng, leaves=int(5600 * near), height=tree_rng.uniform(5.9, 7.0), spread=tree_rng.uniform(1.6, 1.95)
        )
        out += [Shape(f"tree_{i}_wood", wood, "bark", 0, "vegetation"), Shape(f"tree_{i}_leaves", leaves, "leaf", 0, "vegetation")]
    things: list[tuple[str, dict[str, Mesh]]] = []
    for i, (x, y) in enumerate(at.LAMPS):
        things.append((f"lamp_{i}", lamp_post(np.array([x, y, float(relief.height(x, y))]), -1.0)))
    for i, (x, y, facing) in enumerate([(at.ZEBRA[0] - 0.5, -6.15, -1.0), (at.ZEBRA[1] + 0.5, 4.0, 1.0)]):
        things.append((f"sign_{i}", crossing_sign(np.array([x, y, float(relief.height(x, y))]), facing)))
    for i, (x, y, yaw) in enumerate([(8.9, -7.75, np.pi), (9.6, -7.72, np.pi), (12.2, 7.05, 0.0)]):
        things.append((f"bin_{i}", bin_(np.array([x, y, float(relief.height(x, y))]), yaw)))
    for name, parts in things:
        out += [Shape(f"{name}_{part}", mesh, part, 0, "furniture") for part, mesh in parts.items()]
    paints = ("paint_silver", "paint_white", "paint_black", "paint_green")
    for i, x in enumerate(at.PARKED):
        parts = car((SALOON, HATCHBACK)[i % 2], paints[i % 4])
        T = on_wheels(relief, x, at.PARKING, 0.0 if i % 3 else 0.02)
        out += [Shape(f"parked_{i}_{part}", moved(mesh, T), part, 0, "parked") for part, mesh in parts.items()]
    return out


def _shapes(name: str, parts: dict[str, Mesh], instance: int, kind: str) -> tuple[Shape, ...]:
    return tuple(Shape(f"{name}_{part}", mesh, part, instance, kind) for part, mesh in parts.items())


def _resized(values: NDArray[np.float32], shape: tuple[int, int]) -> NDArray[np.float32]:
    import cv2

    return np.asarray(cv2.resize(values, shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)
