"""The built-in street for experiments: photographed, reconstructed, wetted in several ways, and truly wet."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from materials.foundation.progress import stage
from materials.foundation.settings import as_dict
from scene.flow_files import Flow, read_flow
from scene.images import encode, read_image, read_raw
from scene.reconstruction.build import build
from scene.reconstruction.build_settings import BuildSettings
from scene.recording import Recording, read_recording
from scene.scene_file import read_scene
from scene.street import StreetSettings, street
from scene.wetting.water import water_level
from scene.wetting.windshield import Windshield
from transport.air import mist_over
from transport.augment import (
    estimate_sky_gain,
    rainy_frame,
    separate_frame,
    through_drops,
    windshield_before,
)
from transport.augment_settings import AugmentSettings
from transport.kernels.media import MediumArrays
from transport.photograph import PhotographSettings, photograph, with_noise
from transport.projected_world import ProjectedFrame, project_frame
from transport.render import render
from transport.separate import Separation, water_normals
from transport.wet import wet_frame
from transport.world import World, compile_world

from ..algorithms import algorithm
from .cache import Cache
from .settings import StreetPart
from .wetting import METHODS


@dataclass(frozen=True)
class Weather:
    """How wet the ground is, and how much mist and how many drops on the windshield there are, 0 to 1 each."""

    wetness: float = 0.0
    mist: float = 0.0
    droplets: float = 0.0


class Rain(NamedTuple):
    """A frame in some weather.

    Attributes
    ----------
    picture : as the recorded one
        Its numbers in the file.
    standing : (H, W) float32
        Accumulation, how much water stands on the ground, 0 to 1; 0 off the ground.
    drops : (H, W) float32
        Share of the lens that drops on the windshield cover.
    """

    picture: NDArray
    standing: NDArray[np.float32]
    drops: NDArray[np.float32]


class WettedDrive:
    """A reconstructed drive whose frames are wetted on demand.

    Parameters
    ----------
    recording : Recording
    folder : path
        Gets `scene/` and `cache/`.
    settings : StreetPart
        Samples and seed count here.
    frames : list of int
        Those that will be asked for; the unseen sky is judged on them.
    """

    def __init__(self, recording: Recording, folder: Path, settings: StreetPart, frames: list[int]) -> None:
        self.cache = Cache(folder / "cache")
        with stage("building the scene"):
            build(recording, folder / "scene", BuildSettings(seed=settings.seed))
        self.scene = read_scene(folder / "scene")
        self.settings = AugmentSettings(samples=settings.samples, seed=settings.seed)
        self._normals = water_normals(self.scene.maps["height"], self.scene.maps["coverage"], self.scene.grid.cell)
        gain = self.cache.array(
            self._parts() | {"what": "sky gain", "frames": frames},
            lambda: np.array(estimate_sky_gain(self.scene, frames, self._normals, self.settings)),
        )
        self._gain = float(gain)
        # The two frames of a pair, which are asked for in turn.
        self._recent: dict[int, tuple[ProjectedFrame, Separation]] = {}
        # By amount; the drops on a glass are the same whatever else the weather does.
        self._mists: dict[float, MediumArrays | None] = {}
        self._shields: dict[float, Windshield] = {}

    def picture(self, frame: int) -> NDArray:
        """Return a recorded picture as stored."""
        return read_raw(self.scene.recording.frames[frame].image)

    def wet(self, frame: int, wetness: float, method: str = "augmented") -> NDArray:
        """Return a frame wetted by one of `METHODS`, as its numbers in the file."""
        parts = self._parts() | {"what": "wet", "frame": frame, "wetness": wetness}

        def make() -> NDArray:
            projected, separation = self._separated(frame)
            water = np.clip(water_level(self.scene.maps, self.scene.grid, wetness, self.settings.water), 0, 1)
            wet = wet_frame(projected, separation, water, self.settings.seed, self.settings.bounces)
            return np.stack([f(projected, separation, wet) for f in METHODS.values()])

        return self.cache.array(parts, make)[list(METHODS).index(method)]

    def rain(self, frame: int, weather: Weather) -> Rain:
        """Return a frame in some weather, and where water stands and drops are in it."""
        picture = self.picture(frame)
        kept = self.cache.array(
            self._parts() | {"what": "rain", "frame": frame, "weather": asdict(weather)}, lambda: self._in_weather(frame, weather)
        )
        return Rain(kept[..., :-2].reshape(picture.shape).astype(picture.dtype), kept[..., -2], kept[..., -1])

    def _in_weather(self, frame: int, weather: Weather) -> NDArray[np.float32]:
        """Return the numbers of the picture, the standing water and the drops, one behind the other."""
        settings = replace(self.settings, mist=weather.mist, droplets=weather.droplets)
        if weather.mist not in self._mists:
            self._mists[weather.mist] = mist_over(self.scene, settings)
        mist = self._mists[weather.mist]
        projected, separation = self._separated(frame)
        water = np.clip(water_level(self.scene.maps, self.scene.grid, weather.wetness, settings.water), 0, 1)
        result = rainy_frame(projected, separation, water, mist, settings)
        covered = np.zeros_like(separation.share)
        if weather.droplets > 0:
            if weather.droplets not in self._shields:
                self._shields[weather.droplets] = windshield_before(projected, settings)
            result = through_drops(result, mist, self._shields[weather.droplets], frame, settings)
            assert result.droplets is not None
            covered = result.droplets.covered
        # Accumulation of the ground's share of a pixel.
        standing = result.wet.wet.wetness[..., 1] / np.maximum(separation.share, 1e-6)
        return np.dstack([result.raw, np.where(separation.share > 0.5, standing, 0), covered]).astype(np.float32)

    def ground(self, frame: int) -> NDArray[np.bool_]:
        """Return the pixels that see the static ground."""
        return self.cache.array(self._parts() | {"what": "ground", "frame": frame}, lambda: self._separated(frame)[0].is_ground)

    def flow(self, name: str, first: NDArray, second: NDArray) -> NDArray[np.float32]:
        """Return an algorithm's flow between two pictures."""
        parts = {"what": "flow", "algorithm": name, "first": first, "second": second}
        return self.cache.array(parts, lambda: algorithm(name).estimate(first, second))

    def _separated(self, frame: int) -> tuple[ProjectedFrame, Separation]:
        if frame not in self._recent:
            last = next(reversed(self._recent.values()))[0] if self._recent else None
            projected = project_frame(self.scene, frame, last, self._gain)
            separation = separate_frame(projected, self.scene, self._normals, self.settings)
            self._recent = dict([*list(self._recent.items())[-1:], (frame, (projected, separation))])
        return self._recent[frame]

    def _parts(self) -> dict[str, object]:
        # A scene is what its settings and its recording made of it; the recording's pictures stand for it.
        pictures = [read_raw(frame.image) for frame in self.scene.recording.frames]
        return {"scene": np.concatenate([p.ravel() for p in pictures]), "augment": as_dict(self.settings)}


class WetStreet(WettedDrive):
    """The built-in street: besides, its true flow, and its truly wet pictures.

    Parameters
    ----------
    settings : StreetPart
    folder : path
        Gets `recording/` besides.
    """

    def __init__(self, settings: StreetPart, folder: Path) -> None:
        self.pairs = [(i, i + 1) for i in range(settings.pairs)]
        self._photographs = PhotographSettings(samples=settings.samples, render_seed=settings.seed)
        given = StreetSettings(
            frames=settings.pairs + 1,
            width=settings.width,
            height=settings.height,
            step=settings.step,
            detail=settings.detail,
            seed=settings.seed,
        )
        with stage("building the street"):
            self._street = street(given)
        photograph(self._street, folder / "recording", self._photographs)
        self._truth = folder / "recording" / "truth"
        self._worlds: dict[float, World] = {}
        recording = read_recording(folder / "recording")
        super().__init__(recording, folder, settings, list(range(settings.pairs + 1)))
        self._street_settings = as_dict(given)

    def true_flow(self, frame: int) -> Flow:
        """Return the true flow to the next frame."""
        return read_flow(self._truth / "flow" / f"{frame:04d}.npy")

    def visible(self, frame: int) -> NDArray[np.bool_]:
        """Return what the next frame sees too."""
        return read_raw(self._truth / "visible" / f"{frame:04d}.png") > 0

    def truly_wet(self, frame: int, shower: float, repeat: int = 0) -> NDArray[np.uint8]:
        """Return a photograph of the truly wet street, with sensor noise as the dry one's; another `repeat` has other noise."""
        parts = {"what": "truly wet", "street": self._street_settings, "photograph": as_dict(self._photographs)}

        def make() -> NDArray:
            world = compile_world(self._street.simulation(frame, shower), self._worlds.get(shower))
            self._worlds = {shower: world}
            s = self._photographs
            picture = render(
                world,
                self._street.cameras[frame],
                s.samples,
                s.render_seed + 7919 * frame + 104729 * (repeat + 1),
                s.max_bounces,
                clamp=s.clamp or np.inf,
                label=f"truly wet frame {frame}, shower {shower:.2f}",
            )
            noise = self.scene.recording.noise
            assert noise is not None
            rng = np.random.default_rng([s.render_seed, frame, round(1000 * shower), repeat])
            linear = with_noise(picture.radiance * np.float32(s.exposure), noise, rng)
            first = self.scene.recording.frames[frame].image
            return encode(linear, read_image(first)[1])

        return self.cache.array(parts | {"frame": frame, "shower": shower, "repeat": repeat}, make)
