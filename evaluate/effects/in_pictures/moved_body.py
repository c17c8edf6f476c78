"""A body, known by its mask, that is shifted in the picture."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, distance_transform_edt

from ...mismatch.case import Case, Floats
from ...mismatch.effect import Context, Parameter, Values, shape_index, shapes_seen
from ...mismatch.formation import State
from ...mismatch.pictures.case import STATIC
from ...mismatch.sensor_plane import cubic
from ..moved_object import MovedObject

_SEARCH = 6  # [px]: as far the first guess is looked for


class MovedBody(MovedObject):
    """The body with a rim of a pixel is taken off and laid on again elsewhere; what it uncovers is filled from its border."""

    says = "one body is shifted in the picture, in each frame by a shift of its own, and all else fits"
    decides = "look at the body in frames before and after"
    settles = False

    def targets(self, case: Case) -> list[str | None]:
        return [n for n in shapes_seen(case, 0.0005) if n != STATIC]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        most = 0.1 * case.size[1]
        return tuple(Parameter(n, 0.0, -most, most, 0.1, "px", per="frame") for n in ("shift_x", "shift_y"))

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return a first guess of the shifts (F, 2) [px]."""
        own = _layer(case, target)[0]
        return np.array([
            _whole_pixels(context.picture[f], context.picture[f] + context.residual[f], context.weight[f], own[f])
            for f in range(case.num_frames)
        ])  # fmt: skip

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, Any]]:
        return [{"shift_x": aux[:, 0], "shift_y": aux[:, 1]}]

    def of_frames(self, aux: Any, frames: NDArray[np.int64]) -> Any:
        return aux[frames]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        own, nearest = _layer(case, target)
        height, width = case.size
        y, x = np.mgrid[:height, :width].astype(np.float32)
        by = np.stack([values["shift_x"], values["shift_y"]], axis=1).astype(np.float32)

        def shifted(pictures):
            out = pictures.copy()
            for f in np.flatnonzero(np.any(by != 0, axis=1) & own.any(axis=(1, 2))):
                at = x - by[f, 0], y - by[f, 1]
                body = cubic(pictures[f], *at)
                cover = cv2.remap(own[f].astype(np.float32), *at, cv2.INTER_LINEAR)[..., None]
                ground = np.where(own[f][..., None], pictures[f][tuple(nearest[f])], pictures[f])
                out[f] = ground + cover * (body - ground)
            return out

        if np.any(by):
            state.lens.insert(0, shifted)

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        seen = _layer(case, target)[0].any(axis=(1, 2))
        length = np.hypot(values["shift_x"], values["shift_y"])[seen]
        return {"shift": {"value": float(np.sqrt(np.mean(length**2))) if len(length) else 0.0, "unit": "px"}}


def _layer(case: Case, target: str | None) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return the pixels of a body with its rim (F, H, W), and the nearest pixel of something else (F, 2, H, W)."""
    key = ("layer", target)
    if key not in case.cache:
        shape = case.pieces.shape.reshape(case.valid.shape)
        own = np.stack([binary_dilation(m) for m in shape == shape_index(case, target)])
        nearest = [distance_transform_edt(m, return_distances=False, return_indices=True) for m in own]
        case.cache[key] = own, np.stack(nearest)
    return case.cache[key]


def _whole_pixels(picture: Floats, recorded: Floats, weight: Floats, own: NDArray[np.bool_]) -> tuple[float, float]:
    """Return by how many whole pixels (x, y) a body has to be shifted to be most like the recording; (0, 0) if it is not seen."""
    if not own.any():
        return 0.0, 0.0
    rows, cols = np.nonzero(own)
    height, width = own.shape
    best, chosen = np.inf, (0.0, 0.0)
    for dy in range(-_SEARCH, _SEARCH + 1):
        for dx in range(-_SEARCH, _SEARCH + 1):
            to_y, to_x = rows + dy, cols + dx
            ok = (to_y >= 0) & (to_y < height) & (to_x >= 0) & (to_x < width)
            if ok.sum() < 0.5 * len(rows):
                continue
            r = recorded[to_y[ok], to_x[ok]] - picture[rows[ok], cols[ok]]
            chi2 = float((weight[to_y[ok], to_x[ok]] * r * r).mean())
            if chi2 < best:
                best, chosen = chi2, (float(dx), float(dy))
    return chosen
