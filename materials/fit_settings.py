"""How a BRDF is fitted; loads no numerics, for --help."""

from __future__ import annotations

from dataclasses import dataclass, fields

from .foundation.errors import InputError
from .foundation.settings import check_settings, setting


@dataclass(frozen=True)
class FitSettings:
    """How a BRDF is fitted."""

    model: str = setting("ct", "BRDF: ct (Cook-Torrance), ward, phong, ggx", choices=("ct", "ward", "phong", "ggx"))
    base: str = setting(
        "lambert", "matte part: lambert, or oren_nayar (its spread of slopes fitted)", choices=("lambert", "oren_nayar")
    )
    normals: bool = setting(False, "estimate a normal per texel first (eq. 5.3)")
    constrained: bool = setting(True, "the two-step fit with bounds of 5.3.4; else all angles at once, free")
    lobes: int = setting(2, "specular lobes of the last step", within="[1, 2]")
    eta: float = setting(1.5, "refractive index of the Fresnel factor of ct and ggx", within="(1, 5]")
    diffuse_share: float = setting(2 / 3, "lowest diffuse albedo of step two, relative to step one", within="[0, 1]")
    first_angle_deg: float = setting(45.0, "largest elevation angle of step one", within="(0, 90)")
    full_angle_deg: float = setting(60.0, "largest elevation angle of normals and of step two", within="(0, 90)")
    free_angle_deg: float = setting(80.0, "largest elevation angle of the free fit", within="(0, 90)")
    loss_scale: float = setting(1.0, "residual [1/sr] that counts as 1 in Cauchy's loss", within="(0, inf)")
    solver: str = setting(
        "levenberg", "minimiser: levenberg (compiled) or slsqp (NLopt's, ten times slower)", choices=("levenberg", "slsqp")
    )
    warm_starts: bool = setting(True, "start most texels of a texture from a neighbour's fit")
    threads: int = setting(0, "threads; 0 takes all cores", within="[0, 1024]")

    def __post_init__(self) -> None:
        check_settings(self)
        for item in fields(self):
            allowed = item.metadata.get("choices")
            if allowed and getattr(self, item.name) not in allowed:
                raise InputError(f"be one of {', '.join(allowed)}", got=repr(getattr(self, item.name)), key=item.name)
