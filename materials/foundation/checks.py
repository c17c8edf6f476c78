"""Checks of arguments at the public border; kernels behind it trust what they get."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError


def check_range(name: str, value: ArrayLike, interval: str) -> None:
    """Refuse values outside an interval written as mathematicians do: `"[0, 1)"`, `"(0, inf)"`.

    Raises
    ------
    InputError
        If any element is outside or not a number; names the first one.

    Examples
    --------
    >>> check_range("wetness", [0.0, 1.0], "[0, 1]")
    >>> check_range("g", -1, "(-1, 1)")
    Traceback (most recent call last):
    materials.foundation.errors.InputError: g must lie in (-1, 1), got -1.
    """
    values = _numbers(name, value)
    low, high = (float(end) for end in interval[1:-1].split(","))
    above = values >= low if interval[0] == "[" else values > low
    below = values <= high if interval[-1] == "]" else values < high
    good = above & below
    if not np.all(good):
        raise InputError(f"lie in {interval}", got=_first(values, ~good), key=name)


def check_shape(name: str, value: NDArray, shape: tuple[int | None, ...]) -> None:
    """Refuse an array whose shape differs; `None` stands for any length."""
    if len(value.shape) != len(shape) or any(w is not None and w != g for w, g in zip(shape, value.shape, strict=True)):
        want = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
        raise InputError(f"have shape {want}", got=value.shape, key=name)


def check_finite(name: str, value: ArrayLike) -> None:
    """Refuse NaN and infinities, naming the first."""
    values = _numbers(name, value)
    good = np.isfinite(values)
    if not np.all(good):
        raise InputError("be finite", got=_first(values, ~good), key=name)


def check_unit(name: str, vectors: ArrayLike, tolerance: float = 1e-4) -> None:
    """Refuse vectors (..., 3) that are not of unit length, naming the first."""
    lengths = np.linalg.norm(_numbers(name, vectors), axis=-1)
    bad = ~(np.abs(lengths - 1) <= tolerance)
    if np.any(bad):
        raise InputError("have unit length", got=_first(lengths, bad), key=name, remedy="Normalise it first.")


def _numbers(name: str, value: ArrayLike) -> NDArray[np.float64]:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError("be a number or an array of numbers", got=repr(value), key=name) from error


def _first(values: NDArray, bad: NDArray) -> str:
    """Say the first bad value and, in an array, its index."""
    if values.ndim == 0:
        return f"{values:g}"
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    return f"{values[index]:g} at index {index[0] if len(index) == 1 else index}"
