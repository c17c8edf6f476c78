"""Settings of `spray`. Imports no numerics, so that the `--help` of a command answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class SpraySettings:
    """Constants of eq 6.6; what it leaves open (the noise's contrast, how drops scatter) is chosen here."""

    view_distance: float = setting(50.0, "mean free path of light at the ground for m = 1 [m] (eq 6.6)", within="(0, 1e6]")
    scale_height: float = setting(1.0, "height in which the density falls to 1/e [m] (eq 6.6)", within="(0, 1000]")
    noise_scale: float = setting(0.5, "base scale of the noise [m] (6.3.4)", within="(0, 1000]")
    noise_exponent: float = setting(3.0, "beta of its 1/f^beta (6.3.4)", within="[0, 10]")
    octaves: int = setting(3, "its octaves: 0.5 m to 0.125 m", within="[1, 16]")
    contrast: float = setting(0.3, "its standard deviation about the mean of 1; 0 is even mist", within="[0, 10]")
    ceiling: float = setting(12.0, "where mist is cut off, in scale heights above the ground (e^-12 is left)", within="[1, 100]")
    margin: float = setting(200.0, "how far mist reaches beyond the ground map [m]", within="[0, 1e5]")
    albedo: float = setting(1.0, "single-scattering albedo; water absorbs less than 1e-4, dirt more", within="[0, 1]")
    droplet_diameter_um: float = setting(20.0, "mean diameter of the drops [micrometres]", within="[5, 50]")

    def __post_init__(self) -> None:
        check_settings(self)
