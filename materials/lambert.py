"""Ideally matte surfaces, and mirrors and black emitters, which need no more than an albedo."""

from __future__ import annotations

from .kernels.kinds import EMISSION, MIRROR, Surface
from .scattering import RGB, blank, check_albedo


def surface(albedo: RGB) -> Surface:
    """Return a Lambertian surface, f = albedo / pi.

    Parameters
    ----------
    albedo : (3,) float
        Share reflected per channel, in [0, 1].

    Examples
    --------
    >>> surface((0.2, 0.3, 0.4)).albedo_g
    0.3
    """
    r, g, b = check_albedo(albedo)
    return blank()._replace(albedo_r=r, albedo_g=g, albedo_b=b)


def mirror(albedo: RGB = (1.0, 1.0, 1.0)) -> Surface:
    """Return a perfect mirror that reflects the share `albedo` at all angles."""
    return surface(albedo)._replace(kind=MIRROR)


def emitter() -> Surface:
    """Return a surface that scatters nothing; what it emits is the light's business."""
    return blank()._replace(kind=EMISSION)
