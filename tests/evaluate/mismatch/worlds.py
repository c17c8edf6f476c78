"""A small studio for the diagnosis: a plate and a ball under three lamps, seen from three places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from evaluate.effects import catalogue
from evaluate.mismatch.calibrate import free_term
from evaluate.mismatch.case import Case, build
from evaluate.mismatch.effect import Term
from evaluate.mismatch.formation import Develop
from evaluate.mismatch.solve import predict
from scene.camera import Camera
from scene.images import write_exr
from scene.mesh import Mesh
from scene.recording import Frame, Noise, Recording
from scene.simulation import Material, PointLight, Shape, Simulation, Transport

NOISE = Noise(0.0015, 0.0004)
SIZE = (64, 48)


def plate() -> Mesh:
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 7), np.linspace(-0.3, 0.3, 7))
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).astype(np.float32)
    a = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + 8], 1), np.stack([a, a + 8, a + 7], 1)]).astype(np.uint32)
    normals = np.tile(np.float32([0, 0, 1]), (len(vertices), 1))
    uv = ((vertices[:, :2] + 0.3) / 0.6).astype(np.float32)
    return Mesh(vertices, faces, normals, uv)


def ball(radius: float = 0.08, height: float = 0.1) -> Mesh:
    u, v = np.meshgrid(np.linspace(0, 1, 49), np.linspace(0.001, 0.999, 33))
    theta, phi = np.pi * v.ravel(), 2 * np.pi * u.ravel()
    d = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], 1)
    a = (np.arange(32)[:, None] * 49 + np.arange(48)).ravel()
    faces = np.concatenate([np.stack([a, a + 50, a + 1], 1), np.stack([a, a + 49, a + 50], 1)]).astype(np.uint32)
    uv = np.stack([u.ravel(), v.ravel()], 1).astype(np.float32)
    return Mesh((d * radius + [0, 0, height]).astype(np.float32), faces, d.astype(np.float32), uv)


def simulation(ball_material: Material | None = None) -> Simulation:
    rng = np.random.default_rng(5)
    coarse = rng.uniform(0.25, 0.55, (8, 8, 3)).astype(np.float32)
    texture = np.repeat(np.repeat(coarse, 4, 0), 4, 1)
    materials = {
        "plate": Material("lambert", albedo_texture=texture, free=("albedo_scale",)),
        "ball": ball_material or Material("lambert", albedo=(0.5, 0.4, 0.3), free=("albedo_scale",)),
    }
    lights = {
        f"lamp{i}": PointLight((float(np.cos(a)), float(np.sin(a)), 1.0), (2.0, 2.0, 2.0)) for i, a in enumerate((0.3, 2.2, 4.4))
    }
    shapes = (Shape("plate", plate(), "plate"), Shape("ball", ball(), "ball"))
    return Simulation(shapes, materials, lights, Transport(1))


def camera(azimuth: float) -> Camera:
    eye = np.array([0.55 * np.cos(azimuth), 0.55 * np.sin(azimuth), 0.45])
    z = np.array([0, 0, 0.03]) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], 1)
    pose[:3, 3] = eye
    return Camera("PINHOLE", *SIZE, pose, 80.0, 80.0, SIZE[0] / 2, SIZE[1] / 2)


def recorded(
    folder: Path, believed: Simulation, effects: dict[str, dict], develop: Develop | None = None, gain: float = 1.0
) -> Case:
    """Return a case whose pictures were made by the forward model with some effects, or a change of the picture, and noise.

    `effects` are parameters by "id" or "id.target".
    """
    frames = [
        Frame(folder / f"{p}{k}.exr", camera(a), "linear", lights=(f"lamp{k}",))
        for p, a in enumerate((-1.4, -0.6, 0.4))
        for k in range(3)
    ]
    blank = np.zeros((SIZE[1], SIZE[0]), np.float32)
    for frame in frames:
        write_exr(frame.image, dict.fromkeys("RGB", blank))
    recording = Recording(tuple(frames), folder, noise=NOISE)
    case = build(recording, believed)
    known = {e.id: e for e in catalogue()}
    terms = [free_term(case)]
    terms[0].values = {p.name: np.float64(p.start) for p in terms[0].parameters}
    for key, values in effects.items():
        id, _, target = key.partition(".")
        effect = known[id]
        parameters = effect.parameters(case, target or None)
        term = Term(effect, target or None, None, parameters, {p.name: np.float64(p.start) for p in parameters})
        term.values |= {k: np.asarray(v, float) for k, v in values.items()}
        terms.append(term)
    picture = predict(case, terms)[2]
    picture = picture if develop is None else develop(picture)
    sigma = np.sqrt(NOISE.read_sigma**2 + NOISE.shot_gain * np.maximum(picture, 0))
    noisy = picture + gain * sigma * np.random.default_rng(9).standard_normal(picture.shape).astype(np.float32)
    for frame, image in zip(frames, noisy, strict=True):
        write_exr(frame.image, dict(zip("RGB", np.moveaxis(image.astype(np.float32), -1, 0), strict=True)))
    return build(recording, believed)


def glossy() -> Material:
    return replace(
        Material("ggx", albedo=(0.5, 0.4, 0.3), alpha=0.25, eta=1.5, specular_scale=2.0), free=("albedo_scale", "specular_scale")
    )
