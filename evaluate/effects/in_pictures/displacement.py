"""Pictures that are shifted and turned as a whole, or row by row: what little motions of a camera do to what is far."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...mismatch.case import Case, Floats
from ...mismatch.effect import Context, Parameter, Values
from ...mismatch.formation import State
from ...mismatch.sensor_plane import offsets
from ...mismatch.warp import moved
from ..pose_error import PoseError
from ..rolling_shutter import RollingShutter

SHIFT = ("shift_x", "shift_y", "turn")


def shift_basis(case: Case) -> Floats:
    """Return how pixels move per unit of shift in x and y [px per px] and of turn about the centre (3, H, W, 2) [px per rad]."""
    x, y, _ = offsets(case)
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack(v, axis=-1) for v in ((one, zero), (zero, one), (-y, x))]).astype(np.float32)


def shift_parameters(case: Case, per: str, most: float = 0.1) -> tuple[Parameter, ...]:
    """Return shift [px] and turn [rad] of each frame; a step moves pixels by a tenth of a pixel."""
    width = case.size[1]
    shift = [Parameter(n, 0.0, -most * width, most * width, 0.1, "px", per=per) for n in SHIFT[:2]]
    return (*shift, Parameter("turn", 0.0, -0.3, 0.3, 0.2 / width, "rad", per=per))


def shifted(case: Case, pictures: Floats, by: NDArray, share: NDArray | None = None) -> Floats:
    """Return pictures (F, H, W, 3) moved by shift and turn (F, 3), times a share of each row (H,)."""
    basis = shift_basis(case)
    rows = np.float32(1) if share is None else share.astype(np.float32)[:, None, None]
    return np.stack([moved(p, np.tensordot(b.astype(np.float32), basis, 1) * rows) for p, b in zip(pictures, by, strict=True)])


def _values(values: Values) -> NDArray:
    return np.stack([values[n] for n in SHIFT], axis=1)


class PicturePose(PoseError):
    title = "pictures out of place"
    says = "each frame as a whole is shifted and turned, whatever it shows"
    decides = "calibrate the camera on targets that the simulation does not hold"
    settles = False

    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return shift_parameters(case, "frame")

    def prepare(self, case: Case, target: str | None, context: Context) -> Any:
        """Return the shift of each frame (F, 2) [px] as the phases of both pictures' spectra have it."""
        window = cv2.createHanningWindow((case.size[1], case.size[0]), cv2.CV_32F)
        grey = [v.mean(axis=3).astype(np.float32) for v in (context.picture, context.picture + context.residual)]
        return np.array([cv2.phaseCorrelate(a, b, window)[0] for a, b in zip(*grey, strict=True)])

    def starts(self, case: Case, target: str | None, aux: Any) -> list[dict[str, Any]]:
        # The fit itself finds its way over a pixel, not over several.
        far = np.hypot(aux[:, 0], aux[:, 1]) > 1.0
        guess = np.where(far[:, None], np.clip(aux, -0.1 * case.size[1], 0.1 * case.size[1]), 0.0)
        return [{}, {"shift_x": guess[:, 0], "shift_y": guess[:, 1]}] if far.any() else [{}]

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        by = _values(values)
        if np.any(by):
            state.lens.append(lambda picture: shifted(case, picture, by))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        by = _values(values)
        rms = float(np.sqrt((by[:, :2] ** 2).sum(axis=1).mean()))
        return {"rms_shift": {"value": rms, "unit": "px"}}


class PictureRollingShutter(RollingShutter):
    def parameters(self, case: Case, target: str | None) -> tuple[Parameter, ...]:
        return shift_parameters(case, "frame")

    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        by, rows = _values(values), case.size[0]
        time = (np.arange(rows) + 0.5) / rows - 0.5
        if np.any(by):
            state.lens.append(lambda picture: shifted(case, picture, by, time))

    def summary(self, case: Case, values: Values, target: str | None, aux: Any) -> dict[str, Any]:
        return {}
