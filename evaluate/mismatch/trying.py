"""Try one effect more: on a few frames first, where all can be tried, then on all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .case import Case, Floats, subset, with_believed
from .effect import Context, Effect, Term, shape_index
from .settle import completed
from .solve import Fit, context, derivatives, fit, held_out, predict
from .surface_map import refined_mask
from .warp import first_piece


@dataclass(frozen=True)
class Screen:
    """A model on a few frames, on which effects are tried on top of it.

    Attributes
    ----------
    total : float
        Held-out chi-square of the model itself.
    known : (K, F, H, W, 3) float32
        Derivatives by its parameters.
    """

    case: Case
    weight: Floats
    fit: Fit
    about: Context
    total: float
    known: NDArray[np.float32]

    @property
    def num_values(self) -> float:
        return float((self.weight > 0).sum())

    def tried(self, effect: Effect, target: str | None, hopeless: float) -> tuple[float, Fit] | None:
        """Return (held-out gain a value, fit) with an effect more; None where it has no place, or gains less than `hopeless`.

        `hopeless` is in chi-square of the fit, not a value.
        """
        limit = self.fit.total - hopeless
        fitted = try_effect(self.case, self.weight, self.fit, self.about, effect, target, 3, hopeless=limit, known=self.known)
        if fitted is None or fitted.iterations == 0:
            return None
        return (self.total - float(held_out(self.case, fitted).sum())) / self.num_values, fitted


def screen(case: Case, weight: Floats, terms: list[Term], most: int) -> Screen:
    """Return the model of these terms on at most so many frames."""
    frames = spread_frames(case, most)
    small = _few(case, frames) if len(frames) < case.num_frames else case
    few = weight[frames]
    fitted = fit(small, few, _carried(case, small, frames, terms), 2)
    known = derivatives(small, fitted.terms, fitted.columns, *predict(small, fitted.terms))
    return Screen(small, few, fitted, context(small, few, fitted), float(held_out(small, fitted).sum()), known)


def spread_frames(case: Case, most: int) -> NDArray[np.int64]:
    """Return frames that show as many lamps and poses as possible."""
    if case.num_frames <= most:
        return np.arange(case.num_frames)
    chosen: list[int] = []
    lit = np.zeros(case.lit.max() + 1)
    pose = np.zeros(case.pose.max() + 1)
    even = np.linspace(0, case.num_frames - 1, most).round()
    for _ in range(most):
        cost = lit[case.lit] + pose[case.pose] + 0.001 * np.abs(np.arange(case.num_frames) - even[len(chosen)])
        cost[chosen] = np.inf
        f = int(np.argmin(cost))
        chosen.append(f)
        lit[case.lit[f]] += 1
        pose[case.pose[f]] += 1
    return np.array(sorted(chosen))


def _few(case: Case, frames: NDArray) -> Case:
    small = subset(case, frames)
    return with_believed(small, tuple(_carried(case, small, frames, list(case.believed))))


def _carried(case: Case, small: Case, frames: NDArray, terms: list[Term]) -> list[Term]:
    """Return terms for a subset of the frames: what was prepared for pieces and frames is cut to them."""
    out = []
    size = case.size[0] * case.size[1]
    keep = np.isin(case.pieces.pixel // size, frames)
    new_row = np.cumsum(keep) - 1
    for t in terms:
        values = {}
        for p in t.parameters:
            v = t.values[p.name]
            if p.per == "frame":
                v = np.asarray(v)[frames]
            elif p.per == "pose":
                v = np.array([np.asarray(v)[case.pose[frames[small.pose == g][0]]] for g in range(small.pose.max() + 1)])
            values[p.name] = v
        aux = t.effect.of_frames(t.aux, frames)
        out.append(Term(t.effect, t.target, _cut(aux, keep, new_row), t.parameters, values))
    return out


def _cut(aux, keep: NDArray[np.bool_], new_row: NDArray):
    """Cut what an effect prepared to the pieces of fewer frames: arrays with one row a piece, and lists of their rows."""
    if isinstance(aux, np.ndarray) and len(aux) == len(keep):
        return aux[keep]
    if isinstance(aux, dict) and "own" not in aux:
        return {k: _cut(v, keep, new_row) for k, v in aux.items()}
    if isinstance(aux, dict):
        held = keep[aux["own"]]
        cut = {k: v[held] if isinstance(v, np.ndarray) and len(v) == len(held) else v for k, v in aux.items()}
        cut["own"] = new_row[aux["own"][held]]
        return cut
    if isinstance(aux, list) and aux and isinstance(aux[0], tuple) and isinstance(aux[0][0], np.ndarray):
        return [(new_row[r[keep[r]]], *(o[keep[r]] for o in others)) for r, *others in aux]
    return aux


def try_effect(
    case: Case, weight: Floats, base: Fit, about: Context, effect: Effect, target: str | None, iterations: int,
    guess: Term | None = None, hopeless: float = np.inf, known: NDArray[np.float32] | None = None,
) -> Fit | None:  # fmt: skip
    """Return the fit of a model with one effect more, from the best of its first guesses; None where it has no place."""
    aux = effect.prepare(case, target, about)
    if aux is False:
        return None
    parameters = effect.parameters(case, target)
    starts = effect.starts(case, target, aux)
    if guess is not None:
        # A lamp that is on in none of the few frames has no guess from them.
        whole = {p.name: guess.values[p.name] for p in parameters if p.per == "" and p.name in guess.values}
        starts = [{**s, **whole} for s in starts[:1]] if whole else starts
    best = None
    for s in starts:
        term = Term(effect, target, aux, parameters, {k: np.asarray(v, float) for k, v in s.items()})
        fitted = fit(case, weight, [*base.terms, term], 2 if len(starts) > 1 else iterations, hopeless=hopeless, known=known)
        if fitted.iterations == 0 and best is not None:
            continue
        if best is None or best.iterations == 0 or fitted.total < best.total:
            best = fitted
    if best is not None and best.iterations > 0 and len(starts) > 1:
        best = fit(case, weight, best.terms, iterations, known=known)
    if best is not None and guess is not None and effect.on_region:
        best = with_better_masks(case, weight, best)
    if best is not None and guess is not None and effect.prepares_again:
        terms = [t.copy() for t in best.terms]
        terms[-1].aux = effect.prepare(case, target, context(case, weight, best))
        again = fit(case, weight, terms, iterations)
        best = again if again.total < best.total else best
    if best is not None and guess is not None and effect.completes:
        for _ in range(3):
            again = fit(case, weight, [*best.terms[:-1], completed(case, weight, best.terms)], iterations)
            done = again.total > 0.999 * best.total
            best = again if again.total < best.total else best
            if done:
                break
    return best


def with_better_masks(case: Case, weight: Floats, fitted: Fit, rounds: int = 3) -> Fit:
    """Return the fit with the masks of its terms refined, each as long as that helps."""
    for key in [t.key for t in fitted.terms if t.effect.on_region]:
        for _ in range(rounds):
            terms = [t.copy() for t in fitted.terms]
            term, eps = next(t for t in terms if t.key == key), np.float32(0.05)
            shape, mask = shape_index(case, term.target), term.aux
            term.aux = np.where(case.pieces.shape == shape, mask - np.sign(mask - 0.5) * eps, 0).astype(np.float32)
            step = np.where(mask > 0.5, -eps, eps)
            changed = predict(case, terms)[2]
            # A pixel is mostly one piece: that piece's step is the pixel's.
            by = step[first_piece(case)].reshape(*case.valid.shape, 1)
            derivative = ((changed - fitted.picture) / by).astype(np.float32)
            term.aux = refined_mask(case, shape, mask, context(case, weight, fitted), derivative)
            better = fit(case, weight, terms, 4)
            done = better.total > 0.999 * fitted.total
            fitted = better if better.total < fitted.total else fitted
            if done:
                break
    return fitted
