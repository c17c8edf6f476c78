"""Fit a model of effects to a recording: Levenberg-Marquardt on the weighted residual, and what it would predict unseen.

Derivatives are finite differences. Parameters per frame or pose do not meet in any pixel: one difference serves them all.
K. Levenberg (1944), D. Marquardt (1963); the weighting of bounds by clipping follows C. Kanzow et al. (2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .case import Case, Floats
from .effect import STAGES, Context, Parameter, Term, groups
from .formation import State, believed, develop, radiance

# Two halves of a frame in tiles of so many pixels: what belongs to one frame alone is fitted on one and judged on the other.
_TILE = 16
# A parameter of which other blocks know less than this share belongs to its block alone.
_OTHERS = 0.02
# Curvatures are sums of products of single floats: directions with less than this share of the largest are rounding.
_PARTED = 1e-6


@dataclass
class Fit:
    """A model that has been fitted.

    Attributes
    ----------
    terms : list of Term
        With fitted values; the believed model's own free parameters come first.
    picture : (F, H, W, 3) float32
        What it predicts.
    chi2 : (F, 2) float64
        Weighted squared residual of each frame, in two halves.
    gradient, curvature : (F, 2, K), (F, 2, K, K)
        Of the residual in the columns of the parameters (one column for all groups of a parameter per frame).
    columns : list of (term, parameter)
    """

    terms: list[Term]
    picture: Floats
    state: State
    chi2: NDArray[np.float64]
    gradient: NDArray[np.float64]
    curvature: NDArray[np.float64]
    columns: list[tuple[Term, Parameter]]
    iterations: int = 0

    @property
    def total(self) -> float:
        return float(self.chi2.sum())


def predict(
    case: Case, terms: list[Term], base: tuple[State, Floats] | None = None, kept_visible: Floats | None = None
) -> tuple[State, Floats, Floats]:
    """Return (state, radiance, picture) of a model; with `base` = (state, radiance) only what is done to pictures is redone."""
    ordered = sorted([*case.believed, *terms], key=lambda t: STAGES.index(t.effect.stage))
    if base is None:
        state = _start(case).copy()
        state.kept_visible = kept_visible
        for term in ordered:
            term.effect.change(case, state, by_frame(case, term), term.target, term.aux)
        light = radiance(case, state)
    else:
        state, light = base[0].copy(), base[1]
        state.lens, state.sensor = [], []
        for term in ordered:
            if term.effect.on_picture:
                term.effect.change(case, state, by_frame(case, term), term.target, term.aux)
    return state, light, develop(state, light)


def _start(case: Case) -> State:
    if "believed" not in case.cache:
        case.cache["believed"] = believed(case)
    return case.cache["believed"]


def by_frame(case: Case, term: Term) -> dict[str, Any]:
    """Return the values with those of groups spread over frames (F,)."""
    out = {}
    for p in term.parameters:
        value = term.values[p.name]
        out[p.name] = float(value) if p.per == "" else np.asarray(value)[groups(case, p.per)]
    return out


def fit(
    case: Case, weight: Floats, terms: list[Term], iterations: int = 12, tolerance: float = 1e-4, hopeless: float = np.inf,
    known: NDArray[np.float32] | None = None,
) -> Fit:  # fmt: skip
    """Fit all parameters of all terms, from the values that they have.

    Parameters
    ----------
    weight : (F, H, W, 3) float32
        1 / variance, 0 for what is not to be used.
    tolerance : float
        Stop when a step lowers chi-square by less than this share, and by less than one unit a parameter.
    hopeless : float
        Stop at once if even three times the first step's expected gain does not bring chi-square below this.
    known : (K, F, H, W, 3) float32, optional
        Derivatives by the first K parameters, near enough for a first trial: only the others are differentiated, and at the
        end those of the last step are used again.
    """
    terms = [t.copy() for t in terms]
    for t in terms:
        for p in t.parameters:
            if p.name not in t.values:
                t.values[p.name] = np.float64(p.start) if p.per == "" else np.full(groups(case, p.per).max() + 1, p.start)
    columns = [(t, p) for t in terms for p in t.parameters]
    unknowns = _Unknowns(case, columns)
    state, light, picture = predict(case, terms)
    chi2 = _chi2(case, weight, picture)
    gradient, curvature = np.zeros((case.num_frames, 2, 0)), np.zeros((case.num_frames, 2, 0, 0))
    damping, done, gain = 1e-3, 0, 0.0
    jacobian: NDArray[np.float32] | None = None
    for done in range(iterations):
        if not columns:
            break
        if known is None:
            # How the picture goes with the free parameters hardly changes on the way: far from the end their derivatives stay.
            old = jacobian[: _num_free(terms)] if jacobian is not None and gain > 0.01 * chi2.sum() else None
            jacobian = derivatives(case, terms, columns, state, light, picture, old)
        else:
            jacobian = derivatives(case, terms, columns, state, light, picture, known)
        gradient, curvature = _normal_equations(case, weight, jacobian, picture)
        H, g = unknowns.assemble(gradient.sum(axis=1), curvature.sum(axis=1))
        improved = False
        if done == 0 and np.isfinite(hopeless):
            step = np.linalg.lstsq(H + 1e-9 * np.eye(len(H)) * np.trace(H), g, rcond=None)[0]
            if chi2.sum() - 3 * max(2 * g @ step - step @ H @ step, 0) > hopeless:
                return Fit(terms, picture, state, chi2, gradient, curvature, columns, 0)
        for _ in range(7):
            # A clip above all values changes nothing: then there is no curvature at all.
            ridge = 1e-12 * np.eye(len(H)) * (np.trace(H) or 1.0)
            step = np.linalg.solve(H + damping * np.diag(np.diag(H)) + ridge, g)
            if 2 * g @ step - step @ H @ step < max(tolerance * chi2.sum(), 0.5 * len(H)):
                break
            before = [t.copy() for t in terms]
            moved = unknowns.move(step)
            new_state, new_light, new_picture = predict(case, terms)
            new_chi2 = _chi2(case, weight, new_picture)
            gain = chi2.sum() + unknowns.prior(before) - new_chi2.sum() - unknowns.prior(terms)
            if np.isfinite(gain) and gain > 0:
                state, light, picture, chi2 = new_state, new_light, new_picture, new_chi2
                damping, improved = max(damping / 5, 1e-9), True
                break
            for t, kept in zip(terms, before, strict=True):
                t.values = kept.values
            damping = max(10 * damping, 1e-3)
            if not moved:
                break
        if not improved or gain < max(tolerance * chi2.sum(), len(H)):
            break
    if columns:
        # The residual has moved on since the last derivatives were taken; its gradient has to be that of the end.
        if known is None or jacobian is None:
            jacobian = derivatives(case, terms, columns, state, light, picture, known)
        gradient, curvature = _normal_equations(case, weight, jacobian, picture)
    return Fit(terms, picture, state, chi2, gradient, curvature, columns, done + 1)


def context(case: Case, weight: Floats, fitted: Fit) -> Context:
    """Return what a further effect needs to know of a fit."""
    return Context(fitted.picture, fitted.state, weight, case.pictures - fitted.picture)


def held_out(case: Case, fitted: Fit) -> NDArray[np.float64]:
    """Return chi-square of each frame (F,) as predicted by the fit without that frame's block.

    A Newton step from the full fit, without the block's share of gradient and curvature, is the fit without it to second
    order; on the block, the quadratic form says what that costs. Parameters of the block's own frames cannot be had from
    others: they are fitted on one half of its tiles and judged on the other.
    """
    unknowns = _Unknowns(case, fitted.columns)
    if not fitted.columns:
        return fitted.chi2.sum(axis=1)
    out = np.zeros(case.num_frames)
    every = np.ones((case.num_frames, 2))
    whole, _ = unknowns.assemble(fitted.gradient.sum(axis=1), fitted.curvature.sum(axis=1))
    for block in np.unique(case.block):
        frames = np.flatnonzero(case.block == block)
        rest, _ = unknowns.assemble(*(a.sum(axis=1) * _without(case, frames, a.ndim) for a in (fitted.gradient, fitted.curvature)))
        # A lamp that is on in this block alone belongs to it as well.
        own = unknowns.has_local or bool(np.any(np.diag(rest) < _OTHERS * np.diag(whole)))
        for half in (0, 1) if own else (None,):
            use = every.copy()
            use[np.ix_(frames, np.array([0, 1] if half is None else [half]))] = 0
            H, g = unknowns.assemble(
                np.einsum("fh,fhk->fk", use, fitted.gradient), np.einsum("fh,fhkl->fkl", use, fitted.curvature)
            )
            step = unknowns.within_bounds(H, g)
            for f in frames:
                d = unknowns.of_frame(step, int(f))
                for h in (0, 1) if half is None else (half,):
                    out[f] += fitted.chi2[f, h] - 2 * d @ fitted.gradient[f, h] + d @ fitted.curvature[f, h] @ d
    return out


def _without(case: Case, frames: NDArray[np.int64], ndim: int) -> NDArray[np.float64]:
    """Return 0 for some of the frames and 1 for the others, to be multiplied with sums over the halves of an array of `ndim`."""
    return np.where(np.isin(np.arange(case.num_frames), frames), 0.0, 1.0).reshape(-1, *[1] * (ndim - 2))


def covariance(case: Case, fitted: Fit, inflation: float = 1.0) -> dict[tuple[str, str | None, str], NDArray[np.float64]]:
    """Return the standard deviation of each parameter, by (id, target, name); an array for those per group.

    Noise alone would make the intervals too short where the model is not perfect: the curvature is combined with the
    scatter of the gradient over blocks (the sandwich of P. Huber, 1967), and the larger of both is taken.
    """
    unknowns = _Unknowns(case, fitted.columns)
    if not fitted.columns:
        return {}
    H, _ = unknowns.assemble(fitted.gradient.sum(axis=1), fitted.curvature.sum(axis=1))
    inverse = np.linalg.pinv(H, rcond=1e-12, hermitian=True)
    blocks = []
    for b in np.unique(case.block):
        use = (case.block == b)[:, None]
        _, g = unknowns.assemble(fitted.gradient.sum(axis=1) * use, fitted.curvature.sum(axis=1) * use[..., None], prior=False)
        blocks.append(g)
    G = np.array(blocks)
    n = len(G)
    meat = (G - G.mean(axis=0)).T @ (G - G.mean(axis=0)) * (n / max(n - 1, 1))
    variance = np.maximum(np.diag(inverse) * inflation, np.diag(inverse @ meat @ inverse) if n > 2 else 0)
    sigma = np.sqrt(np.maximum(variance, 0))
    return {(t.effect.id, t.target, p.name): sigma[unknowns.index[k]] for k, (t, p) in enumerate(fitted.columns)}


class _Unknowns:
    """The vector of all unknowns: a column has one, or one a group of frames."""

    def __init__(self, case: Case, columns: list[tuple[Term, Parameter]]) -> None:
        self.case, self.columns = case, columns
        self.group = [groups(case, p.per) if p.per else np.zeros(case.num_frames, np.int64) for _, p in columns]
        self.index, total = [], 0
        for g in self.group:
            count = int(g.max()) + 1
            self.index.append(np.arange(total, total + count))
            total += count
        self.total = total
        self.has_local = any(p.per for _, p in columns)
        # (F, K): the unknown that a column stands for in a frame.
        self.rows = np.array([index[g] for index, g in zip(self.index, self.group)]).T.reshape(case.num_frames, len(columns))

    def assemble(self, gradient: NDArray, curvature: NDArray, prior: bool = True) -> tuple[NDArray, NDArray]:
        """Return curvature (U, U) and gradient (U,) of all unknowns from those of frames (F, K, K), (F, K)."""
        H, g = np.zeros((self.total, self.total)), np.zeros(self.total)
        for f in range(self.case.num_frames):
            rows = self.rows[f]
            g[rows] += gradient[f]
            H[np.ix_(rows, rows)] += curvature[f]
        if prior:
            for index, (t, p) in zip(self.index, self.columns):
                if np.isfinite(p.spread):
                    H[index, index] += 1 / p.spread**2
                    g[index] += (p.start - np.atleast_1d(t.values[p.name])) / p.spread**2
        return H, g

    def prior(self, terms: list[Term]) -> float:
        """Return what the parameters' distance from what is likely adds to chi-square."""
        total = 0.0
        for t in terms:
            for p in t.parameters:
                if np.isfinite(p.spread):
                    total += float(np.sum((np.atleast_1d(t.values[p.name]) - p.start) ** 2)) / p.spread**2
        return total

    def move(self, step: NDArray) -> bool:
        """Add a step to the values of the terms, within bounds; return whether anything moved."""
        moved = False
        for index, (t, p) in zip(self.index, self.columns):
            old = np.atleast_1d(t.values[p.name])
            new = np.clip(old + step[index], p.low, p.high)
            moved = moved or bool(np.any(new != old))
            t.values[p.name] = np.float64(new[0]) if p.per == "" else new
        return moved

    def within_bounds(self, H: NDArray, g: NDArray) -> NDArray[np.float64]:
        """Return the Newton step (U,) from the values, where what is at a bound and drawn beyond it stays there."""
        value, low, high = np.zeros(self.total), np.zeros(self.total), np.zeros(self.total)
        for index, (t, p) in zip(self.index, self.columns):
            value[index], low[index], high[index] = np.atleast_1d(t.values[p.name]), p.low, p.high
        edge = 1e-9 * np.abs(high - low)
        free = ~(((value <= low + edge) & (g < 0)) | ((value >= high - edge) & (g > 0)))
        # In units in which all parameters count alike; what single floats cannot part stays where it is.
        unit = free / np.sqrt(np.maximum(np.diag(H), 1e-300))
        step = unit * np.linalg.lstsq(H * np.outer(unit, unit), g * unit, rcond=_PARTED)[0]
        return np.clip(step, low - value, high - value)

    def of_frame(self, step: NDArray, frame: int) -> NDArray:
        return step[self.rows[frame]]


def _num_free(terms: list[Term]) -> int:
    """Return how many parameters the believed model has; they come first."""
    return sum(len(t.parameters) for t in terms if t.effect.id == "free")


def derivatives(
    case: Case, terms: list[Term], columns: list[tuple[Term, Parameter]], state: State, light: Floats, picture: Floats,
    known: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:  # fmt: skip
    """Return the derivatives of the picture by the columns (K, F, H, W, 3), of which the first may be known."""
    out = np.empty((len(columns), *picture.shape), np.float32)
    for k, (t, p) in enumerate(columns):
        if known is not None and k < len(known):
            out[k] = known[k]
            continue
        kept = t.values[p.name]
        # Towards the inside where a bound is near.
        sign = np.where(np.asarray(kept) + p.step > p.high, -1.0, 1.0)
        t.values[p.name] = kept + sign * p.step
        base = (state, light) if t.effect.on_picture else None
        changed = predict(case, terms, base, state.visible)[2]
        t.values[p.name] = kept
        by = sign * p.step if p.per == "" else (sign * p.step)[groups(case, p.per)][:, None, None, None]
        out[k] = (changed - picture) / np.float32(by) if p.per == "" else (changed - picture) / by
    return out


def halves(case: Case) -> NDArray[np.bool_]:
    """Return the first half (H, W) of every frame: each other tile."""
    height, width = case.size
    row, col = np.mgrid[:height, :width] // _TILE
    return (row + col) % 2 == 0


def _chi2(case: Case, weight: Floats, picture: Floats) -> NDArray[np.float64]:
    square = weight * (case.pictures - picture) ** 2
    first = halves(case)
    each = square.sum(axis=3, dtype=np.float64)
    one = (each * first).sum(axis=(1, 2))
    return np.stack([one, each.sum(axis=(1, 2)) - one], axis=1)


def _normal_equations(
    case: Case, weight: Floats, jacobian: NDArray[np.float32], picture: Floats
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    first = halves(case)
    K = len(jacobian)
    root = np.sqrt(weight)
    z = root * (case.pictures - picture)
    gradient, curvature = np.zeros((case.num_frames, 2, K)), np.zeros((case.num_frames, 2, K, K))
    flat = np.repeat(first.ravel(), 3).astype(np.float32)
    for f in range(case.num_frames):
        A = (jacobian[:, f] * root[f]).reshape(K, -1)
        r = z[f].ravel()
        # The other half is what remains of the whole: products are cheaper than picking pixels out.
        half = A * flat
        curvature[f, 0], gradient[f, 0] = half @ A.T, half @ r
        curvature[f, 1], gradient[f, 1] = A @ A.T - curvature[f, 0], A @ r - gradient[f, 0]
    return gradient, curvature
