"""Specular lobes with their derivatives by widths and by the directions' coordinates, for fits.

Each function returns the lobe, its derivatives by alpha_u and alpha_v, and its gradients by the local coordinates of wi and
of wo. The gradients hold along rotations of the frame, all that a fit asks of them: |wi + wo| and wi . wo stay as they are.
"""

import math

from numba import njit

from .cook_torrance import _COLUMNS, _RATIO, _ROWS
from .fresnel import schlick
from .kinds import COOK_TORRANCE, GGX, PHONG, WARD

HALF_VECTOR = -1
"""The anisotropic cosine lobe about the half vector of eq. 5.3: a fitting model only, its scale is no albedo."""

_INV_PI = 1.0 / math.pi
_NONE = (0.0, 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@njit(cache=True, error_model="numpy")
def lobe(kind, wi, wo, alpha_u, alpha_v, f0):
    """Return (K, dK/dalpha_u, dK/dalpha_v, dK/dwi, dK/dwo); null below the surface."""
    if wi[2] <= 0.0 or wo[2] <= 0.0:
        return _NONE
    if kind == PHONG:
        return _phong(wi, wo, alpha_u)
    if kind == WARD:
        return _ward(wi, wo, alpha_u, alpha_v)
    if kind == GGX:
        return _ggx(wi, wo, alpha_u, alpha_v, f0)
    if kind == COOK_TORRANCE:
        return _cook_torrance(wi, wo, alpha_u, alpha_v, f0)
    k, by_u, by_v, by_h = _cosine_power(wi, wo, alpha_u, alpha_v)
    g = (k * by_h[0], k * by_h[1], k * by_h[2])
    return k, k * by_u, k * by_v, g, g


@njit(cache=True, error_model="numpy")
def _phong(wi, wo, alpha):
    m = wo[2] * wi[2] - wo[0] * wi[0] - wo[1] * wi[1]
    if m <= 0.0:
        return _NONE
    m = min(m, 1.0)
    n = 2.0 / (alpha * alpha) - 2.0
    k = (n + 2.0) * 0.5 * _INV_PI * m**n
    slope = k * n / m * 2.0  # m = 2 wi_z wo_z - wi . wo
    by_alpha = k * (1.0 / (n + 2.0) + math.log(m)) * -4.0 / alpha**3
    return k, by_alpha, 0.0, (0.0, 0.0, slope * wo[2]), (0.0, 0.0, slope * wi[2])


@njit(cache=True, error_model="numpy")
def _ward(wi, wo, alpha_u, alpha_v):
    x, y, z = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    length2 = x * x + y * y + z * z
    a, b = x / (alpha_u * z), y / (alpha_v * z)
    t = a * a + b * b
    # (wo . h)^2 = |H|^2 / 4, (n . h)^4 = z^4 / |H|^4
    k = math.exp(-t) * _INV_PI / (alpha_u * alpha_v) * length2 / (z * z * z * z)
    g = (-2.0 * k * a / (alpha_u * z), -2.0 * k * b / (alpha_v * z), k * (2.0 * t - 4.0) / z)
    return k, k * (2.0 * a * a - 1.0) / alpha_u, k * (2.0 * b * b - 1.0) / alpha_v, g, g


@njit(cache=True, error_model="numpy")
def _cosine_power(wi, wo, alpha_u, alpha_v):
    """Return Ashikhmin and Shirley's D and the derivatives of its logarithm by the widths and by wi + wo."""
    x, y, z = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    s = x * x + y * y
    cos_h = z / math.sqrt(s + z * z)
    u2, v2 = alpha_u * alpha_u, alpha_v * alpha_v
    if s < 1e-14:  # the exponent has no azimuth there, and the cosine's logarithm vanishes
        return _INV_PI / (alpha_u * alpha_v), -1.0 / alpha_u, -1.0 / alpha_v, (0.0, 0.0, 0.0)
    p = (x * x / u2 + y * y / v2) / s
    log_cos = math.log(cos_h)
    d = cos_h ** (2.0 * p - 2.0) * _INV_PI / (alpha_u * alpha_v)
    by_u = -4.0 * log_cos * x * x / (u2 * alpha_u * s) - 1.0 / alpha_u
    by_v = -4.0 * log_cos * y * y / (v2 * alpha_v * s) - 1.0 / alpha_v
    g = (4.0 * log_cos * x * (1.0 / u2 - p) / s, 4.0 * log_cos * y * (1.0 / v2 - p) / s, (2.0 * p - 2.0) / z)
    return d, by_u, by_v, g


@njit(cache=True, error_model="numpy")
def _log_area(w, alpha_u, alpha_v):
    """Return the projected area of `cook_torrance` and the derivatives of its logarithm by widths and by w."""
    x, y, z = w
    u2, v2 = alpha_u * alpha_u, alpha_v * alpha_v
    q, r2 = u2 * x * x + v2 * y * y, x * x + y * y
    length = math.sqrt(q + z * z)
    alpha = math.sqrt(q / r2) if r2 > 1e-20 else alpha_u
    s = min(z / length, 1.0)
    row, column = min(alpha, 1.0) * (_ROWS - 1), s * (_COLUMNS - 1)
    i, j = min(int(row), _ROWS - 2), min(int(column), _COLUMNS - 2)
    a, b = row - i, column - j
    r00, r01, r10, r11 = _RATIO[i, j], _RATIO[i, j + 1], _RATIO[i + 1, j], _RATIO[i + 1, j + 1]
    low, high = (1.0 - b) * r00 + b * r01, (1.0 - b) * r10 + b * r11
    ratio = (1.0 - a) * low + a * high
    by_alpha = (high - low) * (_ROWS - 1) / ratio
    by_s = ((1.0 - a) * (r01 - r00) + a * (r11 - r10)) * (_COLUMNS - 1) / ratio
    lx, ly, lz = u2 * x / length, v2 * y / length, z / length
    lu, lv = alpha_u * x * x / length, alpha_v * y * y / length
    # ln area = ln length + ln ratio(alpha, z / length)
    by_length = (1.0 - by_s * s) / length
    if r2 > 1e-20:
        f = by_alpha / (alpha * r2)
        ax, ay = f * x * (u2 - alpha * alpha), f * y * (v2 - alpha * alpha)
        au, av = f * alpha_u * x * x, f * alpha_v * y * y
    else:
        ax, ay, au, av = 0.0, 0.0, 0.0, 0.0
    g = (by_length * lx + ax, by_length * ly + ay, by_length * lz + by_s / length)
    return length * ratio, by_length * lu + au, by_length * lv + av, g


@njit(cache=True, error_model="numpy")
def _cook_torrance(wi, wo, alpha_u, alpha_v, f0):
    d, du, dv, dh = _cosine_power(wi, wo, alpha_u, alpha_v)
    area_i, iu, iv, gi = _log_area(wi, alpha_u, alpha_v)
    area_o, ou, ov, go = _log_area(wo, alpha_u, alpha_v)
    k = schlick(_half_cosine(wi, wo), f0) * d / (4.0 * area_i * area_o)
    by_i = (k * (dh[0] - gi[0]), k * (dh[1] - gi[1]), k * (dh[2] - gi[2]))
    by_o = (k * (dh[0] - go[0]), k * (dh[1] - go[1]), k * (dh[2] - go[2]))
    return k, k * (du - iu - ou), k * (dv - iv - ov), by_i, by_o


@njit(cache=True, error_model="numpy")
def _ggx(wi, wo, alpha_u, alpha_v, f0):
    x, y, z = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    u2, v2 = alpha_u * alpha_u, alpha_v * alpha_v
    e = x * x / u2 + y * y / v2 + z * z
    length2 = x * x + y * y + z * z
    d = _INV_PI / (alpha_u * alpha_v) * (length2 / e) ** 2
    li = math.sqrt(u2 * wi[0] * wi[0] + v2 * wi[1] * wi[1] + wi[2] * wi[2])
    lo = math.sqrt(u2 * wo[0] * wo[0] + v2 * wo[1] * wo[1] + wo[2] * wo[2])
    sum_ = wo[2] * li + wi[2] * lo
    k = schlick(_half_cosine(wi, wo), f0) * d * 0.5 / sum_
    i, o = wo[2] / (li * sum_), wi[2] / (lo * sum_)
    by_u = -1.0 / alpha_u + 4.0 * x * x / (u2 * alpha_u * e) - alpha_u * (i * wi[0] * wi[0] + o * wo[0] * wo[0])
    by_v = -1.0 / alpha_v + 4.0 * y * y / (v2 * alpha_v * e) - alpha_v * (i * wi[1] * wi[1] + o * wo[1] * wo[1])
    hx, hy, hz = -4.0 * x / (u2 * e), -4.0 * y / (v2 * e), -4.0 * z / e
    by_i = (k * (hx - i * u2 * wi[0]), k * (hy - i * v2 * wi[1]), k * (hz - i * wi[2] - lo / sum_))
    by_o = (k * (hx - o * u2 * wo[0]), k * (hy - o * v2 * wo[1]), k * (hz - o * wo[2] - li / sum_))
    return k, k * by_u, k * by_v, by_i, by_o


@njit(cache=True, error_model="numpy")
def _half_cosine(wi, wo):
    """Return wo . h = |wi + wo| / 2."""
    return math.sqrt(max(0.5 * (1.0 + wi[0] * wo[0] + wi[1] * wo[1] + wi[2] * wo[2]), 0.0))
