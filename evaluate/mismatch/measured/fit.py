"""Least squares of a sum of columns: scales per channel in closed form, the few parameters that bend the columns by search."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..effect import Parameter
from .samples import Samples

Floats = NDArray[np.float64]
_RIDGE = 1e-10
_ROUNDS = 3


@dataclass(frozen=True)
class Columns:
    """What a prediction is made of.

    Attributes
    ----------
    arrays : list of (N, 1) or (N, C) float64
    names : list of str
        Of the scale of each column, "effect.parameter"; "free.albedo" for what was believed.
    scales : list of (C,) float64 or None
        Known scale per channel; None: to be found.
    signed : bool
        Whether scales that are to be found may be negative.
    """

    arrays: list[Floats]
    names: list[str]
    scales: list[Floats | None]
    signed: bool = False


class World(Protocol):
    """What kind of thing was measured, and how effects change it."""

    samples: Samples

    def parameters(self, ids: tuple[str, ...]) -> list[tuple[str, Parameter]]:
        """Return the parameters that bend columns, by key "effect.parameter"."""
        ...

    def columns(self, ids: tuple[str, ...], values: dict[str, float]) -> Columns:
        """Return the columns of a model."""
        ...

    def reported(self, id: str, values: dict[str, float]) -> dict[str, tuple[float, str]]:
        """Return the numbers (value, unit) of an effect that a report has, by name; those of scales are added to them."""
        ...


@dataclass
class Fit:
    """A model with its parameters.

    Attributes
    ----------
    values : dict
        By key: parameters that bend columns.
    scales : dict
        By key (C,): scales of columns that were found.
    prediction : (N, C) float64
        Of all samples, whichever it was fitted to.
    chi2 : float
        Over the samples it was fitted to.
    """

    ids: tuple[str, ...]
    values: dict[str, float]
    scales: dict[str, Floats]
    prediction: Floats
    chi2: float
    parameters: list[tuple[str, Parameter]] = field(default_factory=list)

    @property
    def num_free(self) -> int:
        return len(self.values) + sum(len(s) for s in self.scales.values())


def fit(world: World, ids: tuple[str, ...], use: NDArray[np.bool_], starts: list[dict[str, float]], most: int = 150) -> Fit:
    """Fit a model to some samples, from the best of some first guesses.

    Parameters
    ----------
    use : (N,) bool
    starts : list of dict
        Values by key; what they leave out starts where its parameter says.
    most : int
        Evaluations per start.
    """
    import nlopt

    parameters = world.parameters(ids)
    s = world.samples

    def solve(values: dict[str, float]) -> tuple[float, Floats, Columns]:
        columns = world.columns(ids, values)
        scales = fitted_scales(columns, s, use)
        return float((s.z(combined(columns, scales))[use] ** 2).sum()), scales, columns

    best: tuple[float, dict[str, float]] | None = None
    for start in starts or [{}]:
        values = {key: float(np.clip(start.get(key, p.start), p.low, p.high)) for key, p in parameters}
        # What a first guess chooses that is no number, such as one of several formulas, stays as it is.
        chosen = {key: v for key, v in start.items() if key not in values and key.split(".")[0] in ids}
        if parameters:
            search = nlopt.opt(nlopt.LN_BOBYQA, len(parameters))
            search.set_min_objective(lambda x, _, chosen=chosen: solve(_values(x, parameters) | chosen)[0])
            search.set_lower_bounds(np.zeros(len(parameters)))
            search.set_upper_bounds(np.ones(len(parameters)))
            search.set_initial_step(0.08)
            search.set_xtol_abs(1e-4)
            search.set_ftol_rel(1e-7)
            search.set_maxeval(most)
            values = _values(search.optimize(_unit(values, parameters)), parameters)
        values |= chosen
        chi2 = solve(values)[0]
        if best is None or chi2 < best[0]:
            best = chi2, values
    assert best is not None
    chi2, scales, columns = solve(best[1])
    found = {n: s for n, known, s in zip(columns.names, columns.scales, scales) if known is None}
    return Fit(ids, best[1], found, combined(columns, scales), chi2, parameters)


def fitted_scales(columns: Columns, s: Samples, use: NDArray[np.bool_]) -> Floats:
    """Return the scale of each column (K, C), fitted to some samples.

    Noise goes with the prediction, so the fit is done again with what it predicts; as this finds the nearest minimum only,
    it starts from noise that goes with the values, with their root, and not at all, and the best is taken per channel.
    """
    if s.slope == 0 or all(known is not None for known in columns.scales):
        return solve_scales(columns, s.value, use[:, None] / s.sigma**2)
    best, least = np.empty(0), np.empty(0)
    level = np.sqrt((s.sigma**2).mean(axis=0))
    for first in (s.sigma, np.sqrt(s.sigma * level), np.broadcast_to(level, s.sigma.shape)):
        scales = solve_scales(columns, s.value, use[:, None] / first**2)
        for _ in range(_ROUNDS - 1):
            sigma = s.sigma_at(combined(columns, scales))
            scales = solve_scales(columns, s.value, use[:, None] / sigma**2)
        chi2 = (s.z(combined(columns, scales))[use] ** 2).sum(axis=0)
        if not best.size:
            best, least = scales, chi2
        best, least = np.where(chi2 < least, scales, best), np.minimum(chi2, least)
    return best


def solve_scales(columns: Columns, value: Floats, weight: Floats) -> Floats:
    """Return the scale of each column per channel (K, C), least squares; at least 0 unless the columns are signed."""
    num_channels = value.shape[1]
    out = np.zeros((len(columns.arrays), num_channels))
    free = [k for k, known in enumerate(columns.scales) if known is None]
    rest = value.copy()
    for k, known in enumerate(columns.scales):
        if known is not None:
            out[k] = known
            rest -= columns.arrays[k] * known
    if not free:
        return out
    A = np.stack([np.broadcast_to(columns.arrays[k], value.shape) for k in free])
    wA = (weight * A).transpose(2, 0, 1)
    gram = wA @ A.transpose(2, 1, 0)
    right = (wA @ rest.T[:, :, None])[..., 0]
    # Columns of unlike size, such as a lobe and a constant, are brought to one.
    size = np.sqrt(np.maximum(np.einsum("ckk->ck", gram), 1e-300))
    gram, right = gram / size[:, :, None] / size[:, None, :], right / size
    out[free] = (_signed(gram, right) if columns.signed else _non_negative(gram, right)).T / size.T
    return out


def combined(columns: Columns, scales: Floats) -> Floats:
    """Return the sum of scaled columns (N, C)."""
    return np.asarray(sum(a * s for a, s in zip(columns.arrays, scales)), np.float64)


def _signed(gram: Floats, right: Floats) -> Floats:
    return np.asarray(np.linalg.solve(gram + _RIDGE * np.eye(gram.shape[1]), right[..., None])[..., 0], np.float64)


def _non_negative(gram: Floats, right: Floats) -> Floats:
    """Return the minimum over x >= 0 of x gram x / 2 - right x, per channel: the best of all choices of what is not 0."""
    best, least = np.zeros_like(right), np.zeros(len(right))
    num = gram.shape[1]
    whole = _signed(gram, right)
    if (whole >= 0).all():  # nothing can be better, as the misfit is convex
        return whole
    for size in range(1, num + 1):
        for chosen in combinations(range(num), size):
            x = _signed(gram[:, chosen][:, :, chosen], right[:, chosen])
            value = -0.5 * (x * right[:, chosen]).sum(axis=1)
            better = (x >= 0).all(axis=1) & (value < least)
            least = np.where(better, value, least)
            full = np.zeros_like(right)
            full[:, chosen] = x
            best = np.where(better[:, None], full, best)
    return best


def _is_log(p: Parameter) -> bool:
    return p.low > 0 and p.high / p.low > 8


def _values(x: NDArray, parameters: list[tuple[str, Parameter]]) -> dict[str, float]:
    out = {}
    for t, (key, p) in zip(np.clip(x, 0, 1), parameters):
        out[key] = float(p.low * (p.high / p.low) ** t if _is_log(p) else p.low + t * (p.high - p.low))
    return out


def _unit(values: dict[str, float], parameters: list[tuple[str, Parameter]]) -> Floats:
    out = []
    for key, p in parameters:
        v = values[key]
        out.append(np.log(v / p.low) / np.log(p.high / p.low) if _is_log(p) else (v - p.low) / (p.high - p.low))
    return np.clip(np.array(out), 0.0, 1.0)
