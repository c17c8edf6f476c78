"""Pictures of nothing in particular, and what a camera may do to them, for the diagnosis of given pictures."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.images import write_exr

READ, SHOT = 0.002, 0.0003
Pictures = NDArray[np.float32]


def collage(frames: int = 4, height: int = 72, width: int = 96, seed: int = 3) -> Pictures:
    """Return rectangles of colour, drawn over one another (frames, height, width, 3)."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(frames):
        p = np.ones((height, width, 3), np.float32) * rng.uniform(0.15, 0.35, 3).astype(np.float32)
        for _ in range(30):
            x, y = rng.integers(0, [width, height])
            w, h = rng.integers(5, 25, 2)
            p[y : y + h, x : x + w] = rng.uniform(0.03, 0.9, 3)
        out.append(cv2.GaussianBlur(p, (0, 0), 0.7))
    return np.stack(out).astype(np.float32)


def noisy(p: Pictures, seed: int = 4) -> Pictures:
    rng = np.random.default_rng(seed)
    return (p + np.sqrt(READ**2 + SHOT * np.maximum(p, 0)) * rng.standard_normal(p.shape)).astype(np.float32)


def vignetted(p: Pictures, power: float = 1.0) -> Pictures:
    height, width = p.shape[1:3]
    y, x = np.mgrid[:height, :width] + 0.5
    r2 = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / width**2
    return (p * (1 + r2[..., None]) ** -power).astype(np.float32)


def shifted(p: Pictures, x: float = 0.6, y: float = -0.4) -> Pictures:
    M = np.array([[1, 0, x], [0, 1, y]], np.float32)
    size = (p.shape[2], p.shape[1])
    out = [cv2.warpAffine(q, M, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE) for q in p]
    return np.stack(out).astype(np.float32)


def veiled(p: Pictures, strength: float = 0.05) -> Pictures:
    return np.stack([q + strength * (cv2.GaussianBlur(q, (0, 0), 9) - q) for q in p]).astype(np.float32)


def softened(p: Pictures) -> Pictures:
    return np.stack([cv2.GaussianBlur(q, (0, 0), 0.6) for q in p]).astype(np.float32)


def red_spread(p: Pictures, scale: float = 1.01) -> Pictures:
    height, width = p.shape[1:3]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    at = (x + 0.5 - width / 2) / scale + width / 2 - 0.5, (y + 0.5 - height / 2) / scale + height / 2 - 0.5
    out = p.copy()
    for f in range(len(p)):
        out[f, ..., 0] = cv2.remap(np.ascontiguousarray(p[f, ..., 0]), *at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return out


def written(folder: Path, pictures: Pictures, names: list[str] | None = None) -> Path:
    """Write pictures as EXR; return their folder."""
    for i, p in enumerate(pictures):
        name = f"{i:03d}" if names is None else names[i]
        write_exr(folder / f"{name}.exr", dict(zip("RGB", np.moveaxis(p.astype(np.float32), -1, 0), strict=True)))
    return folder
