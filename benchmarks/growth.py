"""`python -m benchmarks.growth SWEEP VALUE`: photograph one world of a sweep in a process of its own, and print what it took.

A process of its own, because the peak of memory that a process has had never falls.
"""

from __future__ import annotations

import json
import resource
import statistics
import sys

import numpy as np

from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import EnvironmentLight, Light, Material, Shape, Simulation, Transport
from scene.transforms import look_at
from transport.render import render
from transport.world import World, compile_world

from .mitsuba_worlds import rectangle_mesh
from .timing import seconds

# What stays the same while one of them grows.
_WIDTH, _SAMPLES, _BOUNCES, _TRIANGLES = 192, 16, 4, 100_000
SWEEPS: dict[str, tuple[int, ...]] = {
    "triangles": (100_000, 300_000, 1_000_000, 3_000_000, 10_000_000),
    "pixels": (96 * 72, 192 * 144, 384 * 288, 768 * 576, 1536 * 1152),
    "samples": (4, 16, 64, 256, 1024),
    "bounces": (1, 2, 4, 8, 16, 32),
}
_RUNS = 3
_SKY: dict[str, Light] = {"sky": EnvironmentLight((1.0, 1.0, 1.0))}


def measured(sweep: str, value: int) -> dict[str, float]:
    """Return seconds to compile the world and to photograph it (medians), rays per second, and peak memory [MiB]."""
    camera = _camera(round(np.sqrt(value * 4 / 3)) if sweep == "pixels" else _WIDTH)
    samples = value if sweep == "samples" else _SAMPLES
    bounces = value if sweep == "bounces" else _BOUNCES
    simulation = _room() if sweep == "bounces" else _hills(value if sweep == "triangles" else _TRIANGLES)
    worlds: list[World] = []
    compiling = seconds(lambda: worlds.append(compile_world(simulation)))
    world = worlds[0]
    # Compiles the kernels, or reads them from the cache.
    render(world, _camera(16), 1, 0, bounces)
    rendering = statistics.median(seconds(lambda: render(world, camera, samples, 0, bounces)) for _ in range(_RUNS))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"compile_s": compiling, "render_s": rendering, "peak_mib": peak}


def _camera(width: int) -> Camera:
    height = width * 3 // 4
    focal = 0.5 * width / np.tan(np.radians(30))
    return Camera("PINHOLE", width, height, look_at(np.array([-4.5, 0.3, 2.5]), np.zeros(3)), focal, focal, width / 2, height / 2)


def _hills(triangles: int) -> Simulation:
    """A rippled square of about so many triangles that fills the lower half of the picture, under an even sky."""
    n = round(np.sqrt(triangles / 2))
    x, y = np.meshgrid(np.linspace(-5, 5, n + 1), np.linspace(-5, 5, n + 1), indexing="ij")
    z = 0.2 * np.sin(3 * x + y) * np.sin(2 * y) + 0.02 * np.sin(31 * x) * np.sin(29 * y)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    corners = (i, i + n + 1, i + n + 2, i + 1)
    faces = np.concatenate([np.stack([corners[0], corners[k], corners[k + 1]], axis=1) for k in (1, 2)]).astype(np.uint32)
    mesh = Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32), faces).with_smooth_normals()
    shapes = (Shape("hills", mesh, "hills"),)
    return Simulation(shapes, {"hills": Material("lambert", (0.5, 0.5, 0.5))}, _SKY, Transport(8))


def _room() -> Simulation:
    """A white room with a window in its roof, in which light goes on for long."""
    walls = {
        "floor": rectangle_mesh((-5, -3, -1), (10, 0, 0), (0, 6, 0)),
        "roof": rectangle_mesh((-5, -3, 4), (0, 6, 0), (8, 0, 0)),
        "left": rectangle_mesh((-5, 3, -1), (10, 0, 0), (0, 0, 5)),
        "right": rectangle_mesh((-5, -3, -1), (0, 0, 5), (10, 0, 0)),
        "front": rectangle_mesh((5, -3, -1), (0, 0, 5), (0, 6, 0)),
        "back": rectangle_mesh((-5, -3, -1), (0, 6, 0), (0, 0, 5)),
    }
    shapes = tuple(Shape(name, mesh, "white") for name, mesh in walls.items())
    return Simulation(shapes, {"white": Material("lambert", (0.9, 0.9, 0.9))}, _SKY, Transport(32))


if __name__ == "__main__":
    print(json.dumps(measured(sys.argv[1], int(sys.argv[2]))))
