"""Fog: what is far is dimmed, and veiled by light that the air scatters."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels import veil
from ..mismatch.case import Case, Floats
from ..mismatch.effect import Effect, Parameter, Values
from ..mismatch.formation import State, eyes, frame_of, open_sky, sight
from ..mismatch.sensor_plane import offsets, wide_blur

_KEPT = 3


class ParticipatingMedium(Effect):
    id = "participating_medium"
    stage = "medium"
    title = "fog"
    says = "what is far loses contrast towards one colour, exponentially in its distance"
    taken_for = ("glare", "height_fog", "ambient_light")
    decides = "photograph dark targets at several distances, and above each other"
    coordinates = "depth"
    approximation = 0.2

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return self.by_distance(case, case.pieces.distance[case.pieces.shape >= 0])

    def by_distance(self, case: Case, distance: np.ndarray) -> tuple[Parameter, ...]:
        """Return what is to be fitted where surfaces are seen at these distances (N,)."""
        far = float(np.quantile(distance, 0.9))
        level = float(np.quantile(case.pictures[case.valid], 0.9)) + 1e-3
        air = tuple(Parameter(f"airlight.{c}", 0.5 * level, 0.0, 50 * level, 0.01 * level, "W/(m² sr)") for c in "rgb")
        out = (Parameter("sigma_t", 0.2 / far, 0.0, 20 / far, 0.01 / far, "1/m"), *air)
        if len(case.lamps):
            # What lamps send into the line of sight, once scattered; the rest has come from all around, and lights surfaces too.
            out += (Parameter("single_albedo", 0.6, 0.0, 1.0, 0.02), Parameter("g", 0.6, -0.5, 0.95, 0.02))
            out += (Parameter("fill", 0.0, 0.0, 5.0, 0.05), Parameter("rise", 0.0, -1 / far, 20 / far, 0.05 / far, "1/m"))
        if case.traced:
            # Of what is scattered, the part that goes on nearly straight: it blurs what is seen, and takes little from it.
            out += (Parameter("forward", 0.0, 0.0, 0.9, 0.03), Parameter("turn", 0.15, 0.02, 0.8, 0.02, "rad"))
        if self._beyond(case).any():
            out += (Parameter("reach", 1.3 * far, 0.2 * far, 50 * far, 0.05 * far, "m"),)
        return out

    def _beyond(self, case: Case) -> np.ndarray:
        return case.pieces.shape < 0

    def _height(self, values: Values) -> tuple[float, float]:
        return 0.0, 0.0  # scale height (0: even), base

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        p = case.pieces
        distance = p.distance.copy()
        beyond = self._beyond(case)
        if "reach" in values:
            distance[beyond] = values["reach"]
        scale_height, base = self._height(values)
        sigma_t, single, g = float(values["sigma_t"]), float(values.get("single_albedo", 0.0)), float(values.get("g", 0.0))
        forward = float(values.get("forward", 0.0))
        thin = sigma_t * (1 - forward)
        # What is turned little by the air still lights what the beam would have: it counts as not scattered at all.
        sigma_lamp = sigma_t * (1 - single * g**2)
        through, lamp_light, lift = _scattered(case, state, distance, (thin, sigma_lamp, scale_height, base, g))
        frame = frame_of(case)
        air = np.array([values[f"airlight.{c}"] for c in "rgb"], np.float32)
        if len(case.lamps):
            arriving = np.ones_like(state.visible)
            veil.arriving(frame, p.position, case.slots, state.lamps, sigma_lamp, scale_height, base, arriving)
            state.arriving = arriving if not len(state.arriving) else state.arriving * arriving
            state.add_ambient(open_sky(case)[:, None] * np.float32(values["fill"]) * air)
        if forward > 0:
            self._spread(case, state, through, forward / (1 - forward), float(values["turn"]))
        # High up the fog is nearer to sun and sky.
        share = (1 - through) + np.float32(values.get("rise", 0.0)) * lift[:, None]
        state.veil(through, share * air + np.float32(single) * lamp_light)

    def _spread(self, case: Case, state: State, through: NDArray[np.float32], share: float, turn: float) -> None:
        """Blur what comes through by the light that the air turns little: a share of the optical thickness."""
        p, (height, width) = case.pieces, case.size
        # Of a pixel with several pieces: the mean of what comes straight through.
        straight = np.bincount(p.pixel, p.weight * through[:, 0] ** np.float32(share), case.num_frames * height * width)
        weight = np.bincount(p.pixel, p.weight, len(straight))
        straight = np.float32(np.where(weight > 0, straight / np.maximum(weight, 1e-6), 1.0)).reshape(-1, height, width, 1)
        sigma = turn * offsets(case)[2]

        def blurred(picture: Floats) -> Floats:
            return (straight * picture + (1 - straight) * wide_blur(picture, sigma)).astype(np.float32)

        state.spread.append(blurred)


def _scattered(
    case: Case, state: State, distance: Floats, fog: tuple[float, float, float, float, float]
) -> tuple[Floats, Floats, Floats]:
    """Return (through (N, 3), light of lamps scattered once (N, 3), lift (N,)); the last few are kept.

    Half of a fog's parameters change nothing of this, and a fit asks for it again with each of them.
    """
    kept = case.cache.setdefault("scattered", {})
    key = (*fog, state.lamps.tobytes(), float(distance[case.pieces.shape < 0].sum()))
    if key in kept:
        kept[key] = kept.pop(key)
        return kept[key]
    n = len(case.pieces)
    out = (np.empty((n, 3), np.float32), np.zeros((n, 3), np.float32), np.empty(n, np.float32))
    veil.veil(eyes(case), frame_of(case), sight(case), distance, case.slots, state.lamps, *fog, 8, *out)
    while len(kept) >= _KEPT:
        kept.pop(next(iter(kept)))
    kept[key] = out
    return out
