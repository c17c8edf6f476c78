"""A sheet of pictures to look at: rows of variants, columns of frames, with captions."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.images import write_raw

_BAR = 22


def contact_sheet(rows: list[tuple[str, list[NDArray[np.uint8]]]], path: str | Path, width: int = 640) -> None:
    """Write rows of 8-bit RGB pictures as one PNG or JPEG; each row has a caption above it.

    Parameters
    ----------
    rows : list of (caption, pictures)
        Pictures of a row are scaled to `width` pixels each and set side by side.
    """
    strips = []
    for caption, pictures in rows:
        scaled = [_scaled(picture, width) for picture in pictures]
        strip = np.concatenate(scaled, axis=1)
        bar = np.full((_BAR, strip.shape[1], 3), 255, np.uint8)
        cv2.putText(bar, caption, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
        strips += [bar, strip]
    widest = max(s.shape[1] for s in strips)
    padded = [np.pad(s, ((0, 0), (0, widest - s.shape[1]), (0, 0)), constant_values=255) for s in strips]
    write_raw(path, np.concatenate(padded))


def _scaled(picture: NDArray, width: int) -> NDArray[np.uint8]:
    picture = np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
    picture = (picture >> 8).astype(np.uint8) if picture.dtype == np.uint16 else picture
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
