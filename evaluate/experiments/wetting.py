"""Ways to wet a recorded picture, from the augmentation down to what is simple, all with the same water.

Each takes a frame, its separation into diffuse and specular light, and the augmentation's wet frame, and returns the numbers
of a wet picture in the encoding of the input.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scene.images import encode
from transport.projected_world import ProjectedFrame
from transport.separate import Separation
from transport.wet import WetFrame


def augmented(frame: ProjectedFrame, separation: Separation, wet: WetFrame) -> NDArray:
    """Return the augmentation itself."""
    return wet.raw


def darkened(frame: ProjectedFrame, separation: Separation, wet: WetFrame) -> NDArray:
    """Return the frame with the same water, darkened only."""
    image = frame.image * (1 + np.where(separation.wanted[..., None], wet.wet.dimming, 0))
    return encode(image, frame.encoding)


def planar_mirror(frame: ProjectedFrame, separation: Separation, wet: WetFrame) -> NDArray:
    """Return the darkened frame with the picture mirrored about the horizon, weighted by Fresnel and accumulation."""
    camera = frame.camera
    up = camera.T_camera_world[:3, :3] @ (0, 0, 1)
    xy = camera.pixel_centres()
    rays = np.column_stack([(xy - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(xy))])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    cos = -(rays @ up)
    mirrored = rays + 2 * cos[:, None] * up
    with np.errstate(divide="ignore", invalid="ignore"):
        x = mirrored[:, 0] / mirrored[:, 2] * camera.fx + camera.cx
        y = mirrored[:, 1] / mirrored[:, 2] * camera.fy + camera.cy
    inside = (mirrored[:, 2] > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    size = frame.image.shape
    col, row = (np.where(inside, v, 0).astype(int) for v in (x, y))
    reflected = np.where(inside[:, None], frame.image[row, col], 0).reshape(size)
    r0 = ((1.33 - 1) / (1.33 + 1)) ** 2
    fresnel = (r0 + (1 - r0) * (1 - np.clip(cos, 0, 1)) ** 5).reshape(size[:2])
    weight = np.where(separation.wanted, wet.wet.wetness[..., 1] * fresnel, 0)[..., None]
    image = frame.image * (1 + np.where(separation.wanted[..., None], wet.wet.dimming, 0)) + weight * reflected
    return encode(image, frame.encoding)


METHODS = {"augmented": augmented, "darkened": darkened, "planar mirror": planar_mirror}
