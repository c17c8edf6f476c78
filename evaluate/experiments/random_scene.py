"""Random scenes of one displaced surface, one small lamp and some light from everywhere, with their true flow (thesis 5.4.1).

What is taken from the thesis: 1/f^4 noise of the size of the sample, a camera of 50 degrees 0.4 to 0.5 m from its middle and up
to 45 degrees off the vertical, that looks at a random place of the surface with a random roll, moves by up to 10 mm and turns by
some 0.1 degrees; a lamp of 5 mm, placed and moved likewise but 1.5 times as far away. What it does not say is chosen here: the
side of the surface, so that 58 % of the pixels see it, as in its count of flow vectors (750 million in 2 x 2457 fields of 512 x
512); the height of the noise, for slopes of some 15 degrees; and directions of motion, even over the sphere.

Its lamp (radiance 200, 5 mm wide) would give the surface a hundredth of what its ambient light (0.3) does, and no highlight
would be seen: here the share of the ambient light is a setting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.noise import octaves_between, spectral_noise_2d
from scene.simulation import EnvironmentLight, Light, SphereLight
from scene.transforms import look_at
from transport.gbuffer import GBuffer, flow_between, gbuffer
from transport.world import World

Floats = NDArray[np.float64]

SIDE = 0.4
_HEIGHT = 0.025  # standard deviation of the noise
_FOV_DEG = 50.0
_NEAR, _FAR, _TILT = 0.4, 0.5, np.pi / 4
_CAMERA_TRAVEL, _CAMERA_TURN_DEG = 0.01, 0.1
_LAMP_FACTOR, _LAMP_RADIUS = 1.5, 0.0025
_HIDDEN = 0.01  # of the distance: what lies that much behind what the other frame sees is hidden from it


@dataclass(frozen=True)
class RandomScene:
    """A surface, and camera and lamp at two moments.

    Attributes
    ----------
    mesh : Mesh
        u and v run from 0 to `repeats`.
    cameras : pair of Camera
    lamps : (2, 3) float
        Places of the lamp [m].
    ambient_share : float
        Of the light that reaches the middle of the surface, before its cosine.
    """

    mesh: Mesh
    cameras: tuple[Camera, Camera]
    lamps: Floats
    ambient_share: float

    def lights(self, frame: int) -> dict[str, Light]:
        """Return the light in a frame: a lamp that gives an irradiance of 1 at its mean distance, and an even sky."""
        distance = _LAMP_FACTOR * 0.5 * (_NEAR + _FAR)
        x, y, z = (float(c) for c in self.lamps[frame])
        power, sky = distance**2, float(self.ambient_share / (1 - self.ambient_share) / np.pi)
        return {
            "lamp": SphereLight((x, y, z), _LAMP_RADIUS, (power, power, power)),
            "sky": EnvironmentLight((sky, sky, sky)),
        }


@dataclass(frozen=True)
class Truth:
    """What is known of a scene's first frame.

    Attributes
    ----------
    buffer : GBuffer
    flow : (H, W, 2) float32
        [px]
    counted : (H, W) bool
        Pixels that see the surface, where the second frame sees it too.
    """

    buffer: GBuffer
    flow: NDArray[np.float32]
    counted: NDArray[np.bool_]


def random_scene(index: int, width: int, repeats: float, ambient_share: float, seed: int = 0) -> RandomScene:
    """Return one of the scenes; the same whatever other scenes there are.

    Parameters
    ----------
    index : int
        Which scene.
    width : int
        Of the square pictures [px]; the scene's geometry is as fine.
    repeats : float
        How often the material's texture repeats over the surface.
    """
    rng = np.random.default_rng([seed, 54, index])
    mesh = _surface(width, repeats, int(rng.integers(2**31)))
    first = _camera(rng, mesh, width)
    moved = first.T_world_camera.copy()
    moved[:3, 3] += _direction(rng) * rng.uniform(0, _CAMERA_TRAVEL)
    moved[:3, :3] = moved[:3, :3] @ _turn(np.radians(rng.normal(0, _CAMERA_TURN_DEG, 3)))
    lamp = _LAMP_FACTOR * _place(rng)
    lamps = np.stack([lamp, lamp + _direction(rng) * rng.uniform(0, _LAMP_FACTOR * _CAMERA_TRAVEL)])
    return RandomScene(mesh, (first, first.moved_to(moved)), lamps, ambient_share)


def truth_of(scene: RandomScene, world: World) -> Truth:
    """Return the true flow of the first frame, ray-traced; `world` is the scene compiled, whatever its material."""
    first, second = scene.cameras
    buffer, later = gbuffer(world, first), gbuffer(world, second)
    flow = flow_between(buffer, first, second, {})
    seen = buffer.face >= 0
    xy = first.pixel_centres().reshape(*seen.shape, 2) + flow
    x, y = (np.where(seen, np.floor(xy[..., i]), -1).astype(int) for i in range(2))
    inside = seen & (x >= 0) & (x < first.width) & (y >= 0) & (y < first.height)
    there = later.distance[np.where(inside, y, 0), np.where(inside, x, 0)]
    away = np.linalg.norm(np.where(seen[..., None], buffer.position, 0) - second.position, axis=-1)
    return Truth(buffer, flow, inside & np.isfinite(there) & (away < (1 + _HIDDEN) * there))


def _surface(width: int, repeats: float, seed: int) -> Mesh:
    at = np.linspace(-0.5 * SIDE, 0.5 * SIDE, width + 1)
    x, y = np.meshgrid(at, at)
    octaves = octaves_between(SIDE, 4 * SIDE / width)
    z = _HEIGHT * spectral_noise_2d(x, y, scale=SIDE, exponent=4.0, octaves=octaves, seed=seed)
    # Its middle is the one that cameras and lamps go about.
    z -= z[width // 2, width // 2]
    u = (x / SIDE + 0.5) * repeats
    v = (0.5 - y / SIDE) * repeats
    corner = np.arange(width * (width + 1)).reshape(width, width + 1)[:, :-1].ravel()
    above = corner + width + 1
    faces = np.concatenate([np.stack([corner, corner + 1, above], 1), np.stack([corner + 1, above + 1, above], 1)])
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2).astype(np.float32)
    return Mesh(vertices, faces.astype(np.uint32), uv=uv).with_smooth_normals()


def _place(rng: np.random.Generator) -> Floats:
    """Return a place above the surface, even over the cap of the sphere."""
    z = rng.uniform(np.cos(_TILT), 1)
    phi, s = rng.uniform(0, 2 * np.pi), np.sqrt(1 - z * z)
    return rng.uniform(_NEAR, _FAR) * np.array([s * np.cos(phi), s * np.sin(phi), z])


def _camera(rng: np.random.Generator, mesh: Mesh, width: int) -> Camera:
    eye = _place(rng)
    target = mesh.vertices[rng.integers(len(mesh.vertices))].astype(np.float64)
    forward = (target - eye) / np.linalg.norm(target - eye)
    up = _direction(rng)
    while abs(up @ forward) > 0.99:  # too near the view to say which way is up
        up = _direction(rng)
    focal = 0.5 * width / np.tan(np.radians(0.5 * _FOV_DEG))
    return Camera("PINHOLE", width, width, look_at(eye, target, up), focal, focal, 0.5 * width, 0.5 * width)


def _direction(rng: np.random.Generator) -> Floats:
    w = rng.standard_normal(3)
    return w / np.linalg.norm(w)


def _turn(angles: Floats) -> Floats:
    """Return a rotation about the axis `angles` by its length [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(angles))
    x, y, z = angles / max(angle, 1e-300)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
