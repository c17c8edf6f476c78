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
