"""What can be chosen about the built-in street."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.checks import check_range
from materials.foundation.settings import setting


@dataclass(frozen=True)
class StreetSettings:
    """Settings of the built-in street; everything else about it follows from these and is the same on every machine.

    Raises
    ------
    InputError
        If a value lies outside its range.
    """

    frames: int = setting(8, "number of frames of the drive")
    width: int = setting(640, "width of the images [px]")
    height: int = setting(270, "height of the images [px]")
    fov_deg: float = setting(58.0, "horizontal field of view [degrees]")
    step: float = setting(1.0, "distance driven from frame to frame [m]")
    sky: str = setting("clear", "weather of the recording", choices=("clear", "overcast"))
    lidar: bool = setting(True, "simulate the LiDAR sweeps")
    detail: float = setting(
        1.0, "fineness of meshes and textures; 1 is a 4 cm grid near the path, 0.25 a 16 cm grid for quick trials"
    )
    seed: int = setting(0, "seed of everything random")

    def __post_init__(self) -> None:
        # Later the oncoming car would reach the crossing while the pedestrian is still on it.
        check_range("frames", self.frames, "[2, 12]")
        check_range("width", self.width, "[16, 8192]")
        check_range("height", self.height, "[16, 8192]")
        check_range("fov_deg", self.fov_deg, "[20, 120]")
        check_range("step", self.step, "[0, 2]")
        check_range("detail", self.detail, "[0.1, 2]")
        check_range("seed", self.seed, "[0, 2147483647]")
