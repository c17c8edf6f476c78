"""Exposures that differ within a drive: of the frame predicted, and of those that it is predicted from."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mismatch.case import Case, Floats
from ...mismatch.effect import Parameter, Values
from ...mismatch.formation import State
from ...mismatch.pictures.case import PictureCase
from ..exposure_drift import ExposureDrift


class DriveExposure(ExposureDrift):
    """A frame lends its colours to others, so that its exposure shows in their predictions: it can be held out."""

    def targets(self, case: Case) -> list[str | None]:
        return [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        # Only ratios show; the spread holds their mean.
        return tuple(Parameter(f"log_gain.{n}", 0.0, -3.0, 3.0, 0.01, spread=0.3) for n in drive_names(case))

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        gain = {n: float(np.exp(values[f"log_gain.{n}"])) for n in drive_names(case)}
        factor = relative_factor(case, gain)
        state.lens.append(lambda picture: picture * factor)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        log = np.array([values[f"log_gain.{n}"] for n in drive_names(case)])
        return {"largest_ratio": {"value": float(np.exp(np.ptp(log))), "unit": "1"}}


def drive_names(case: Case) -> list[str]:
    """Return the names of all frames of the drive, of which the case may hold a few only."""
    assert isinstance(case, PictureCase)
    return list(case.layers)


def relative_factor(case: Case, gain: dict[str, float]) -> Floats:
    """Return by what predictions change (F, H, W, 3) if frames have these gains rather than all the same one."""
    assert isinstance(case, PictureCase)
    out = np.empty(case.pictures.shape, np.float32)
    layers = zip(case.recording.frames, case.layer("colour"), case.layer("share"), case.layer("others"), strict=True)
    for f, (frame, colour, share, others) in enumerate(layers):
        by = np.array([gain[n] for n in others], np.float32)
        before = np.einsum("sp,spc->pc", share, colour)
        after = np.einsum("sp,spc->pc", share / by[:, None], colour)
        ratio = np.where(before > 1e-6, after / np.maximum(before, 1e-6), 1.0)
        out[f] = (gain[frame.name] * ratio).reshape(case.pictures.shape[1:])
    return out
