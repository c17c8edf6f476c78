"""Flow fields as colours: hue is direction, saturation is length; with a legend that says which and how much."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from scene.flow_files import Flow

CODINGS = ("middlebury", "hsv")
# Steps of the Middlebury wheel from each pure colour to the next: red, yellow, green, cyan, blue, magenta (Baker et al. 2011).
_STEPS = (15, 6, 4, 11, 13, 6)
_CORNERS = ((255, 0, 0), (255, 255, 0), (0, 255, 0), (0, 255, 255), (0, 0, 255), (255, 0, 255))


def colour(flow: Flow, largest: float | None = None, coding: str = "middlebury") -> NDArray[np.uint8]:
    """Return a flow field as an RGB picture.

    Parameters
    ----------
    flow : Flow
    largest : float, optional
        Length at which colours are saturated [px]; longer vectors are darkened (Middlebury) or stay saturated (HSV). By
        default the 99th percentile of the field, so that a few outliers do not pale all else.
    coding : {"middlebury", "hsv"}
        The wheel of the Middlebury benchmark, or the hue of HSV at full value.

    Returns
    -------
    picture : (H, W, 3) uint8
        White is no motion, black is unknown.

    Raises
    ------
    InputError
        If `largest` is not positive or the coding unknown.
    """
    largest = scale_of(flow) if largest is None else largest
    check_range("largest", largest, "(0, inf)")
    u, v = (np.where(flow.valid, flow.flow[..., i], 0).astype(np.float64) / largest for i in range(2))
    return np.where(flow.valid[..., None], _coded(u, v, coding), 0).astype(np.uint8)


def scale_of(*flows: Flow) -> float:
    """Return a length that suits one or more fields: the 99th percentile of theirs, at least 1e-6 px."""
    lengths = [np.hypot(f.flow[..., 0], f.flow[..., 1])[f.valid] for f in flows if f.valid.any()]
    return max(float(np.percentile(np.concatenate(lengths), 99)), 1e-6) if lengths else 1.0


def legend(largest: float, coding: str = "middlebury", size: int = 96) -> NDArray[np.uint8]:
    """Return a disc of all colours with the length at its rim in words: (size + 18, size, 3) uint8.

    Raises
    ------
    InputError
        As `colour`.
    """
    check_range("largest", largest, "(0, inf)")
    at = (np.arange(size) + 0.5) / size * 2 - 1
    u, v = np.meshgrid(at, at)
    inside = np.hypot(u, v) <= 1
    disc = np.where(inside[..., None], _coded(u, v, coding), 255).astype(np.uint8)
    words = np.full((18, size, 3), 255, np.uint8)
    cv2.putText(words, f"rim: {largest:.3g} px", (2, 13), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
    return np.concatenate([disc, words])


def with_legend(flow: Flow, largest: float | None = None, coding: str = "middlebury") -> NDArray[np.uint8]:
    """Return the coloured field with its legend at the right, both on white."""
    largest = scale_of(flow) if largest is None else largest
    picture = colour(flow, largest, coding)
    key = legend(largest, coding)
    height = max(len(picture), len(key))

    def padded(image: NDArray[np.uint8], left: int) -> NDArray[np.uint8]:
        return np.pad(image, ((0, height - len(image)), (left, 0), (0, 0)), constant_values=255)

    return np.concatenate([padded(picture, 0), padded(key, 8)], axis=1)


def _coded(u: NDArray[np.float64], v: NDArray[np.float64], coding: str) -> NDArray[np.float64]:
    if coding not in CODINGS:
        raise InputError(f"be one of {', '.join(CODINGS)}", got=coding, key="coding")
    length = np.hypot(u, v)
    if coding == "hsv":
        hue = (np.degrees(np.arctan2(v, u)) % 360).astype(np.float32)
        saturation = np.minimum(length, 1).astype(np.float32)
        return 255.0 * np.asarray(cv2.cvtColor(np.dstack([hue, saturation, np.ones_like(hue)]), cv2.COLOR_HSV2RGB), np.float64)
    wheel = _wheel()
    # The published code walks the wheel by atan2(-v, -u), from -pi to pi.
    position = (np.arctan2(-v, -u) / np.pi + 1) / 2 * (len(wheel) - 1)
    low = np.floor(position).astype(int)
    share = (position - low)[..., None]
    hue = (1 - share) * wheel[low] + share * wheel[(low + 1) % len(wheel)]
    radius = length[..., None]
    return 255 * np.where(radius <= 1, 1 - radius * (1 - hue), 0.75 * hue)


@cache
def _wheel() -> NDArray[np.float64]:
    """Return the 55 colours of the Middlebury wheel in [0, 1]."""
    corners = np.array(_CORNERS, float)
    parts = []
    for i, steps in enumerate(_STEPS):
        share = np.floor(255 * np.arange(steps) / steps)[:, None] / 255
        parts.append(corners[i] + share * (corners[(i + 1) % 6] - corners[i]))
    return np.concatenate(parts) / 255
