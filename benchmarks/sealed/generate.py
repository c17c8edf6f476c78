"""Make recordings with something left out, and seal what it was.

Each recording is a folder with `recording.json` and `simulation.json` under a name that says nothing. The answers are
written to another folder, and beside the recordings only their commitment: the SHA-256 of the answers with a random
salt, which shows afterwards that they were fixed before any diagnosis was made.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import secrets
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from materials.foundation.files import make_folder, write_json
from materials.foundation.progress import stage
from scene.images import write_exr
from scene.mesh import Mesh, write_ply

from ..peers import mitsuba
from . import camera_changes  # noqa: F401  (registers its changes)
from .changes import CHANGES, UNLISTED, Truth
from .photograph import photograph
from .worlds import Floats, World, random_world

_SIGMAS = 3.0
# Of rendering, in standard deviations of the sensor.
_RENDERING_NOISE = 0.25
# What a second change may be: what any world, or any table, can have.
_COMPANIONS = ["vignetting", "glare", "exposure_drift", "specular_lobe", "ambient_light"]


def plan(rng: np.random.Generator, trials: int, nulls: float, pairs: float, unlisted: float) -> list[list[str]]:
    """Return the changes of each trial: shares of nulls, pairs and unlisted ones, the rest single, each id in its turn."""
    ids = list(rng.permutation(sorted(CHANGES)))
    others = list(rng.permutation(sorted(UNLISTED)))
    out: list[list[str]] = []
    for i in range(trials):
        kind = rng.random()
        if kind < nulls:
            out.append([])
        elif kind < nulls + unlisted:
            out.append([others[i % len(others)]])
        elif kind < nulls + unlisted + pairs:
            out.append([ids[i % len(ids)], str(rng.choice(_COMPANIONS))])
        else:
            out.append([ids[i % len(ids)]])
    return [[str(x) for x in dict.fromkeys(chosen)] for chosen in out]


@dataclass(frozen=True)
class Tolerance:
    """What a sender's calibration may be off by without anything being left out.

    Attributes
    ----------
    lamps : float
        Standard deviation of a lamp's place along each axis [m]; of the sun's direction [rad].
    poses : float
        Standard deviation of a camera's turn about each axis [px at the middle of the picture].
    noise : (float, float)
        Range of the factor on the sensor's noise, stated as it is.
    """

    lamps: float = 0.0
    poses: float = 0.0
    noise: tuple[float, float] = (1.0, 1.0)


def make(
    mi: ModuleType, rng: np.random.Generator, ids: list[str], strength: float, size: tuple[int, int], folder: Path,
    tolerance: Tolerance | None = None, more: Sequence[Path] = (),
) -> dict:  # fmt: skip
    """Write one recording into `folder` and return its answer, with `affected` (F, H, W) under that key.

    Where two changes share no kind of world, the second is dropped. Into the folders of `more` goes the same with other noise
    (and another level of it, if `tolerance` has a range); the answer is that of the first.
    """
    kinds = {"studio", "corner", "street"}
    kept = []
    for id in ids:
        both = kinds & set((CHANGES | UNLISTED)[id][1])
        if both:
            kinds, kept = both, [*kept, id]
    glossy = "anisotropy" in kept
    believed = random_world(rng, str(rng.choice(sorted(kinds - {"corner"} if glossy and len(kinds) > 1 else kinds))), size, glossy)
    if "near_field_light" in kept:
        believed = _directional(believed)
    tolerance = tolerance or Tolerance()
    # Rendered finely enough for the lowest level of noise.
    truth = Truth(_miscalibrated(rng, _nuisance(rng, _noisier(believed, tolerance.noise[0])), tolerance))
    calibrated = truth.world
    for id in kept:
        # The subsurface of a body replaces its texture, which the sender then believes too.
        truth = (CHANGES | UNLISTED)[id][0](rng, truth, strength)
    if "subsurface" in kept:
        believed = believed.with_body("object", texture=truth.world.bodies["object"].texture)
    nuisance = replace(_with_scales(believed, truth.world), lights=calibrated.lights, frames=calibrated.frames)
    samples = max(truth.samples, 256 if believed.kind == "street" else 64)
    seed = int(rng.integers(2**31))
    clean, rendering_noise = _converged(mi, truth, samples, seed)
    plain = _converged(mi, Truth(nuisance), samples, seed + 1)[0] if kept else clean
    levels = rng.uniform(*tolerance.noise, 1 + len(more))
    for copy, level in zip((folder, *more), levels, strict=True):
        sent = _noisier(believed, float(level))
        noise = truth.noise_gain * np.sqrt(_variance(sent, clean)) * rng.standard_normal(clean.shape)
        _write(copy, sent, (clean + noise).astype(np.float16))
    z = np.abs(clean - plain) / np.sqrt(_variance(_noisier(believed, float(levels[0])), clean))
    return {
        "effects": list(truth.effects),
        "kind": believed.kind,
        "strength": strength,
        "rms_z": float(np.sqrt((z**2).mean())),
        "rendering_noise": rendering_noise,
        "affected": z.max(axis=-1) > _SIGMAS if kept else np.zeros(z.shape[:3], bool),
    }


def _converged(mi: ModuleType, truth: Truth, samples: int, seed: int) -> tuple[NDArray, float]:
    """Return developed pictures and their rendering noise in units of the sensor's, rendered until that is small."""
    passes: list[NDArray] = []
    while True:
        for _ in range(2):
            radiance = photograph(mi, truth.world, truth.physics, samples, seed + 1_000_003 * len(passes))
            passes.append(np.array([_developed(truth, p, i) for i, p in enumerate(radiance)]))
        mean = np.mean(passes, axis=0)
        # What the means of the even and of the odd passes differ by is twice the noise of the mean of all.
        noise = 0.5 * np.abs(np.mean(passes[::2], axis=0) - np.mean(passes[1::2], axis=0))
        # Outliers (pixels that hide a lamp) must not keep a recording from being finished.
        share = float(np.sqrt(np.mean(np.minimum(noise**2 / _variance(truth.world, mean), 9.0))))
        if share < _RENDERING_NOISE or len(passes) >= 16:
            return mean, share


def _developed(truth: Truth, picture: NDArray, frame: int) -> NDArray:
    for develop in truth.develop:
        picture = develop(picture, frame)
    return picture


def _variance(world: World, clean: NDArray) -> NDArray:
    return world.noise["read_sigma"] ** 2 + world.noise["shot_gain"] * np.maximum(clean, 0)


def _nuisance(rng: np.random.Generator, world: World) -> World:
    """Return the world with what the sender admits not to know, off by some per cent."""
    for name, body in world.bodies.items():
        surface = body.surface
        if surface.get("scale", 0) > 0:
            alpha = surface["alpha_u"] * rng.uniform(0.9, 1.1)
            surface = surface | {"alpha_u": alpha, "alpha_v": alpha, "scale": surface["scale"] * rng.uniform(0.9, 1.1)}
        world = world.with_body(name, texture=body.texture * rng.uniform(0.93, 1.07), surface=surface)
    return world


def _noisier(world: World, factor: float) -> World:
    """Return the world photographed with a multiple of the sensor's noise."""
    read, shot = world.noise["read_sigma"], world.noise["shot_gain"]
    return replace(world, noise={"read_sigma": read * factor, "shot_gain": shot * factor**2})


def _miscalibrated(rng: np.random.Generator, world: World, tolerance: Tolerance) -> World:
    """Return the world with lamps and poses off by what is tolerated; frames from one place share its error."""
    lights = {}
    for name, light in world.lights.items():
        key = "position" if "position" in light else "direction"
        off = tolerance.lamps * rng.standard_normal(3)
        lights[name] = light | {key: (np.array(light[key]) + off).tolist()} if key in light else light
    turns: dict[bytes, Floats] = {}
    frames = []
    for pose, lit in world.frames:
        if pose.tobytes() not in turns:
            turns[pose.tobytes()] = np.eye(4)
            turns[pose.tobytes()][:3, :3] = Rotation.from_rotvec(tolerance.poses / world.focal * rng.standard_normal(3)).as_matrix()
        frames.append((pose @ turns[pose.tobytes()], lit))
    return replace(world, lights=lights, frames=tuple(frames))


def _with_scales(believed: World, true: World) -> World:
    """Return the believed world with the true values of what is free, so that only the changes differ."""
    for name, body in believed.bodies.items():
        other = true.bodies[name]
        # Changes of texture are local: the median of the ratio is the scale.
        scale = float(np.median(other.texture / body.texture))
        lobe = {} if body.surface.get("scale", 0) == 0 else {"scale": other.surface["scale"]}
        believed = believed.with_body(name, texture=body.texture * scale, surface=body.surface | lobe)
    return believed


def _directional(world: World) -> World:
    lights = {}
    for name, light in world.lights.items():
        towards = np.array(light["position"]) / np.linalg.norm(light["position"])
        lights[name] = {"type": "directional", "direction": (-towards).tolist(), "irradiance": [1.7, 1.7, 1.7]}
    return replace(world, lights=lights)


def _write(folder: Path, world: World, images: NDArray[np.float16]) -> None:
    for part in ("images", "meshes", "textures"):
        make_folder(folder / part)
    width, height = world.size
    frames = []
    for i, (pose, lit) in enumerate(world.frames):
        write_exr(folder / "images" / f"{i:04d}.exr", {c: np.ascontiguousarray(images[i, ..., k]) for k, c in enumerate("RGB")})
        camera = {"model": "PINHOLE", "width": width, "height": height, "fx": world.focal, "fy": world.focal}
        camera |= {"cx": width / 2, "cy": height / 2, "T_world_camera": pose.tolist()}
        frames.append(
            {"image": f"images/{i:04d}.exr", "response": "linear", "lights": list(lit), "exposure": 1.0, "camera": camera}
        )
    write_json(folder / "recording.json", {"format": "recording/1", "length_unit": "m", "frames": frames, "noise": world.noise})
    materials, shapes = {}, []
    for name, body in world.bodies.items():
        mesh = Mesh(body.vertices.astype(np.float32), body.faces, body.normals.astype(np.float32), body.uv.astype(np.float32))
        write_ply(folder / "meshes" / f"{name}.ply", mesh)
        write_exr(folder / "textures" / f"{name}.exr", {c: body.texture[..., k].astype(np.float16) for k, c in enumerate("RGB")})
        shapes.append({"name": name, "mesh": f"meshes/{name}.ply", "material": name})
        materials[name] = {
            "model": "lambert",
            "albedo_texture": f"textures/{name}.exr",
            "albedo_scale": 1.0,
            "free": ["albedo_scale"],
        }
        if body.surface.get("scale", 0) > 0:
            lobe = {"eta": body.surface["eta"], "alpha": body.surface["alpha_u"], "specular_scale": body.surface["scale"]}
            materials[name] |= {"model": "ggx", **lobe, "free": ["albedo_scale", "alpha", "specular_scale"]}
    simulation = {"format": "simulation/1", "shapes": shapes, "materials": materials, "lights": world.lights}
    simulation |= {"transport": {"max_bounces": 1}, "medium": None, "lens": {"model": "pinhole"}, "sensor": {"response": "linear"}}
    write_json(folder / "simulation.json", simulation | {"effects": []})


def seal(answers: dict[str, dict], folder: Path) -> tuple[str, str]:
    """Write the answers into `folder` and return (commitment, salt)."""
    make_folder(folder)
    for name, answer in answers.items():
        affected = answer.pop("affected")
        answer["affected_fraction"] = float(affected.mean())
        np.savez_compressed(folder / f"{name}.npz", affected=affected)
    text = json.dumps(answers, indent=1, sort_keys=True)
    (folder / "answers.json").write_text(text, encoding="utf-8")
    salt = secrets.token_hex(16)
    return hashlib.sha256((salt + text).encode()).hexdigest(), salt


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sealed", description=__doc__)
    parser.add_argument("output", type=Path, help="folder of the recordings, with commitment.json")
    parser.add_argument("--answers", type=Path, required=True, help="folder of the answers; keep it away from who diagnoses")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", default="160x120")
    parser.add_argument("--strength", default="0.4:1", help="range of strengths; 1 is plain to see")
    parser.add_argument("--nulls", type=float, default=0.2, help="share of recordings with nothing left out")
    parser.add_argument("--pairs", type=float, default=0.15)
    parser.add_argument("--unlisted", type=float, default=0.1)
    parser.add_argument("--only", help="ids, comma-separated: a trial each, instead of a random plan; null for nothing")
    args = parser.parse_args(argv)
    rng = np.random.default_rng(args.seed)
    width, height = (int(v) for v in args.size.split("x"))
    low, high = (float(v) for v in args.strength.split(":"))
    if args.only:
        trials = [[] if group == "null" else group.split("+") for group in args.only.split(",")]
        if unknown := {id for group in trials for id in group} - set(CHANGES | UNLISTED):
            parser.error(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(sorted(CHANGES | UNLISTED))}")
    else:
        trials = plan(rng, args.trials, args.nulls, args.pairs, args.unlisted)
    mi = mitsuba("llvm_ad_rgb")
    answers = {}
    for i, ids in enumerate(trials, 1):
        name = f"trial-{i:03d}"
        with stage(f"{name} of {len(trials)}"):
            own = np.random.default_rng([args.seed, i])
            answers[name] = make(mi, own, ids, float(own.uniform(low, high)), (width, height), args.output / name)
    commitment, salt = seal(answers, args.answers)
    write_json(args.output / "commitment.json", {"sha256": commitment})
    write_json(args.answers / "salt.json", {"salt": salt})
    return 0


if __name__ == "__main__":
    sys.exit(main())
