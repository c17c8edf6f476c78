"""Make the ground of a frame wet (thesis 6.4.4, eqs 6.12 and 6.13)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.images import encode

from .projected_world import ProjectedFrame
from .separate import Separation, SpecularPass, trace_specular


@dataclass(frozen=True)
class WetFrame:
    """A frame with wet ground.

    Attributes
    ----------
    image : (H, W, 3) float32
        Linear.
    raw : as the input's file
        Its numbers: those of the input, to the bit, wherever the water changes nothing.
    diffuse, specular : (H, W, 3) float32
        Wet diffuse and specular light of the ground's share of each pixel.
    wet : SpecularPass
        Saturation, accumulation, dimming, and the variance of the specular light.
    """

    image: NDArray[np.float32]
    raw: NDArray
    diffuse: NDArray[np.float32]
    specular: NDArray[np.float32]
    wet: SpecularPass


def wet_frame(frame: ProjectedFrame, separation: Separation, water: NDArray[np.float32], seed: int, bounces: int) -> WetFrame:
    """Return the frame under a water level.

    The wet picture is `L + dimming * L_d + scale * (L_s,wet - L_s,dry)`: equal to the dimmed diffuse light plus the new
    specular light, never negative, and without any change where there is no water, since both specular terms come from
    the same random numbers.

    Parameters
    ----------
    water : (rows, cols) float32
        Water level W on the scene's grid (eq 6.5).
    seed, bounces
        Those of the separation, or the differences of the two passes are no longer free of noise.
    """
    ground = separation.ground._replace(water=np.ascontiguousarray(water, np.float32))
    wanted = separation.wanted & (separation.share > 0)
    wet = trace_specular(frame, ground, separation.diffuse, wanted, separation.samples, seed, bounces)
    change = wet.dimming * separation.diffuse + separation.scale * (wet.specular - separation.specular)
    image = frame.image + np.where(wanted[..., None], change, 0)
    # What rounding leaves below zero of an exact zero; an EXR's own negative values stay.
    image = np.where((image < 0) & (frame.image >= 0), 0, image).astype(np.float32)
    changed = np.any(image != frame.image, axis=-1)
    raw = encode(image, frame.encoding)
    raw = np.where(changed if frame.raw.ndim == 2 else changed[..., None], raw, frame.raw)
    diffuse = separation.share[..., None] * separation.diffuse + wet.dimming * separation.diffuse
    return WetFrame(image, raw, diffuse.astype(np.float32), separation.scale * wet.specular, wet)
