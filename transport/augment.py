"""Augment a drive with wet ground, mist and drops on the windshield, frame by frame (thesis 6.4).

All is written that a user of the data may ask for: pictures, layers, labels, truth, and a record.
"""

from __future__ import annotations

import importlib.metadata
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import make_folder, replacing, write_json
from materials.foundation.progress import logger, tracked
from materials.foundation.settings import as_dict
from scene.images import write_exr, write_raw
from scene.recording import Frame, Recording, write_recording
from scene.scene_file import Scene
from scene.wetting.water import water_level
from scene.wetting.wetting_patterns import puddle_pattern
from scene.wetting.windshield import Windshield, glass_before

from .air import air_over
from .augment_settings import AugmentSettings, check_wetness
from .droplets import droplet_frame
from .kernels.media import MediumArrays
from .kernels.wet import SPLIT
from .layers import FrameResult, labels, layers
from .mist import misty_frame
from .projected_world import ProjectedFrame, project_frame
from .separate import Separation, refine, separate, water_normals
from .wet import wet_frame

# The unseen sky is judged on this many frames of a drive, every so many pixels, with so many paths each.
_GAIN_FRAMES, _GAIN_STEP, _GAIN_SAMPLES = 4, 5, 64


def augment(
    scene: Scene, frames: list[int], wetness: list[float], settings: AugmentSettings, folder: str | Path
) -> list[dict[str, Any]]:
    """Write the frames of a scene at each wetness, in mist and through drops if the settings have any.

    Parameters
    ----------
    scene : Scene
    frames : list of int
        Indices into the recording.
    wetness : list of float
        Global wetness values in [0, 1].
    settings : AugmentSettings
    folder : path
        Gets one folder per wetness (`w0.33/`, with mist and drops `w0.33_m0.50_d0.20/`), with `image/`, `layers/` and
        `label/`, what rain does not change (`truth/`), `recording.json`, which makes a recording of the wet pictures and
        that truth, and `augment.json`.

    Returns
    -------
    report : list of dict
        Per frame and wetness: samples, clamped share, mean saturation and accumulation, standard error.

    Raises
    ------
    InputError
        If a setting is out of range or an input cannot be used.
    """
    check_wetness(wetness)
    if settings.format == "png":
        for file in (scene.recording.frames[i].image for i in frames):
            if file.suffix.lower() != ".png":
                remedy = f"The input is {file.suffix}; use --format same."
                raise InputError("be same or exr", got="png", key="--format", remedy=remedy)
    folder = make_folder(folder)
    normals = water_normals(scene.maps["height"], scene.maps["coverage"], scene.grid.cell)
    maps = dict(scene.maps)
    if settings.puddle_scale > 0:
        maps["puddles"] = puddle_pattern(*scene.grid.centres(), settings.seed, scale=settings.puddle_scale)
    levels = [water_level(maps, scene.grid, w, settings.water) for w in wetness]
    air = air_over(scene, settings)
    names = [folder_name(w, settings) for w in wetness]
    report: list[dict[str, Any]] = []
    gain = settings.sky_gain or estimate_sky_gain(scene, frames, normals, settings)
    logger.info("unseen sky at %.2f of its level", gain)
    passed: dict[str, list[Frame]] = {}
    shield: Windshield | None = None
    projected: ProjectedFrame | None = None
    for index in tracked(frames, "wetting frames", len(frames)):
        projected = project_frame(scene, index, projected, gain)
        separation = separate_frame(projected, scene, normals, settings)
        for w, name, water in zip(wetness, names, levels, strict=True):
            mist = air.at(index, water)
            result = rainy_frame(projected, separation, np.clip(water, 0, 1), mist, settings)
            if settings.droplets > 0:
                shield = shield or windshield_before(projected, settings)
                result = through_drops(result, mist, shield, index, settings)
            _write_frame(folder / name, result, settings)
            passed.setdefault(name, []).append(_pass_truth(projected, folder / name, settings.format))
            figures = _figures(result, w)
            report.append(figures | {"wheel_spray": air.figures(index, water)} if settings.wheel_spray > 0 else figures)
    for w, name in zip(wetness, names, strict=True):
        used = replace(settings, sky_gain=gain)
        wet = Recording(tuple(passed[name]), (folder / name).resolve(), f"{scene.name}, wetness {w:g}", noise=scene.recording.noise)
        write_recording(folder / name / "recording.json", wet)
        write_json(folder / name / "augment.json", _record(scene, w, used, [r for r in report if r["wetness"] == w]))
    return report


def rainy_frame(
    frame: ProjectedFrame, separation: Separation, water: NDArray[np.float32], mist: MediumArrays | None, settings: AugmentSettings
) -> FrameResult:
    """Return a frame with wet ground, and in mist if there is any.

    Parameters
    ----------
    water : (rows, cols) float32
        Water level W on the scene's grid, in [0, 1].
    """
    wet = wet_frame(frame, separation, water, settings.seed, settings.bounces)
    if mist is None:
        return FrameResult(frame, separation, water, wet)
    draws = (separation.samples, settings.seed, settings.bounces, settings.smooth_mist)
    misty = misty_frame(frame, separation, wet, water, mist, *draws)
    return FrameResult(frame, separation, water, wet, misty)


def windshield_before(frame: ProjectedFrame, settings: AugmentSettings) -> Windshield:
    """Return the windshield before a frame's camera, with the drops that the settings ask for."""
    glass = glass_before(frame.camera, settings.windshield)
    return Windshield(glass, settings.droplets, settings.windshield, settings.seed)


def through_drops(
    result: FrameResult, mist: MediumArrays | None, shield: Windshield, index: int, settings: AugmentSettings
) -> FrameResult:
    """Return a frame seen past the drops that lie on the glass by then: the drive's first frame starts with the first drops."""
    so_far = (result.frame, result.separation, result.image, result.raw, result.water, mist)
    draws = (result.separation.samples, settings.seed, settings.bounces)
    return replace(result, droplets=droplet_frame(*so_far, shield.glass, shield.at(index), settings.windshield, *draws))


def estimate_sky_gain(scene: Scene, frames: list[int], normals: NDArray[np.float32], settings: AugmentSettings) -> float:
    """Return the largest factor on the unseen sky that the pictures allow, at most 1.

    The sky above the picture is a guess, and its gloss on the ground must not exceed what the camera saw there (eq 6.11).
    Gloss is linear in the factor g, `S = S_0 + g S_1`, so each pixel allows `(L - S_0) / S_1`; g is what all but 5 % of
    the ground allow. One value serves the whole drive, or the street would flicker.
    """
    allowed = []
    picture: ProjectedFrame | None = None
    for index in frames[:: max(1, len(frames) // _GAIN_FRAMES)][:_GAIN_FRAMES]:
        picture = project_frame(scene, index, picture)
        wanted = np.zeros_like(picture.is_ground)
        wanted[1::_GAIN_STEP, 1::_GAIN_STEP] = picture.is_ground[1::_GAIN_STEP, 1::_GAIN_STEP]
        if not wanted.any():
            continue
        gloss = []
        for frame in (project_frame(scene, index, picture, 0.0), picture):
            gloss.append(_separated(frame, scene, normals, replace(settings, samples=_GAIN_SAMPLES), wanted).specular[wanted])
        light = picture.image[wanted].mean(axis=-1) - gloss[0].mean(axis=-1)
        added = (gloss[1] - gloss[0]).mean(axis=-1)
        told = added > 1e-4
        allowed.append(np.clip(light[told] / added[told], 0, None))
    return float(np.clip(np.quantile(np.concatenate(allowed), 0.05), 0.02, 1.0)) if allowed and sum(map(len, allowed)) else 1.0


def _separated(
    frame: ProjectedFrame,
    scene: Scene,
    normals: NDArray[np.float32],
    settings: AugmentSettings,
    wanted: NDArray[np.bool_] | None = None,
) -> Separation:
    return separate(
        frame,
        scene.grid,
        normals,
        settings.relief,
        settings.eta,
        settings.porosity,
        settings.darkening,
        settings.strength,
        settings.samples,
        settings.seed,
        settings.bounces,
        wanted,
    )


def separate_frame(frame: ProjectedFrame, scene: Scene, normals: NDArray[np.float32], settings: AugmentSettings) -> Separation:
    """Take the dry ground of a frame apart, with as many samples as the settings ask for."""

    first = settings if settings.noise <= 0 else replace(settings, samples=-(-settings.samples // SPLIT) * SPLIT)
    separation = _separated(frame, scene, normals, first)
    if settings.noise <= 0:
        return separation
    while separation.samples < settings.max_samples:
        error = _standard_error(frame, separation.variance, separation.share)
        if error <= settings.noise:
            break
        # The error falls with the root of the samples; ask for what that predicts, but at most four times as many.
        factor = min(max((error / settings.noise) ** 2, 1.25), 4.0)
        samples = int(np.ceil(separation.samples * factor / SPLIT)) * SPLIT
        separation = refine(frame, separation, min(samples, settings.max_samples))
    return separation


def _standard_error(frame: ProjectedFrame, variance: NDArray[np.float32], share: NDArray[np.float32]) -> float:
    """Return the median standard error over what has a share, the ground, in 8-bit levels of the picture."""
    ground = share > 0.5
    if not ground.any():
        return 0.0
    sigma = np.sqrt(variance[ground].mean(axis=-1))
    if frame.encoding.response == "srgb":
        # Slope of the sRGB curve at the pixel's value: d(8-bit) = 255 * d(encoded)/d(linear) * sigma.
        value = np.clip(frame.image[ground].mean(axis=-1), 0.0031308, 1)
        sigma = sigma * (1.055 / 2.4) * value ** (1 / 2.4 - 1)
    return float(np.median(255 * sigma))


def _write_frame(folder: Path, result: FrameResult, settings: AugmentSettings) -> None:
    frame = result.frame
    name = frame.frame.name
    picture = folder / "image" / picture_name(frame.frame, settings.format)
    if settings.format == "exr":
        write_raw(picture, result.image)
    elif np.array_equal(result.raw, frame.raw):
        _copy(frame.frame.image, picture)  # encoding a JPEG again would change what the rain did not
    else:
        write_raw(picture, result.raw)
    if settings.layers:
        write_exr(folder / "layers" / f"{name}.exr", layers(result))
    if settings.labels:
        for label, values in labels(result).items():
            write_raw(folder / "label" / label / f"{name}.png", values)


def picture_name(frame: Frame, format: str) -> str:
    """Return the file name of a frame's wet picture."""
    return f"{frame.name}.exr" if format == "exr" else f"{frame.name}{frame.image.suffix.lower()}"


def _pass_truth(frame: ProjectedFrame, folder: Path, format: str) -> Frame:
    """Copy the measurements that rain does not change, byte by byte; return the wet frame with them."""
    given, folder = frame.frame, folder.resolve()

    def passed(file: Path, kind: str) -> Path:
        target = folder / "truth" / kind / f"{given.name}{file.suffix}"
        _copy(file, target)
        return target

    return replace(
        given,
        image=folder / "image" / picture_name(given, format),
        response="linear" if format == "exr" else frame.encoding.response,
        points=None,  # rain weakens a scanner's returns
        stereo=None,  # the second camera's picture is dry
        masks=given.masks and replace(given.masks, file=passed(given.masks.file, "mask")),
        disparity=given.disparity and replace(given.disparity, file=passed(given.disparity.file, "disparity")),
        segmentation=given.segmentation and passed(given.segmentation, "segmentation"),
        flow=given.flow and passed(given.flow, "flow"),
        depth=given.depth and replace(given.depth, file=passed(given.depth.file, "depth")),
        boxes=given.boxes and replace(given.boxes, file=passed(given.boxes.file, "boxes")),
    )


def _copy(source: Path, target: Path) -> None:
    with replacing(target) as temporary:
        shutil.copyfile(source, temporary)


def _figures(result: FrameResult, w: float) -> dict[str, Any]:
    frame, separation, wet = result.frame, result.separation, result.wet
    ground = separation.share > 0
    wetness = wet.wet.wetness[ground] / separation.share[ground][:, None] if ground.any() else np.zeros((1, 2))
    figures = {
        "frame": frame.frame.name,
        "wetness": w,
        "samples": separation.samples,
        "ground_share": float(ground.mean()),
        "clamped_share": separation.clamped_share,
        "mean_saturation": float(wetness[:, 0].mean()),
        "mean_accumulation": float(wetness[:, 1].mean()),
        "standard_error_levels": _standard_error(frame, wet.wet.variance, separation.share),
    }
    if result.mist is not None:
        everywhere = np.ones_like(separation.share)
        figures["mean_transmittance"] = float(result.mist.transmittance.mean())
        figures["standard_error_levels_mist"] = _standard_error(frame, result.mist.variance, everywhere)
    if result.droplets is not None:
        figures["mean_droplet_cover"] = float(result.droplets.covered.mean())
    return figures


def _record(scene: Scene, w: float, settings: AugmentSettings, frames: list[dict[str, Any]]) -> dict[str, Any]:
    packages = ("meniscus", "numpy", "numba", "embreex", "scipy", "opencv-contrib-python-headless", "OpenEXR")
    return {
        "format": "augmented/1",
        "scene": scene.name,
        "wetness": w,
        "mist": settings.mist,
        "wheel_spray": settings.wheel_spray,
        "droplets": settings.droplets,
        "settings": as_dict(settings),
        "frames": frames,
        "versions": {name: _version(name) for name in packages},
    }


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def folder_name(w: float, settings: AugmentSettings) -> str:
    """Name the folder of a wetness so that names sort as numbers do: `w0.33`, with all `w0.33_m0.50_s1.00_d0.20`."""
    amounts = (("m", settings.mist), ("s", settings.wheel_spray), ("d", settings.droplets))
    more = "".join(f"_{key}{value:.2f}" for key, value in amounts if value > 0)
    return f"w{w:.2f}{more}"


def summarise(report: list[dict[str, Any]]) -> None:
    """Log the figures that tell whether to trust the result."""
    for row in report:
        logger.info(
            "%s at w = %.2f: %.1f %% of the ground clamped, standard error %.2f levels",
            row["frame"],
            row["wetness"],
            100 * row["clamped_share"],
            row["standard_error_levels"],
        )
