"""Settings of the spray behind wheels. Imports no numerics, so that the `--help` of a command answers at once."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class WakeSettings:
    """Tyres, drops and wake (`scene.wetting.wakes` says what each constant does and whence it comes)."""

    film_depth: float = setting(0.001, "depth of the water on a street where accumulation is full [m]", within="[0, 0.01]")
    tyre_width: float = setting(0.205, "of one tyre [m]", within="(0, 1]")
    airborne_share: float = setting(
        0.1, "share of the water a tyre meets that flies as spray; the rest is pushed aside or falls back", within="[0, 1]"
    )
    groove_width: float = setting(0.0055, "of the tread, which sets the Weber number of the tyre's water [m]", within="(0, 0.1]")
    carried: float = setting(0.3, "speed of the air in the wake, as a share of the vehicle's", within="[0, 0.9]")
    spread_across: float = setting(0.35, "standard deviation across, a vehicle's height behind it, in that height", within="(0, 2]")
    spread_up: float = setting(0.3, "the same upwards", within="(0, 2]")
    slowest: float = setting(2.0, "slower vehicles throw up nothing [m/s]", within="[0.5, 100]")
    fastest: float = setting(70.0, "a faster track is an error of the tracking, and is left out [m/s]", within="(0, 1000]")
    frame_time: float = setting(0.1, "from frame to frame, as a recording does not say it [s]", within="(0, 100]")
    stray: float = setting(
        0.5, "tracks that stray more from a straight, even motion over 5 frames are unknown [m]", within="(0, 10]"
    )

    def __post_init__(self) -> None:
        check_settings(self)
