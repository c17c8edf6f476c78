"""Split what the camera saw of the ground into diffuse and specular light (thesis 6.4.2, 6.4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from materials.from_image import ImageRelief, bump_normals, height_variation, roughness_map
from materials.wetness import diffuse_attenuation, porosity_attenuation
from scene.grid import GroundGrid
from scene.wetting.map_filters import wide_slopes

from .kernels.wet import SPLIT, WetGround, specular_pass
from .projected_world import ProjectedFrame
from .render import variance_of_mean
from .world import compile_camera

# Water follows the street at this scale (sigma): far above a kerb's or a gutter's width, below a hill's.
_PLANE_SCALE = 4.0


@dataclass(frozen=True)
class Separation:
    """The dry ground of a frame, taken apart.

    Attributes
    ----------
    ground : WetGround
        Its parameters, with no water yet.
    wanted : (H, W) bool
        Pixels of which any part may see the ground.
    specular : (H, W, 3) float32
        Specular radiance of the ground's share of each pixel (eq 6.10), as estimated.
    scale : (H, W, 3) float32
        Factor in [0, 1] that keeps the specular part within what was observed; below 1 the light that was guessed
        to reach the ground is too strong there.
    diffuse : (H, W, 3) float32
        The picture less `scale * specular` (eq 6.11), never negative where the picture is not.
    share : (H, W) float32
        Share of the pixel that sees the ground.
    variance : (H, W, 3) float32
        Of `specular`.
    samples : int
    sums : SpecularSums
        Where the samples went; see `refine`.
    """

    ground: WetGround
    wanted: NDArray[np.bool_]
    specular: NDArray[np.float32]
    scale: NDArray[np.float32]
    diffuse: NDArray[np.float32]
    share: NDArray[np.float32]
    variance: NDArray[np.float32]
    samples: int
    sums: SpecularSums

    @property
    def clamped_share(self) -> float:
        """Share of the ground's pixels where the estimate exceeded the observation in any channel."""
        ground = self.share > 0
        return float(np.mean(np.any(self.scale[ground] < 1, axis=-1))) if ground.any() else 0.0


@dataclass(frozen=True)
class SpecularPass:
    """Means over the samples of a pixel; what does not see the ground counts 0."""

    specular: NDArray[np.float32]
    variance: NDArray[np.float32]
    dimming: NDArray[np.float32]
    share: NDArray[np.float32]
    wetness: NDArray[np.float32]


class SpecularSums:
    """Sums over the samples of a pixel, to which more samples can be added.

    Parameters
    ----------
    frame : ProjectedFrame
    ground : WetGround
        Its water among the rest.
    diffuse : (H, W, 3) float32
        The picture without the ground's gloss, for wet ground that is met on the way.
    wanted : (H, W) bool
        Pixels to trace.
    seed : int
        The numbers drawn do not depend on the water, so passes can be compared pixel by pixel.
    bounces : int
        Reflections followed.
    """

    def __init__(
        self,
        frame: ProjectedFrame,
        ground: WetGround,
        diffuse: NDArray[np.float32],
        wanted: NDArray[np.bool_],
        seed: int,
        bounces: int,
    ) -> None:
        size = wanted.shape
        view = compile_camera(frame.camera)
        self._inputs = (frame.world.arrays, frame.picture, diffuse, ground, view, wanted)
        # The arrays hold bare handles of Embree's trees, which live as long as their world.
        self._world = frame.world
        self._draws = (seed & 0xFFFFFFFF, bounces)
        self._specular, self._square, self._dimming = np.zeros((*size, 3)), np.zeros((*size, 3)), np.zeros((*size, 3))
        self._share, self._wetness = np.zeros(size), np.zeros((*size, 2))
        self.samples = 0

    def extend(self, samples: int) -> SpecularPass:
        """Trace until each pixel has `samples` and return the means (eq 6.10): to the bit those of one run of as many.

        Rays of the camera serve `SPLIT` samples each, so a number that is no multiple of it cannot be extended further.
        """
        assert samples > self.samples and self.samples % SPLIT == 0
        sums = (self._specular, self._square, self._dimming, self._share, self._wetness)
        specular_pass(*self._inputs, self.samples, samples - self.samples, *self._draws, *sums)
        self.samples = samples
        mean = self._specular / samples
        variance = variance_of_mean(mean, self._square / samples, -(-samples // SPLIT))
        parts = (mean, variance, *(part / samples for part in sums[2:]))
        return SpecularPass(*(part.astype(np.float32) for part in parts))


def trace_specular(
    frame: ProjectedFrame,
    ground: WetGround,
    diffuse: NDArray[np.float32],
    wanted: NDArray[np.bool_],
    samples: int,
    seed: int,
    bounces: int,
) -> SpecularPass:
    """Path trace the specular light of the ground (eq 6.10) under given water, `samples` per pixel (see `SpecularSums`)."""
    return SpecularSums(frame, ground, diffuse, wanted, seed, bounces).extend(samples)


def separate(
    frame: ProjectedFrame,
    grid: GroundGrid,
    water_normal: NDArray[np.float32],
    relief: ImageRelief,
    eta: float,
    porosity: float,
    darkening: str,
    strength: float,
    samples: int,
    seed: int,
    bounces: int,
    wanted: NDArray[np.bool_] | None = None,
    reference_albedo: float = 0.12,
) -> Separation:
    """Estimate the dry ground's parameters from the picture and take its specular light off it.

    Parameters
    ----------
    water_normal : (rows, cols, 3) float32
        From `water_normals`.
    relief : ImageRelief
        Constants of eqs 6.7 to 6.9.
    eta : float
        Refractive index of the dry ground (1.63: tarmac).
    porosity : float
        Effective porosity of the ground.
    darkening : {"lagarde", "lekner_dorf", "twomey", "thesis"}
        Model of `materials.wetness.diffuse_attenuation`.
    strength : float
        Weight of eq 6.13 (0.95).
    wanted : (H, W) bool, optional
        Pixels to trace; by default all that may see the ground.
    reference_albedo : float
        Albedo that the mean brightness of the ground stands for, where the model of darkening asks for albedos.
    """
    mask = frame.is_ground
    roughness = roughness_map(frame.image, mask, relief)
    height = height_variation(frame.image, mask, relief)
    normal = bump_normals(height, frame.position, frame.normal, mask, relief)
    normal = np.where(mask[..., None], normal, (0.0, 0.0, 1.0)).astype(np.float32)
    ground = WetGround(
        roughness=roughness.astype(np.float32),
        normal=normal,
        attenuation=_attenuation(frame.image, mask, porosity, darkening, reference_albedo, eta),
        water=np.zeros(grid.shape, np.float32),
        water_normal=water_normal,
        x_min=grid.x_min,
        y_min=grid.y_min,
        cell=grid.cell,
        eta=eta,
        rho=float(porosity_attenuation(porosity, "thesis" if darkening == "thesis" else "lagarde")),
        strength=strength,
        mean_roughness=0.5 * (relief.roughness_min + relief.roughness_max),
    )
    # By default one pixel around: its square may reach the ground though its centre does not.
    near: NDArray[np.bool_] = np.asarray(binary_dilation(mask, np.ones((3, 3), bool)), np.bool_) & (frame.instance == 0)
    traced = near if wanted is None else wanted
    sums = SpecularSums(frame, ground, frame.image, traced, seed, bounces)
    return _separation(frame, ground, traced, sums, samples)


def refine(frame: ProjectedFrame, separation: Separation, samples: int) -> Separation:
    """Return a separation with more samples, for the cost of those that are added.

    Parameters
    ----------
    frame : ProjectedFrame
        That of the separation.
    samples : int
        In all, more than it has. A separation is refined once; its sums go on in the new one.
    """
    return _separation(frame, separation.ground, separation.wanted, separation.sums, samples)


def _separation(
    frame: ProjectedFrame, ground: WetGround, traced: NDArray[np.bool_], sums: SpecularSums, samples: int
) -> Separation:
    dry = sums.extend(samples)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(dry.specular > frame.image, frame.image / dry.specular, 1.0)
    # An image with negative values (EXR keeps them) has nothing to give away there.
    scale = np.clip(np.nan_to_num(scale, nan=1.0), 0, 1).astype(np.float32)
    diffuse = (frame.image - scale * dry.specular).astype(np.float32)
    return Separation(ground, traced, dry.specular, scale, diffuse, dry.share, dry.variance, samples, sums)


def water_normals(height: NDArray[np.float32], coverage: NDArray[np.float32], cell: float) -> NDArray[np.float32]:
    """Return the normal of water standing on the ground: that of the plane that fits the ground over some metres.

    Upright (0, 0, 1) would be exact for a puddle if the recording's z axis were exactly vertical; half a degree of tilt
    turns mirror images by a whole one, and the film on a sloping street follows the street.

    Parameters
    ----------
    height : (rows, cols) float32
        Ground height [m].
    coverage : (rows, cols) float32
        1 where it was measured.
    cell : float
        Size of a cell [m].

    Returns
    -------
    normals : (rows, cols, 3) float32
        Unit vectors.
    """
    slope_x, slope_y = wide_slopes(height, coverage, _PLANE_SCALE, cell)
    normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _attenuation(
    image: NDArray[np.float32], mask: NDArray[np.bool_], porosity: float, darkening: str, reference_albedo: float, eta: float
) -> NDArray[np.float32]:
    mean = float(image[mask].mean()) if mask.any() else 1.0
    albedo = np.clip(image / max(mean, 1e-6) * reference_albedo, 0.0, 1.0)
    return diffuse_attenuation(albedo, 1.0, porosity, darkening, eta=eta).astype(np.float32)  # type: ignore[arg-type]
