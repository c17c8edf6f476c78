"""A frame in the rain, and what it was made of as layers and labels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .droplets import DropletFrame
from .mist import MistyFrame
from .projected_world import ProjectedFrame
from .separate import Separation
from .wet import WetFrame


@dataclass(frozen=True)
class FrameResult:
    """A frame at one wetness, in memory; `mist` is None in clear air, `droplets` where the windshield is clean."""

    frame: ProjectedFrame
    separation: Separation
    water: NDArray[np.float32]
    wet: WetFrame
    mist: MistyFrame | None = None
    droplets: DropletFrame | None = None

    @property
    def last(self) -> WetFrame | MistyFrame | DropletFrame:
        """The frame with all effects."""
        return self.droplets or self.mist or self.wet

    @property
    def image(self) -> NDArray[np.float32]:
        """The picture with all effects, linear."""
        return self.last.image

    @property
    def raw(self) -> NDArray:
        """The same as the input's file stores it."""
        return self.last.raw


def layers(result: FrameResult) -> dict[str, NDArray]:
    """Return the channels of a frame's EXR: the picture and all that it was made of, in linear light and metres."""
    frame, sep, wet = result.frame, result.separation, result.wet
    out: dict[str, NDArray] = {}

    def add(layer: str, values: NDArray, channels: str) -> None:
        prefix = f"{layer}." if layer else ""
        for i, channel in enumerate(channels):
            out[prefix + channel] = values[..., i].astype(np.float32)

    add("", result.image, "RGB")
    add("diffuse_dry", sep.share[..., None] * sep.diffuse, "RGB")
    add("diffuse_wet", wet.diffuse, "RGB")
    add("specular_dry", sep.scale * sep.specular, "RGB")
    add("specular_wet", wet.specular, "RGB")
    add("normal", sep.ground.normal, "XYZ")
    share = np.maximum(sep.share, 1e-6)
    saturation, accumulation = wet.wet.wetness[..., 0] / share, wet.wet.wetness[..., 1] / share
    ground = sep.share > 0
    # Saturation fills the lower half of the water level, accumulation the upper half.
    out["water.level"] = np.where(ground, 0.5 * saturation + 0.5 * accumulation, 0).astype(np.float32)
    out["water.saturation"] = np.where(ground, saturation, 0).astype(np.float32)
    out["water.accumulation"] = np.where(ground, accumulation, 0).astype(np.float32)
    out["roughness.Y"] = np.where(ground, sep.ground.roughness, 0).astype(np.float32)
    out["depth.Z"] = frame.depth.astype(np.float32)
    out["ground.A"] = sep.share
    out["id.instance"] = frame.instance.astype(np.uint32)
    out["id.role"] = (frame.shape + 1).astype(np.uint32)
    if result.mist is not None:
        add("mist.scattered", result.mist.scattered, "RGB")
        out["mist.transmittance"] = result.mist.transmittance
    if result.droplets is not None:
        add("droplets", result.droplets.light, "RGB")
        out["droplets.A"] = result.droplets.covered
    return out


def labels(result: FrameResult) -> dict[str, NDArray[np.uint8]]:
    """Return label maps: share of ground, saturation and accumulation (0 to 255), what changed (0 or 255), what
    mist lets through and how far drops cover the lens (0 to 255)."""
    sep, wet = result.separation, result.wet
    share = np.maximum(sep.share, 1e-6)[..., None]
    wetness = np.rint(255 * np.clip(wet.wet.wetness / share, 0, 1)).astype(np.uint8)
    changed = result.frame.raw != result.raw
    changed = changed if changed.ndim == 2 else changed.any(axis=-1)
    found = {
        "ground": np.rint(255 * np.clip(sep.share, 0, 1)).astype(np.uint8),
        "saturation": wetness[..., 0],
        "accumulation": wetness[..., 1],
        "changed": (changed * 255).astype(np.uint8),
    }
    if result.mist is not None:
        found["transmittance"] = np.rint(255 * np.clip(result.mist.transmittance, 0, 1)).astype(np.uint8)
    if result.droplets is not None:
        found["droplets"] = np.rint(255 * np.clip(result.droplets.covered, 0, 1)).astype(np.uint8)
    return found
