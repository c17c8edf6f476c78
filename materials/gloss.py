"""What the glossy models share: a diffuse part, a lobe of some colour, and, where one lobe falls short, a second."""

from __future__ import annotations

from typing import NamedTuple

from .foundation.checks import check_range
from .kernels.kinds import PLAIN, Surface
from .lambert import surface as lambert_surface
from .scattering import RGB, check_albedo


class Tail(NamedTuple):
    """A second lobe of the same model, wider as a rule: the long tail that one lobe leaves over.

    Attributes
    ----------
    scale : float
        Its factor, as `specular_scale` of the first.
    alpha : float
        Its width, in (0, 1].
    alpha_v : float or None
        Its width across; None is `alpha`.
    """

    scale: float
    alpha: float
    alpha_v: float | None = None


def gloss(
    kind: int,
    albedo: RGB,
    alpha: float,
    alpha_v: float | None,
    specular_scale: float,
    eta: float,
    tint: RGB,
    tail: Tail | None,
    normalisation: int = 0,
) -> Surface:
    """Return albedo / pi + tint x (specular_scale lobe + tail), with all arguments checked.

    Raises
    ------
    InputError
        If an albedo or a tint leaves [0, 1], a width (0, 1], eta [1, inf), or a factor is negative.
    """
    check_range("alpha", alpha, "(0, 1]")
    across = alpha if alpha_v is None else alpha_v
    check_range("alpha_v", across, "(0, 1]")
    check_range("specular_scale", specular_scale, "[0, inf)")
    check_range("eta", eta, "[1, inf)")
    second = Tail(0.0, 1.0) if tail is None else tail
    second_v = second.alpha if second.alpha_v is None else second.alpha_v
    check_range("tail.scale", second.scale, "[0, inf)")
    check_range("tail.alpha", second.alpha, "(0, 1]")
    check_range("tail.alpha_v", second_v, "(0, 1]")
    r, g, b = check_albedo(tint, "tint")
    return lambert_surface(albedo)._replace(
        kind=kind,
        specular_scale=float(specular_scale),
        eta=float(eta),
        alpha_u=float(alpha),
        alpha_v=float(across),
        more=(r, g, b, float(second.scale), float(second.alpha), float(second_v), float(normalisation), *PLAIN[7:]),
    )
