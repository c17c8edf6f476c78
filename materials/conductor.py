"""Metals: GGX facets with the exact reflectance of a complex index of refraction."""

from __future__ import annotations

from .foundation.checks import check_range
from .foundation.errors import InputError
from .kernels.kinds import CONDUCTOR, PLAIN, Surface
from .scattering import RGB, blank

# Index and extinction at 610, 550 and 465 nm, near the dominant wavelengths of the Rec. 709 primaries: interpolated from
# tables 3 and 5 of Hagemann, Gudat and Kunz (1974), DESY report SR-74/7.
METALS: dict[str, tuple[RGB, RGB]] = {
    "aluminium": ((1.250, 0.998, 0.688), (7.170, 6.508, 5.570)),
    "copper": ((0.338, 0.943, 1.158), (3.096, 2.594, 2.451)),
    "gold": ((0.509, 0.689, 1.640), (3.192, 2.459, 1.745)),
    "silver": ((0.266, 0.251, 0.233), (4.093, 3.565, 2.787)),
}


def surface(eta: RGB, k: RGB, alpha: float = 0.0, *, alpha_v: float | None = None, specular_scale: float = 1.0) -> Surface:
    """Return a metal.

    Parameters
    ----------
    eta, k : (3,) float
        Real and imaginary part of the index, per channel; see `METALS`.
    alpha, alpha_v : float
        GGX widths along and across, in [0, 1]; `alpha` 0 is a smooth mirror. `alpha_v` defaults to `alpha`.
    specular_scale : float
        Factor, for dirt: in [0, 1].

    Raises
    ------
    InputError
        If eta is not positive, k negative, a width or the factor out of range, or only one width is 0.

    Examples
    --------
    >>> from materials.scattering import albedo
    >>> gold = surface(*METALS["gold"])
    >>> bool(albedo(gold, 1.0)[0] > albedo(gold, 1.0)[2])
    True
    """
    across = alpha if alpha_v is None else alpha_v
    for name, value, interval in (
        ("eta", eta, "(0, inf)"),
        ("k", k, "[0, inf)"),
        ("alpha", alpha, "[0, 1]"),
        ("alpha_v", across, "[0, 1]"),
        ("specular_scale", specular_scale, "[0, 1]"),
    ):
        check_range(name, value, interval)
    if (alpha == 0) != (across == 0):
        raise InputError("be 0 where alpha is, and only there", got=across, key="alpha_v")
    values = (*(float(x) for x in eta), *(float(x) for x in k))
    return blank()._replace(
        kind=CONDUCTOR,
        specular_scale=float(specular_scale),
        alpha_u=float(alpha),
        alpha_v=float(across),
        more=(*values, *PLAIN[6:]),
    )
