"""Places on the sensor, and blurs of what falls on it."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from .case import Case, Floats


def offsets(case: Case) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return x and y (H, W) from the principal point [px], and the focal length [px] (of parallel projection: the width)."""
    camera = case.cameras[0]
    at = np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64)
    x, y = (v.astype(np.float64) for v in np.meshgrid(at[0] + 0.5 - camera.cx, at[1] + 0.5 - camera.cy))
    return x, y, camera.fx if camera.model != "ORTHOGRAPHIC" else float(camera.width)


def radius2(case: Case) -> NDArray[np.float64]:
    """Return the squared distance from the principal point (H, W), in focal lengths."""
    x, y, focal = offsets(case)
    return (x * x + y * y) / focal**2


def resampled(pictures: Floats, x: NDArray, y: NDArray) -> Floats:
    """Return pictures (F, H, W, 3) as seen at pixel indices x, y (H, W); beyond the border the border goes on."""
    x, y = x.astype(np.float32), y.astype(np.float32)
    return np.stack([cubic(p, x, y) for p in pictures])


def cubic(picture: Floats, x: NDArray[np.float32], y: NDArray[np.float32]) -> Floats:
    """Return a picture (H, W, 3) at pixel indices x, y (H, W), never negative; beyond the border the border goes on.

    A cubic swings below zero beside bright outlines. No radiance does, and a response that cuts off what is negative would
    be found where there is none.
    """
    return np.maximum(cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float32(0))


def wide_blur(pictures: Floats, sigma: float) -> Floats:
    """Return pictures (F, H, W, 3) under a Gaussian; beyond the border is taken to be a mirror image of what is within.

    Wide ones are taken on smaller pictures: at a quarter of sigma a pixel nothing is lost.
    """
    step = int(np.clip(sigma / 4, 1, 8))
    # Averages over a step and their interpolation are a blur of their own: variance (step² - 1) / 12 and step² / 6.
    rest = max(sigma**2 - (step**2 - 1) / 12 - (step**2 / 6 if step > 1 else 0), 0.01)
    out = np.empty_like(pictures)
    for f, picture in enumerate(pictures):
        height, width = picture.shape[:2]
        small = cv2.copyMakeBorder(picture, 0, -height % step, 0, -width % step, cv2.BORDER_REFLECT)
        if step > 1:
            small = cv2.resize(small, (small.shape[1] // step, small.shape[0] // step), interpolation=cv2.INTER_AREA)
        small = cv2.GaussianBlur(small, (0, 0), float(np.sqrt(rest)) / step, borderType=cv2.BORDER_REFLECT)
        # The blur of a mirror image is the mirror image of the blur: one pixel of it is all that interpolation asks for.
        small = cv2.copyMakeBorder(small, 1, 1, 1, 1, cv2.BORDER_REFLECT)
        if step > 1:
            small = cv2.resize(small, (small.shape[1] * step, small.shape[0] * step), interpolation=cv2.INTER_LINEAR)
        out[f] = small[step : step + height, step : step + width]
    return out


@lru_cache(maxsize=64)
def disc(radius: float) -> NDArray[np.float32]:
    """Return the kernel of an evenly filled disc [px], its rim by the share of each pixel's area."""
    half, fine = int(np.ceil(radius + 0.5)), 8
    at = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    inside = (at[:, None] ** 2 + at[None] ** 2 <= max(radius, 1e-6) ** 2).astype(np.float64)
    kernel = inside.reshape(2 * half + 1, fine, 2 * half + 1, fine).mean(axis=(1, 3))
    if kernel.sum() == 0:
        kernel[half, half] = 1
    return (kernel / kernel.sum()).astype(np.float32)
