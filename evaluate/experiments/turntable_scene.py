"""A turntable under a dome of lamps, photographed by a real camera or as calibrated: chapter 4 of the thesis (4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from materials.directions import even_directions
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import Light, Material, PointLight, Shape, Simulation, SphereLight, Transport
from scene.transforms import look_at

from ..mismatch.corrections import rgb
from .settings import ReflectanceFieldsSettings

Floats = NDArray[np.float64]
OBJECT, PLATE = "object", "plate"
# Lamps: how far off, how large where they are no points [m], and the lowest elevation that one stands at [degrees].
_DOME, _LAMP, _LOWEST = 0.9, 0.008, 8.0
# Elevation of the camera [degrees], its distance and the height that it aims at [m], and what a metre fills of the picture's width.
_ELEVATION = {"top": 60.0, "frontal": 15.0}
_DISTANCE = 0.6
_AIM = {"pyramid": 0.035, "figure": 0.055}
_SCALE = {"pyramid": 5.4, "figure": 6.6}
_PLATE_RADIUS = 0.115


@dataclass(frozen=True)
class Turntable:
    """Lamps and a camera.

    Attributes
    ----------
    lamps : (L, 3) float64
        Positions [m].
    camera : Camera
    """

    lamps: Floats
    camera: Camera

    def scene(self, frame: int, mesh: Mesh, material: Material, bounces: int) -> Simulation:
        """Return the object on its blackened plate, turned by so many degrees."""
        lights = {f"lamp{i}": self._lamp(place, material) for i, place in enumerate(self.lamps)}
        black = Material("lambert", albedo_texture=_black())
        shapes = (Shape(OBJECT, turned(mesh, frame), OBJECT), Shape(PLATE, turned(plate(), frame), PLATE))
        return Simulation(shapes, {OBJECT: material, PLATE: black}, lights, Transport(bounces))

    def _lamp(self, place: Floats, material: Material) -> Light:
        """Return a lamp as it costs least: of points, each is met at each scattering; of small balls, one drawn at random."""
        brightness = _DOME**2 * 2 * np.pi / len(self.lamps)
        power = (brightness, brightness, brightness)
        return PointLight(rgb(place), power) if material.interior is None else SphereLight(rgb(place), _LAMP, power)


def as_calibrated(settings: ReflectanceFieldsSettings, name: str, view: str) -> Turntable:
    """Return lamps and camera around an object where the calibration says that they are."""
    lowest = 90.0 - _LOWEST
    elevation, width = np.radians(_ELEVATION[view]), settings.width
    eye = np.array([_DISTANCE * np.cos(elevation), 0.0, _AIM[name] + _DISTANCE * np.sin(elevation)])
    focal = _SCALE[name] * width * _DISTANCE
    pose = look_at(eye, np.array([0.0, 0.0, _AIM[name]]))
    camera = Camera("PINHOLE", width, width, pose, focal, focal, width / 2, width / 2)
    return Turntable(_DOME * even_directions(settings.lamps, lowest), camera)


def as_it_is(settings: ReflectanceFieldsSettings, name: str, view: str) -> Turntable:
    """Return lamps and camera off by errors of the sizes of a calibration (thesis, 4.3.3), the same in all frames."""
    known = as_calibrated(settings, name, view)
    rng = np.random.default_rng([settings.seed, 11, list(_ELEVATION).index(view)])
    # Root mean square over directions about each of two axes.
    turn = np.radians(settings.light_error_deg) / np.sqrt(2) * rng.standard_normal((len(known.lamps), 3))
    towards = known.lamps / _DOME
    turn -= (turn * towards).sum(axis=1, keepdims=True) * towards
    lamps = Rotation.from_rotvec(turn).apply(known.lamps)
    shift = settings.camera_error_px / np.sqrt(2) * rng.standard_normal(2)
    camera = replace(known.camera, cx=known.camera.cx + float(shift[0]), cy=known.camera.cy + float(shift[1]))
    return Turntable(np.asarray(lamps, np.float64), camera)


def turned(mesh: Mesh, degrees: float) -> Mesh:
    """Return a mesh turned about the turntable's axis."""
    R = Rotation.from_rotvec(np.radians(degrees) * np.array([0.0, 0.0, 1.0])).as_matrix()
    normals = None if mesh.normals is None else (mesh.normals.astype(np.float64) @ R.T).astype(np.float32)
    return replace(mesh, vertices=(mesh.vertices.astype(np.float64) @ R.T).astype(np.float32), normals=normals)


def plate() -> Mesh:
    """Return the plate: a disc just below the object, with u and v over the square around it."""
    phi = np.linspace(0, 2 * np.pi, 97)[:-1]
    rim = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    flat = np.concatenate([np.zeros((1, 2)), rim])
    points = np.concatenate([_PLATE_RADIUS * flat, np.full((97, 1), -0.0004)], axis=1).astype(np.float32)
    i = np.arange(96)
    faces = np.stack([0 * i, 1 + i, 1 + (i + 1) % 96], axis=1).astype(np.uint32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (97, 1))
    return Mesh(points, faces, normals, (0.5 + 0.5 * flat).astype(np.float32))


def _black() -> NDArray[np.float32]:
    """Return the plate's albedo (256, 256, 3): black paint, a little uneven."""
    grain = np.random.default_rng(17).standard_normal((256, 256))
    return np.repeat(np.clip(0.04 * (1 + 0.25 * grain), 0.005, 0.2)[..., None], 3, axis=2).astype(np.float32)
