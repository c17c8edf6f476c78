"""Put drops on the windshield before a frame (thesis 6.3.5, 6.4.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.images import encode
from scene.mesh import Mesh
from scene.transforms import transform_points, transform_vectors
from scene.wetting.metaballs import drop_mesh
from scene.wetting.windshield import Drops, Glass
from scene.wetting.windshield_settings import WindshieldSettings

from .embree import EmbreeScene
from .kernels.droplets import DropArrays, droplet_pass
from .kernels.media import MediumArrays
from .projected_world import ProjectedFrame
from .render import variance_of_mean
from .separate import Separation
from .world import compile_camera


@dataclass(frozen=True)
class DropletFrame:
    """A frame seen past drops.

    Attributes
    ----------
    image : (H, W, 3) float32
        Linear.
    raw : as the input's file
        Its numbers where no drop is met, to the bit.
    covered : (H, W) float32
        Share of the lens that a drop covers, for each pixel.
    light : (H, W, 3) float32
        Light that comes through drops.
    variance : (H, W, 3) float32
        Of `light`.
    """

    image: NDArray[np.float32]
    raw: NDArray
    covered: NDArray[np.float32]
    light: NDArray[np.float32]
    variance: NDArray[np.float32]


def droplet_frame(
    frame: ProjectedFrame,
    separation: Separation,
    image: NDArray[np.float32],
    raw: NDArray,
    water: NDArray[np.float32],
    mist: MediumArrays | None,
    glass: Glass,
    drops: Drops,
    settings: WindshieldSettings,
    samples: int,
    seed: int,
    bounces: int,
) -> DropletFrame:
    """Return a frame, wet and in mist, with drops on the windshield: `(1 - covered) L + light`.

    Rays of the thin lens that meet a drop are refracted into the wet world and its mist, wherever they lead; the others keep
    the pixel's light, whose own blur the recording's lens has made.

    Parameters
    ----------
    image, raw : (H, W, 3) float32, and as the input's file
        The frame so far, linear and encoded.
    water, mist
        What lies on its ground and in its air.
    glass, drops
        From `scene.wetting.windshield`.
    samples : int
        Paths per pixel.
    """
    size = image.shape[:2]
    light, square, covered = np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros(size)
    mesh = drop_mesh(drops, settings.contact_angle_deg, 1e-3 * settings.resolution_mm)
    if mesh.num_faces > 0:
        tree, arrays = compile_drops(mesh, glass, frame.camera.T_world_camera, settings)
        ground = separation.ground._replace(water=np.ascontiguousarray(water, np.float32))
        world = (frame.world.arrays, frame.picture, separation.diffuse, ground, mist, compile_camera(frame.camera), arrays)
        droplet_pass(*world, samples, (seed + 0x51ED270B) & 0xFFFFFFFF, bounces, light, square, covered)
        del tree  # the arrays hold its bare handle
    mean, share = light / samples, covered / samples
    met = share > 0
    out = np.where(met[..., None], (1 - share[..., None]) * image + mean, image).astype(np.float32)
    coded = np.where(met if raw.ndim == 2 else met[..., None], encode(out, frame.encoding), raw)
    variance = variance_of_mean(mean, square / samples, samples)
    return DropletFrame(out, coded, share.astype(np.float32), mean.astype(np.float32), variance.astype(np.float32))


def compile_drops(
    mesh: Mesh, glass: Glass, T_world_camera: NDArray[np.float64], settings: WindshieldSettings
) -> tuple[EmbreeScene, DropArrays]:
    """Return Embree's tree over the drops, which must outlive the arrays, and these.

    The camera's frame keeps the drops near the origin: in the world float32 would not resolve them.
    """
    assert mesh.normals is not None
    T = glass.T_camera_glass
    tree = EmbreeScene(transform_points(T, mesh.vertices.astype(np.float64)).astype(np.float32), mesh.faces)
    return tree, DropArrays(
        tree.handle,
        mesh.faces,
        transform_vectors(T, mesh.normals.astype(np.float64)).astype(np.float32),
        T[:3, 2].copy(),
        T_world_camera[:3, :3].copy(),
        T_world_camera[:3, 3].copy(),
        settings.eta,
        settings.aperture_radius,
        settings.focus_distance,
    )
