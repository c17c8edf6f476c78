"""Files of true depth: 16-bit PNG (KITTI's, metres times 256), EXR, and `.npy`."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from .images import read_exr, read_raw

SUFFIXES = (".png", ".exr", ".npy")
_CHANNELS = ("depth.Z", "Z", "Y", "R")


def read_depth(path: str | Path, scale: float = 1.0) -> NDArray[np.float32]:
    """Read depth along the camera's z.

    Parameters
    ----------
    path : path
        `.png` (grey, integers), `.exr` (the first of the channels depth.Z, Z, Y, R), `.npy` (H, W).
    scale : float
        depth = stored / scale; KITTI's PNG has 256.

    Returns
    -------
    depth : (H, W) float32
        NaN where the file has none (0, a negative number or NaN); infinite stays infinite, beyond all surfaces.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind, or not of shape (height, width).
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".png":
        stored = read_raw(path)
    elif suffix == ".exr":
        channels = read_exr(path)
        name = next((name for name in _CHANNELS if name in channels), None)
        if name is None:
            raise InputError(f"have one of the channels {', '.join(_CHANNELS)}", got=", ".join(channels), file=path)
        stored = channels[name]
    elif suffix == ".npy":
        stored = _npy(path)
    else:
        raise InputError(f"be one of {', '.join(SUFFIXES)}", got=path.suffix or "no suffix", file=path)
    if stored.ndim != 2 or stored.dtype.kind not in "fiu":
        raise InputError("hold one number a pixel", got=f"{stored.shape} of {stored.dtype}", file=path, key="the depth")
    depth = stored.astype(np.float32) / np.float32(scale)
    return np.where(depth > 0, depth, np.float32(np.nan))


def _npy(path: Path) -> NDArray:
    try:
        return np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except (ValueError, OSError, EOFError) as error:
        raise InputError("be a whole .npy file", got=error, file=path, remedy="Copy it again.") from error
