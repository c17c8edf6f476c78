"""The matte part of a fit with its derivatives: Oren and Nayar's, of which Lambert's is that of spread 0."""

from numba import njit

from .oren_nayar import coefficients


@njit(cache=True, error_model="numpy")
def matte(wi, wo, sigma):
    """Return m of f = albedo / pi m, and its derivatives by sigma, wi_z and wo_z; both directions above the surface.

    The latter two hold along rotations of the frame, as those of `lobe_gradients`: wi . wo stays as it is, so that m depends on
    the elevations alone.
    """
    a, b = coefficients(sigma)
    s2 = sigma * sigma
    by_a, by_b = -0.33 * sigma / ((s2 + 0.33) * (s2 + 0.33)), 0.081 * sigma / ((s2 + 0.09) * (s2 + 0.09))
    s = wi[0] * wo[0] + wi[1] * wo[1]  # wi . wo - wi_z wo_z
    if s <= 0.0:
        return a, by_a, 0.0, 0.0
    if wi[2] >= wo[2]:
        t = s / wi[2]
        return a + b * t, by_a + by_b * t, b * (-wo[2] - t) / wi[2], -b
    t = s / wo[2]
    return a + b * t, by_a + by_b * t, -b, b * (-wi[2] - t) / wo[2]
