"""A lens that is darker towards the corners: other frames saw the same place at other distances from the centre."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mismatch.case import Case
from ...mismatch.effect import Values
from ...mismatch.formation import State
from ...mismatch.pictures.case import PictureCase
from ...mismatch.sensor_plane import radius2
from ..vignetting import Vignetting


class DriveVignetting(Vignetting):
    def change(self, case: Case, state: State, values: Values, target: str | None, aux: Any) -> None:
        assert isinstance(case, PictureCase)
        own = _log_gain(radius2(case), values)
        others = [
            np.einsum("sp,sp->p", share, _log_gain(r2, values)).reshape(own.shape)
            for share, r2 in zip(case.layer("share"), case.layer("radius2"), strict=True)
        ]
        gain = np.exp(own[None] - np.stack(others)).astype(np.float32)[..., None]
        state.lens.append(lambda picture: picture * gain)


def _log_gain(r2: np.ndarray, values: Values) -> np.ndarray:
    # Beyond the corner nothing was seen; what has no share there must still be a number.
    r2 = np.minimum(r2, 4.0)
    return -values["power"] * np.log1p(r2) - values["more"] * r2**2
