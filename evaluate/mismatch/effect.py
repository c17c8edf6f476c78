"""An effect: one piece of physics that a simulation may have left out, and how it changes the picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from scene.simulation import Simulation, Texture

from .case import Case, Floats
from .formation import State

STAGES = ("light", "surface", "geometry", "transport", "medium", "lens", "sensor")
# Values of parameters by name: a number, or one per frame (F,).
Values = Mapping[str, Any]


@dataclass(frozen=True)
class Parameter:
    """A number to be fitted.

    Attributes
    ----------
    name, unit : str
    start, low, high : float
        First guess and bounds.
    step : float
        For finite differences; about the change that the data could just show.
    per : str
        "" one for the recording; "frame" or "pose": one for each frame, or for each set of frames with equal pose.
    spread : float
        Standard deviation of what is thought likely about `start`, where the data leave the number open (two lamps
        brighter, or two exposures longer); infinite: no opinion.
    """

    name: str
    start: float
    low: float
    high: float
    step: float
    unit: str = "1"
    per: str = ""
    spread: float = np.inf


@dataclass(frozen=True)
class Context:
    """What is known when an effect is tried.

    Attributes
    ----------
    picture : (F, H, W, 3) float32
        What the model so far predicts.
    state : State
        Of that model.
    weight : (F, H, W, 3) float32
        1 / variance of the residual; 0 where nothing was measured, and in frames that are held out.
    """

    picture: Floats
    state: State
    weight: Floats
    residual: Floats

    @property
    def z(self) -> Floats:
        """Residual in units of noise."""
        return self.residual * np.sqrt(self.weight)


class Effect:
    """One piece of physics. A subclass says what it is and does in class attributes and `change`.

    Attributes
    ----------
    id : str
    stage : str
        One of `STAGES`: effects act in this order.
    says : str
        What the report prints: where its residual stands still, and how it looks.
    title : str
        In a few words, for a sentence: "light bounced between surfaces".
    taken_for : tuple of str
        Ids that explain about the same pictures.
    decides : str
        The experiment that would tell it from those.
    coordinates : str
        In which coordinates its residual stands still: sensor, surface, frame, lamp, depth, radiance or time.
    on_picture : bool
        Whether it acts on finished pictures only: then nothing needs to be shaded anew.
    settles : bool
        Whether it moves lamps, cameras or bodies: what the pixels see is then traced anew once it has been found.
    on_region : bool
        Whether `aux` is a mask (N,) of the pieces, which is refined once the parameters are fitted.
    prepares_again : bool
        Whether `prepare` depends on the state, so that it is done again once the model has been fitted.
    completes : bool
        Whether `completed` finds more than `prepare` could, once the effect has been fitted.
    of_own_frame : bool
        Whether what `prepare` finds is a frame's own (drops in one photograph): held-out frames keep it, and say so.
    approximation : float
        By which share of its amplitude what it predicts may be wrong: so much of it may be left over without being taken
        for another effect.
    on_patch : bool
        Whether it changes nothing but the surface's row of parameters, so that it can be tested on a BRDF without pictures.
    """

    id: ClassVar[str]
    stage: ClassVar[str]
    title: ClassVar[str]
    says: ClassVar[str]
    taken_for: ClassVar[tuple[str, ...]] = ()
    decides: ClassVar[str] = ""
    coordinates: ClassVar[str] = "surface"
    on_picture: ClassVar[bool] = False
    settles: ClassVar[bool] = False
    on_region: ClassVar[bool] = False
    prepares_again: ClassVar[bool] = False
    completes: ClassVar[bool] = False
    of_own_frame: ClassVar[bool] = False
    approximation: ClassVar[float] = 0.015
    on_patch: ClassVar[bool] = False

    def targets(self, case: Case) -> list[str | None]:
        """Return what the effect may belong to (names of shapes or lights), [None] if to everything, [] if to nothing here."""
        return [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        """Return what is to be fitted."""
        return ()

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return what `change` needs besides the parameters, found once before the fit; False: nothing of it is to be seen."""
        return None

    def completed(self, case: Case, target: str | None, aux: Any, values: Values, without: Context) -> Any:
        """Return what `prepare` gave, with what can be found only by someone who knows how the effect looks.

        `values` are of the fit with what was prepared, `without` is that fit without the effect.
        """
        return aux

    def of_frames(self, aux: Any, frames: NDArray[np.int64]) -> Any:
        """Return what `prepare` gave cut to some frames; arrays with a row a piece are cut by the caller."""
        return aux

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        """Return first guesses that replace those of the parameters; the fit goes on from the best."""
        return [{}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        """Change the supposed world."""
        raise NotImplementedError

    def corrected(self, case: Case, simulation: Simulation, values: Values, target: str | None, aux: Any) -> Simulation | None:
        """Return the simulation with the effect in its fields; None where they do not hold it: then `effects` does."""
        return None

    def stored(self, case: Case, target: str | None, aux: Any) -> Texture | None:
        """Return the map, (H, W) or (H, W, C), that is stored with the effect, if it needs one besides its parameters."""
        return None

    def restored(self, case: Case, target: str | None, context: Context, field: Texture | None) -> Any:
        """Return what `prepare` gave when the effect was found, from the map that was stored."""
        return self.prepare(case, target, context)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        """Return further figures for the report, by name."""
        return {}


@dataclass
class Term:
    """An effect in a model: with its target, what it prepared, and the values of its parameters.

    `values` has one number a parameter, or an array (groups,) for those per frame or pose.
    """

    effect: Effect
    target: str | None
    aux: Any
    parameters: tuple[Parameter, ...]
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str | None]:
        return self.effect.id, self.target

    def copy(self) -> Term:
        return Term(self.effect, self.target, self.aux, self.parameters, {k: np.copy(v) for k, v in self.values.items()})


def shape_index(case: Case, name: str | None) -> int:
    """Return the index of a shape."""
    assert name is not None
    return case.shape_names.index(name)


def shapes_seen(case: Case, least: float = 0.002) -> list[str]:
    """Return the shapes that fill at least this share of all pixels."""
    p = case.pieces
    seen = np.bincount(p.shape[p.shape >= 0], p.weight[p.shape >= 0], len(case.shape_names))
    return [name for name, area in zip(case.shape_names, seen, strict=True) if area > least * (len(p.start) - 1)]


def groups(case: Case, per: str) -> NDArray[np.int64]:
    """Return the group of each frame (F,) for parameters per frame or per pose."""
    return np.arange(case.num_frames) if per == "frame" else case.pose
