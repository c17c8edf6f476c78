"""Drops on the glass in photographs: where they are, what is sharp behind them is no longer seen."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from ...mismatch.case import Case, Floats
from ...mismatch.effect import Context, Parameter, Values
from ...mismatch.formation import State
from ...mismatch.sensor_plane import wide_blur
from ..lens_droplets import LensDroplets

# From so many frames on the drops are taken to stay where they are.
_STEADY = 3
_LEAST, _MOST = 0.004, 0.85


class PictureDrops(LensDroplets):
    """A drop gathers light from around: what is sharp behind it gives way to the picture blurred widely, dimmed, and veiled.

    The places come from the finest detail alone: 1 less the slope of the recording's detail over that predicted. How
    bright the drops are is then a matter of three numbers for all of them.
    """

    says = "in spots fixed to the glass, what is sharp behind it gives way to light from around"
    taken_for = ("defocus", "glare")
    of_own_frame = True
    completes = False

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        unit = case.size[1] / 160
        level = float(np.quantile(case.pictures[case.valid], 0.9)) + 1e-3
        return (
            Parameter("blur", 6.0 * unit, 1.5 * unit, 40.0 * unit, 0.3 * unit, "px"),
            Parameter("transmission", 1.0, 0.0, 3.0, 0.01),
            Parameter("veil", 0.0, -level, level, 0.003 * level),
        )

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return how much of each pixel a drop covers (pixels,); False where detail is missing nowhere, or everywhere."""
        mask = drop_mask(case, context.picture, context.weight)
        covered = float((mask > 0.5).mean())
        return mask.ravel() if _LEAST < covered < _MOST else False

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, float]]:
        unit = case.size[1] / 160
        return [{"blur": 3.0 * unit}, {"blur": 10.0 * unit}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        share = aux.reshape(case.valid.shape)[..., None]
        sigma, level, veil = (np.float32(values[n]) for n in ("blur", "transmission", "veil"))
        state.lens.append(lambda p: p + share * (level * wide_blur(p, float(sigma)) + veil - p))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"covered": {"value": float(aux.mean()), "unit": "1"}}


def drop_mask(case: Case, picture: Floats, weight: Floats) -> Floats:
    """Return which share of the fine detail of `picture` the recording lacks (F, H, W), beyond what it lacks everywhere."""
    unit = case.size[1] / 160
    fine, window = 0.8 * max(unit, 1.0), 1.5 * max(unit, 1.0)
    top, bottom, noise = (np.zeros(case.valid.shape) for _ in range(3))
    ok = case.valid[..., None] & (weight > 0)
    for f in range(case.num_frames):
        S = np.where(ok[f], picture[f], 0).astype(np.float32)
        detail, recorded = (v - gaussian_filter(v, (fine, fine, 0)) for v in (S, np.where(ok[f], case.pictures[f], S)))
        w = weight[f] * ok[f]
        top[f], bottom[f], noise[f] = (
            gaussian_filter(v.sum(axis=-1), window) for v in (w * detail * recorded, w * detail**2, ok[f].astype(float))
        )
    if case.num_frames >= _STEADY:
        top, bottom, noise = (np.broadcast_to(v.mean(axis=0), v.shape) for v in (top, bottom, noise))
    # Half the detail is likely to be there before the data have spoken: where nothing is fine, nothing is said.
    doubt = 0.25 * noise / 3 + 1e-12
    lacking = 1 - (top + doubt) / (bottom + doubt)
    usual = np.quantile(lacking, 0.1)
    return np.clip((lacking - usual - 0.15) / max(0.85 - usual, 0.2), 0, 1).astype(np.float32)
