"""Models judged on blocks that they were not fitted to, beside flexible functions that are no physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks import surely
from .fit import Columns, Fit, World, combined, fit, fitted_scales
from .samples import Samples

Floats = NDArray[np.float64]
_FOLD_STEPS = 60
_KNOTS_DEG = (0.0, 2.0, 5.0, 10.0, 18.0, 30.0, 50.0, 90.0)


@dataclass
class Model:
    """A fit to all samples, and fits without each block.

    Attributes
    ----------
    folds : list of Fit
        One a block, that never saw it; where there is one block only, the fit to all.
    score : (B,) float64
        Held-out chi-square of each block.
    unseen : (N, C) float64
        What the folds predict of the blocks that they did not see.
    """

    world: World
    fit: Fit
    folds: list[Fit]
    score: Floats
    unseen: Floats

    @property
    def ids(self) -> tuple[str, ...]:
        return self.fit.ids

    @property
    def total(self) -> float:
        return float(self.score.sum())

    @property
    def per_value(self) -> float:
        """Held-out chi-square a value."""
        return self.total / self.world.samples.value.size

    @property
    def excess(self) -> float:
        return self.per_value - 1

    @property
    def z(self) -> Floats:
        """Held-out residual in units of noise (N, C)."""
        return self.world.samples.z(self.unseen)


@dataclass(frozen=True)
class Decoy:
    """A flexible function that stands for no physics, added to a model.

    Attributes
    ----------
    coordinate : str
        What it is a function of.
    score : (B,) float64
        Held-out chi-square of each block.
    unseen : (N, C) float64
    """

    name: str
    coordinate: str
    score: Floats
    unseen: Floats

    @property
    def total(self) -> float:
        return float(self.score.sum())


def assess(world: World, ids: tuple[str, ...], starts: list[dict[str, float]]) -> Model:
    """Fit a model to all samples, and without each block."""
    s = world.samples
    whole = fit(world, ids, np.ones(len(s.value), bool), starts)
    return without_blocks(world, whole)


def without_blocks(world: World, whole: Fit) -> Model:
    """Return a fit with those that leave out one block each."""
    s = world.samples
    blocks = np.unique(s.block)
    if len(blocks) < 2:
        folds = [whole]
    else:
        folds = [fit(world, whole.ids, s.block != b, [whole.values], _FOLD_STEPS) for b in blocks]
    unseen = stitched(s, [f.prediction for f in folds])
    return Model(world, whole, folds, block_score(s, unseen), unseen)


def stitched(s: Samples, predictions: list[Floats]) -> Floats:
    """Return of each block what the fit predicts that did not see it."""
    out = np.empty_like(s.value)
    for b, prediction in zip(np.unique(s.block), predictions if len(predictions) > 1 else predictions * 8, strict=False):
        out[s.block == b] = prediction[s.block == b]
    return out


def block_score(s: Samples, unseen: Floats) -> Floats:
    """Return chi-square of each block (B,)."""
    each = (s.z(unseen) ** 2).sum(axis=1)
    return np.array([each[s.block == b].sum() for b in np.unique(s.block)])


def gain_over(before: Model | Decoy, after: Model | Decoy, s: Samples) -> tuple[float, float]:
    """Return (gain in held-out chi-square a value, standard errors) of one model over another."""
    change = np.abs(after.unseen - before.unseen) / s.sigma_at(after.unseen)
    blocks = np.unique(s.block)
    square = np.array([(change[s.block == b] ** 2).sum() for b in blocks])
    size = np.array([change[s.block == b].sum() for b in blocks])
    gain, sigmas = surely(before.score - after.score, square, size, blocks, 1.0)
    return gain / s.value.size, sigmas


def decoys(model: Model) -> list[Decoy]:
    """Return what smooth functions without physics, on top of a model, do on blocks that they were not fitted to."""
    s = model.world.samples
    kinds = _of_directions(s) if s.kind == "directions" else _of_conditions(s)
    out = []
    for name, coordinate, extra in kinds:
        predictions = []
        for b, fold in zip(np.unique(s.block), model.folds, strict=len(model.folds) > 1):
            use = s.block != b if len(model.folds) > 1 else np.ones(len(s.block), bool)
            more = extra(fold.prediction)
            columns = Columns(
                [fold.prediction, *more], [""] * (1 + len(more)), [np.ones(s.value.shape[1]), *[None] * len(more)], True
            )
            scales = fitted_scales(columns, s, use)
            predictions.append(combined(columns, scales))
        unseen = stitched(s, predictions)
        out.append(Decoy(name, coordinate, block_score(s, unseen), unseen))
    return out


Extra = Callable[[Floats], list[Floats]]


def _of_directions(s: Samples) -> list[tuple[str, str, Extra]]:
    t = {name: (angle / 90.0)[:, None] for name, angle in s.coordinates.items()}
    incidence, viewing = t["incidence angle"], t["viewing angle"]
    half = hats(s.coordinates["half angle"])
    difference = hats(s.coordinates["difference angle"])
    return [
        ("a gain over the incidence angle", "incidence angle", lambda p: [p * incidence, p * incidence**2]),
        ("a gain over the viewing angle", "viewing angle", lambda p: [p * viewing, p * viewing**2, p * viewing**3]),
        ("an offset over the viewing angle", "viewing angle", lambda _: [viewing**k for k in range(4)]),
        ("any lobe over the half angle", "half angle", lambda _: half),
        ("any gain over the difference angle", "difference angle", lambda p: [p * h for h in difference]),
    ]


def _of_conditions(s: Samples) -> list[tuple[str, str, Extra]]:
    assert s.condition is not None
    m = ((s.condition - s.condition.mean()) / max(float(np.ptp(s.condition)), 1e-12))[:, None]
    return [
        ("another spectrum at all levels", "wavelength", lambda p: [p]),
        (f"any gain quadratic in {s.condition_name}", s.condition_name, lambda p: [p, p * m, p * m**2]),
    ]


def hats(angle_deg: Floats) -> list[Floats]:
    """Return hat functions (N, 1) over an angle; those that no sample reaches are left out."""
    knots = np.array(_KNOTS_DEG)
    out = [np.interp(angle_deg, knots, row)[:, None] for row in np.eye(len(knots))]
    return [h for h in out if (h > 0.1).sum() > 3]
