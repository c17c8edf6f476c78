"""Render the frames of a simulation into a folder: EXR files with all layers, going on where an earlier run stopped."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, read_json, write_json
from materials.foundation.progress import logger
from scene.images import Encoding, write_exr, write_image
from scene.simulation import RectangleLight, Simulation

from .checkpoint import identity, load_checkpoint, save_checkpoint
from .denoise import denoised, denoiser
from .progressive import Goal, Outcome, develop
from .render import Exposure, Tracing
from .render_layers import label_layers, light_layers
from .render_settings import RenderSettings
from .views import View, lit, with_lens
from .world import World, compile_world, with_lights

_SAMPLES = 64
_FORMAT = "rendering/1"
_SRGB = Encoding(".png", "uint8", 3, "srgb")
# Where no recording says how a camera exposed, this share of the pixels of the first preview may be white.
_WHITE = 0.01


@dataclass(frozen=True)
class RenderedFrame:
    """One frame on disk: its EXR, and how far it got."""

    name: str
    file: Path
    samples: int
    noise: float
    seconds: float
    reached: str


def render_frames(
    simulation: Simulation,
    views: Sequence[View],
    output: str | Path,
    settings: RenderSettings | None = None,
    preview_gain: float | None = None,
) -> list[RenderedFrame]:
    """Render each view of a simulation into `output`, as `NAME.exr` with all layers of docs/render.md and `NAME.png`.

    Parameters
    ----------
    simulation : Simulation
        Its lens and `max_bounces` are heeded; sensor and effects are not: what is written is light.
    views : sequence of View
        In order of time: flow is to the next one.
    output : path
        Folder. `render.json` in it says what is there and how it was made.
    settings : RenderSettings, optional
    preview_gain : float, optional
        Factor on the light of the previews; by default what lets few pixels of the first frame be white.

    Returns
    -------
    frames : list of RenderedFrame

    Raises
    ------
    InputError
        If a view names a light that is not there, the scene cannot be compiled, or the folder holds frames or checkpoints of
        another scene or other settings, or other files.

    Notes
    -----
    Frames that are there, of the same scene, settings and goal, are kept. An unfinished one leaves `NAME.checkpoint.npz`, from
    which the next run goes on to the same bits as if nothing had happened.
    """
    settings = settings or RenderSettings()
    if settings.denoise:
        denoiser()  # before hours of work, not after
    names = [view.name for view in views]
    if len(set(names)) < len(names):
        raise InputError("have a name each", got=", ".join(names), key="views")
    folder = _open(Path(output), settings)
    tracing = Tracing(settings.seed, settings.max_bounces or simulation.transport.max_bounces, clamp=settings.clamp or np.inf)
    goal = _goal(settings)
    not_rendered = unsaid(simulation)
    for line in not_rendered:
        logger.warning("not rendered: %s", line)
    known: dict[str, Any] = _frames_of(folder)
    world: World | None = None
    out = []
    for i, view in enumerate(views):
        world = _world(lit(simulation, view), world)
        camera, lens = with_lens(view.camera, simulation.lens)
        exposure = Exposure(world, camera, tracing, lens)
        made = identity(exposure) | {"exposure": repr(view.exposure)}
        target = {"samples": goal.samples, "noise": goal.noise, "seconds": goal.seconds, "denoise": settings.denoise}
        file = folder / f"{view.name}.exr"
        checkpoint = folder / f"{view.name}.checkpoint.npz"
        before = known.get(view.name)
        if before is not None and file.exists():
            if before["made"] != made and not settings.overwrite:
                _refuse(file, before["made"], made)
            if before["made"] == made and before["goal"] == target:
                logger.info("%s: kept", file)
                out.append(RenderedFrame(view.name, file, *(before[k] for k in ("samples", "noise", "seconds", "reached"))))
                continue
        spent = _resume(checkpoint, exposure, settings.overwrite)

        def keep(seconds: float, path: Path = checkpoint, picture: Exposure = exposure) -> None:
            save_checkpoint(path, picture, seconds)

        label = view.name if len(views) == 1 else f"{view.name} ({i + 1} of {len(views)})"
        outcome = develop(exposure, goal, label, spent, keep, settings.checkpoint_seconds)
        following = views[i + 1].camera if i + 1 < len(views) else None
        next_camera = None if following is None else with_lens(following, simulation.lens)[0]
        channels = light_layers(outcome.rendering, view.exposure)
        clean = denoised(outcome.rendering) * np.float32(view.exposure) if settings.denoise else None
        if clean is not None:
            channels |= {f"denoised.{c}": np.ascontiguousarray(clean[..., k]) for k, c in enumerate("RGB")}
        channels |= label_layers(world, camera, lens, next_camera, seed=settings.seed)
        write_exr(file, channels, _header(world, view, outcome))
        shown = clean if clean is not None else outcome.rendering.radiance * np.float32(view.exposure)
        if preview_gain is None:
            preview_gain = _gain(shown)
        if settings.preview:
            write_image(file.with_suffix(".png"), shown * np.float32(preview_gain), _SRGB)
        frame = RenderedFrame(view.name, file, outcome.rendering.samples, outcome.noise, outcome.seconds, outcome.reached)
        known[view.name] = {
            "samples": frame.samples,
            "noise": frame.noise,
            "seconds": frame.seconds,
            "reached": frame.reached,
            "goal": target,
            "made": made,
        }
        write_json(folder / "render.json", {"format": _FORMAT, "not_rendered": not_rendered, "frames": known})
        checkpoint.unlink(missing_ok=True)
        logger.info("%s: %d samples, noise %.4f, %.1f s", file, frame.samples, frame.noise, frame.seconds)
        out.append(frame)
    return out


def unsaid(simulation: Simulation) -> list[str]:
    """Return what a simulation says about its pictures that light alone does not show, a line each."""
    out = [f"effect {e.id}" + (f" on {e.target}" if e.target else "") for e in simulation.effects]
    if not simulation.transport.shadows:
        out.append("transport.shadows false: surfaces are shadowed here")
    if simulation.sensor.response != "linear" or simulation.sensor.saturation is not None:
        out.append("sensor: values are linear and not clipped")
    return out


def _goal(settings: RenderSettings) -> Goal:
    limit = Goal().samples if settings.noise is not None or settings.seconds is not None else _SAMPLES
    return Goal(settings.samples or limit, settings.noise, settings.seconds)


def _open(folder: Path, settings: RenderSettings) -> Path:
    make_folder(folder)
    there = any(p for p in folder.iterdir() if not p.name.startswith(".") and not p.name.endswith(".checkpoint.npz"))
    if there and not (folder / "render.json").exists() and not settings.overwrite:
        raise InputError("be empty or hold renderings", file=folder, remedy="Choose another output folder, or give --overwrite.")
    return folder


def _frames_of(folder: Path) -> dict[str, Any]:
    file = folder / "render.json"
    if not file.exists():
        return {}
    said = read_json(file)
    if not isinstance(said, dict) or said.get("format") != _FORMAT or not isinstance(said.get("frames"), dict):
        raise InputError(f"be a {_FORMAT}", file=file, remedy="Choose another output folder.")
    return said["frames"]


def _refuse(file: Path, before: dict[str, str], now: dict[str, str]) -> None:
    name = next((n for n, value in now.items() if before.get(n) != value), "settings")
    said = before.get(name, "")
    remedy = "Choose another output folder, or give --overwrite."
    if len(said) == 64:  # a hash says nothing to people
        raise InputError("be the one that this frame was made with", file=file, key=f"the {name}", remedy=remedy)
    raise InputError(f"be {said}, as when this frame was made", got=now.get(name), file=file, key=name, remedy=remedy)


def _resume(checkpoint: Path, exposure: Exposure, overwrite: bool) -> float:
    if not checkpoint.exists():
        return 0.0
    try:
        spent = load_checkpoint(checkpoint, exposure)
    except InputError:
        if not overwrite:
            raise
        return 0.0
    logger.info("%s: going on from %d samples", checkpoint, exposure.samples)
    return spent


def _world(simulation: Simulation, before: World | None) -> World:
    """Compile a world, or only its lights where the rest is there; a rectangle of light is a piece of geometry."""
    if before is None:
        return compile_world(simulation)
    has_rectangles = any(isinstance(light, RectangleLight) for light in simulation.lights.values())
    if has_rectangles or len(before.shapes) != len(simulation.shapes):
        return compile_world(simulation, before)
    return with_lights(before, simulation.lights)


def _header(world: World, view: View, outcome: Outcome) -> dict[str, object]:
    shapes = {str(i + 1): shape.name for i, shape in enumerate(world.shapes)}
    numbers = world.arrays.shape_material
    materials = {str(int(m) + 1): shape.material for m, shape in zip(numbers, world.shapes, strict=True)}
    return {
        "samples": outcome.rendering.samples,
        "exposure_factor": float(view.exposure),
        "shapes": json.dumps(shapes),
        "materials": json.dumps(materials),
    }


def _gain(light: NDArray[np.float32]) -> float:
    white = float(np.quantile(light.max(axis=-1), 1 - _WHITE))
    return 1.0 / white if white > 0 else 1.0
