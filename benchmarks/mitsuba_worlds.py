"""Small worlds that show one thing each, to be photographed by two renderers."""

from __future__ import annotations

import numpy as np

from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import RGB, DirectionalLight, EnvironmentLight, Film, Light, Material, PointLight, Shape, Simulation
from scene.transforms import look_at


def camera() -> Camera:
    """Return the camera of all small worlds."""
    focal = 48 / np.tan(np.radians(30))
    return Camera("PINHOLE", 96, 72, look_at(np.array([-6.0, 1, 3]), np.array([0.0, 0, 1])), focal, focal, 48, 36)


def worlds() -> dict[str, Simulation]:
    """Return the worlds by what they show."""
    rng = np.random.default_rng(0)
    patches = np.kron(rng.random((4, 4, 3)), np.ones((4, 4, 1))).astype(np.float32) * 0.8
    patches[:4, :4] = (0.9, 0.05, 0.05)
    grey = np.kron(rng.random((4, 4)), np.ones((4, 4))).astype(np.float32)
    relief = np.full((8, 8, 3), (0.5, 0.5, 1.0), np.float32)
    relief[2:4, 2:6, 0], relief[5, 1:4, 1] = 0.8, 0.2
    sun = DirectionalLight((0.5, 0.3, -0.8), (2.0, 2.0, 2.0), 0.05)
    lights: dict[str, Light] = {"sun": sun, "sky": EnvironmentLight(panorama=_poles())}
    lamp: dict[str, Light] = {"lamp": PointLight((1.0, 1, 3), (9.0, 9, 9)), "sky": EnvironmentLight((0.2, 0.3, 0.4))}
    wall = rectangle_mesh((4, -3, 5), (0, 6, 0), (0, 0, -5))
    ground = rectangle_mesh((-6, -6, 0), (12, 0, 0), (0, 12, 0))
    left, right = ball_mesh((0, 1.1, 1)), ball_mesh((0, -1.1, 1))
    matte = Material("lambert", (0.5, 0.5, 0.5))
    painted = Material("lambert", albedo_texture=patches)
    gloss = Material("ggx", albedo_texture=patches, alpha=0.15, eta=1.63)
    film = Film(grey, 0.05 * grey, level=False)
    return {
        "sky, sun, texture": _world({"wall": (wall, painted), "ground": (ground, matte)}, lights),
        "varnish and mirror": _world(
            {
                "coated": (left, _plain("coated", (0.6, 0.2, 0.1))),
                "mirror": (right, _plain("mirror", (0.9, 0.9, 0.9))),
                "ground": (ground, matte),
            },
            lights,
        ),
        "gloss and glass": _world(
            {
                "gloss": (left, Material("ggx", (0.3, 0.2, 0.1))),
                "glass": (right, Material("dielectric")),
                "ground": (ground, gloss),
            },
            lights,
        ),
        "patchy water on gloss": _world(
            {
                "wall": (wall, painted),
                "ground": (ground, Material("ggx", albedo_texture=patches, alpha_texture=grey, eta=1.63, film=film)),
            },
            lights,
        ),
        "relief by a lamp": _world(
            {"wall": (wall, Material("lambert", albedo_texture=patches, normal_texture=relief)), "ground": (ground, matte)}, lamp
        ),
    }


def _world(shapes: dict[str, tuple[Mesh, Material]], lights: dict[str, Light]) -> Simulation:
    return Simulation(tuple(Shape(n, mesh, n) for n, (mesh, _) in shapes.items()), {n: m for n, (_, m) in shapes.items()}, lights)


def _plain(model: str, albedo: RGB) -> Material:
    return Material(model, albedo)  # type: ignore[arg-type]


def _poles() -> np.ndarray:
    """Return a grey sky with a coloured pole in each direction, which tells a turned or mirrored one apart."""
    sky = np.full((64, 128, 3), 0.2, np.float32)
    for col, colour in ((64, (3, 0, 0)), (96, (0, 3, 0)), (32, (0, 0, 3)), (2, (3, 3, 0))):
        sky[8:32, col - 2 : col + 2] = colour
    return sky


def rectangle_mesh(corner: RGB, edge_u: RGB, edge_v: RGB) -> Mesh:
    c, u, v = (np.array(x, np.float32) for x in (corner, edge_u, edge_v))
    n = np.cross(u, v)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    normals = np.tile(n / np.linalg.norm(n), (4, 1)).astype(np.float32)
    return Mesh(np.stack([c, c + u, c + u + v, c + v]), np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals, uv)


def ball_mesh(centre: RGB, rings: int = 48) -> Mesh:
    """Return a unit ball of rings and meridians, with exact normals."""
    theta, phi = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    n = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    i = (np.arange(rings)[:, None] * len(phi) + np.arange(2 * rings)).ravel()
    below, right = i + len(phi), i + 1
    # The triangles that touch a pole with a whole side have no area there.
    upper, lower = np.stack([i, below, right], axis=1)[2 * rings :], np.stack([below, below + 1, right], axis=1)[: -2 * rings]
    # At the south pole `lower` would be empty, at the north pole `upper`.
    faces = np.concatenate([upper, lower]).astype(np.uint32)
    uv = np.stack([p / (2 * np.pi), t / np.pi], axis=-1).reshape(-1, 2)
    return Mesh((n + centre).astype(np.float32), faces, n.astype(np.float32), uv.astype(np.float32))
