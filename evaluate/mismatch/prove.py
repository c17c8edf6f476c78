"""What a model predicts of frames that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .attribute import Model
from .calibrate import weigh
from .case import Case, Floats
from .settle import prepared
from .solve import fit, halves, predict
from .trying import with_better_masks

_SHARE = 0.25


@dataclass(frozen=True)
class HeldOut:
    """Figures on held-out blocks, of fits that never saw them.

    Attributes
    ----------
    frames : list of int
    chi2_before, chi2_after : float
        Per pixel and channel.
    rmse_before, rmse_after : float
        In the recording's linear units.
    views, lights, blocks : int
        How many there are in all.
    """

    frames: list[int]
    chi2_before: float
    chi2_after: float
    rmse_before: float
    rmse_after: float
    views: int
    lights: int
    blocks: int


def held_frames(case: Case, seed: int) -> NDArray[np.int64]:
    """Choose a quarter of the blocks of repeats, so that no view and no light is held out altogether where that can be."""
    blocks = np.unique(case.block)
    if len(blocks) < 2:
        return np.zeros(0, np.int64)
    rng = np.random.default_rng(seed)
    want = max(1, round(_SHARE * len(blocks)))
    chosen: list[int] = []
    for b in rng.permutation(blocks):
        rest = ~np.isin(case.block, [*chosen, b])
        own = case.block == b
        seen_from = set(case.pose[own]) <= set(case.pose[rest]) or len(np.unique(case.pose)) == len(blocks)
        if set(case.lit[own]) <= set(case.lit[rest]) and seen_from:
            chosen.append(int(b))
        if len(chosen) == want:
            break
    chosen = chosen or [int(blocks[-1])]
    return np.flatnonzero(np.isin(case.block, chosen))


def prove(case: Case, base: Model, best: Model, seed: int) -> HeldOut:
    """Fit both models without the held-out frames and judge them there.

    Parameters of a frame or view of its own are fitted on half of the tiles of held-out frames; the other half is judged.
    """
    frames = held_frames(case, seed)
    counts = (len(np.unique(case.pose)), len(np.unique(case.lit)), len(np.unique(case.block)))
    if not len(frames):
        return HeldOut([], np.nan, np.nan, np.nan, np.nan, *counts)
    local = any(p.per for t in best.terms for p in t.parameters)
    judged = np.zeros(case.valid.shape, bool)
    judged[frames] = halves(case)[None] if local else True
    judged &= case.valid
    before, after = (_refitted(m, judged if local else _whole(case, frames)) for m in (base, best))

    def chi2(model: Model, picture: Floats) -> float:
        r = (case.pictures - picture) ** 2 * model.weight
        return float(r[judged].mean())

    def rmse(picture: Floats) -> float:
        return float(np.sqrt(((case.pictures - picture)[judged] ** 2).mean()))

    return HeldOut(frames.tolist(), chi2(base, before), chi2(best, after), rmse(before), rmse(after), *counts)


def _whole(case: Case, frames: NDArray[np.int64]) -> NDArray[np.bool_]:
    out = np.zeros(case.valid.shape, bool)
    out[frames] = True
    return out


def _refitted(model: Model, unseen: NDArray[np.bool_]) -> Floats:
    """Return the picture of the model fitted anew, maps and masks of its effects found anew too, without the unseen pixels."""

    def weigh_seen(case: Case, picture: Floats) -> Floats:
        return np.where(unseen[..., None], 0, weigh(case, picture)).astype(np.float32)

    weight = np.where(unseen[..., None], 0, model.weight).astype(np.float32)
    terms = prepared(model.case, model.terms, weigh_seen)
    kept = {t.key: t.aux for t in model.terms if t.effect.of_own_frame}
    for t in terms:
        t.aux = kept.get(t.key, t.aux)
    fitted = fit(model.case, weight, terms, 6)
    if any(t.effect.on_region for t in fitted.terms):
        fitted = with_better_masks(model.case, weight, fitted)
    return predict(model.case, fitted.terms)[2]
