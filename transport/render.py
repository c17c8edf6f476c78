"""Photograph a world: radiance by path tracing, and what it was made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from materials.foundation.checks import check_range
from materials.foundation.errors import InputError
from materials.foundation.interrupts import held_back
from materials.foundation.progress import tracked
from scene.camera import Camera
from scene.simulation import Lens

from .kernels import film
from .kernels.arrays import CameraArrays
from .kernels.optics import OpticsArrays
from .lens import Shutter, compile_optics
from .media import both_or_none
from .world import World, compile_camera

# Rows that share a count of samples, and the most paths between two chances to stop (some tenths of a second).
_BAND = 64
_PATHS_PER_STEP = 1 << 18
# Paths are first ended by chance at this bounce.
_ROULETTE_FROM = 4


@dataclass(frozen=True)
class Rendering:
    """A rendered image, and what it was made of. All are means over each pixel's square.

    Attributes
    ----------
    radiance : (H, W, 3) float32
        Of everything [W/(m² sr)], the sum of the four below.
    diffuse, specular : (H, W, 3) float32
        What the surface that the camera sees scatters by its matte part, and by its specular lobes: whatever lit it.
    seen : (H, W, 3) float32
        Lamps and sky that the camera sees themselves.
    scattered : (H, W, 3) float32
        What particles in the air scatter before any surface does.
    variance : (H, W, 3) float32
        Estimated variance of `radiance`, see `variance_of_mean`.
    albedo : (H, W, 3) float32
        Of the matte part of the surface seen, or where it has none its reflectance at normal incidence: no view and no
        light in it. Glass counts 1, lamps and sky 0; paths that a particle stopped before are left out.
    normal : (H, W, 3) float32
        Shading normal with relief, in the world, towards the viewer, likewise; shorter than 1 where a pixel sees several.
    samples : int
        Per pixel; the fewest, where the picture was left unfinished.
    """

    radiance: NDArray[np.float32]
    variance: NDArray[np.float32]
    samples: int
    diffuse: NDArray[np.float32]
    specular: NDArray[np.float32]
    seen: NDArray[np.float32]
    scattered: NDArray[np.float32]
    albedo: NDArray[np.float32]
    normal: NDArray[np.float32]


@dataclass(frozen=True)
class Tracing:
    """How paths are traced: parameters as of `render`."""

    seed: int = 0
    max_bounces: int = 8
    specular_only: bool = False
    clamp: float = np.inf

    def __post_init__(self) -> None:
        check_range("clamp", self.clamp, "(0, inf]")
        check_range("max_bounces", self.max_bounces, "[0, 1024]")


class Exposure:
    """A picture that gathers samples for as long as one likes, in the same memory.

    What is gathered after `advance(n)` depends on n alone, to the bit: not on the steps, threads, or interruptions.

    Parameters
    ----------
    world, camera, lens, shutter
        As for `render`.

    Raises
    ------
    InputError
        If specular light of measured materials is asked for, or as `compile_optics`.

    Attributes
    ----------
    sums : (H, W, NUM_SUMS) float64
        See `kernels.film`.
    done : (bands,) int64
        Samples per pixel so far, of each band of rows.
    """

    def __init__(
        self, world: World, camera: Camera, tracing: Tracing, lens: Lens | None = None, shutter: Shutter | None = None
    ) -> None:
        if tracing.specular_only and world.tables is not None:
            must = "be False in a world with measured materials"
            raise InputError(must, got=True, key="specular_only", remedy="A measurement does not say which light is specular.")
        self.world, self.tracing = world, tracing
        self.view, self.optics = compile_view(camera, lens, shutter)
        self.sums = np.zeros((camera.height, camera.width, film.NUM_SUMS))
        self.done = np.zeros(-(-camera.height // _BAND), np.int64)

    @property
    def samples(self) -> int:
        """Samples that every pixel has."""
        return int(self.done.min())

    def steps(self, samples: int) -> list[tuple[int, int]]:
        """Return (band, samples then) of the steps to `samples` per pixel, each some 0.1 to 1 s long."""
        at_once = max(1, _PATHS_PER_STEP // (_BAND * self.view.width))
        out = []
        for band, done in enumerate(self.done):
            out += [(band, min(n + at_once, samples)) for n in range(int(done), samples, at_once)]
        # All bands grow together: a picture that is stopped is evenly exposed, but for one step.
        return sorted(out, key=lambda step: (step[1], step[0]))

    def advance(self, samples: int, label: str = "rendering") -> None:
        """Bring every pixel to `samples` samples; an interrupt between two steps leaves sums and counts in accord."""
        for band, then in tracked(self.steps(samples), label):
            self.expose(band, then)

    def expose(self, band: int, samples: int) -> None:
        """Take one of the `steps`."""
        w, t = self.world, self.tracing
        medium, bodies = both_or_none(w.medium, w.bodies, len(w.arrays.material_kind))
        first_row, last_row = band * _BAND, min((band + 1) * _BAND, self.view.height)
        first = int(self.done[band])
        with held_back():
            film.expose(
                w.arrays,
                w.tables,
                w.lights,
                medium,
                bodies,
                self.view,
                self.optics,
                first_row,
                last_row,
                first,
                samples - first,
                t.seed & 0xFFFFFFFF,
                t.max_bounces,
                _ROULETTE_FROM,
                t.specular_only,
                float(t.clamp),
                self.sums,
            )
            self.done[band] = samples

    def rendering(self) -> Rendering:
        """Return the picture so far; black where there is no sample yet."""
        counts = np.repeat(self.done, _BAND)[: self.view.height, None, None]
        # In place of a copy of all sums: each layer is taken for itself.
        per_sample = 1.0 / np.maximum(counts, 1)

        def mean(column: int) -> NDArray[np.float64]:
            return self.sums[..., column : column + 3] * per_sample

        radiance, specular = mean(film.RADIANCE), mean(film.SPECULAR)
        seen, scattered = mean(film.SEEN), mean(film.SCATTERED)
        variance = variance_of_mean(radiance, mean(film.SQUARE), counts)
        # Differences of sums: what is 0 may come out as some units in the last place below it.
        diffuse = np.maximum(radiance - specular - seen - scattered, 0)
        unstopped = counts / np.maximum(counts - self.sums[..., film.STOPPED, None], 1)
        layers = (diffuse, specular, seen, scattered, mean(film.ALBEDO) * unstopped, mean(film.NORMAL) * unstopped)
        return Rendering(
            radiance.astype(np.float32), variance.astype(np.float32), self.samples, *(x.astype(np.float32) for x in layers)
        )


def render(
    world: World,
    camera: Camera,
    samples: int = 64,
    seed: int = 0,
    max_bounces: int = 8,
    specular_only: bool = False,
    clamp: float = np.inf,
    label: str = "rendering",
    lens: Lens | None = None,
    shutter: Shutter | None = None,
) -> Rendering:
    """Trace paths through every pixel, and through the world's medium if it has one.

    Parameters
    ----------
    samples : int
        Paths per pixel.
    seed : int
        The same seed gives the same bits, whatever the number of threads.
    max_bounces : int
        Scattering events per path, in the air as on surfaces; 1 is direct light only.
    specular_only : bool
        Let the surface that the camera sees scatter by its specular lobes alone.
    clamp : float
        Largest contribution of one indirect path; infinity is unbiased, a finite value trades the rare bright pixels
        of sunlight in mirrors for a small loss of indirect light.
    lens : Lens, optional
        A thin lens, or distortion besides that of an OPENCV camera; by default a pinhole.
    shutter : Shutter, optional
        The camera's way while it exposes; by default it stands still.

    Raises
    ------
    InputError
        If a number is out of range, or as `compile_optics`.
    """
    check_range("samples", samples, "[1, 1048576]")
    exposure = Exposure(world, camera, Tracing(seed, max_bounces, specular_only, clamp), lens, shutter)
    exposure.advance(samples, label)
    return exposure.rendering()


def compile_view(camera: Camera, lens: Lens | None, shutter: Shutter | None) -> tuple[CameraArrays, OpticsArrays | None]:
    """Return a camera as the kernels take it.

    Raises
    ------
    InputError
        As `compile_optics` and `compile_camera`.
    """
    optics = compile_optics(camera, lens, shutter)
    straight = camera if optics is None else replace(camera, model="PINHOLE", k1=0.0, k2=0.0, p1=0.0, p2=0.0)
    return compile_camera(straight), optics


def variance_of_mean(
    mean: NDArray[np.float64], mean_square: NDArray[np.float64], samples: int | NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the variance of a mean of independent samples, estimated from the mean of their squares.

    Scrambled Sobol samples do better than independent ones, so it is an upper estimate. One sample has no spread: its
    square, which the variance exceeds at most by chance, stands in.
    """
    spread = np.maximum(mean_square - mean * mean, 0) / np.maximum(np.asarray(samples) - 1, 1)
    return np.where(np.asarray(samples) <= 1, mean_square, spread)
