"""Which effects there are, and how a user adds one from a file of his own."""

from __future__ import annotations

import importlib.util
import inspect
from pathlib import Path

from materials.foundation.errors import InputError

from ..mismatch.effect import STAGES, Effect
from .albedo_error import AlbedoError
from .ambient_light import AmbientLight
from .anisotropy import Anisotropy
from .cast_shadow import CastShadow
from .chromatic_aberration import ChromaticAberration
from .defocus import Defocus
from .exposure_drift import ExposureDrift
from .fresnel_grazing import FresnelGrazing
from .glare import Glare
from .height_fog import HeightFog
from .interreflection import Interreflection
from .lens_distortion import LensDistortion
from .lens_droplets import LensDroplets
from .light_colour import LightColour
from .light_extent import LightExtent
from .light_position import LightPosition
from .long_tail_lobe import LongTailLobe
from .mesoscopic_normals import MesoscopicNormals
from .missing_occluder import MissingOccluder
from .motion_blur import MotionBlur
from .moved_object import MovedObject
from .near_field_light import NearFieldLight
from .noise_model import NoiseModel
from .participating_medium import ParticipatingMedium
from .pose_error import PoseError
from .retroreflection import Retroreflection
from .rolling_shutter import RollingShutter
from .rough_diffuse import RoughDiffuse
from .saturation import Saturation
from .sensor_response import SensorResponse
from .specular_lobe import SpecularLobe
from .subsurface import Subsurface
from .surface_wetness import SurfaceWetness
from .vignetting import Vignetting
from .water_film import WaterFilm

CATALOGUE: tuple[type[Effect], ...] = (
    ExposureDrift, LightPosition, LightColour, NearFieldLight, LightExtent, AmbientLight, MissingOccluder, CastShadow,
    AlbedoError, SpecularLobe, LongTailLobe, FresnelGrazing, Anisotropy, RoughDiffuse, Retroreflection, MesoscopicNormals,
    Subsurface, SurfaceWetness, WaterFilm, PoseError, MovedObject, Interreflection, ParticipatingMedium, HeightFog, Glare,
    Vignetting, Defocus, MotionBlur, LensDistortion, ChromaticAberration, LensDroplets, SensorResponse, Saturation, NoiseModel,
    RollingShutter,
)  # fmt: skip


def catalogue(files: tuple[str | Path, ...] = (), without: tuple[str, ...] = ()) -> list[Effect]:
    """Return one of each effect: those of the toolkit, and those of a user's files, but for those left out.

    Raises
    ------
    InputError
        If a file cannot be used, two effects have one id, or there is none of an id that is to be left out.
    """
    effects: dict[str, Effect] = {e.id: e() for e in CATALOGUE}
    for file in files:
        for effect in load_file(file):
            if effect.id in effects:
                raise InputError("have an id of its own", got=effect.id, file=file, key="id")
            effects[effect.id] = effect
    for id in without:
        if id not in effects:
            raise InputError(f"be one of {', '.join(effects)}", got=id, key="--without")
    return [e for e in effects.values() if e.id not in without]


def load_file(file: str | Path) -> list[Effect]:
    """Return the effects that a Python file defines: its subclasses of `Effect`.

    Raises
    ------
    InputError
        If there is no such file, running it fails, or it defines no effect, or one without id, stage, words or `change`.
    """
    file = Path(file)
    spec = importlib.util.spec_from_file_location(f"effects_{file.stem}", file) if file.is_file() else None
    if spec is None or spec.loader is None:
        raise InputError("be a Python file", got=file, key="--effects")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError("run", got=f"{type(error).__name__}: {error}", file=file) from error
    own = [c for c in vars(module).values() if inspect.isclass(c) and issubclass(c, Effect) and c.__module__ == module.__name__]
    if not own:
        raise InputError("define a subclass of evaluate.mismatch.effect.Effect", file=file)
    for c in own:
        for name in ("id", "stage", "title", "says"):
            if not isinstance(getattr(c, name, None), str):
                raise InputError("be given as text", file=file, key=f"{c.__name__}.{name}")
        if c.stage not in STAGES:
            raise InputError(f"be one of {', '.join(STAGES)}", got=c.stage, file=file, key=f"{c.__name__}.stage")
        if c.change is Effect.change:
            raise InputError("be defined: it is what the effect does", file=file, key=f"{c.__name__}.change")
    return [c() for c in own]
