"""Settings of `augment`. Imports no numerics, so that `--help` answers at once."""

from __future__ import annotations

from dataclasses import dataclass, field

from materials.foundation.settings import check_settings, setting
from materials.relief_settings import ImageRelief
from scene.wetting.spray_settings import SpraySettings
from scene.wetting.wake_settings import WakeSettings
from scene.wetting.water_settings import WaterSettings
from scene.wetting.windshield_settings import WindshieldSettings


@dataclass(frozen=True)
class AugmentSettings:
    """How wet, and how it is computed; defaults are the thesis's (6.4), deviations as documented in docs/augment.md."""

    eta: float = setting(1.63, "refractive index of the dry ground (6.4.2: tarmac)", within="(1, 3]")
    porosity: float = setting(0.6, "effective porosity of the ground (2.5.2: 0.5 to 0.7 for concrete and asphalt)", within="[0, 1]")
    darkening: str = setting(
        "lagarde", "model of the diffuse darkening of full pores", choices=("lagarde", "lekner_dorf", "twomey", "thesis")
    )
    strength: float = setting(0.95, "how far full accumulation goes towards smooth water (eq 6.13)", within="[0, 1]")
    mist: float = setting(0.0, "amount of spray and mist, 0 to 1 (mean free path 50 m at the ground)", within="[0, 1]")
    smooth_mist: float = setting(
        3.0, "width over which the noise of mist is smoothed along surfaces [px]; 0 leaves every pixel unbiased", within="[0, 100]"
    )
    wheel_spray: float = setting(
        0.0,
        "amount of spray behind moving vehicles; 1 is what tyres throw up at their speed from the water there",
        within="[0, 10]",
    )
    droplets: float = setting(0.0, "amount of drops on the windshield, 0 to 1", within="[0, 1]")
    bounces: int = setting(3, "reflections followed between ground and objects", within="[1, 64]")
    samples: int = setting(64, "paths per pixel", within="[1, 65536]")
    noise: float = setting(
        0.0,
        "if above 0: add samples until the median standard error is below this, in 8-bit levels of the picture",
        within="[0, 255]",
    )
    max_samples: int = setting(1024, "most paths per pixel that --noise may take", within="[1, 65536]")
    seed: int = setting(0, "seed of the paths", within="[0, 2147483647]")
    sky_gain: float = setting(
        0.0, "factor on the sky that no frame saw; 0 finds the largest that the pictures allow", within="[0, 100]"
    )
    puddle_scale: float = setting(0.0, "largest size of the puddles [m]; 0 keeps those of the scene (2 m)", within="[0, 100]")
    layers: bool = setting(True, "write the multi-layer EXR of each frame")
    labels: bool = setting(True, "write label maps as PNG")
    format: str = setting("same", "format of the pictures: as the input, or png, exr", choices=("same", "png", "exr"))
    relief: ImageRelief = field(default_factory=ImageRelief)
    water: WaterSettings = field(default_factory=WaterSettings)
    spray: SpraySettings = field(default_factory=SpraySettings)
    wakes: WakeSettings = field(default_factory=WakeSettings)
    windshield: WindshieldSettings = field(default_factory=WindshieldSettings)

    def __post_init__(self) -> None:
        check_settings(self)


def check_wetness(wetness: list[float]) -> None:
    """Refuse wetness out of [0, 1].

    Raises
    ------
    InputError
        Names the first value.
    """
    from materials.foundation.checks import check_range

    for w in wetness:
        check_range("wetness", w, "[0, 1]")
