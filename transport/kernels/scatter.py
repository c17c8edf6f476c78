"""How light leaves the surfaces of a world, be they formulas or tables. See `materials.kernels.bsdf` and `.tabulated`.

Where a world has no tables (None), Numba compiles these to the formulas alone.
"""

import math

from materials.kernels import bsdf, tabulated
from materials.kernels.kinds import TABLE, TABLE_U, TABLE_V, TABULATED
from materials.kernels.lean import lean

from .first_surface import base_colour

_UP, _SLANTING = (0.0, 0.0, 1.0), (math.sqrt(0.5), 0.0, math.sqrt(0.5))


@lean()
def _place(surface):
    more = surface.more
    return int(more[TABLE]), more[TABLE_U], more[TABLE_V]


@lean()
def evaluate(tables, surface, wo, wi):
    """Return the BSDF without the cosine, per channel; delta lobes count 0."""
    if tables is None:
        return bsdf.evaluate(surface, wo, wi)
    if surface.kind == TABULATED:
        which, u, v = _place(surface)
        return tabulated.evaluate(tables, which, u, v, wo, wi)
    return bsdf.evaluate(surface, wo, wi)


@lean()
def pdf(tables, surface, wo, wi):
    """Return the density of `sample` per solid angle; delta lobes count 0."""
    if tables is None:
        return bsdf.pdf(surface, wo, wi)
    if surface.kind == TABULATED:
        which, u, v = _place(surface)
        return tabulated.pdf(tables, which, u, v, wo, wi)
    return bsdf.pdf(surface, wo, wi)


@lean()
def sample(tables, surface, wo, u0, u1, u2):
    """Return wi, the weight f |cos| / pdf per channel, the pdf, and whether the lobe is a delta."""
    if tables is None:
        return bsdf.sample(surface, wo, u0, u1, u2)
    if surface.kind == TABULATED:
        which, u, v = _place(surface)
        wi, weight, density = tabulated.sample(tables, which, u, v, wo, u0, u1, u2)
        return wi, weight, density, False
    return bsdf.sample(surface, wo, u0, u1, u2)


@lean()
def colour(tables, surface):
    """Return a colour that does not depend on the view: `base_colour`, of a measurement its reflectance factor 45/0.

    That is what colorimetry takes for the colour of a surface: light from 45 degrees, seen from above, over white's.
    """
    if tables is None:
        return base_colour(surface)
    if surface.kind == TABULATED:
        which, u, v = _place(surface)
        f = tabulated.evaluate(tables, which, u, v, _UP, _SLANTING)
        return (math.pi * f[0], math.pi * f[1], math.pi * f[2])
    return base_colour(surface)
