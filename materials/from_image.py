"""Roughness and relief of the ground guessed from one photograph (thesis, 6.4.2, eqs. 6.7 to 6.9).

Bright detail is taken for smooth and high, dark detail for rough and low. These are plausible variations about reference
values, no measurement. All maps live in the picture's pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from .foundation.checks import check_finite, check_range, check_shape
from .foundation.errors import InputError
from .relief_settings import ImageRelief

Floats = NDArray[np.floating]
Mask = NDArray[np.bool_]

LUMINANCE = (0.2126, 0.7152, 0.0722)  # Rec. 709


def roughness_map(image: Floats, mask: Mask, settings: ImageRelief = ImageRelief()) -> Floats:
    """Return the perceptual roughness of the ground in every pixel (eqs. 6.7 and 6.8).

    Parameters
    ----------
    image : (H, W) or (H, W, 3) float
        Linear intensities (`model="thesis"`: any).
    mask : (H, W) bool
        Ground pixels; nothing else enters the filters.
    settings : ImageRelief

    Returns
    -------
    roughness : (H, W) float32
        From `roughness_min` to `roughness_max` on the ground; the mean of both elsewhere.

    Raises
    ------
    InputError
        If shapes differ, intensities are not finite, or a setting is out of range.
    """
    _check_settings(settings)
    detail = _detail(image, mask, settings.roughness_fine_px, settings.roughness_coarse_px, settings)
    bright = _normalised(detail, mask, settings)
    low, high = settings.roughness_min, settings.roughness_max
    return (high + (low - high) * bright).astype(np.float32)  # coarse - fine: bright detail is smooth


def height_variation(image: Floats, mask: Mask, settings: ImageRelief = ImageRelief()) -> Floats:
    """Return the relief of the ground in every pixel (eq. 6.9), in metres, 0 to `bump_height`.

    Parameters and errors as `roughness_map`; half of `bump_height` off the ground.
    """
    _check_settings(settings)
    detail = _detail(image, mask, settings.height_fine_px, settings.height_coarse_px, settings)
    return (settings.bump_height * _normalised(detail, mask, settings)).astype(np.float32)


def bump_normals(
    height: Floats, positions_world: Floats, normals_world: Floats, mask: Mask, settings: ImageRelief = ImageRelief()
) -> Floats:
    """Return shading normals of the ground with a relief on it.

    The slope is metres of height over metres of ground: differences between neighbouring pixels are set against the
    true distance of what they see, in the tangent plane. So relief fades with distance as it should (3 mm over a
    footprint of 10 cm is 1.7 degrees), without a term for it.

    Parameters
    ----------
    height : (H, W) float
        Relief along the normal [m], from `height_variation`.
    positions_world : (H, W, 3) float
        What each pixel sees [m]; read on the ground only.
    normals_world : (H, W, 3) float
        Unit normals of the smooth ground; read on the ground only.
    mask : (H, W) bool
        Ground pixels.
    settings : ImageRelief
        `max_slope` is used.

    Returns
    -------
    normals : (H, W, 3) float32
        Unit length; the given normals off the ground and where the slope is undefined.

    Raises
    ------
    InputError
        If shapes differ or values on the ground are not finite.

    Notes
    -----
    A neighbour counts only if it is ground, lies within 45 degrees of the tangent plane and not more than four times as
    far as the neighbour across, so that no slope reaches over the edge of a kerb or an occluder. With two neighbours
    along an axis their difference is taken, with one that to the centre, with none the axis is left flat. The gradient
    from two skew tangents is Mikkelsen's (2010, Bump mapping unparametrized surfaces on the GPU).
    """
    check_shape("height", height, mask.shape)
    check_shape("positions_world", positions_world, (*mask.shape, 3))
    check_shape("normals_world", normals_world, (*mask.shape, 3))
    check_finite("height", height[mask])
    check_finite("positions_world", positions_world[mask])
    check_finite("normals_world", normals_world[mask])
    check_range("max_slope", settings.max_slope, "(0, inf)")
    points = np.where(mask[..., None], positions_world, 0).astype(np.float64)
    n = np.where(mask[..., None], normals_world, (0.0, 0.0, 1.0)).astype(np.float64)
    h = np.where(mask, height, 0).astype(np.float64)
    step_u, rise_u = _step(points, h, n, mask, axis=1)
    step_v, rise_v = _step(points, h, n, mask, axis=0)
    # an axis without neighbours is flat: any tangent across the other will do
    step_u = np.where(_is_null(step_u)[..., None], np.cross(step_v, n), step_u)
    step_v = np.where(_is_null(step_v)[..., None], np.cross(n, step_u), step_v)
    area = np.einsum("...i,...i", n, np.cross(step_u, step_v))
    size = np.linalg.norm(step_u, axis=-1) * np.linalg.norm(step_v, axis=-1)
    is_defined = np.abs(area) > 0.05 * size  # tangents within 3 degrees of each other define no plane
    slope = rise_u[..., None] * np.cross(step_v, n) + rise_v[..., None] * np.cross(n, step_u)
    slope = np.where(is_defined[..., None], slope / np.where(is_defined, area, 1)[..., None], 0)
    steepness = np.linalg.norm(slope, axis=-1, keepdims=True)
    slope *= np.minimum(1, settings.max_slope / np.maximum(steepness, 1e-12))
    bumped = n - slope
    bumped /= np.linalg.norm(bumped, axis=-1, keepdims=True)
    return np.where(mask[..., None], bumped, normals_world).astype(np.float32)


def masked_gaussian(values: Floats, mask: Mask, sigma_px: float) -> Floats:
    """Return the Gaussian mean of the masked pixels around each pixel (normalised convolution); 0 where there are none.

    Parameters
    ----------
    values : (H, W) float
    mask : (H, W) bool
    sigma_px : float
        Standard deviation [px]; the kernel is cut at four of them.
    """
    weight = gaussian_filter(mask.astype(np.float64), sigma_px, mode="constant")
    total = gaussian_filter(np.where(mask, values, 0).astype(np.float64), sigma_px, mode="constant")
    return np.where(weight > 1e-9, total / np.maximum(weight, 1e-9), 0)


def _detail(image: Floats, mask: Mask, fine_px: float, coarse_px: float, settings: ImageRelief) -> Floats:
    """Return fine minus coarse masked Gaussian, relative to the coarse one unless as in the thesis."""
    check_shape("mask", mask, image.shape[:2])
    if mask.dtype != np.bool_:
        raise InputError("be boolean", got=mask.dtype, key="mask")
    if image.ndim == 3:
        check_shape("image", image, (*mask.shape, 3))
        image = image @ np.asarray(LUMINANCE)
    check_finite("image", image[mask])
    fine, coarse = masked_gaussian(image, mask, fine_px), masked_gaussian(image, mask, coarse_px)
    if settings.model == "thesis":
        return fine - coarse
    # black pixels have no contrast: a floor of a thousandth of the mean keeps them from becoming noise
    floor = 1e-3 * float(np.mean(np.abs(image[mask]))) if mask.any() else 1.0
    return (fine - coarse) / np.maximum(coarse, max(floor, 1e-12))


def _normalised(detail: Floats, mask: Mask, settings: ImageRelief) -> Floats:
    """Map the detail on the ground to [0, 1]; 0.5 off the ground and if there is no detail.

    No detail is 0.5 (not so in the thesis's form): what else is in the picture must not shift the level of a plain road
    from one frame to the next.
    """
    out = np.full(detail.shape, 0.5)
    if not mask.any():
        return out
    ground = detail[mask]
    if settings.model == "thesis":
        low, high = float(ground.min()), float(ground.max())
    else:
        high = float(np.percentile(np.abs(ground), 100 - settings.percentile))
        low = -high
    if high - low > 1e-12:
        out[mask] = np.clip((ground - low) / (high - low), 0, 1)
    return out


def _step(points: Floats, height: Floats, n: Floats, mask: Mask, axis: int) -> tuple[Floats, Floats]:
    """Return the way along the ground between the neighbours of each pixel on one axis, and the rise of height."""
    ahead, rise_ahead, has_ahead = _neighbour(points, height, n, mask, axis, -1)
    back, rise_back, has_back = _neighbour(points, height, n, mask, axis, 1)
    length_ahead, length_back = np.linalg.norm(ahead, axis=-1), np.linalg.norm(back, axis=-1)
    use_ahead = has_ahead & ~(has_back & (length_ahead > 4 * length_back))
    use_back = has_back & ~(has_ahead & (length_back > 4 * length_ahead))
    step = np.where(use_ahead[..., None], ahead, 0) - np.where(use_back[..., None], back, 0)
    return step, np.where(use_ahead, rise_ahead, 0) - np.where(use_back, rise_back, 0)


def _neighbour(points: Floats, height: Floats, n: Floats, mask: Mask, axis: int, shift: int) -> tuple[Floats, Floats, Mask]:
    """Return tangential way and rise to the neighbour, and whether it is ground on the same sheet."""
    there = np.roll(points, shift, axis) - points
    out_of_plane = np.einsum("...i,...i", there, n)
    tangential = there - out_of_plane[..., None] * n
    exists = np.roll(mask, shift, axis) & mask
    border = (slice(None),) * axis + (slice(-1, None) if shift < 0 else slice(0, 1),)
    exists[border] = False  # np.roll wraps round
    length = np.linalg.norm(tangential, axis=-1)
    exists &= (np.abs(out_of_plane) <= length) & (length > 0)
    return tangential, np.roll(height, shift, axis) - height, exists


def _is_null(step: Floats) -> Mask:
    return np.all(step == 0, axis=-1)


def _check_settings(settings: ImageRelief) -> None:
    for name in ("roughness_fine_px", "roughness_coarse_px", "height_fine_px", "height_coarse_px"):
        check_range(name, getattr(settings, name), "(0, inf)")
    for name in ("roughness_min", "roughness_max"):
        check_range(name, getattr(settings, name), "[0, 1]")
    check_range("bump_height", settings.bump_height, "[0, inf)")
    check_range("percentile", settings.percentile, "[0, 100)")
    if settings.model not in ("contrast", "thesis"):
        raise InputError("be one of contrast, thesis", got=repr(settings.model), key="model")
