"""Settings of `water`. Imports no numerics, so that the `--help` of a command answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.settings import check_settings, setting

MODELS = ("standing", "bounded", "thesis")


@dataclass(frozen=True)
class WaterSettings:
    """Constants of eqs 6.2-6.5; the defaults are the thesis's, but for the slope, which it does not consider."""

    model: str = setting(
        "standing",
        "standing lets puddles fill, bounded keeps eq 6.5 within [0, 1], thesis computes it as printed",
        choices=MODELS,
    )
    k_acc: float = setting(100.0, "weight of height differences in accumulation [1/m] (eq 6.4)", within="[0, 1e6]")
    k_sat: float = setting(2.0, "weight of height differences in saturation [1/m] (eq 6.3)", within="[0, 1e6]")
    sigma_per_wetness: float = setting(0.5, "sigma of the height filter at w = 1 [m] (eq 6.2: w / 2)", within="[0, 100]")
    moisture_blend: float = setting(0.75, "how far w = 1 blends the moisture pattern with 0.5 (eq 6.3)", within="[0, 1]")
    puddle_blend: float = setting(0.5, "how far w = 1 blends the puddle pattern with 0.5 (eq 6.4)", within="[0, 1]")
    puddle_threshold: float = setting(
        0.5, "value of the puddle pattern above which water stands on flat ground at w = 1 (standing)", within="[0, 1]"
    )
    pattern_share: float = setting(
        1.0,
        "how far the puddle pattern covers ground that has no hollow to hold water; 0 trusts the height map alone (standing)",
        within="[0, 1]",
    )
    hollow_noise: float = setting(0.006, "hollows less deep than this are noise of the height map [m] (standing)", within="[0, 1]")
    hollow_film: float = setting(0.003, "depth of water that covers the ground's texture [m] (standing)", within="(0, 1]")
    accumulation_share: float = setting(0.5, "share of accumulation in the water level at w = 1 (eq 6.5)", within="[0, 1]")
    relief_noise: float = setting(
        0.002, "noise of the height map [m]: differences of height below it are not believed", within="[0, 10]"
    )
    slope_scale: float = setting(
        2.0, "scale over which the slope of a hillside is measured, sigma [m]; above a gutter's width", within="[0, 100]"
    )
    slope_start: float = setting(0.05, "slope from which on puddles shrink, rise over run", within="[0, 10]")
    slope_end: float = setting(0.12, "slope from which on no puddle stays, rise over run", within="[0, 10]")
    texture_depth: float = setting(0.001, "mean depth of the ground's own texture that a full film drowns [m]", within="[0, 1]")

    def __post_init__(self) -> None:
        check_settings(self)
