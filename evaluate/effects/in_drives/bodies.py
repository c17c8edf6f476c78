"""Bodies that move: the reconstruction shows what is behind them, and other frames show them elsewhere."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...mismatch.case import Case, Floats
from ...mismatch.effect import Context, Parameter, Values
from ...mismatch.formation import State
from ...mismatch.pictures.case import PictureCase
from ..moved_object import MovedObject

_SEARCH = 2  # [px]: as far a body's picture is tried around where its outline puts it
_FEWEST = 12  # pixels of a body


class DriveBodies(MovedObject):
    """Each body is a body of another frame, scaled and shifted from outline to outline, or of one colour: what is most like it.

    Which one, and where to the pixel, is chosen on half of the body's pixels, as on a chequered board, and the one colour is
    that half's median; how far all agree in brightness is one number.
    """

    title = "bodies that move"
    says = "in the masks of what moves, a body hides the still world, such as other frames show elsewhere or of one colour"
    decides = "look at the same place when nothing moves"
    settles = False
    approximation = 0.3
    of_own_frame = True

    def targets(self, case: Case) -> list[str | None]:
        return [None]

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return (Parameter("log_gain", 0.0, -1.0, 1.0, 0.01, spread=0.05),)

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return colour and cover (pixels, 4) of the bodies; False if none is like what the frames show."""
        assert isinstance(case, PictureCase)
        out = np.zeros((*case.valid.shape, 4), np.float32)
        for f, (frame, ids) in enumerate(zip(case.recording.frames, case.layer("instances"), strict=True)):
            for i in np.unique(ids[ids > 0]):
                own = ids == i
                found = _most_like(case, frame.name, f, own, context)
                if found is not None:
                    out[f][own] = np.concatenate([found[own], np.ones((own.sum(), 1))], axis=1)
        return out.reshape(-1, 4) if out.any() else False

    def of_frames(self, aux: Any, frames: NDArray[np.int64]) -> Any:
        return aux  # one row a pixel

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        layer = aux.reshape(*case.valid.shape, 4)
        body, cover = layer[..., :3] * np.float32(np.exp(values["log_gain"])), layer[..., 3:]
        state.lens.insert(0, lambda picture: picture + cover * (body - picture))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {"covered": {"value": float(aux[:, 3].mean()), "unit": "1"}}


def _most_like(case: PictureCase, name: str, f: int, own: NDArray[np.bool_], context: Context) -> Floats | None:
    """Return the picture (H, W, 3) in which a body of another frame is most like this one; None if the still world is."""
    used = own & case.valid[f]
    if used.sum() < _FEWEST:
        return None
    row, col = np.nonzero(used)
    half = (row + col) % 2 == 0
    row, col = row[half], col[half]
    recorded, weight = case.pictures[f][row, col], context.weight[f][row, col]
    still = float((weight * context.residual[f][row, col] ** 2).sum())
    best, found = still, None
    flat = np.broadcast_to(np.median(recorded, axis=0), case.pictures[f].shape)
    if (chi2 := float((weight * (recorded - flat[row, col]) ** 2).sum())) < best:
        best, found = chi2, flat
    for other, layer in case.layers.items():
        if other == name:
            continue
        ids = layer["instances"]
        for i in np.unique(ids[ids > 0]):
            for picture in _laid_on(layer["recorded"], ids == i, own):
                chi2 = float((weight * (recorded - picture[row, col]) ** 2).sum())
                if chi2 < best:
                    best, found = chi2, picture
    return found


def _laid_on(picture: Floats, body: NDArray[np.bool_], own: NDArray[np.bool_]):
    """Yield a frame's picture moved so that the box around its body comes to lie on that around another, and about it."""
    (top, left, height, width), (top0, left0, height0, width0) = _box(own), _box(body)
    if height0 * width0 < _FEWEST:
        return
    scale_y, scale_x = height0 / height, width0 / width
    if not (1 / 4 < scale_y < 4 and 1 / 4 < scale_x < 4):
        return
    y, x = np.mgrid[: own.shape[0], : own.shape[1]].astype(np.float32)
    for dy in range(-_SEARCH, _SEARCH + 1):
        for dx in range(-_SEARCH, _SEARCH + 1):
            at_x = (x + 0.5 - left - dx) * scale_x + left0 - 0.5
            at_y = (y + 0.5 - top - dy) * scale_y + top0 - 0.5
            at = at_x.astype(np.float32), at_y.astype(np.float32)
            yield np.asarray(cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _box(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(rows[0]), int(cols[0]), int(rows[-1] - rows[0] + 1), int(cols[-1] - cols[0] + 1)
