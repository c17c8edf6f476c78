"""Mist that augmentation adds to a recording, against the true street in the same mist.

The true one is rendered from the world itself, with sun and sky shining through the mist of eq 6.6. The augmentation sees
only the recording of clear air. It is compared with leaving the mist out, and with the fog that is painted on by depth:
`T L + (1 - T) airlight`, with the airlight of the sky at the horizon (Koschmieder's, as in most fog data sets).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from skimage.metrics import peak_signal_noise_ratio

from materials.foundation.progress import stage
from scene.images import encode
from scene.reconstruction.build import build
from scene.reconstruction.build_settings import BuildSettings
from scene.recording import read_recording
from scene.scene_file import Scene, read_scene
from scene.street import Street, StreetSettings, street
from scene.wetting.spray import spray_over
from transport.augment import AugmentSettings, estimate_sky_gain, separate_frame
from transport.contact_sheet import contact_sheet
from transport.media import MediumArrays, compile_spray
from transport.mist import MistyFrame, misty_frame
from transport.photograph import PhotographSettings, photograph
from transport.projected_world import ProjectedFrame, project_frame
from transport.render import render
from transport.separate import water_normals
from transport.wet import wet_frame
from transport.world import compile_world

from .report import Report

_FRAME, _AMOUNTS = 0, (0.5, 1.0)
_SAMPLES, _TRUE_SAMPLES = 64, 64
_PHOTOGRAPHS = PhotographSettings(samples=64)


def run(report: Report) -> None:
    """Record PSNR over the whole picture, under an overcast and a clear sky."""
    for sky in ("overcast", "clear"):
        folder = Path(report.folder) / "proof" / "misty_street" / sky
        world = street(StreetSettings(frames=2, width=320, height=135, sky=sky))
        photograph(world, folder / "recording", _PHOTOGRAPHS)
        build(read_recording(folder / "recording"), folder / "scene", BuildSettings())
        scene = read_scene(folder / "scene")
        rows: list[tuple[str, list[NDArray]]] = []
        for m in _AMOUNTS:
            spray = compile_spray(spray_over(scene.maps["height"], scene.grid, m))
            frame, misty = _augmented(scene, spray)
            truth = _true_picture(world, frame, spray)
            painted = encode(_painted(frame, misty.transmittance), frame.encoding)
            score = {
                name: float(peak_signal_noise_ratio(truth, picture, data_range=255))
                for name, picture in (("augmented", misty.raw), ("painted", painted), ("clear", frame.raw))
            }
            for name in ("painted", "clear"):
                label = f"{sky} street, mist {m:g}: PSNR [dB] of the augmentation, above {name}"
                report.proof(name=label, value=score["augmented"], bound=score[name], holds=score["augmented"] > score[name])
            rows.append((f"m = {m:g}: true | augmented | painted | clear", [truth, misty.raw, painted, frame.raw]))
        contact_sheet(rows, folder / "mist.png")


def _augmented(scene: Scene, spray: MediumArrays) -> tuple[ProjectedFrame, MistyFrame]:
    settings = AugmentSettings(samples=_SAMPLES)
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
    gain = estimate_sky_gain(scene, [_FRAME], normals, settings)
    frame = project_frame(scene, _FRAME, None, gain)
    separation = separate_frame(frame, scene, normals, settings)
    dry = np.zeros(scene.grid.shape, np.float32)
    wet = wet_frame(frame, separation, dry, settings.seed, settings.bounces)
    return frame, misty_frame(frame, separation, wet, dry, spray, _SAMPLES, settings.seed, settings.bounces, settings.smooth_mist)


def _true_picture(world: Street, frame: ProjectedFrame, spray: MediumArrays) -> NDArray:
    with stage("true street in mist"):
        misty = replace(compile_world(world.simulation(_FRAME)), medium=spray)
        rendering = render(misty, frame.camera, _TRUE_SAMPLES, seed=1, max_bounces=16, clamp=_PHOTOGRAPHS.clamp)
    return encode(_PHOTOGRAPHS.exposure * rendering.radiance, frame.encoding)


def _painted(frame: ProjectedFrame, transmittance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the picture with fog painted on: the airlight is the mean of the sky's lowest tenth."""
    sky = ~np.isfinite(frame.depth)
    rows = np.nonzero(sky)[0]
    low = sky & (np.arange(sky.shape[0])[:, None] >= np.quantile(rows, 0.9)) if rows.size else np.ones_like(sky)
    airlight = frame.image[low].mean(axis=0)
    T = transmittance[..., None]
    return (T * frame.image + (1 - T) * airlight).astype(np.float32)
