"""A built scene and its drive as a case: every frame predicted from the others, beside what was recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.progress import tracked
from scene.reconstruction.frame_view import raycasting_scene
from scene.recording import Noise
from scene.scene_file import Scene, read_scene

from ..attribute import SearchSettings
from ..case import Floats, estimated_noise, fitted_noise, noise_levels
from ..pictures.case import Given, PictureCase, build
from .look import ENVIRONMENT, GROUND, surroundings_of
from .predict import drive_frame, predict_frame

# Ids of bodies begin here, beside the meshes'.
BODY = 10
# Sides of a body are lit differently, and windows differ from paint: its brightness is known to this share.
_BODY_SHARE = 0.3
_WIDTH = 320
_FEWEST = 3


def drive_settings(most: int = 3) -> SearchSettings:
    """Return how effects of a drive are looked for.

    Bodies and foliage always leave something over, so that a further effect need not explain much of it; but what gains less
    than a hundredth of the noise is not claimed, as most of that noise is what the reconstruction may be wrong by.
    """
    return SearchSettings(most=most, least_share=0.03, least_gain=0.01)


def load_scene(folder: str | Path, factor: int | None = None, pose_error_px: float = 0.2) -> PictureCase:
    """Read a scene, and predict each of its frames.

    Parameters
    ----------
    factor : int, optional
        Pictures are averaged over so many pixels in each direction; by default to at most 320 columns.
    pose_error_px : float
        What poses and calibration displace points by, as a standard deviation in pixels of the recording.

    Raises
    ------
    InputError
        If the folder is no scene, its drive has fewer than three frames or frames of several sizes, or none of them sees what
        another one saw.
    """
    try:
        return drive_case(read_scene(folder), factor, pose_error_px)
    except InputError as error:
        raise error.at(file=Path(folder)) from error


def drive_case(scene: Scene, factor: int | None = None, pose_error_px: float = 0.2) -> PictureCase:
    """Predict each frame of a scene in memory; parameters and refusals are those of `load_scene`."""
    frames = scene.recording.frames
    if len(frames) < _FEWEST:
        raise InputError(f"have at least {_FEWEST} frames: each is predicted from the others", got=len(frames))
    sizes = {(f.camera.width, f.camera.height) for f in frames}
    if len(sizes) > 1:
        raise InputError("have frames of one size", got=", ".join(f"{w} x {h}" for w, h in sorted(sizes)))
    width = next(iter(sizes))[0]
    factor = factor or max(1, -(-width // _WIDTH))
    rays = raycasting_scene([scene.ground, scene.environment])
    drive = [drive_frame(f, rays, factor) for f in tracked(frames, "reading the drive")]
    recorded = np.stack([d.view.linear for d in drive])
    stated = scene.recording.noise
    if stated is None:
        # As it is in pictures that are averaged and divided already.
        noise, exposures = estimated_noise(recorded, np.ones(recorded.shape[:3], bool)), (1.0,) * len(frames)
    else:
        noise, exposures = averaged_noise(stated, factor), tuple(f.exposure for f in frames)
    around, off = surroundings_of(scene), pose_error_px / factor
    numbers = tracked(range(len(drive)), "predicting frames")
    made = [predict_frame(scene, rays, around, drive, t, noise, exposures, off) for t in numbers]
    size = recorded.shape[1:3]
    if not any(p.known.any() for p in made):
        raise InputError("have frames that see the same places", got="none", remedy="Check the poses.")
    stacked = np.stack([p.picture.reshape(*size, 3) for p in made])
    known = np.stack([(p.known & (d.sight.mesh >= 0)).reshape(size) & ~d.clipped for p, d in zip(made, drive, strict=True)])
    if stated is None:
        noise = _lower(noise, recorded, stacked, known)
    bodies = np.stack([d.view.instances for d in drive])
    meshes = np.stack([np.where(d.sight.mesh == ENVIRONMENT, ENVIRONMENT, GROUND).reshape(size) for d in drive])
    extra = np.stack([p.variance.reshape(*size, 3) for p in made])
    extra += (bodies > 0)[..., None] * (_BODY_SHARE * np.maximum(recorded, stacked)) ** 2
    given = Given(
        recorded, stacked, [f.image.name for f in frames],
        depth=np.stack([d.sight.depth.reshape(size) for d in drive]).astype(np.float32),
        labels=np.where(bodies > 0, bodies + BODY, meshes).astype(np.int64),
        measured=known,
        extra=extra.astype(np.float32),
        cameras=tuple(d.view.camera for d in drive),
        label_names={GROUND: "ground", ENVIRONMENT: "environment"}
        | {int(i) + BODY: f"body {int(i)}" for i in np.unique(bodies[bodies > 0])},
        exposures=exposures,
    )  # fmt: skip
    case = build(given, noise, stated is None, _notes(factor, pose_error_px, known), scene.recording.root)
    layers = {}
    for t, (d, p) in enumerate(zip(drive, made, strict=True)):
        others = [x.name for i, x in enumerate(drive) if i != t]
        layers[d.name] = {
            "colour": p.colour, "share": p.share, "radius2": p.radius2, "gloss": p.gloss, "others": others,
            "recorded": d.view.linear, "instances": d.view.instances,
        }  # fmt: skip
    return replace(case, layers=layers)


def averaged_noise(noise: Noise, factor: int) -> Noise:
    """Return the noise of means over `factor` x `factor` pixels, each of which has noise of its own."""
    return Noise(noise.read_sigma / factor, noise.shot_gain / factor**2)


def _lower(noise: Noise, recorded: Floats, predicted: Floats, known: NDArray[np.bool_]) -> Noise:
    """Return the noise by the finest differences of recording and residual, the lower one at each brightness."""
    rows = noise_levels(recorded, recorded, known)
    rest = noise_levels(recorded, recorded - predicted, known)
    if not len(rows):
        return noise
    rows[:, 1] = np.minimum(rows[:, 1], rest[:, 1])
    return fitted_noise(rows)


def _notes(factor: int, pose_error_px: float, known: NDArray[np.bool_]) -> tuple[str, ...]:
    size = "" if factor == 1 else f"Pictures were averaged over {factor} x {factor} pixels. "
    return (
        f"{size}Each frame is predicted from the others through the reconstruction; {known.mean():.0%} of the pixels could be. "
        "A frame that is held out from a fit has still lent its colours to the predictions of others.",
        "Depths that are off by 2 cm along the ground's normal or 4 cm along the environment's, "
        f"poses that are off by {pose_error_px:g} px, what lies between pixels, what the other frames disagree by, and "
        f"{_BODY_SHARE:.0%} of the brightness of bodies that move are part of the noise.",
    )
