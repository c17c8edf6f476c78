"""The augmented street against the true wet street, beside two simpler ways to wet a picture.

The true one is rendered from the world itself: water where the shower leaves it, wet materials, real geometry. The
augmentation sees only the recording: photographs, LiDAR, masks, poses. How strong a shower makes how much wetness is not
given: each method takes the global wetness that suits it best on the first frame, and is scored on the others.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from evaluate.experiments.wetting import METHODS
from materials.foundation.progress import stage
from scene.images import encode
from scene.reconstruction.build import build
from scene.reconstruction.build_settings import BuildSettings
from scene.recording import read_recording
from scene.scene_file import Scene, read_scene
from scene.street import Street, StreetSettings, street
from scene.wetting.water import water_level
from transport.augment import AugmentSettings, estimate_sky_gain, separate_frame
from transport.contact_sheet import contact_sheet
from transport.photograph import PhotographSettings, photograph
from transport.projected_world import ProjectedFrame, project_frame
from transport.render import render
from transport.separate import Separation, water_normals
from transport.wet import wet_frame
from transport.world import compile_world

from .report import Report

_WETNESS = (1 / 3, 2 / 3, 1.0)
_GRID = (1 / 3, 0.5, 2 / 3, 5 / 6, 1.0)
_FRAMES = (1, 4, 6)
_SAMPLES = 64
_TRUE_SAMPLES = 64
_PHOTOGRAPHS = PhotographSettings(samples=64)


def run(report: Report) -> None:
    """Record PSNR and SSIM of the augmentation and both baselines, over the pixels of the ground."""
    folder = Path(report.folder) / "proof" / "wet_street"
    world = street(StreetSettings())
    photograph(world, folder / "recording", _PHOTOGRAPHS)
    build(read_recording(folder / "recording"), folder / "scene", BuildSettings())
    scene = read_scene(folder / "scene")
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
    settings = AugmentSettings(samples=_SAMPLES)
    gain = estimate_sky_gain(scene, list(range(len(scene.recording.frames))), normals, settings)
    water = {w: water_level(scene.maps, scene.grid, w, settings.water) for w in _GRID}
    chosen: dict[tuple[float, str], float] = {}
    scores: dict[tuple[float, str], list[tuple[float, float]]] = {}
    projected: ProjectedFrame | None = None
    for index in _FRAMES:
        projected = project_frame(scene, index, projected, gain)
        separation = separate_frame(projected, scene, normals, settings)
        pictures: dict[tuple[str, float], NDArray] = {}
        for v in _GRID:
            wet = wet_frame(projected, separation, water[v], settings.seed, settings.bounces)
            for name, method in METHODS.items():
                pictures[name, v] = method(projected, separation, wet)
        rows: list[tuple[str, list[NDArray]]] = [("recorded dry", [projected.raw])]
        for w in _WETNESS:
            truth = _true_picture(world, index, w, projected)
            if index == _FRAMES[0]:
                for name in METHODS:
                    psnr = {v: _score(pictures[name, v], truth, projected.is_ground)[0] for v in _GRID}
                    chosen[w, name] = max(_GRID, key=lambda v, psnr=psnr: psnr[v])
            best = {name: pictures[name, chosen[w, name]] for name in METHODS}
            if index != _FRAMES[0]:
                for name, picture in best.items():
                    scores.setdefault((w, name), []).append(_score(picture, truth, projected.is_ground))
            caption = " | ".join(f"{name} at {chosen[w, name]:.2f}" for name in METHODS)
            rows.append((f"shower {w:.2f}: true | {caption}", [truth, *best.values()]))
        contact_sheet(rows, folder / f"frame_{index}.png")
        if index == _FRAMES[0]:
            _separation_proof(report, world, index, projected, separation, folder)
    for w in _WETNESS:
        ours = np.mean(scores[w, "augmented"], axis=0)
        for name in ("darkened", "planar mirror"):
            theirs = np.mean(scores[w, name], axis=0)
            for k, measure in enumerate(("PSNR [dB]", "SSIM")):
                label = f"wet street, shower {w:.2f}: {measure} of the augmentation, above {name}"
                report.proof(name=label, value=float(ours[k]), bound=float(theirs[k]), holds=bool(ours[k] > theirs[k]))
    _recomposition_proof(report, scene, projected, normals, settings)


def _true_picture(world: Street, index: int, w: float, frame: ProjectedFrame) -> NDArray:
    with stage(f"true wet street, frame {index}, w = {w:.2f}"):
        rendering = render(compile_world(world.simulation(index, w)), frame.camera, _TRUE_SAMPLES, seed=1, clamp=_PHOTOGRAPHS.clamp)
    return encode(_PHOTOGRAPHS.exposure * rendering.radiance, frame.encoding)


def _score(picture: NDArray, truth: NDArray, ground: NDArray[np.bool_]) -> tuple[float, float]:
    """Return PSNR and mean SSIM over the ground's pixels, of 8-bit pictures."""
    psnr = peak_signal_noise_ratio(truth[ground], picture[ground], data_range=255)
    result: Any = structural_similarity(truth, picture, channel_axis=-1, data_range=255, full=True)
    return float(psnr), float(result[1][ground].mean())


def _separation_proof(
    report: Report, world: Street, index: int, frame: ProjectedFrame, separation: Separation, folder: Path
) -> None:
    """Compare the separated specular layer with the true one: the ground's own lobes in the true, dry world."""
    dry = compile_world(world.simulation(index))
    true = render(dry, frame.camera, _TRUE_SAMPLES, seed=2, specular_only=True, clamp=_PHOTOGRAPHS.clamp)
    layer = _PHOTOGRAPHS.exposure * true.radiance
    ground = separation.share == 1
    ours = separation.scale * separation.specular
    error = float(np.sqrt(np.mean((ours - layer)[ground] ** 2)))
    # What one would believe without separating: no specular light at all.
    nothing = float(np.sqrt(np.mean(layer[ground] ** 2)))
    report.proof(
        name="separated specular layer: RMSE, below that of no separation", value=error, bound=nothing, holds=error < nothing
    )
    shown = [
        np.rint(255 * np.clip(4 * np.where(ground[..., None], v, 0), 0, 1) ** (1 / 2.2)).astype(np.uint8) for v in (ours, layer)
    ]
    contact_sheet([("specular layer of the ground (x 4): separated | true", shown)], folder / "specular_layer.png")


def _recomposition_proof(
    report: Report, scene: Scene, frame: ProjectedFrame | None, normals: NDArray[np.float32], settings: AugmentSettings
) -> None:
    """Recompose at w = 0 with the specular light of a second seed: only the predicted Monte Carlo noise may remain."""
    from dataclasses import replace

    assert frame is not None
    first = separate_frame(frame, scene, normals, settings)
    second = separate_frame(frame, scene, normals, replace(settings, seed=settings.seed + 1))
    ground = first.share == 1
    z = (first.specular - second.specular)[ground] / np.sqrt((first.variance + second.variance)[ground] + 1e-20)
    # Scrambled Sobol points only lower the variance that independent samples predict: z has a deviation of at most 1.
    deviation = float(np.sqrt(np.mean(z**2)))
    report.proof(
        name="recomposition at w = 0, second seed: deviation over prediction", value=deviation, bound=1.0, holds=deviation <= 1.0
    )
    # The unseen sky is set so that 5 % of the ground's pixels exceed their light in the mean of the channels; any of three
    # channels may do so.
    clamped = first.clamped_share
    report.proof(name="share of the ground's pixels clamped in any channel", value=clamped, bound=0.15, holds=clamped <= 0.15)
