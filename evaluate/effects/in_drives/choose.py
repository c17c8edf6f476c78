"""Which effects can be tested on a drive, in which form, and why the others cannot."""

from __future__ import annotations

from dataclasses import replace

from ...mismatch.effect import Effect
from ...mismatch.pictures.case import PictureCase
from .bodies import DriveBodies
from .exposure import DriveExposure
from .gloss import DriveGloss
from .pose import DrivePose
from .vignetting import DriveVignetting

_OF_DRIVES: tuple[type[Effect], ...] = (
    DriveExposure, DriveVignetting, DriveGloss, DrivePose, DriveBodies,
)  # fmt: skip
_SAME_CAMERA = "acts on the prediction as on the recording: both come through the same lens, sensor and air"
_LIGHTS = "needs lights and materials, which a reconstructed drive has not"
_ALIKE = (
    "participating_medium", "height_fog", "glare", "defocus", "lens_distortion", "chromatic_aberration", "lens_droplets",
    "sensor_response", "saturation", "motion_blur", "rolling_shutter",
)  # fmt: skip


def choose_for_drive(case: PictureCase, effects: list[Effect]) -> tuple[PictureCase, list[Effect]]:
    """Return the case with what cannot be tested on it, and the effects that can, in the form that acts on drives."""
    forms = {e.id: e for e in _OF_DRIVES}
    usable: list[Effect] = []
    reasons: dict[str, str] = {}
    for effect in effects:
        if effect.id in forms:
            usable.append(forms[effect.id]())
        elif effect.id in _ALIKE:
            reasons[effect.id] = _SAME_CAMERA
        elif effect.id == "noise_model":
            reasons[effect.id] = "cannot be told from the reconstruction's own error, which is part of the noise"
        elif effect.on_picture and not effect.settles:
            usable.append(effect)
        else:
            reasons[effect.id] = _LIGHTS
    return replace(case, reasons=reasons), usable
