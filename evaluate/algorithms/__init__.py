"""Optical flow algorithms behind one interface: `estimate(image0, image1, name)`.

`horn-schunck`, `papenberg` and `brox` are our own and take linear pictures of any range; the others are OpenCV's and see
8 bits. The thesis's third algorithm, MDP-Flow2, exists as a Windows program only: `brox`, the most accurate here on
Middlebury's RubberWhale, stands in for it, and `FlowCommand` runs any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from . import opencv, variational
from .command import FlowCommand

__all__ = ["ALGORITHMS", "Algorithm", "FlowCommand", "algorithm", "estimate"]


@dataclass(frozen=True)
class Algorithm:
    """A flow algorithm: what it is, whether it sees light above white, and the function from two pictures to the flow."""

    name: str
    description: str
    hdr: bool
    estimate: Callable[[NDArray, NDArray], NDArray[np.float32]]


def _own(name: str, description: str, settings: variational.VariationalSettings) -> Algorithm:
    return Algorithm(name, description, True, partial(variational.estimate, settings=settings))


def _described(function: Callable[..., object]) -> str:
    return (function.__doc__ or "").removeprefix("Return the flow ").removeprefix("of ").strip().rstrip(".")


_OWN = (
    _own("horn-schunck", "multi-scale nonlinear Horn-Schunck, quadratic penalisers, five levels", variational.HORN_SCHUNCK),
    _own("papenberg", "Charbonnier penalisers on intensity and smoothness, as in the thesis", variational.PAPENBERG),
    _own("brox", "the same with constancy of gradients (Brox et al. 2004; Papenberg et al. 2006)", variational.BROX),
)
_OPENCV = tuple(Algorithm(name, _described(function), False, function) for name, function in opencv.available().items())
ALGORITHMS: dict[str, Algorithm] = {a.name: a for a in (*_OWN, *_OPENCV)}


def algorithm(name: str) -> Algorithm:
    """Return an algorithm by its name.

    Raises
    ------
    InputError
        If there is none of that name here; lists those there are.
    """
    if name not in ALGORITHMS:
        remedy = "OpenCV's need opencv-contrib-python; any other runs by --flow-command."
        raise InputError(f"be one of {', '.join(ALGORITHMS)}", got=name, key="algorithm", remedy=remedy)
    return ALGORITHMS[name]


def estimate(image0: NDArray, image1: NDArray, name: str = "brox") -> NDArray[np.float32]:
    """Return the flow from one picture to the next.

    Parameters
    ----------
    image0, image1 : (H, W) or (H, W, 3)
        8 or 16 bits, or linear floats.
    name : str
        One of `ALGORITHMS`.

    Returns
    -------
    flow : (H, W, 2) float32
        x right, y down [px]

    Raises
    ------
    InputError
        If the name is unknown or the pictures cannot be used.
    """
    return algorithm(name).estimate(image0, image1)
