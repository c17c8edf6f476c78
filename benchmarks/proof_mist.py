"""Mist of eq 6.6 as it is rendered: its mean free path at a camera's height, and how contrast falls with distance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from materials.foundation.files import make_folder, replacing
from materials.phase import henyey_greenstein
from scene.camera import Camera
from scene.grid import GroundGrid
from scene.mesh import Mesh
from scene.simulation import EnvironmentLight, Light, Material, Shape, Simulation
from scene.transforms import look_at
from scene.wetting.spray import Spray, spray_over
from scene.wetting.spray_settings import SpraySettings
from transport.media import MediumArrays, compile_spray
from transport.render import Rendering, render
from transport.world import compile_world

from .report import Report

_EYE, _DISTANCE = 1.1, 60.0  # [m]
_AMOUNTS = (1 / 3, 2 / 3, 1.0)
_DISTANCES = (10.0, 25.0, 50.0, 100.0, 150.0, 200.0)
_GRID = GroundGrid(-10.0, -20.0, 0.5, 80, 480)
_VIEW = Camera("PINHOLE", 24, 24, look_at(np.array([0.0, 0, _EYE]), np.array([1.0, 0, _EYE])), 24e3, 24e3, 12, 12)
# All z-tests of this file share 1 %.
_Z = float(norm.isf(0.5 * (1 - (1 - 0.01) ** (1 / (2 * len(_AMOUNTS) + len(_DISTANCES))))))


def run(report: Report) -> None:
    """Record mean free paths and contrasts, and plot the contrasts to `proof/mist`."""
    for m in _AMOUNTS:
        for contrast in (0.0, 0.3):
            _mean_free_path(report, mist(m, contrast))
    folder = make_folder(Path(report.folder) / "proof" / "mist")
    koschmieder(report, folder / "contrast.png")


def mist(m: float, contrast: float, albedo: float = 0.0) -> Spray:
    """Return mist over a level road."""
    return spray_over(np.zeros(_GRID.shape, np.float32), _GRID, m, SpraySettings(contrast=contrast, albedo=albedo))


def _mean_free_path(report: Report, spray: Spray) -> None:
    """Measure it on a glowing wall behind mist that scatters nothing back."""
    seen = _picture(compile_spray(spray), "glow", _DISTANCE, 4.0, {}, 256)
    mean, error = _mean(seen)
    if spray.settings.contrast == 0:
        expected, by = 50.0 * np.exp(_EYE) / spray.m, "eq 6.6 at 1.1 m"
    else:
        # The pixels' rays fill a pyramid 6 cm wide at its end: its axis stands for them to 1 % of the optical depth.
        x = (np.arange(100_000) + 0.5) / 100_000 * _DISTANCE
        beam = np.column_stack([x, 0 * x, 0 * x + _EYE])
        expected, by = 1 / float(spray.extinction(beam).mean()), "the line integral"
    measured = -_DISTANCE / np.log(mean)
    bound = _Z * error / mean * measured**2 / _DISTANCE + (0.0 if spray.settings.contrast == 0 else 0.01 * expected)
    name = f"mist m = {spray.m:.2f}, contrast {spray.settings.contrast:g}: mean free path {measured:.1f} m, {by} {expected:.1f} m"
    report.proof(
        name=name, value=float(abs(measured - expected)), bound=float(bound), holds=bool(abs(measured - expected) <= bound)
    )


def koschmieder(report: Report, plot: Path) -> None:
    """Compare the contrast of a black target with exp(-sigma d) (Koschmieder 1924), for even scattering and for drops."""
    spray = mist(1.0, 0.0, albedo=1.0)
    drops = compile_spray(spray)
    even = drops._replace(phase=np.array(henyey_greenstein(0.0)))
    law = np.exp(-np.array(_DISTANCES) * 0.02 * np.exp(-_EYE))
    found: dict[str, list[float]] = {"even scattering": [], "drops": []}
    sky: dict[str, Light] = {"sky": EnvironmentLight((1.0, 1.0, 1.0))}
    for distance, expected in zip(_DISTANCES, law, strict=True):
        for label, medium in (("even scattering", even), ("drops", drops)):
            mean, error = _mean(_picture(medium, "black", distance, 0.5, sky, 1024))
            found[label].append(1 - mean)
            if label == "even scattering":
                # The target hides part of the sky from the air before it, of which the law knows nothing.
                bound = _Z * error + 0.002
                name = f"mist m = 1: contrast at {distance:.0f} m {1 - mean:.4f}, by Koschmieder {expected:.4f}"
                off = abs(1 - mean - expected)
                report.proof(name=name, value=float(off), bound=float(bound), holds=bool(off <= bound))
    _plot(plot, law, found)


def _picture(
    medium: MediumArrays, material: str, distance: float, size: float, lights: dict[str, Light], samples: int
) -> Rendering:
    """Return a picture filled by a square target that stands upright at a distance."""
    half = size / 2
    corners = [(distance, -half, _EYE - half), (distance, half, _EYE - half), (distance, half, _EYE + half)]
    vertices = np.array([*corners, (distance, -half, _EYE + half)], np.float32)
    target = Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.uint32)).with_smooth_normals()
    materials = {"glow": Material("emission", emission=(1.0, 1.0, 1.0)), "black": Material("lambert", (0.0, 0.0, 0.0))}
    world = compile_world(Simulation((Shape("target", target, material),), materials, lights))
    return render(replace(world, medium=medium), _VIEW, samples, max_bounces=64)


def _mean(rendering: Rendering) -> tuple[float, float]:
    pixels = rendering.radiance[..., 1].astype(float)
    return float(pixels.mean()), float(pixels.std(ddof=1) / np.sqrt(pixels.size))


def _plot(path: Path, law: NDArray, found: dict[str, list[float]]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.semilogy(_DISTANCES, law, "k-", label="Koschmieder: exp(-σ d)")
    for (label, values), mark in zip(found.items(), "ox", strict=True):
        axes.semilogy(_DISTANCES, values, mark, label=label)
    axes.set_xlabel("distance [m]")
    axes.set_ylabel("contrast of a black target before an even sky")
    axes.set_title("mist, m = 1, 1.1 m above the ground")
    axes.legend()
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=110)
