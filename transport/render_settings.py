"""Settings of `meniscus render`; nothing here loads numerics, so that --help does not."""

from __future__ import annotations

from dataclasses import dataclass

from materials.foundation.errors import InputError
from materials.foundation.settings import check_settings, setting


@dataclass(frozen=True)
class RenderSettings:
    """How frames are rendered, and until when."""

    samples: int | None = setting(
        None, "paths per pixel; default 64, or no limit where --noise or --seconds is given", within="[1, 1048576]"
    )
    noise: float | None = setting(None, "stop at this relative standard error (root mean square over pixels)", within="(0, 10]")
    seconds: float | None = setting(None, "stop after this time per frame", within="(0, 1e9]")
    max_bounces: int | None = setting(None, "scattering events per path; default is the simulation's", within="[1, 1024]")
    clamp: float = setting(0.0, "largest contribution of one indirect path; 0 is no limit, and unbiased", within="[0, 1e30]")
    seed: int = setting(0, "seed of the sampler", within="[0, 4294967295]")
    denoise: bool = setting(False, "add a denoised picture (needs pyoidn, see docs/render.md)")
    preview: bool = setting(True, "write a PNG beside each EXR")
    checkpoint_seconds: float = setting(60.0, "store an unfinished frame this often", within="[1, 1e9]")
    overwrite: bool = setting(False, "replace frames and checkpoints of other settings in the output folder")

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class ViewSettings:
    """Where to look from, if no recording says so; by default at everything, from above and aside."""

    width: int = setting(640, "of the picture [px]", within="[1, 65536]")
    height: int = setting(480, "of the picture [px]", within="[1, 65536]")
    fov_deg: float = setting(40.0, "horizontal field of view [degrees]", within="[0.1, 170]")
    eye: tuple[float, float, float] | None = setting(None, "place of the camera [m]")
    target: tuple[float, float, float] | None = setting(None, "what it looks at [m]; default is the middle of everything")

    def __post_init__(self) -> None:
        check_settings(self)
        if self.eye is not None and self.eye == self.target:
            raise InputError("differ from eye", got=self.target, key="target")
