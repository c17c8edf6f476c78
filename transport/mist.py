"""Put spray and mist into a frame whose ground is wet (thesis 6.3.4, 6.4.5)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from scene.images import encode

from .kernels.media import MediumArrays
from .kernels.mist import mist_pass
from .projected_world import ProjectedFrame
from .render import variance_of_mean
from .separate import Separation
from .wet import WetFrame
from .world import compile_camera

# So many samples share one estimate of the transmittance, which has little noise and costs some of them.
_EVERY = 16
# Width of the guess of what collisions turn to the camera, in widths of the picture.
_AROUND = 0.01
# What is farther is one surface to the smoothing, the sky among it [m].
_FAR = 1000.0


@dataclass(frozen=True)
class MistyFrame:
    """A frame with wet ground in mist.

    Attributes
    ----------
    image : (H, W, 3) float32
        Linear.
    raw : as the input's file
    transmittance : (H, W) float32
        Share of what the pixel sees that gets to the camera; 1 is clear air.
    scattered : (H, W, 3) float32
        Radiance that the mist before it sends to the camera.
    gloss_change : (H, W, 3) float32
        By how much mist over the road changes the road's specular light, where it leaves the road.
    variance : (H, W, 3) float32
        Of `scattered` before it is smoothed.
    """

    image: NDArray[np.float32]
    raw: NDArray
    transmittance: NDArray[np.float32]
    scattered: NDArray[np.float32]
    gloss_change: NDArray[np.float32]
    variance: NDArray[np.float32]


def misty_frame(
    frame: ProjectedFrame,
    separation: Separation,
    wet: WetFrame,
    water: NDArray[np.float32],
    mist: MediumArrays,
    samples: int,
    seed: int,
    bounces: int,
    smooth: float = 0.0,
) -> MistyFrame:
    """Return a wet frame in mist: `T (L_wet + scale * change of gloss) + scattered`.

    The projected world's radiance is what its surfaces send out in clear air. Mist takes its share of it, on the way to the
    camera and on the way to the mirrors of the road, and turns light of all directions, from picture, other frames
    and sky, towards both.

    Parameters
    ----------
    water : (rows, cols) float32
        The water level that the frame was wetted with.
    mist : MediumArrays
        From `media.compile_spray`.
    samples : int
        Paths per pixel.
    seed, bounces : int
        As for the wet ground.
    smooth : float
        Width [px] over which noise is smoothed, among pixels of about the same distance: what the guess of the scattered light
        leaves over, and the change of gloss, vary little along a surface. 0 leaves every pixel unbiased.
    """
    ground = separation.ground._replace(water=np.ascontiguousarray(water, np.float32))
    size = wet.image.shape[:2]
    scattered, square, gloss, passed = np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros(size)
    view = compile_camera(frame.camera)
    around = gaussian_filter(wet.image, (_AROUND * size[1], _AROUND * size[1], 0), mode="nearest")
    inputs = (frame.world.arrays, frame.picture, separation.diffuse, ground, mist, view, around)
    # The seed of the wet passes would tie the mist's noise to theirs.
    draws = (samples, _EVERY, (seed + 0x9E3779B9) & 0xFFFFFFFF, bounces)
    mist_pass(*inputs, *draws, scattered, square, passed, gloss)
    variance = variance_of_mean(scattered / samples, square / samples, samples)
    residual, change = (_smoothed(x / samples, frame.depth, smooth) for x in (scattered, gloss))
    transmittance = passed / -(-samples // _EVERY)
    # A share 1 - T of the light collides, whatever is then guessed for it: the mean does not depend on the guess.
    mean = around * (1 - transmittance[..., None]) + residual
    light = wet.image + separation.scale * change
    # Nothing may get darker than black where the wet picture is not.
    light = np.where((light < 0) & (wet.image >= 0), 0, light)
    image = (transmittance[..., None] * light + mean).astype(np.float32)
    return MistyFrame(
        image,
        encode(image, frame.encoding),
        transmittance.astype(np.float32),
        mean.astype(np.float32),
        change.astype(np.float32),
        variance.astype(np.float32),
    )


def _smoothed(values: NDArray[np.float64], depth: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Return values (H, W, 3) averaged with a Gaussian of some width [px] over pixels within some 10 % of their depth."""
    if width <= 0:
        return values
    guide = np.log(np.where(np.isfinite(depth), np.minimum(depth, _FAR), _FAR)).astype(np.float32)
    return cv2.ximgproc.jointBilateralFilter(guide, values.astype(np.float32), -1, 0.1, width).astype(np.float64)
