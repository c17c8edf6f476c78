"""A street that costs nothing: one texture that moves by a known flow, with each kind of picture made by a formula."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evaluate.algorithms import estimate
from evaluate.experiments.wet_street import Rain, Weather
from scene.flow_files import Flow, as_flow

from ..algorithms.textures import texture

SHIFT = np.array([2.0, 1.0])
SIZE = (48, 64)


class FakeStreet:
    """Stands in for `WetStreet`: the augmentation equals the truth but for noise, darkening loses half of the contrast."""

    def __init__(self, settings, folder) -> None:
        self.pairs = [(i, i + 1) for i in range(settings.pairs)]

    def ground(self, frame: int) -> NDArray[np.bool_]:
        out = np.zeros(SIZE, bool)
        out[8:-8, 8:-8] = True
        return out

    def visible(self, frame: int) -> NDArray[np.bool_]:
        return np.ones(SIZE, bool)

    def rain(self, frame: int, weather: Weather) -> Rain:
        """Return water that blurs the lower half of the ground, mist that takes contrast, and a drop at a fixed place."""
        standing, drops = (np.zeros(SIZE, np.float32) for _ in range(2))
        standing[24:40, 8:-8] = weather.wetness
        drops[10:20, 20:40] = weather.droplets
        gloss = 120.0 * weather.wetness * standing
        dull = self._textured(frame, 1.0 - 0.9 * weather.mist, 0.0, 5)
        mirrored = np.repeat(texture(*np.mgrid[: SIZE[1], : SIZE[0]].astype(float), seed=9).T[..., None], 3, axis=2) / 255
        picture = dull + gloss[..., None] * mirrored
        picture = np.where(drops[..., None] > 0.5, 90 + 60 * mirrored, picture)
        return Rain(np.rint(np.clip(picture, 0, 255)).astype(np.uint8), standing, drops)

    def true_flow(self, frame: int) -> Flow:
        return as_flow(np.broadcast_to(SHIFT, (*SIZE, 2)))

    def picture(self, frame: int) -> NDArray[np.uint8]:
        return self._textured(frame, 1.0, 0.0, 0)

    def truly_wet(self, frame: int, shower: float, repeat: int = 0) -> NDArray[np.uint8]:
        return self._textured(frame, 1.0, 40.0, 1 + repeat)

    def wet(self, frame: int, wetness: float, method: str = "augmented") -> NDArray[np.uint8]:
        contrast, gloss = {"augmented": (1.0, 40.0), "darkened": (0.3, 0.0), "planar mirror": (0.3, 20.0)}[method]
        return self._textured(frame, contrast * (0.5 + 0.5 * wetness), gloss, 3)

    def flow(self, name: str, first: NDArray, second: NDArray) -> NDArray[np.float32]:
        return estimate(first, second, name)

    def _textured(self, frame: int, contrast: float, gloss: float, noise: int) -> NDArray[np.uint8]:
        y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
        dx, dy = frame * SHIFT
        ground = 60 + contrast * 0.4 * (texture(x - dx, y - dy, seed=4) - 127.5)
        # What is mirrored does not move with the ground.
        ground += gloss * (texture(x + dx, y, seed=9) / 255)
        ground += np.random.default_rng([frame, noise]).normal(0, 0.7, SIZE)
        return np.repeat(np.rint(np.clip(ground, 0, 255)).astype(np.uint8)[..., None], 3, axis=2)
