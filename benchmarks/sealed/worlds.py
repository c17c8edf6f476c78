"""Random worlds as a sender believes them: a studio table, a corner of three walls, and a street, with cameras and lamps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A textured mesh.

    Attributes
    ----------
    vertices, normals : (V, 3) float
    uv : (V, 2) float
    faces : (F, 3) int
    texture : (H, W, 3) float
        Albedo before `albedo_scale`.
    surface : dict
        What differs from Lambert: the parameters of `surface.Reflectance`.
    normal_map : (H, W, 3) float or None
        Unit normals in the tangent frame.
    """

    vertices: Floats
    normals: Floats
    uv: Floats
    faces: NDArray[np.uint32]
    texture: Floats
    surface: dict[str, float] = field(default_factory=dict)
    normal_map: Floats | None = None


@dataclass(frozen=True)
class World:
    """What is photographed, as believed or as it is.

    Attributes
    ----------
    kind : str
        "studio", "corner" or "street".
    bodies : dict of Body
    lights : dict
        As in simulation/1; a point light may have a `radius` [m].
    frames : tuple of (pose, lights)
        Pose (4, 4) of the camera, and the names of the lamps that are on.
    focal : float
        [px]
    size : (width, height)
    """

    kind: str
    bodies: dict[str, Body]
    lights: dict[str, dict]
    frames: tuple[tuple[Floats, tuple[str, ...]], ...]
    focal: float
    size: tuple[int, int]
    noise: dict[str, float]

    def with_body(self, name: str, **changes: object) -> World:
        """Return the world with one body changed."""
        return replace(self, bodies=self.bodies | {name: replace(self.bodies[name], **changes)})  # type: ignore[arg-type]


def random_world(rng: np.random.Generator, kind: str, size: tuple[int, int] = (160, 120), glossy: bool = False) -> World:
    """Return a world of a kind; with `glossy` its object is believed to have an isotropic GGX lobe."""
    world = {"studio": _studio, "corner": _corner, "street": _street}[kind](rng, size)
    if glossy:
        lobe = {"scale": 1.0, "alpha_u": 0.25, "alpha_v": 0.25, "eta": 1.5}
        world = world.with_body("object", surface=lobe)
    return world


def mottled(rng: np.random.Generator, size: int, smallest: int = 4, contrast: float = 0.25) -> Floats:
    """Return a periodic pattern (size, size) of mean 1 with power at all scales above `smallest` texels."""
    total = np.zeros((size, size))
    scale = size / 3
    while scale >= smallest:
        layer = gaussian_filter(rng.standard_normal((size, size)), scale / 3, mode="wrap")
        total += layer / layer.std() * scale**0.7
        scale /= 2
    return np.clip(1 + contrast * total / total.std(), 0.3, 1.9)


def _texture(rng: np.random.Generator, mean: float, size: int = 128) -> Floats:
    tint = np.clip(1 + 0.18 * rng.standard_normal(3), 0.6, 1.4)
    return np.clip(mean * mottled(rng, size)[..., None] * tint, 0.02, 0.85)


def _grid(
    n: int, surface: Callable[[Floats, Floats], Floats], texture: Floats, flip: bool = False, rows: int | None = None
) -> Body:
    """Return a patch of n x rows cells over surface(u, v), with normals by central differences."""
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, (rows or n) + 1))
    eps = 1e-4
    points = surface(u, v)
    normals = np.cross(surface(u + eps, v) - surface(u - eps, v), surface(u, v + eps) - surface(u, v - eps))
    normals *= (-1 if flip else 1) / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    a = (np.arange(len(u) - 1)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + 1, a + n + 2, a + n + 1
    quads = [(a, b, c), (a, c, d)] if not flip else [(a, c, b), (a, d, c)]
    faces = np.concatenate([np.stack(t, -1) for t in quads]).astype(np.uint32)
    return Body(points.reshape(-1, 3), normals.reshape(-1, 3), np.stack([u, v], -1).reshape(-1, 2), faces, texture)


def _plane(corner: list[float], along_u: list[float], along_v: list[float], n: int, texture: Floats) -> Body:
    o, a, b = np.array(corner), np.array(along_u), np.array(along_v)
    return _grid(n, lambda u, v: o + u[..., None] * a + v[..., None] * b, texture)


def _stone(rng: np.random.Generator, centre: Floats, radius: float, texture: Floats) -> Body:
    """Return a sphere with smooth bumps; u runs around, v from pole to pole."""
    waves = [(rng.normal(size=3) * 2.5, rng.uniform(0, 2 * np.pi), rng.uniform(0.005, 0.025)) for _ in range(6)]

    def surface(u: Floats, v: Floats) -> Floats:
        # 1e-3 keeps the poles open, so that each vertex has a tangent.
        theta, phi = np.pi * (1e-3 + (1 - 2e-3) * v), 2 * np.pi * u
        d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
        bumps = np.sum([a * np.sin(d @ k + p) for k, p, a in waves], axis=0)
        return centre + radius * (1 + bumps)[..., None] * d

    return _grid(96, surface, texture, flip=True, rows=64)


def _studio(rng: np.random.Generator, size: tuple[int, int]) -> World:
    radius = rng.uniform(0.07, 0.1)
    plate = _plane([-0.3, -0.3, 0], [0.6, 0, 0], [0, 0.6, 0], 39, _texture(rng, rng.uniform(0.25, 0.5)))
    stone = _stone(rng, np.array([0.0, 0.0, radius * 1.25]), radius, _texture(rng, rng.uniform(0.25, 0.5)))
    return _table({"plate": plate, "object": stone}, "studio", rng, size, around=np.array([0, 0, 0.07]))


def _corner(rng: np.random.Generator, size: tuple[int, int]) -> World:
    wall = [_texture(rng, rng.uniform(0.5, 0.75)) for _ in range(3)]
    bodies = {
        "plate": _plane([-0.25, -0.25, 0], [0.5, 0, 0], [0, 0.5, 0], 39, wall[0]),
        "wall_a": _plane([-0.25, 0.25, 0], [0.5, 0, 0], [0, 0, 0.3], 23, wall[1]),
        "wall_b": _plane([-0.25, -0.25, 0], [0, 0.5, 0], [0, 0, 0.3], 23, wall[2]),
        "object": _stone(rng, np.array([-0.08, 0.1, 0.07]), 0.055, _texture(rng, 0.5)),
    }
    return _table(bodies, "corner", rng, size, around=np.array([-0.06, 0.06, 0.08]))


def _table(bodies: dict[str, Body], kind: str, rng: np.random.Generator, size: tuple[int, int], around: Floats) -> World:
    """Return 20 distinct pairs of 5 poses and 6 lamps about a table; of a corner, its open side."""
    span = (-np.pi / 2, 0.0) if kind == "corner" else (-np.pi, np.pi)
    poses, lamps = [], {}
    for i in range(5):
        azimuth = span[0] + (span[1] - span[0]) * (i + rng.uniform(0.1, 0.9)) / 5
        elevation, distance = rng.uniform(0.4, 0.85), rng.uniform(0.6, 0.75)
        eye = around + distance * np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        poses.append(_look_at(eye, around + rng.normal(size=3) * 0.01))
    for i in range(6):
        azimuth = span[0] + (span[1] - span[0]) * (i + rng.uniform(0.1, 0.9)) / 6
        elevation = rng.uniform(0.5, 1.2)
        towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        lamps[f"led{i}"] = {"type": "point", "position": (1.2 * towards).tolist(), "intensity": [2.4, 2.4, 2.4]}
    pairs = [(p, k) for p in range(5) for k in range(6)]
    chosen = [pairs[i] for i in rng.permutation(len(pairs))[:20]]
    frames = tuple((poses[p], (f"led{k}",)) for p, k in chosen)
    noise = {"read_sigma": 0.0015, "shot_gain": 0.0004}
    return World(kind, bodies, lamps, frames, 210.0 * size[0] / 160, size, noise)


def _street(rng: np.random.Generator, size: tuple[int, int]) -> World:
    height = zoom(mottled(rng, 64, 8, 1.0) - 1, 2, order=3) * 0.02

    def road(u: Floats, v: Floats) -> Floats:
        row, col = np.clip(v * 127, 0, 127).astype(int), np.clip(u * 127, 0, 127).astype(int)
        return np.stack([-4 + 8 * u, -2 + 40 * v, height[row, col]], -1)

    flat = _grid(58, road, _texture(rng, 0.22), rows=240)
    bodies = {"plate": replace(flat, normals=_vertex_normals(flat))}
    for i in range(6):
        side = 1 if i % 2 == 0 else -1
        half, top, y = rng.uniform(0.35, 0.7), rng.uniform(1.2, 2.5), 3 + 5.5 * i
        x = side * rng.uniform(2.4, 2.7)
        post = _plane([x - half, y, -0.05], [2 * half, 0, 0], [0, 0, top + 0.05], 23, _texture(rng, rng.uniform(0.2, 0.6)))
        bodies[f"post{i}"] = post
    bodies["back"] = _plane([-12, 39, -0.2], [24, 0, 0], [0, 0, 9], 23, _texture(rng, 0.4))
    azimuth = rng.uniform(-0.9, 0.9)
    sun = np.array([np.sin(azimuth), np.cos(azimuth), -rng.uniform(0.8, 1.6)])
    lights = {
        "sun": {"type": "directional", "direction": (sun / np.linalg.norm(sun)).tolist(), "irradiance": [2.2, 2.1, 1.9]},
        "sky": {"type": "environment", "radiance": [0.35, 0.38, 0.45]},
    }
    frames = []
    for i in range(14):
        eye = np.array([0.01 * i + 0.05 * np.sin(i), -1.5 + 0.35 * i, 1.4])
        frames.append((_look_at(eye, eye + [0.004 * np.sin(i), 1.0, -0.0435]), ("sun", "sky")))
    return World("street", bodies, lights, tuple(frames), 150.0 * size[0] / 160, size, {"read_sigma": 0.006, "shot_gain": 0.001})


def _vertex_normals(body: Body) -> Floats:
    a, b, c = (body.vertices[body.faces[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros_like(body.vertices)
    for i in range(3):
        np.add.at(total, body.faces[:, i], face)
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def _look_at(eye: Floats, target: Floats) -> Floats:
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, np.cross(z, x), z, eye
    return pose
