"""What can be chosen about the experiments. Imports no numerics, so that `--help` answers at once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class StreetPart:
    """The built-in street as the experiments on it photograph and reconstruct it."""

    width: int = setting(640, "width of the pictures [px]", within="[64, 4096]")
    height: int = setting(270, "height of the pictures [px]", within="[32, 4096]")
    detail: float = setting(1.0, "fineness of the street's meshes and textures", within="[0.1, 2]")
    step: float = setting(0.5, "distance driven from frame to frame [m]", within="[0, 2]")
    pairs: int = setting(4, "pairs of consecutive frames", within="[1, 10]")
    samples: int = setting(64, "paths per pixel, of photographs, truth and augmentation", within="[1, 65536]")
    seed: int = setting(0, "seed of everything random", within="[0, 2147483647]")
    algorithms: tuple[str, ...] = setting(("horn-schunck", "papenberg", "brox", "dis"), "flow algorithms, see flow-eval")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class TrueWetSettings(StreetPart):
    """Settings of `true-wet`."""

    showers: tuple[float, ...] = setting((1 / 3, 2 / 3, 1.0), "strengths of the true showers")


@dataclass(frozen=True)
class WetterSettings(StreetPart):
    """Settings of `wetter`."""

    effects: tuple[str, ...] = setting(
        ("wetness", "mist", "droplets", "together"),
        "effects of rain: each alone, or all together",
        choices=("wetness", "mist", "droplets", "together"),
    )
    levels: tuple[float, ...] = setting((1 / 3, 2 / 3, 1.0), "how strong the effects are")
    street: bool = setting(True, "run on the built-in street")
    recordings: tuple[Path, ...] = setting((), "recordings with true flow or measured disparity, besides")


_SAMPLES = ("carpet", "copper", "alu", "fabric", "felt", "leather", "stone", "wallpaper", "wood")


@dataclass(frozen=True)
class FittedMaterialsSettings:
    """Settings of `fitted-materials`. The thesis: 39 scenes, 512 px, 1024 samples, 512 texels."""

    scenes: int = setting(12, "random scenes", within="[1, 100000]")
    width: int = setting(192, "width and height of the pictures [px]", within="[48, 4096]")
    samples: int = setting(64, "paths per pixel", within="[1, 65536]")
    bounces: int = setting(3, "scattering events per path; 1 is direct light", within="[1, 64]")
    materials: tuple[str, ...] = setting(_SAMPLES, "virtual materials", choices=_SAMPLES)
    models: tuple[str, ...] = setting(
        ("ct", "ward", "phong", "ggx"), "models fitted, each with and without normals", choices=("ct", "ward", "phong", "ggx")
    )
    texels: int = setting(32, "texels of a material each way", within="[8, 1024]")
    directions: int = setting(151, "directions of light, and of view, of the virtual dome", within="[40, 4096]")
    dome_samples: int = setting(4, "paths of the virtual dome per texel and view", within="[1, 65536]")
    rank: int = setting(32, "factors that the BTFs are compressed to", within="[1, 1024]")
    ambient_share: float = setting(0.1, "share of the ambient light in what reaches the surface", within="[0, 0.99]")
    seed: int = setting(0, "seed of everything random", within="[0, 2147483647]")
    algorithms: tuple[str, ...] = setting(("horn-schunck", "brox"), "flow algorithms, see flow-eval")

    def __post_init__(self) -> None:
        check_settings(self)


_OBJECTS, _VIEWS = ("pyramid", "figure"), ("top", "frontal")


@dataclass(frozen=True)
class ReflectanceFieldsSettings:
    """Settings of `reflectance-fields`. The thesis: 11 frames, 198 lamps, 512 paths, 151 directions, up to 3072 texels."""

    objects: tuple[str, ...] = setting(_OBJECTS, "objects on the turntable", choices=_OBJECTS)
    views: tuple[str, ...] = setting(_VIEWS, "where the camera stands", choices=_VIEWS)
    frames: int = setting(11, "frames, one degree from each to the next", within="[2, 360]")
    lamps: int = setting(198, "lamps on the dome, all on", within="[1, 4096]")
    width: int = setting(320, "width and height of the pictures [px]", within="[48, 4096]")
    samples: int = setting(16, "paths per pixel, each meeting all lamps; 16 times as many within bodies", within="[1, 65536]")
    bounces: int = setting(12, "scattering events per path, on the turntable and in the dome", within="[1, 64]")
    texels: tuple[int, ...] = setting((512, 768), "texels of the objects' atlases each way, one experiment for each")
    directions: int = setting(61, "directions of light, and of view, of the dome (thesis: 151)", within="[8, 4096]")
    dome_samples: int = setting(4, "paths of the dome per texel and view; each serves all lights", within="[1, 65536]")
    rank: int = setting(64, "factors that the fields are compressed to", within="[1, 1024]")
    detail: float = setting(1.0, "fineness of the objects' meshes", within="[0.05, 4]")
    light_error_deg: float = setting(0.08, "how far real lamps stand off, root mean square [degrees]", within="[0, 10]")
    camera_error_px: float = setting(0.16, "how far real pictures are shifted, root mean square [px]", within="[0, 10]")
    read_noise: float = setting(0.002, "noise of the real camera in the dark, of white", within="[0, 1]")
    shot_noise: float = setting(0.0001, "variance of its noise per light, of white", within="[0, 1]")
    seed: int = setting(0, "seed of everything random", within="[0, 2147483647]")
    algorithms: tuple[str, ...] = setting(("horn-schunck", "papenberg", "brox"), "flow algorithms, see flow-eval")

    def __post_init__(self) -> None:
        check_settings(self)
