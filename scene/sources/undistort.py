"""Pictures of a lens that bends straight lines, as a pinhole would have taken them.

The tracer's rays and the projection of a picture onto meshes are a pinhole's, so a scene keeps undistorted pictures
(Brown-Conrady with `k1 k2 p1 p2`, as OpenCV defines it).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from ..camera import Camera
from ..images import read_ids, read_image, write_image, write_raw

_LARGEST_ZOOM = 4.0


def is_distorted(camera: Camera) -> bool:
    """Say whether the lens bends lines at all: coefficients of zero are a pinhole by another name."""
    return camera.model == "OPENCV" and any((camera.k1, camera.k2, camera.p1, camera.p2))


def pinhole_of(camera: Camera) -> Camera:
    """Return the pinhole camera of the same place and picture size whose every pixel the distorted picture shows.

    The focal length stays where that is enough (a barrel loses its rim); a pincushion is zoomed until no corner is empty,
    since a black corner would be taken for a black street.

    Raises
    ------
    InputError
        If even a fourfold zoom leaves pixels without a value: the coefficients cannot be those of this picture.
    """
    pinhole = replace(camera, model="PINHOLE", k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    zoom = 1.0
    while zoom <= _LARGEST_ZOOM:
        target = replace(pinhole, fx=camera.fx * zoom, fy=camera.fy * zoom)
        xy = _border(target)
        with np.errstate(invalid="ignore"):
            source = _where(xy, target, camera)
            if np.all((source >= 0) & (source <= (camera.width, camera.height))):
                return target
        zoom *= 1.005
    got = ", ".join(f"{name} {getattr(camera, name):g}" for name in ("k1", "k2", "p1", "p2"))
    raise InputError("be the distortion of a lens", got=got, key="the camera", remedy="Calibrate again, or undistort the images.")


def undistort_image(source: Path, target: Path, camera: Camera, pinhole: Camera, response: str | None) -> None:
    """Write a picture as the pinhole sees it: same encoding, resampled bilinearly in linear light."""
    linear, encoding = read_image(source, response)
    write_image(target, _resampled(linear, camera, pinhole, cv2.INTER_LINEAR), encoding)


def undistort_ids(source: Path, target: Path, camera: Camera, pinhole: Camera) -> None:
    """Write a map of ids as the pinhole sees it: each pixel takes the nearest id."""
    write_raw(target, _resampled(read_ids(source), camera, pinhole, cv2.INTER_NEAREST))


def _resampled(image: NDArray, camera: Camera, pinhole: Camera, how: int) -> NDArray:
    xy = _where(pinhole.pixel_centres(), pinhole, camera)
    # OpenCV counts positions from the first pixel's centre, we from its corner.
    x, y = (xy - 0.5).astype(np.float32).T.reshape(2, camera.height, camera.width)
    return cv2.remap(image, x, y, how, borderMode=cv2.BORDER_REPLICATE)


def _where(xy: NDArray[np.float64], pinhole: Camera, camera: Camera) -> NDArray[np.float64]:
    """Return where the distorted picture shows what the pinhole sees at positions (N, 2); NaN where it does not."""
    origins, directions = pinhole.rays(xy)
    return camera.project(origins + directions)[0]


def _border(camera: Camera) -> NDArray[np.float64]:
    centres = camera.pixel_centres().reshape(camera.height, camera.width, 2)
    return np.concatenate([centres[0], centres[-1], centres[:, 0], centres[:, -1]])
