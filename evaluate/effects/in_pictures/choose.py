"""Which effects can be tested on given pictures, in which form, and why the others cannot."""

from __future__ import annotations

from dataclasses import replace

from ...mismatch.effect import Effect
from ...mismatch.pictures.case import PictureCase
from .blur import PictureDefocus, PictureMotionBlur
from .displacement import PicturePose, PictureRollingShutter
from .drops import PictureDrops
from .encoding import PictureExposure, PictureResponse, WhiteBalance
from .fog import PictureFog, PictureHeightFog
from .moved_body import MovedBody

# Act on finished pictures as they are.
_AS_THEY_ARE = ("glare", "vignetting", "lens_distortion", "chromatic_aberration", "saturation", "noise_model")
_OF_PICTURES: tuple[type[Effect], ...] = (
    PictureExposure, WhiteBalance, PictureResponse, PictureDefocus, PictureMotionBlur, PicturePose, PictureRollingShutter,
    PictureDrops, PictureFog, PictureHeightFog, MovedBody,
)  # fmt: skip
_NEEDS_DEPTH = ("participating_medium", "height_fog")
_NEEDS_SHAPES = ("moved_object",)
_WORLD = "needs shapes, materials and lights: give a recording.json and a simulation.json"


def choose(case: PictureCase, effects: list[Effect]) -> tuple[PictureCase, list[Effect]]:
    """Return the case with what cannot be tested on it, and the effects that can, in the form that acts on pictures.

    An effect of a user's own stays as it is if it acts on finished pictures.
    """
    forms = {e.id: e for e in _OF_PICTURES}
    usable: list[Effect] = []
    reasons: dict[str, str] = {}
    for effect in effects:
        if effect.id in _NEEDS_DEPTH and not case.has_depth:
            reasons[effect.id] = "needs depth: give --depth"
        elif effect.id in _NEEDS_SHAPES and len(case.shape_names) < 2:
            reasons[effect.id] = "needs to know which pixels are whose: give --masks"
        elif effect.id in forms:
            usable.append(forms[effect.id]())
        elif effect.id in _AS_THEY_ARE or (effect.on_picture and not effect.settles):
            usable.append(effect)
        else:
            reasons[effect.id] = _WORLD
    return replace(case, reasons=reasons), usable
