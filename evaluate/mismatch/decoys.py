"""Flexible corrections that are no physics: an effect has to explain more than they do, in coordinates that are wrong for it.

A smooth gain and offset over the sensor, a smooth gain over each surface, a gain and offset of each frame, a mixing of
colours. Camera corrections of this kind raise the score of almost any fit; an effect of a surface that does no better than a
gain over the sensor is none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from .case import Case
from .effect import Context, Effect, Parameter, Term, Values, shapes_seen
from .formation import State

_GRID = (3, 4)
_CELLS = 3


class SensorDecoy(Effect):
    """A smooth gain over the sensor, the same in all frames, and one offset."""

    id = "decoy_sensor"
    stage = "lens"
    title = "a smooth gain over the sensor"
    says = "no physics"
    coordinates = "sensor"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        level = float(np.median(case.pictures[case.valid])) + 1e-6
        gains = [Parameter(f"gain.{r}.{c}", 0.0, -3.0, 3.0, 0.01, spread=1.0) for r in range(_GRID[0]) for c in range(_GRID[1])]
        return (*gains, Parameter("offset", 0.0, -10 * level, 10 * level, 0.01 * level))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        height, width = case.size
        knots = np.array([[values[f"gain.{r}.{c}"] for c in range(_GRID[1])] for r in range(_GRID[0])])
        gain = np.exp(zoom(knots, (height / _GRID[0], width / _GRID[1]), order=3, mode="nearest", grid_mode=True))
        factor, offset = gain[:height, :width, None].astype(np.float32), np.float32(values["offset"])
        state.lens.append(lambda picture: picture * factor + offset)


class SurfaceDecoy(Effect):
    """A smooth gain over the texture coordinates of each shape, the same under all lamps and from everywhere."""

    id = "decoy_surface"
    stage = "surface"
    title = "a smooth gain over each surface"
    says = "no physics"
    coordinates = "surface"

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        cells = [(i, j) for i in range(_CELLS) for j in range(_CELLS)]
        return tuple(
            Parameter(f"gain.{name}.{i}.{j}", 0.0, -3.0, 3.0, 0.01, spread=1.0)
            for name in shapes_seen(case, 0.02)
            for i, j in cells
        )

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return the weights of the cells at each piece (N, cells), bilinear over a texture that repeats."""
        at = case.pieces.uv % 1.0 * _CELLS
        across, down = (np.maximum(1 - np.abs(_nearer(at[:, k, None] - np.arange(_CELLS) - 0.5)), 0) for k in (0, 1))
        return (down[:, :, None] * across[:, None, :]).reshape(len(at), -1).astype(np.float32)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        log = np.zeros(len(case.pieces), np.float32)
        for name in shapes_seen(case, 0.02):
            own = case.pieces.shape == case.shape_names.index(name)
            knots = [values[f"gain.{name}.{i}.{j}"] for i in range(_CELLS) for j in range(_CELLS)]
            log[own] = aux[own] @ np.array(knots, np.float32)
        state.scale_albedo(np.repeat(np.exp(log)[:, None], 3, 1))


class TimeDecoy(Effect):
    """A gain and an offset of each frame."""

    id = "decoy_time"
    stage = "sensor"
    title = "a gain and an offset of each frame"
    says = "no physics"
    coordinates = "frame"
    on_picture = True

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        level = float(np.median(case.pictures[case.valid])) + 1e-6
        gain = Parameter("log_gain", 0.0, -3.0, 3.0, 0.01, per="frame", spread=0.3)
        return (gain, Parameter("offset", 0.0, -10 * level, 10 * level, 0.01 * level, per="frame", spread=level))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        gain, offset = (np.asarray(values[n], np.float32)[:, None, None, None] for n in ("log_gain", "offset"))
        state.sensor.append(lambda picture: picture * np.exp(gain) + offset)


class ColourDecoy(Effect):
    """Shares of each colour channel in the others, the same everywhere."""

    id = "decoy_colour"
    stage = "sensor"
    title = "a mixing of the colour channels"
    says = "no physics"
    coordinates = "colour"
    on_picture = True
    _pairs = tuple((to, of) for to in range(3) for of in range(3) if to != of)

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # What a channel keeps of its own is left to albedos and lamps.
        return tuple(Parameter(f"share.{'rgb'[of]}.{'rgb'[to]}", 0.0, -1.0, 1.0, 0.005) for to, of in self._pairs)

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        mix = np.eye(3, dtype=np.float32)
        for to, of in self._pairs:
            mix[to, of] = values[f"share.{'rgb'[of]}.{'rgb'[to]}"]
        state.sensor.append(lambda picture: picture @ mix.T)


_DECOYS: tuple[type[Effect], ...] = (SensorDecoy, SurfaceDecoy, TimeDecoy, ColourDecoy)
# Coordinates in which a decoy of these coordinates is no rival but the effect itself, less exactly.
_OWN = {
    "sensor": {"sensor"},
    "surface": {"surface", "half vector", "lamp"},
    "frame": {"frame", "time", "lamp"},
    # No effect lives there: those of colours (lamps, fog, subsurface light) are told by where they show.
    "colour": set(),
}


@dataclass(frozen=True)
class DecoyResult:
    """How a decoy does in an effect's place.

    Attributes
    ----------
    title : str
        Of the decoy.
    gain : float
        What the effect gains over it on held-out frames, in chi-square a value.
    sigmas : float
        How surely.
    """

    title: str
    gain: float
    sigmas: float


def decoys_for(effect: Effect) -> list[Effect]:
    """Return the decoys in coordinates that are wrong for an effect."""
    return [d() for d in _DECOYS if effect.coordinates not in _OWN[d.coordinates]]


def decoy_term(case: Case, decoy: Effect, about: Context) -> Term:
    """Return a decoy as a term that does nothing yet."""
    return Term(decoy, None, decoy.prepare(case, None, about), decoy.parameters(case, None))


def _nearer(d: NDArray) -> NDArray:
    """Return differences of places on a circle of `_CELLS`."""
    return (d + _CELLS / 2) % _CELLS - _CELLS / 2
