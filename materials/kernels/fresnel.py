"""How much an interface reflects: exact for dielectrics and conductors, Schlick's, and averages over directions."""

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def dielectric(cos_i, eta):
    """Return the unpolarised reflectance at cos_i >= 0; eta is the index behind over the index before (TIR gives 1)."""
    if eta == 1.0:
        return 0.0
    sin2_t = (1.0 - cos_i * cos_i) / (eta * eta)
    if sin2_t >= 1.0:
        return 1.0
    if cos_i <= 0.0:
        return 1.0
    cos_t = math.sqrt(1.0 - sin2_t)
    r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return 0.5 * (r_s * r_s + r_p * r_p)


@njit(cache=True, error_model="numpy")
def normal_reflectance(eta):
    """Return ((eta - 1) / (eta + 1))^2."""
    r = (eta - 1.0) / (eta + 1.0)
    return r * r


@njit(cache=True)
def schlick(cos_i, f0):
    """Return Schlick's (1994) approximation from the reflectance f0 at normal incidence."""
    m = min(max(1.0 - cos_i, 0.0), 1.0)
    m2 = m * m
    return f0 + (1.0 - f0) * m2 * m2 * m


@njit(cache=True, error_model="numpy")
def conductor(cos_i, eta, k):
    """Return the unpolarised reflectance of a metal of index eta + ik."""
    c2 = cos_i * cos_i
    s2 = 1.0 - c2
    d = eta * eta - k * k - s2
    a2b2 = math.sqrt(d * d + 4.0 * eta * eta * k * k)
    a = math.sqrt(max(0.5 * (a2b2 + d), 0.0))
    t1 = a2b2 + c2
    t2 = 2.0 * a * cos_i
    r_s = (t1 - t2) / (t1 + t2)
    t3 = c2 * a2b2 + s2 * s2
    t4 = t2 * s2
    return 0.5 * r_s * (1.0 + (t3 - t4) / (t3 + t4))


@njit(cache=True, error_model="numpy")
def diffuse_external(eta):
    """Return the reflectance for diffuse light from outside, eta >= 1, in closed form (Walsh 1926, by Duntley 1942).

    Below eta = 1.001 the terms cancel; there it is the chord to 0, wrong by less than 1e-4.
    """
    if eta <= 1.0:
        return 0.0
    n = max(eta, 1.001)
    n2 = n * n
    n4 = n2 * n2
    value = (
        0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) ** 2)
        + n2 * (n2 - 1.0) ** 2 / (n2 + 1.0) ** 3 * math.log((n - 1.0) / (n + 1.0))
        - 2.0 * n2 * n * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0) ** 2) * math.log(n)
    )
    return value if eta >= 1.001 else value * (eta - 1.0) / 0.001


@njit(cache=True, error_model="numpy")
def diffuse_internal(eta):
    """Return the reflectance for diffuse light from inside, eta >= 1: 1 - (1 - external) / eta^2, since etendue is kept."""
    return 1.0 - (1.0 - diffuse_external(eta)) / (eta * eta)


# The absorbing film: light that leaves the base diffusely, is reflected by the interface and returns has crossed the
# film twice. Its mean reflectance is Fdi(tau) = 2 int F(mu) exp(-2 tau / mu) mu dmu, mu the cosine inside. Stored is
# the ratio to tau = 0, so that a clear film is exact, over mu_c (the critical cosine, standing for eta) and
# s = v / (1 + v), v = sqrt(tau / mu_c): with that scaling the ratio is smooth, down to eta = 1. Bilinear
# interpolation is then off by less than 1e-4 for eta up to 3 (tested).
_ROWS, _COLUMNS, _MU_MAX = 33, 193, math.sqrt(1.0 - 1.0 / 9.0)


def _absorbed_ratio() -> np.ndarray:
    nodes, weights = np.polynomial.legendre.leggauss(48)
    x, w = 0.5 * (nodes + 1.0), 0.5 * weights
    table = np.zeros((_ROWS, _COLUMNS))
    s = np.arange(_COLUMNS) / (_COLUMNS - 1.0)
    with np.errstate(divide="ignore"):
        t = (s / (1.0 - s)) ** 2
    for row, mu_c in enumerate(np.linspace(0.0, _MU_MAX, _ROWS)):
        mu_c = max(mu_c, 1e-3)
        # beyond mu_c, F falls from 1 like the square root of mu - mu_c and, near eta = 1, within a few mu_c:
        # mu = mu_c exp(q^2) resolves both
        q_max = math.sqrt(math.log(1.0 / mu_c))
        q = q_max * x
        mu = mu_c * np.exp(q * q)
        dmu = 2.0 * q * mu * q_max * w
        eta = 1.0 / math.sqrt(1.0 - mu_c * mu_c)
        cos_t = np.sqrt(np.maximum(1.0 - eta * eta * (1.0 - mu * mu), 0.0))
        r_s = (eta * mu - cos_t) / (eta * mu + cos_t)
        r_p = (mu - eta * cos_t) / (mu + eta * cos_t)
        mu = np.concatenate([mu_c * x, mu])
        weight = np.concatenate([mu_c * w, 0.5 * (r_s * r_s + r_p * r_p) * dmu]) * mu
        finite = np.isfinite(t)
        table[row, finite] = np.exp(-2.0 * (t[finite, None] * mu_c) / mu) @ weight / weight.sum()
    return table


_RATIO = _absorbed_ratio()


@njit(cache=True, error_model="numpy")
def absorbed_ratio(eta, tau):
    """Return Fdi(tau) / Fdi(0), eta in [1, 3]; tau is the vertical optical depth of one crossing."""
    if tau <= 0.0 or eta <= 1.0:
        return 1.0
    mu_c = math.sqrt(1.0 - 1.0 / (eta * eta))
    v = math.sqrt(tau / mu_c)
    row = min(mu_c / _MU_MAX, 1.0) * (_ROWS - 1)
    column = (1.0 - 1.0 / (1.0 + v)) * (_COLUMNS - 1)
    i = min(int(row), _ROWS - 2)
    j = min(int(column), _COLUMNS - 2)
    a, b = row - i, column - j
    low = (1.0 - b) * _RATIO[i, j] + b * _RATIO[i, j + 1]
    high = (1.0 - b) * _RATIO[i + 1, j] + b * _RATIO[i + 1, j + 1]
    return (1.0 - a) * low + a * high


@njit(cache=True, error_model="numpy")
def diffuse_internal_absorbed(eta, tau):
    """Return Fdi(tau), the share of diffuse light from below that an interface sends back down through tau twice."""
    return diffuse_internal(eta) * absorbed_ratio(eta, tau) if eta > 1.0 else 0.0
