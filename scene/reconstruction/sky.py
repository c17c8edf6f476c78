"""The sky sphere: what the frames see beyond all meshes, and a generic sky for the rest (thesis 6.4 and 6.4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.progress import logger

from ..mesh import Mesh
from ..recording import Recording
from ..scene_file import Cardboard, Sky
from ..wetting.map_filters import fill_holes
from .build_settings import SkySettings
from .frame_view import FrameView, frame_views
from .merge_views import MergedColours
from .projection import frame_gains

_DEFAULTS = SkySettings()
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def generic_sky(
    elevation: NDArray[np.floating] | float, sky_level: NDArray | float = 1.0, full_deg: float = 15.0
) -> NDArray[np.float32]:
    """Return the generic emission of unseen sky: 0 at the horizon and below, rising linearly to `sky_level`.

    Parameters
    ----------
    elevation : (...) float
        Angle above the horizon [rad].
    sky_level : float or (3,) float
        Radiance at and above `full_deg`.
    full_deg : float
        Elevation from which on it is full [deg].

    Returns
    -------
    radiance : (...) or (..., 3) float32
    """
    check_range("full_deg", full_deg, "(0, 90]")
    ramp = np.clip(np.asarray(elevation) / np.deg2rad(full_deg), 0, 1)
    level = np.asarray(sky_level, np.float32)
    return (ramp[..., None] * level if level.ndim else ramp * level).astype(np.float32)


def sky_panorama(
    recording: Recording,
    meshes: Mapping[str, Mesh],
    cardboards: Sequence[Sequence[Cardboard]] = (),
    settings: SkySettings = _DEFAULTS,
    gains: NDArray[np.float64] | None = None,
) -> Sky:
    """Return the radiance from beyond the meshes, merged from all frames.

    Rays that hit no mesh and nothing that moves count, whatever they show: sky, and also what the reconstruction misses
    (hills, upper storeys), taken to be far away. Directions that no frame sees hold the generic sky, whose level with
    `model="measured"` is the median of the pixels that look like sky.

    Parameters
    ----------
    recording, meshes
        Frames, and all static meshes.
    cardboards : sequence of sequences
        Per frame; their masks are left out.
    settings : SkySettings
        Texel, model and margins.
    gains : (F,) float, optional
        Exposures relative to the first frame (`projection.frame_gains`, called if absent); the sky is in the first's.

    Returns
    -------
    sky : Sky
        RGB is usable at every texel; the weight is 1 where a frame saw it, falls to 0 within `fill_deg` of that, and is
        0 where RGB is generic. Clipped pixels make the radiance a lower bound: their share is logged, and `sky_report`
        gives it.
    """
    return sky_report(recording, meshes, cardboards, settings, gains)[0]


def sky_report(
    recording: Recording,
    meshes: Mapping[str, Mesh],
    cardboards: Sequence[Sequence[Cardboard]] = (),
    settings: SkySettings = _DEFAULTS,
    gains: NDArray[np.float64] | None = None,
) -> tuple[Sky, dict[str, float | list[float]]]:
    """As `sky_panorama`, with a report: `seen_share` of the upper half sphere, `sky_level` and `clipped_share`."""
    check_range("texel_deg", settings.texel_deg, "[0.05, 15]")
    if gains is None:
        gains = frame_gains(meshes, recording)
    rows = round(180 / settings.texel_deg)
    elevation, directions = _directions(rows)
    merged = MergedColours(len(directions))
    bright: list[NDArray] = []
    clipped = total = 0
    for t, view in enumerate(frame_views(recording, meshes, "Sky")):
        beyond = (view.mesh_index < 0) & ~view.dynamic
        looks = _looks_like_sky(view, beyond)
        bright.append(view.linear[looks][::16] / gains[t])
        clipped += int((view.linear[looks].max(axis=1) >= 0.995 * view.top).sum())
        total += int(looks.sum())
        index, colour, weight = _seen(view, beyond, directions, settings.texel_deg)
        answer, quality = np.zeros((len(directions), 3), np.float32), np.zeros(len(directions), np.float32)
        answer[index], quality[index] = colour / np.float32(gains[t]), weight
        merged.add(answer, quality)
    colour, weight = merged.result()
    level = _sky_level(bright, settings)
    generic = np.repeat(generic_sky(elevation, level, settings.full_elevation_deg)[:, None], 2 * rows, axis=1)
    shape = rows, 2 * rows
    panorama = _continue(colour.reshape(*shape, 3), np.minimum(weight, 1).reshape(shape), generic, settings)
    upper = np.cos(elevation[: rows // 2])
    report: dict[str, float | list[float]] = {
        "seen_share": float((weight.reshape(shape)[: rows // 2] > 0).mean(axis=1) @ upper / upper.sum()),
        "sky_level": [float(c) for c in level],
        "clipped_share": clipped / total if total else 0.0,
    }
    logger.info("sky: %.0f %% of the pixels are clipped, so its radiance is a lower bound", 100 * float(report["clipped_share"]))  # type: ignore[arg-type]
    return Sky(panorama), report


def _directions(rows: int) -> tuple[NDArray, NDArray]:
    """Return the elevation (rows,) and the direction (rows * 2 rows, 3) of the texels of a panorama."""
    elevation = np.pi / 2 - (np.arange(rows) + 0.5) * np.pi / rows
    azimuth = -np.pi + (np.arange(2 * rows) + 0.5) * np.pi / rows
    e, a = np.meshgrid(elevation, azimuth, indexing="ij")
    return elevation, np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1).reshape(-1, 3)


def _seen(view: FrameView, beyond: NDArray[np.bool_], directions: NDArray, texel_deg: float) -> tuple[NDArray, NDArray, NDArray]:
    """Return the texels that a frame sees, their colour averaged over the texel, and the share of it that is sky."""
    import cv2

    if view.camera.model == "ORTHOGRAPHIC":
        return np.zeros(0, int), np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
    # The sky is at infinity: only the rotation counts.
    far = view.camera.position + 1e6 * directions
    xy, depth = view.camera.project(far)
    with np.errstate(invalid="ignore"):
        inside = (depth > 0) & (xy[:, 0] >= 0) & (xy[:, 1] >= 0) & (xy[:, 0] < view.camera.width) & (xy[:, 1] < view.camera.height)
    if view.camera.model == "OPENCV" and inside.any():
        # Far outside the picture a distortion polynomial may fold back into it.
        back = view.camera.rays(xy[inside])[1]
        inside[inside] = np.sum(back * directions[inside], axis=1) > np.cos(np.deg2rad(0.5))
    index = np.flatnonzero(inside)
    size = max(round(np.deg2rad(texel_deg) * view.camera.fx), 1)
    share = cv2.blur(beyond.astype(np.float32), (size, size))
    colour = cv2.blur(view.linear * beyond[..., None], (size, size))
    pixel = xy[index].astype(int)
    weight = share[pixel[:, 1], pixel[:, 0]]
    keep = weight > 0.5
    return index[keep], colour[pixel[keep, 1], pixel[keep, 0]] / weight[keep, None], weight[keep]


def _looks_like_sky(view: FrameView, beyond: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels beyond all meshes that are sky: smooth, bright, no warmer than white, and above the horizon."""
    import cv2

    luminance = view.linear @ _LUMINANCE
    display = np.sqrt(np.clip(luminance / (view.top if np.isfinite(view.top) else max(luminance.max(), 1e-6)), 0, 1)).astype(
        np.float32
    )
    smooth = cv2.dilate(cv2.absdiff(display, cv2.blur(display, (5, 5))), np.ones((5, 5))) < 0.03
    surfaces = luminance[(view.mesh_index >= 0) & ~view.dynamic]
    floor = max(np.percentile(surfaces, 60) if surfaces.size else 0.0, 1e-3)
    up = view.camera.rays(view.camera.pixel_centres())[1][:, 2].reshape(luminance.shape) > np.sin(np.deg2rad(2))
    return beyond & smooth & up & (luminance > floor) & (view.linear[..., 2] >= 0.95 * view.linear[..., 0])


def _sky_level(bright: list[NDArray], settings: SkySettings) -> NDArray[np.float32]:
    """Return the radiance (3,) of the generic sky."""
    pixels = np.concatenate(bright) if bright else np.zeros((0, 3))
    if settings.model == "thesis" or len(pixels) < 50:
        return np.ones(3, np.float32)
    return np.median(pixels, axis=0).astype(np.float32)


def _continue(colour: NDArray, weight: NDArray, generic: NDArray, settings: SkySettings) -> NDArray[np.float32]:
    """Return RGBA: the seen sky, carried on smoothly into its surroundings, and the generic sky beyond."""
    import cv2

    seen = weight > 0
    if not seen.any():
        return np.dstack([generic, np.zeros(seen.shape)]).astype(np.float32)
    # Across the seam of the azimuth: fill three half-turns wide, keep the middle.
    half = seen.shape[1] // 2
    known = np.concatenate([seen[:, half:], seen, seen[:, :half]], axis=1)
    filled = np.empty_like(colour)
    distance = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)[:, half : half + seen.shape[1]]
    for c in range(3):
        wide = np.concatenate([colour[:, half:, c], colour[..., c], colour[:, :half, c]], axis=1)
        filled[..., c] = fill_holes(wide, known)[:, half : half + seen.shape[1]]
    fade = np.clip(1 - distance * settings.texel_deg / max(settings.fill_deg, 1e-6), 0, 1)
    alpha = np.where(seen, weight, fade**2 * 0.5)
    blend = np.where(seen, 1.0, fade)[..., None]
    return np.dstack([blend * filled + (1 - blend) * generic, alpha]).astype(np.float32)
