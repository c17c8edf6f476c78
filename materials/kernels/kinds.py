"""The kinds of surfaces, and the record that carries the parameters of any of them."""

from typing import NamedTuple

LAMBERT, GGX, COATED, MIRROR, DIELECTRIC, ROUGH_DIELECTRIC, EMISSION = 0, 1, 2, 3, 4, 5, 6
OREN_NAYAR, PHONG, WARD, COOK_TORRANCE, DISNEY, CONDUCTOR, TABULATED = 7, 8, 9, 10, 11, 12, 13

# Entries of `Surface.more`. Of the kinds that are a diffuse part and a lobe: colour of the lobe, a second lobe, and which
# of Ward's normalisations.
TINT, SECOND_SCALE, SECOND_ALPHA_U, SECOND_ALPHA_V, NORMALISATION = 0, 3, 4, 5, 6
# Of `OREN_NAYAR`: spread of slopes [rad]. Of `CONDUCTOR`: complex index eta + ik per channel. Of `DISNEY`: see `disney`.
SIGMA, METAL_ETA, METAL_K = 0, 0, 3
# Of `TABULATED`: which row of the world's tables it is (see `tabulated`), and the texture coordinates.
TABLE, TABLE_U, TABLE_V = 0, 1, 2
NUM_MORE = 10
PLAIN = (1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)


class Surface(NamedTuple):
    """All that a scattering event needs; float64 but for `kind`.

    eta is inside over outside for the dielectrics and the specular lobe of `GGX`, of `COOK_TORRANCE` and of a coated base
    (over air, not over the film). film_eta in [1, 3], film_alpha (0: smooth) and tau (optical depth of one vertical
    crossing, per channel) belong to `COATED`. `more` holds what only some kinds have, see above.
    """

    kind: int
    albedo_r: float
    albedo_g: float
    albedo_b: float
    specular_scale: float
    eta: float
    alpha_u: float
    alpha_v: float
    film_eta: float
    film_alpha: float
    tau_r: float
    tau_g: float
    tau_b: float
    more: tuple[float, ...] = PLAIN
