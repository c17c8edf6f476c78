"""Settings of `augment`. Imports no numerics, so that `--help` answers at once."""

from __future__ import annotations

from dataclasses import dataclass, field

from materials.foundation.settings import setting
from materials.relief_settings import ImageRelief
from scene.water_settings import WaterSettings


@dataclass(frozen=True)
class AugmentSettings:
    """How wet, and how it is computed; defaults are the thesis's (6.4), deviations as documented in docs/augment.md."""

    eta: float = setting(1.63, "refractive index of the dry ground (6.4.2: tarmac)")
    porosity: float = setting(0.6, "effective porosity of the ground (2.5.2: 0.5 to 0.7 for concrete and asphalt)")
    darkening: str = setting(
        "lagarde", "model of the diffuse darkening of full pores", choices=("lagarde", "lekner_dorf", "twomey", "thesis")
    )
    strength: float = setting(0.95, "how far full accumulation goes towards smooth water (eq 6.13)")
    bounces: int = setting(3, "reflections followed between ground and objects")
    samples: int = setting(64, "paths per pixel")
    noise: float = setting(
        0.0, "if above 0: add samples until the median standard error is below this, in 8-bit levels of the picture"
    )
    max_samples: int = setting(1024, "most paths per pixel that --noise may take")
    seed: int = setting(0, "seed of the paths")
    sky_gain: float = setting(0.0, "factor on the sky that no frame saw; 0 finds the largest that the pictures allow")
    puddle_scale: float = setting(0.0, "largest size of the puddles [m]; 0 keeps those of the scene (2 m)")
    layers: bool = setting(True, "write the multi-layer EXR of each frame")
    labels: bool = setting(True, "write label maps as PNG")
    format: str = setting("same", "format of the pictures: as the input, or png, exr", choices=("same", "png", "exr"))
    relief: ImageRelief = field(default_factory=ImageRelief)
    water: WaterSettings = field(default_factory=WaterSettings)


def check_settings(settings: AugmentSettings, wetness: list[float]) -> None:
    """Refuse settings out of range before any work starts.

    Raises
    ------
    InputError
        Names the option.
    """
    from materials.foundation.checks import check_range

    for w in wetness:
        check_range("wetness", w, "[0, 1]")
    check_range("eta", settings.eta, "(1, 3]")
    check_range("porosity", settings.porosity, "[0, 1]")
    check_range("strength", settings.strength, "[0, 1]")
    check_range("bounces", settings.bounces, "[1, 64]")
    check_range("samples", settings.samples, "[1, 65536]")
    check_range("max_samples", settings.max_samples, "[1, 65536]")
    check_range("noise", settings.noise, "[0, 255]")
    check_range("sky_gain", settings.sky_gain, "[0, 100]")
    check_range("puddle_scale", settings.puddle_scale, "[0, 100]")
