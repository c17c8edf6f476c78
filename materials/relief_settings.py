"""Settings of `from_image`. Imports no numerics, so that the `--help` of a command answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from .foundation.errors import InputError
from .foundation.settings import check_settings, setting


@dataclass(frozen=True)
class ImageRelief:
    """How roughness and relief follow from a picture; defaults are the thesis's, but for `model` and `percentile`."""

    roughness_fine_px: float = setting(1.0, "fine Gaussian of the roughness, standard deviation [px] (eq. 6.7)", within="(0, 1000]")
    roughness_coarse_px: float = setting(8.0, "coarse Gaussian of the roughness [px]", within="(0, 1000]")
    roughness_min: float = setting(0.5, "lowest perceptual roughness of the ground (eq. 6.8)", within="[0, 1]")
    roughness_max: float = setting(1.0, "highest perceptual roughness of the ground", within="[0, 1]")
    height_fine_px: float = setting(0.1, "fine Gaussian of the height, against sensor noise [px] (eq. 6.9)", within="(0, 1000]")
    height_coarse_px: float = setting(0.5, "coarse Gaussian of the height [px]", within="(0, 1000]")
    bump_height: float = setting(0.003, "difference of height between the lowest and the highest point [m]", within="[0, 1]")
    percentile: float = setting(
        2.0, "share of the strongest detail that is clipped, so that one pixel cannot set the scale [%]", within="[0, 100)"
    )
    max_slope: float = setting(0.6, "steepest slope of the relief [m/m]; steeper ones are scaled down", within="(0, 10]")
    model: str = setting(
        "contrast",
        "'contrast': detail relative to its surroundings' brightness, alike in sun and shade, no detail staying in the middle; "
        "'thesis': plain differences of the values given, minimum and maximum becoming 0 and 1",
        choices=("contrast", "thesis"),
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if self.roughness_min > self.roughness_max:
            raise InputError("be at most roughness_max", got=f"{self.roughness_min:g}", key="roughness_min")
