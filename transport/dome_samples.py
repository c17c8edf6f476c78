"""Nine procedural samples for the dome, one for each class of the thesis's materials (5.5), deterministic from a seed.

They are no copies of any measured material: each has the traits that its class is known for, in relief of some tenths of a
millimetre at most and a gloss of its kind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from .dome import Relief

Floats = NDArray[np.float64]
_TEXEL = 2e-4


def dome_sample(name: str, size: int = 64, seed: int = 0) -> Relief:
    """Return one of `SAMPLES`.

    Parameters
    ----------
    name : str
    size : int
        Texels each way, at least 8; 0.2 mm each.
    seed : int

    Raises
    ------
    InputError
        If the name is unknown or the size too small.
    """
    if name not in _MAKERS:
        raise InputError(f"be one of {', '.join(SAMPLES)}", got=name, key="name")
    if size < 8:
        raise InputError("be at least 8", got=size, key="size")
    # Each sample its own numbers, whatever the others draw.
    rng = np.random.default_rng([seed, SAMPLES.index(name)])
    return _MAKERS[name](size, rng)


def _noise(rng: np.random.Generator, size: int, x: float, y: float, power: float = 0.0) -> Floats:
    """Return noise of mean 0 and deviation 1 that repeats: Gaussian of these correlation lengths [texels], or 1/f^power."""
    fx, fy = np.fft.fftfreq(size)[None, :], np.fft.fftfreq(size)[:, None]
    if power > 0:
        f = np.hypot(fx * x, fy * y)
        gain = np.where(f > 0, np.maximum(f, 1e-9) ** (-power / 2), 0)
    else:
        gain = np.exp(-2 * np.pi**2 * ((fx * x) ** 2 + (fy * y) ** 2))
    field = np.real(np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * gain))
    field -= field.mean()
    return field / field.std()


def _tinted(base: tuple[float, float, float], shade: Floats) -> Floats:
    return np.clip(np.asarray(base) * shade[..., None], 0.01, 0.95)


def _relief(name: str, height: Floats, albedo: Floats, scale: float | Floats, alpha: tuple[float, float], **rest) -> Relief:
    shape = height.shape
    widths = np.broadcast_to(np.asarray(alpha, np.float64), (*shape, 2)).copy()
    return Relief(height, _TEXEL, albedo, np.broadcast_to(np.asarray(scale, np.float64), shape).copy(), widths, name=name, **rest)


def _carpet(size: int, rng: np.random.Generator) -> Relief:
    tufts = _noise(rng, size, 2.0, 2.0)
    return _relief("carpet", 1.2e-4 * tufts, _tinted((0.35, 0.10, 0.08), 1 + 0.25 * tufts), 0.1, (0.7, 0.7))


def _copper(size: int, rng: np.random.Generator) -> Relief:
    # Hammered: slopes of some degrees over long distances.
    height = 6e-5 * _noise(rng, size, 6.0, 6.0)
    return _relief(
        "copper", height, _tinted((0.05, 0.03, 0.02), np.ones((size, size))), 20.0, (0.18, 0.18), tint=(0.95, 0.64, 0.54)
    )


def _alu(size: int, rng: np.random.Generator) -> Relief:
    height = 1.5e-5 * _noise(rng, size, 12.0, 1.0) + 3e-5 * _noise(rng, size, 8.0, 8.0)
    return _relief("alu", height, np.full((size, size, 3), 0.04), 21.0, (0.14, 0.3))


def _fabric(size: int, rng: np.random.Generator) -> Relief:
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    threads = max(size // 7, 1)
    warp, weft = np.cos(2 * np.pi * threads * x / size), np.cos(2 * np.pi * threads * y / size)
    over = np.where(np.sin(np.pi * threads * x / size) * np.sin(np.pi * threads * y / size) > 0, warp, weft)
    shade = 1 + 0.1 * over + 0.05 * _noise(rng, size, 1.0, 1.0)
    return _relief("fabric", 4e-5 * over, _tinted((0.12, 0.18, 0.40), shade), 0.8, (0.3, 0.45))


def _felt(size: int, rng: np.random.Generator) -> Relief:
    fibres = _noise(rng, size, 1.0, 3.0) + _noise(rng, size, 3.0, 1.0)
    return _relief("felt", 5e-5 * fibres, _tinted((0.45, 0.42, 0.20), 1 + 0.08 * fibres), 0.05, (0.8, 0.8))


def _leather(size: int, rng: np.random.Generator) -> Relief:
    # Cells about scattered points, with creases between them.
    points = rng.uniform(0, size, (max(size * size // 60, 4), 2))
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    away = [np.hypot(*[(d + size / 2) % size - size / 2 for d in (x - px, y - py)]) for px, py in points]
    nearest = np.sort(np.stack(away), axis=0)[:2]
    height = 6e-5 * np.tanh(0.5 * (nearest[1] - nearest[0]))
    shade = 0.8 + 0.2 * height / height.max() + 0.03 * _noise(rng, size, 1.5, 1.5)
    return _relief("leather", height, _tinted((0.25, 0.13, 0.07), shade), 1.0, (0.22, 0.22))


def _stone(size: int, rng: np.random.Generator) -> Relief:
    rough = _noise(rng, size, 1.0, 1.0, power=3.0)
    return _relief(
        "stone", 4e-5 * rough, _tinted((0.45, 0.43, 0.40), 1 + 0.2 * _noise(rng, size, 1.0, 1.0, power=2.0)), 0.7, (0.3, 0.3)
    )


def _wallpaper(size: int, rng: np.random.Generator) -> Relief:
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    pattern = np.tanh(3 * np.cos(4 * np.pi * x / size) * np.cos(4 * np.pi * y / size))
    height = 6e-5 * pattern + 1e-5 * _noise(rng, size, 1.5, 1.5)
    return _relief("wallpaper", height, _tinted((0.75, 0.70, 0.62), 1 + 0.05 * pattern), 0.4, (0.4, 0.4))


def _wood(size: int, rng: np.random.Generator) -> Relief:
    grain = _noise(rng, size, 20.0, 1.2)
    return _relief("wood", 1.5e-5 * grain, _tinted((0.45, 0.28, 0.15), 1 + 0.2 * grain), 0.8, (0.2, 0.35))


_MAKERS: dict[str, Callable[[int, np.random.Generator], Relief]] = {
    "carpet": _carpet,
    "copper": _copper,
    "alu": _alu,
    "fabric": _fabric,
    "felt": _felt,
    "leather": _leather,
    "stone": _stone,
    "wallpaper": _wallpaper,
    "wood": _wood,
}
SAMPLES = tuple(_MAKERS)
