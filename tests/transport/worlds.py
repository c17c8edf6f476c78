"""Small worlds whose light is known in closed form, and the cameras that look at them."""

from __future__ import annotations

import numpy as np

from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import Light, Material, Shape, Simulation
from scene.transforms import look_at
from transport.world import World, compile_world

WHITE = (1.0, 1.0, 1.0)


def rectangle(corner, edge_u, edge_v, repeat: float = 1.0) -> Mesh:
    """Return a rectangle of two triangles; u runs along the first edge, v along the second, normal u x v."""
    corner, u, v = (np.asarray(x, np.float32) for x in (corner, edge_u, edge_v))
    vertices = np.stack([corner, corner + u, corner + u + v, corner + v])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * np.float32(repeat)
    n = np.cross(u, v)
    normals = np.tile(n / np.linalg.norm(n), (4, 1)).astype(np.float32)
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals, uv)


def floor(size: float = 200.0, z: float = 0.0) -> Mesh:
    """Return a horizontal square about the z axis, facing up."""
    return rectangle((-size / 2, -size / 2, z), (size, 0, 0), (0, size, 0))


def ball(radius: float = 1.0, centre=(0.0, 0.0, 0.0), subdivisions: int = 4) -> Mesh:
    """Return an icosahedron, subdivided onto the sphere, with exact normals and outward faces."""
    g = (1 + 5**0.5) / 2
    v = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g)]
    v = np.array([*v, (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)], float)
    f = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)]
    f += [(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    faces = np.array(f)
    for _ in range(subdivisions):
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, index = np.unique(edges, axis=0, return_inverse=True)
        middle = v[unique].sum(axis=1)
        ab, bc, ca = (len(v) + index.reshape(3, -1))[:, :]
        v = np.concatenate([v, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        a, b, c = faces.T
        faces = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return Mesh(
        (v * radius + centre).astype(np.float32), faces.astype(np.uint32), v.astype(np.float32), np.zeros((len(v), 2), np.float32)
    )


def camera(eye, target, width: int = 16, height: int = 16, fov_deg: float = 20.0) -> Camera:
    """Return a pinhole camera; looking straight down, its x axis is the world's."""
    eye, target = np.asarray(eye, float), np.asarray(target, float)
    focal = 0.5 * width / np.tan(np.radians(fov_deg) / 2)
    if np.allclose((target - eye)[:2], 0):
        s = np.sign(target[2] - eye[2])
        T = np.eye(4)
        T[:3, :3] = np.diag([1.0, s, s])
        T[:3, 3] = eye
    else:
        T = look_at(eye, target)
    return Camera("PINHOLE", width, height, T, focal, focal, width / 2, height / 2)


def world(shapes: dict[str, tuple[Mesh, Material]], lights: dict[str, Light]) -> World:
    """Compile shapes given by name as (mesh, material)."""
    return compile_world(
        Simulation(tuple(Shape(n, m, n) for n, (m, _) in shapes.items()), {n: m for n, (_, m) in shapes.items()}, lights)
    )


def grey(albedo: float) -> Material:
    """Return a Lambertian material."""
    return Material("lambert", (albedo,) * 3)


def mean_and_error(rendering) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean radiance over all pixels and its standard error, per channel.

    Pixels are independent (each has a stream of its own), so the spread over pixels of an even scene is honest, which the
    upper estimate of `Rendering.variance` is not for Sobol samples.
    """
    pixels = rendering.radiance.reshape(-1, 3).astype(float)
    return pixels.mean(axis=0), pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))
