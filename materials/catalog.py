"""Named surfaces of the street with documented optical values: starting points where nothing was measured.

Albedos are linear Rec. 709, typical dry values of the visible range; where no measurement is cited they are
representative, not standard. Porosity is Lagarde's effective porosity for `wetness`.

References
----------
[1] The thesis this toolkit follows, 6.4.2: index of tarmac 1.63, roughness 0.5 to 1. [2] Lagarde (2013), Water drop 3b:
porosity 0.5 to 0.7 for asphalt and concrete. [3] Akbari, Pomerantz and Taha (2001), Cool surfaces and shade trees: asphalt
0.05 to 0.15, aged concrete 0.25 to 0.35. [4] Hale and Querry (1973): water 1.333 at 589 nm. [5] Rubin (1985): soda-lime
glass 1.52. [6] Jacquemoud and Baret (1990), PROSPECT: leaf tissue 1.42 to 1.48 in the visible. [7] Ghosh (1999): quartz
1.544. [8] Clear coats are acrylics and polyurethanes, 1.49 to 1.52.
"""

from __future__ import annotations

from dataclasses import dataclass

from . import dielectric, ggx, water_film
from .foundation.errors import InputError
from .scattering import RGB, Surface


@dataclass(frozen=True)
class Named:
    """A surface by name.

    Attributes
    ----------
    name : str
    albedo : RGB
        Diffuse, dry, linear.
    eta : float
        Refractive index of the solid over air.
    roughness : float
        Perceptual; `alpha = roughness**2`.
    porosity : float
        Effective porosity, 0 (glass) to 1.
    coat_eta : float or None
        Index of a smooth clear coat; None without.
    is_clear : bool
        Whether light passes (glass, water).
    sources : str
        Numbers of the module's references.
    """

    name: str
    albedo: RGB
    eta: float
    roughness: float
    porosity: float
    coat_eta: float | None = None
    is_clear: bool = False
    sources: str = ""

    def surface(self) -> Surface:
        """Return it dry, ready to scatter light."""
        alpha = self.roughness**2
        if self.is_clear:
            return dielectric.surface(self.eta, alpha)
        if self.coat_eta is not None:
            return water_film.coated(self.albedo, film_eta=self.coat_eta, sigma_a=(0.0, 0.0, 0.0))
        return ggx.surface(self.albedo, alpha, eta=self.eta)


_ALL = (
    Named("tarmac", (0.09, 0.09, 0.088), 1.63, 0.75, 0.6, sources="[1] [2] [3]"),
    Named("concrete", (0.28, 0.27, 0.25), 1.58, 0.8, 0.5, sources="[2] [3]"),
    Named("paving", (0.22, 0.20, 0.18), 1.58, 0.75, 0.4, sources="[3]"),
    Named("lane_paint", (0.70, 0.70, 0.68), 1.5, 0.6, 0.1),
    Named("brick", (0.30, 0.13, 0.09), 1.55, 0.85, 0.6),
    Named("soil", (0.17, 0.12, 0.08), 1.544, 0.95, 0.8, sources="[7], of its grains"),
    Named("grass", (0.04, 0.08, 0.025), 1.45, 0.6, 0.0, sources="[6]"),
    Named("car_paint", (0.25, 0.03, 0.03), 1.5, 0.0, 0.0, coat_eta=1.5, sources="[8]"),
    Named("glass", (0.0, 0.0, 0.0), 1.52, 0.0, 0.0, is_clear=True, sources="[5]"),
    Named("water", (0.0, 0.0, 0.0), 1.33, 0.0, 0.0, is_clear=True, sources="[4]"),
)
CATALOG: dict[str, Named] = {entry.name: entry for entry in _ALL}


def named(name: str) -> Named:
    """Return an entry of the catalog.

    Raises
    ------
    InputError
        If there is none of that name; lists those there are.

    Examples
    --------
    >>> named("tarmac").eta
    1.63
    """
    if name not in CATALOG:
        raise InputError("be in the catalog", got=repr(name), key="name", remedy=f"Known: {', '.join(CATALOG)}.")
    return CATALOG[name]
