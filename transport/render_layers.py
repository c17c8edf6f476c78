"""A rendered frame as the channels of an EXR: its light, what that was made of, and what geometry says of each pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.simulation import Lens

from .gbuffer import GBuffer, flow_between, gbuffer
from .kernels import film
from .media import transmittance
from .reflected_flow import reflected_flow
from .render import Rendering, compile_view
from .world import World

# Estimates of the transmittance per pixel, where it is tracked.
_TRACKED = 64


def light_layers(picture: Rendering, exposure: float = 1.0) -> dict[str, NDArray[np.float32]]:
    """Return the channels that hold light and what it met, times `exposure` (the variance times its square)."""
    out: dict[str, NDArray[np.float32]] = {}
    _add(out, "", "RGB", picture.radiance * np.float32(exposure))
    _add(out, "variance", "RGB", picture.variance * np.float32(exposure) ** 2)
    for name, light in (
        ("diffuse", picture.diffuse),
        ("specular", picture.specular),
        ("emission", picture.seen),
        ("scattered", picture.scattered),
    ):
        _add(out, name, "RGB", light * np.float32(exposure))
    _add(out, "albedo", "RGB", picture.albedo)
    _add(out, "normal", "XYZ", picture.normal)
    return out


def label_layers(
    world: World,
    camera: Camera,
    lens: Lens | None = None,
    next_camera: Camera | None = None,
    next_world: World | None = None,
    motions: dict[int, NDArray[np.float64]] | None = None,
    seed: int = 0,
) -> dict[str, NDArray]:
    """Return the channels that geometry decides, each at the pixel's centre.

    Parameters
    ----------
    world, camera
        Of this frame.
    lens : Lens, optional
        As for `render`.
    next_camera : Camera, optional
        Of the next frame; without it there is no flow.
    next_world, motions
        What else moves, as for `reflected_flow`.

    Returns
    -------
    channels : dict of (H, W) float32 or uint32
        See docs/render.md.
    """
    seen = gbuffer(world, camera, lens)
    materials = world.arrays.shape_material[np.maximum(seen.shape, 0)]
    out: dict[str, NDArray] = {
        "Z": seen.depth,
        "id.shape": (seen.shape + 1).astype(np.uint32),
        "id.material": np.where(seen.shape >= 0, materials + 1, 0).astype(np.uint32),
        "id.instance": seen.instance.astype(np.uint32),
        "transmittance.Y": air_transmittance(world, camera, seen, lens, seed),
    }
    if next_camera is not None:
        _add_flow(out, "flow", flow_between(seen, camera, next_camera, motions or {}))
        _add_flow(out, "reflected_flow", reflected_flow(world, camera, next_camera, next_world, motions, lens))
    return out


def air_transmittance(world: World, camera: Camera, seen: GBuffer, lens: Lens | None = None, seed: int = 0) -> NDArray[np.float32]:
    """Return the share of light that the medium of the air lets through from the first surface; 1 in a vacuum.

    (H, W) float32. Where there is no surface, that along the whole ray. It is exact for even media and those that thin with
    height, else the mean of 64 estimates.
    """
    size = (camera.height, camera.width)
    if world.medium is None:
        return np.ones(size, np.float32)
    origins, directions = np.empty((*size, 3)), np.empty((*size, 3))
    film.central_rays(*compile_view(camera, lens, None), origins, directions)
    far = seen.distance.astype(np.float64).ravel()
    through = transmittance(world.medium, origins.reshape(-1, 3), directions.reshape(-1, 3), far, _TRACKED, seed)
    return through.reshape(size).astype(np.float32)


def _add(out: dict[str, NDArray], layer: str, channels: str, values: NDArray) -> None:
    for i, channel in enumerate(channels):
        out[f"{layer}.{channel}" if layer else channel] = np.ascontiguousarray(values[..., i], np.float32)


def _add_flow(out: dict[str, NDArray], layer: str, flow: NDArray[np.float32]) -> None:
    """Add a flow as X, Y, and A: 1 where it is known, else all 0, as not every viewer knows NaN."""
    known = np.isfinite(flow[..., 0]) & np.isfinite(flow[..., 1])
    _add(out, layer, "XY", np.where(known[..., None], flow, 0))
    out[f"{layer}.A"] = np.where(known, np.float32(1), np.float32(0))
