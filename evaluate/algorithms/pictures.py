"""Pictures as flow algorithms want them: a pair in grey or 8 bits, on one scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_finite
from materials.foundation.errors import InputError
from scene.images import Encoding, encode

# ITU-R BT.601, which OpenCV and the benchmarks use for grey; on encoded values.
_LUMA = (0.299, 0.587, 0.114)
_SRGB = Encoding(".exr", "float64", 3, "srgb")


def encoded_pair(image0: NDArray, image1: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both pictures (H, W, 3) on the scale of 8 bits, 0 to 255.

    Integers are taken as they are (16 bits are divided by 257). Floats are linear light: the 99th percentile of both
    becomes white and the sRGB curve is applied, without clipping, so that what is brighter than white stays so.

    Raises
    ------
    InputError
        If sizes differ, a picture has fewer than 16 pixels a side, or holds what is no light.
    """
    if image0.shape[:2] != image1.shape[:2] or image0.ndim not in (2, 3) or image1.ndim not in (2, 3):
        raise InputError("have one size", got=f"{image0.shape} and {image1.shape}", key="the two pictures")
    if min(image0.shape[:2]) < 16:
        raise InputError("be at least 16 pixels high and wide", got=image0.shape[:2], key="the pictures")
    if image0.dtype != image1.dtype:
        raise InputError("have one kind of numbers", got=f"{image0.dtype} and {image1.dtype}", key="the two pictures")
    pair = [_three(image) for image in (image0, image1)]
    if image0.dtype == np.uint8:
        return pair[0], pair[1]
    if image0.dtype == np.uint16:
        return pair[0] / 257, pair[1] / 257
    if image0.dtype.kind != "f":
        raise InputError("be 8- or 16-bit integers or floats", got=image0.dtype, key="the pictures")
    for image in pair:
        check_finite("the pictures", image)
    white = float(np.percentile(np.concatenate([image.max(axis=-1).ravel() for image in pair]), 99))
    if not white > 0:
        raise InputError("hold light", got="a pair that is black", key="the pictures")
    one, two = (255 * encode(np.maximum(image, 0) / white, _SRGB) for image in pair)
    return one, two


def grey_pair(image0: NDArray, image1: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both pictures (H, W) in grey, on the scale of `encoded_pair`."""
    one, two = encoded_pair(image0, image1)
    return one @ _LUMA, two @ _LUMA


def bytes_pair(image0: NDArray, image1: NDArray) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return both pictures (H, W, 3) in 8 bits: what is brighter than white is clipped."""
    if image0.dtype == np.uint8 and image1.dtype == np.uint8:
        encoded_pair(image0, image1)  # for its checks
        return _three(image0).astype(np.uint8), _three(image1).astype(np.uint8)
    one, two = (np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in encoded_pair(image0, image1))
    return one, two


def _three(image: NDArray) -> NDArray[np.float64]:
    if image.ndim == 2:
        image = np.repeat(image[..., None], 3, axis=2)
    if image.shape[2] != 3:
        raise InputError("have one or three channels", got=image.shape, key="the pictures")
    return image.astype(np.float64)
