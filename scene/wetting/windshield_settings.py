"""Settings of the droplets on the windshield. Imports no numerics, so that the `--help` of a command answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class WindshieldSettings:
    """Glass, drops and lens of 6.3.5 and 6.4.5; what the thesis leaves open (how many, how large, how fast) is chosen here."""

    distance: float = setting(0.2, "from the camera to the glass along its axis [m] (6.3.5)", within="(0.01, 10]")
    inclination_deg: float = setting(
        45.0, "of the glass against the camera's axis; its top leans towards the camera", within="[10, 90]"
    )
    density: float = setting(6000.0, "drops per square metre of glass for D = 1, at the first frame", within="[0, 1e5]")
    arrivals: float = setting(600.0, "drops that fall on a square metre in a second for D = 1", within="[0, 1e5]")
    radius_mm: float = setting(2.0, "median radius of a fresh drop's base [mm]", within="[0.2, 10]")
    spread: float = setting(0.4, "standard deviation of the radius's logarithm", within="[0, 1]")
    sticks_mm: float = setting(4.0, "base radius up to which a drop sticks; larger ones run [mm]", within="[0.5, 20]")
    speed: float = setting(0.08, "at which a drop of twice that radius runs down [m/s]", within="[0, 10]")
    contact_angle_deg: float = setting(60.0, "between water and glass", within="[10, 90]")
    cohesion: float = setting(0.9, "drops merge when nearer than this share of the sum of their radii", within="[0.1, 1.5]")
    frame_time: float = setting(0.1, "from frame to frame [s]", within="(0, 100]")
    eta: float = setting(1.33, "refractive index of water", within="[1, 3]")
    aperture_radius: float = setting(0.003, "of the thin lens that blurs the drops [m] (6.4.5)", within="[0, 0.1]")
    focus_distance: float = setting(100.0, "of that lens [m] (6.4.5)", within="[0.3, 1e9]")
    resolution_mm: float = setting(0.2, "of the drops' surface [mm]", within="[0.02, 5]")

    def __post_init__(self) -> None:
        check_settings(self)
