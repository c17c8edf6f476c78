"""Noise taken out by Intel's Open Image Denoise, for those who have installed it: `pip install meniscus[denoise]`."""

from __future__ import annotations

import importlib
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError

from .render import Rendering


def denoiser() -> ModuleType:
    """Return pyoidn.

    Raises
    ------
    InputError
        If it is not installed, or does not start.
    """
    try:
        return importlib.import_module("pyoidn")
    except (ImportError, OSError) as error:
        remedy = "Install it: .venv/bin/python -m pip install -r requirements-denoise.lock"
        raise InputError("be given only where pyoidn is installed", got=error, key="--denoise", remedy=remedy) from error


def denoised(picture: Rendering) -> NDArray[np.float32]:
    """Return the radiance (H, W, 3) with its noise guessed away, guided by albedo and normal.

    It looks converged and is not: a network's guess, biased where noise hides what was there. The variance of a picture
    says nothing about it.

    Raises
    ------
    InputError
        If there is no denoiser.
    """
    oidn = denoiser()
    albedo = np.clip(picture.albedo, 0, 1)
    return oidn.denoise(picture.radiance, albedo=albedo, normal=picture.normal, hdr=True)
