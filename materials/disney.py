"""The principled BRDF of Disney, for surfaces that an artist described.

References
----------
Burley, B. (2012), Physically based shading at Disney, SIGGRAPH course notes (section 5, and the addenda of 2014 on
shadowing).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from .foundation.checks import check_range
from .kernels.kinds import DISNEY, Surface
from .lambert import surface as lambert_surface
from .scattering import RGB


@dataclass(frozen=True)
class Principled:
    """Parameters of the model but for the base colour, all in [0, 1]; defaults as in the reference code."""

    metallic: float = 0.0
    subsurface: float = 0.0
    specular: float = 0.5
    specular_tint: float = 0.0
    roughness: float = 0.5
    anisotropic: float = 0.0
    sheen: float = 0.0
    sheen_tint: float = 0.5
    clearcoat: float = 0.0
    clearcoat_gloss: float = 1.0

    def __post_init__(self) -> None:
        for item in fields(self):
            check_range(item.name, getattr(self, item.name), "[0, 1]")

    @property
    def aspect(self) -> float:
        """Root of the ratio of widths across and along (section 5.4)."""
        return math.sqrt(1 - 0.9 * self.anisotropic)

    @property
    def widths(self) -> tuple[float, float]:
        """GGX widths (alpha_u, alpha_v)."""
        return max(1e-3, self.roughness**2 / self.aspect), max(1e-3, self.roughness**2 * self.aspect)


def surface(base_color: RGB, principled: Principled | None = None) -> Surface:
    """Return the principled BRDF.

    Notes
    -----
    The model was made to please, not to keep books: sheen, coat and the retroreflection of its diffuse part are not
    balanced, and a white surface can reflect more than it receives.

    Raises
    ------
    InputError
        If a channel of the colour leaves [0, 1].

    Examples
    --------
    >>> surface((0.5, 0.5, 0.5), Principled(roughness=0.5)).alpha_u
    0.25
    """
    p = Principled() if principled is None else principled
    alpha_u, alpha_v = p.widths
    # In the order of the kernel; the last is the weight of the matte part.
    more = (p.metallic, p.subsurface, p.specular, p.specular_tint, p.roughness, p.sheen, p.sheen_tint, p.clearcoat)
    return lambert_surface(base_color)._replace(
        kind=DISNEY, alpha_u=alpha_u, alpha_v=alpha_v, more=(*(float(v) for v in more), float(p.clearcoat_gloss), 1.0)
    )
