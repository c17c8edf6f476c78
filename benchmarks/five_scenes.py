"""Five worlds, each for one kind of light transport, as files that two renderers read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import (
    RGB,
    EnvironmentLight,
    Light,
    Material,
    Medium,
    PointLight,
    RectangleLight,
    Shape,
    Simulation,
    SphereLight,
    Transport,
)
from scene.simulation_file import read_simulation, write_simulation
from scene.transforms import look_at

from .mitsuba_worlds import ball_mesh, rectangle_mesh

WIDTH, HEIGHT = 96, 72


@dataclass(frozen=True)
class FiveScene:
    """A world, where it is seen from, and whether Mitsuba has its surfaces without Python's help."""

    simulation: Simulation
    camera: Camera
    is_native: bool = True

    @property
    def bounces(self) -> int:
        return self.simulation.transport.max_bounces


def five_scenes(folder: Path) -> dict[str, FiveScene]:
    """Write the five simulations below a folder, and return them as read from there."""
    out = {}
    for name, scene in _made().items():
        place = folder / name.replace(" ", "_")
        write_simulation(place, scene.simulation)
        out[name] = FiveScene(read_simulation(place), scene.camera, scene.is_native)
    return out


def _made() -> dict[str, FiveScene]:
    return {
        "diffuse corner": FiveScene(_corner(), _camera((3.2, -3.4, 2.2), (0.9, 0.9, 0.9))),
        "glossy spheres": FiveScene(_spheres(), _camera((-5.5, 0.5, 2.2), (0, 0, 0.8)), is_native=False),
        "mesh under a sky": FiveScene(_mesh(), _camera((-3.6, 0.6, 2.0), (0, 0, 0.7))),
        "fog around a lamp": FiveScene(_fog(), _camera((-6.0, 1.0, 2.0), (0, 0, 1.2))),
        "water in a pool": FiveScene(_pool(), _camera((-3.0, -2.2, 2.4), (0, 0, -0.4))),
    }


def _camera(eye: RGB, target: RGB) -> Camera:
    focal = 0.5 * WIDTH / np.tan(np.radians(25))
    return Camera("PINHOLE", WIDTH, HEIGHT, look_at(np.array(eye), np.array(target)), focal, focal, WIDTH / 2, HEIGHT / 2)


def _world(things: dict[str, tuple[Mesh, Material]], lights: dict[str, Light], bounces: int = 8, medium=None) -> Simulation:
    shapes = tuple(Shape(name, mesh, name) for name, (mesh, _) in things.items())
    return Simulation(shapes, {n: m for n, (_, m) in things.items()}, lights, Transport(bounces), medium)


def _corner() -> Simulation:
    """Three walls of three colours, two bodies, and a lamp over them."""
    white, red, green = (Material("lambert", c) for c in ((0.75, 0.75, 0.75), (0.7, 0.1, 0.1), (0.1, 0.6, 0.15)))
    things = {
        "floor": (rectangle_mesh((0, -3, 0), (3, 0, 0), (0, 6, 0)), white),
        "left": (rectangle_mesh((0, -3, 0), (0, 6, 0), (0, 0, 3)), red),
        "back": (rectangle_mesh((0, 2, 0), (3, 0, 0), (0, 0, 3)), green),
        "ball": (_scaled(ball_mesh((0, 0, 0)), 0.5, (1.0, 0.9, 0.5)), white),
        "step": (rectangle_mesh((1.6, 1.0, 0.7), (1.0, 0.3, 0), (-0.3, 0.9, 0)), red),
    }
    return _world(things, {"lamp": RectangleLight((0.6, 0.4, 2.6), (0, 0.8, 0), (0.8, 0, 0), (12.0, 11.0, 9.0))})


def _spheres() -> Simulation:
    """Three widths of gloss over colours, and a glossy floor, under a ball of light and a weak sky."""
    things: dict[str, tuple[Mesh, Material]] = {
        "floor": (rectangle_mesh((-6, -6, 0), (12, 0, 0), (0, 12, 0)), Material("ggx", (0.3, 0.3, 0.3), alpha=0.25, eta=1.6))
    }
    looks = (((0.4, 0.05, 0.05), 0.05), ((0.05, 0.3, 0.1), 0.15), ((0.1, 0.1, 0.4), 0.4))
    for i, (albedo, alpha) in enumerate(looks):
        ball = _scaled(ball_mesh((0, 0, 0)), 0.8, (0.0, 1.9 * (i - 1), 0.8))
        things[f"ball {i}"] = (ball, Material("ggx", albedo, alpha=alpha, eta=1.8))
    return _world(
        things, {"lamp": SphereLight((-2.0, 1.5, 3.5), 0.4, (12.0, 11.0, 10.0)), "sky": EnvironmentLight((0.2, 0.25, 0.3))}
    )


def _mesh() -> Simulation:
    """A wrinkled body of 18 000 triangles under a painted sky with a bright place."""
    ball = ball_mesh((0, 0, 0), rings=96)
    n = ball.vertices.astype(np.float64)
    wrinkles = 1 + 0.12 * np.sin(7 * n[:, 0]) * np.sin(6 * n[:, 1] + 1) * np.sin(8 * n[:, 2]) + 0.05 * np.sin(19 * n[:, 2])
    body = Mesh((n * wrinkles[:, None] + (0, 0, 0.9)).astype(np.float32), ball.faces, None, ball.uv).with_smooth_normals()
    ground = rectangle_mesh((-8, -8, -0.15), (16, 0, 0), (0, 16, 0))
    things = {"body": (body, Material("lambert", (0.65, 0.55, 0.45))), "ground": (ground, Material("lambert", (0.35, 0.35, 0.35)))}
    return _world(things, {"sky": EnvironmentLight(panorama=_sky())})


def _fog() -> Simulation:
    """A ball and a ground in even fog around a point of light.

    The lamp stands above the picture: through the place of a point in fog no estimate that draws distances by extinction alone,
    as Mitsuba's, has a finite variance, and errors could not be compared.
    """
    ground, ball = rectangle_mesh((-7, -7, 0), (14, 0, 0), (0, 14, 0)), _scaled(ball_mesh((0, 0, 0)), 0.7, (0.0, -1.3, 0.7))
    things = {"ground": (ground, Material("lambert", (0.4, 0.4, 0.4))), "ball": (ball, Material("lambert", (0.7, 0.4, 0.1)))}
    fog = Medium(0.15, (0.95, 0.92, 0.85), 0.5, ((-8.0, -8.0, -1.0), (8.0, 8.0, 7.0)))
    return _world(things, {"lamp": PointLight((0.0, 0.6, 3.7), (34.0, 30.0, 24.0))}, medium=fog)


def _pool() -> Simulation:
    """A tiled basin below waves."""
    tiles = np.kron(np.random.default_rng(3).random((8, 8, 3)) * 0.5 + 0.3, np.ones((4, 4, 1))).astype(np.float32)
    stone = Material("lambert", (0.6, 0.58, 0.5))
    things = {
        "bottom": (rectangle_mesh((-2, -2, -1), (4, 0, 0), (0, 4, 0)), Material("lambert", albedo_texture=tiles)),
        "side 0": (rectangle_mesh((-2, -2, -1), (0, 4, 0), (0, 0, 1.2)), stone),
        "side 1": (rectangle_mesh((2, -2, -1), (0, 0, 1.2), (0, 4, 0)), stone),
        "side 2": (rectangle_mesh((-2, -2, -1), (0, 0, 1.2), (4, 0, 0)), stone),
        "side 3": (rectangle_mesh((-2, 2, -1), (4, 0, 0), (0, 0, 1.2)), stone),
        "water": (_waves(), Material("dielectric", eta=1.33)),
    }
    return _world(things, {"sky": EnvironmentLight(panorama=_sky(peak=12.0))}, bounces=12)


def _waves(cells: int = 96) -> Mesh:
    """Return a rippled square from wall to wall, facing up."""
    x, y = np.meshgrid(np.linspace(-2, 2, cells + 1), np.linspace(-2, 2, cells + 1), indexing="ij")
    z = 0.04 * np.sin(5 * x + 2 * y) + 0.025 * np.sin(-3 * x + 7 * y + 1)
    i = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    a, b, c, d = i, i + cells + 1, i + cells + 2, i + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.uint32)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    uv = (points[:, :2] / 4 + 0.5).astype(np.float32)
    return Mesh(points, faces, None, uv).with_smooth_normals()


def _sky(peak: float = 30.0) -> NDArray[np.float32]:
    """Return a panorama (32, 64): blue above, grey below, and a bright place of some 15 degrees."""
    theta, phi = np.meshgrid((np.arange(32) + 0.5) / 32 * np.pi, ((np.arange(64) + 0.5) / 64 - 0.5) * 2 * np.pi, indexing="ij")
    d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    towards = np.array([-0.4, 0.5, 0.75]) / np.linalg.norm([-0.4, 0.5, 0.75])
    base = np.where(d[..., 2:] > 0, (0.3, 0.4, 0.6), (0.2, 0.2, 0.18))
    return (base + peak * np.exp((d @ towards - 1) / 0.015)[..., None] * (1.0, 0.9, 0.75)).astype(np.float32)


def _scaled(mesh: Mesh, scale: float, centre: RGB) -> Mesh:
    return Mesh((mesh.vertices * scale + np.array(centre)).astype(np.float32), mesh.faces, mesh.normals, mesh.uv)
