"""From where, and under which lights, a simulation is rendered: as a recording says, or from aside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.recording import Recording
from scene.simulation import Lens, Simulation
from scene.transforms import look_at

from .render_settings import ViewSettings


@dataclass(frozen=True)
class View:
    """One frame to be: its name, camera, the names of the lights that are on (None: all), and its exposure."""

    name: str
    camera: Camera
    lights: tuple[str, ...] | None = None
    exposure: float = 1.0


def recorded_views(recording: Recording, frames: Sequence[int]) -> tuple[View, ...]:
    """Return the views of a recording's frames; they are named as the frames, or by number where names come twice."""
    names = [recording.frames[i].name for i in frames]
    if len(set(names)) < len(names):
        names = [f"{i:04d}" for i in frames]
    chosen = [recording.frames[i] for i in frames]
    return tuple(View(name, f.camera, f.lights, f.exposure) for name, f in zip(names, chosen, strict=True))


def view_from_aside(simulation: Simulation, settings: ViewSettings) -> View:
    """Return a view of a simulation that no recording goes with.

    Raises
    ------
    InputError
        If eye and target are the same point.
    """
    corners = np.concatenate([[s.mesh.vertices.min(axis=0), s.mesh.vertices.max(axis=0)] for s in simulation.shapes])
    low, high = corners.min(axis=0).astype(np.float64), corners.max(axis=0).astype(np.float64)
    target = (low + high) / 2 if settings.target is None else np.array(settings.target)
    width, height = settings.width, settings.height
    focal = 0.5 * width / np.tan(np.radians(settings.fov_deg) / 2)
    if settings.eye is None:
        # As far away as the ball around everything fills the narrower side.
        radius = max(float(np.linalg.norm(high - low)) / 2, 1e-3)
        aside = np.array([0.6, -0.7, 0.4])
        eye = target + radius / np.sin(np.arctan(0.5 * min(width, height) / focal)) * aside / np.linalg.norm(aside)
    else:
        eye = np.array(settings.eye)
    if not np.linalg.norm(eye - target) > 0:
        raise InputError("differ from --target", got=tuple(eye), key="--eye")
    return View("view", Camera("PINHOLE", width, height, look_at(eye, target), focal, focal, width / 2, height / 2))


def lit(simulation: Simulation, view: View, file: str | Path | None = None) -> Simulation:
    """Return the simulation under the lights that are on in a view, the sky among them if it is named.

    Raises
    ------
    InputError
        If a light of the view is not in the simulation.
    """
    if view.lights is None:
        return simulation
    for name in view.lights:
        if name not in simulation.lights:
            known = ", ".join(simulation.lights) or "none"
            raise InputError(f"name lights of the simulation ({known})", got=name, key=f"lights of frame {view.name}", file=file)
    return replace(simulation, lights={n: light for n, light in simulation.lights.items() if n in view.lights})


def with_lens(camera: Camera, lens: Lens) -> tuple[Camera, Lens]:
    """Return the camera with the distortion that a simulation gives to its lens, and the lens without it.

    What projects points must know the distortion, and only a camera does.
    """
    if not (lens.k1 or lens.k2):
        return camera, lens
    if camera.model != "PINHOLE":
        got = f"{camera.model} and {lens.k1, lens.k2}"
        raise InputError("belong to a PINHOLE camera", got=got, key="lens.k1, lens.k2", remedy="Leave distortion to one of them.")
    return replace(camera, model="OPENCV", k1=lens.k1, k2=lens.k2), replace(lens, k1=0.0, k2=0.0)
