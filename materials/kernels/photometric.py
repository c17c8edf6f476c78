"""Normals of pixels seen from one side under many lights: a robust fit of a dictionary of reflectances, per candidate normal.

The viewer is at z. A pixel's reflectance is a sum, with coefficients of at least 0, of a matte term and of GGX lobes of fixed
widths; the normal is the one under which such a sum explains the pixel best.
"""

import math

import numpy as np
from numba import njit, prange

from .frames import basis, dot, normalize
from .fresnel import schlick
from .microfacet import ggx_d, visibility

_F0 = 0.04
_LOWEST_COS = 0.02
"""Of the viewer: a visible surface cannot lean away, and at grazing its normal cannot be told."""
_VIEW = (0.0, 0.0, 1.0)


@njit(cache=True, error_model="numpy")
def _shade(n, lights, alphas, out):
    """Fill out (N, 1 + A) with the radiance of each term under each unit light: max(n . l, 0) f."""
    t, b = basis(n)
    wo = (dot(_VIEW, t), dot(_VIEW, b), max(n[2], _LOWEST_COS))
    for j in range(lights.shape[0]):
        light = (lights[j, 0], lights[j, 1], lights[j, 2])
        wi = (dot(light, t), dot(light, b), dot(light, n))
        if wi[2] <= 0.0:
            for k in range(out.shape[1]):
                out[j, k] = 0.0
            continue
        out[j, 0] = wi[2] / math.pi
        h = normalize((wo[0] + wi[0], wo[1] + wi[1], wo[2] + wi[2]))
        f = schlick(dot(wo, h), _F0) * wi[2]
        for k in range(len(alphas)):
            out[j, 1 + k] = f * ggx_d(h, alphas[k], alphas[k]) * visibility(wo, wi, alphas[k], alphas[k])


@njit(cache=True, error_model="numpy")
def _non_negative(gram, right, c):
    """Solve min |A c - y|, c >= 0, from A^T A and A^T y by coordinate descent, from the c given."""
    for _ in range(60):
        change = 0.0
        for k in range(len(c)):
            if gram[k, k] <= 1e-30:
                c[k] = 0.0
                continue
            r = right[k]
            for q in range(len(c)):
                r -= gram[k, q] * c[q]
            new = max(c[k] + r / gram[k, k], 0.0)
            change = max(change, abs(new - c[k]) * math.sqrt(gram[k, k]))
            c[k] = new
        if change < 1e-6:
            break


@njit(cache=True, error_model="numpy")
def _misfit(n, lights, y, floor, spread, alphas, start, rounds, shade, gram, right, c, w):
    """Return the sum of log(1 + z^2) of the best sum of terms, z the residual over `spread` of the level plus `floor`.

    The logarithm (Cauchy's loss) lets shadows and light from elsewhere, which no normal explains, count little; it is
    minimised over c by reweighted least squares.
    """
    num, terms = shade.shape
    _shade(n, lights, alphas, shade)
    for j in range(num):
        w[j] = start[j]
    total = 0.0
    for _ in range(rounds):
        right[:] = 0.0
        gram[:] = 0.0
        for j in range(num):
            for a in range(terms):
                wf = w[j] * shade[j, a]
                right[a] += wf * y[j]
                for q in range(terms):
                    gram[a, q] += wf * shade[j, q]
        _non_negative(gram, right, c)
        total = 0.0
        for j in range(num):
            m = 0.0
            for a in range(terms):
                m += c[a] * shade[j, a]
            sigma = spread * 0.5 * (m + y[j]) + floor
            z = (y[j] - m) / sigma
            total += math.log1p(z * z)
            w[j] = 1.0 / (sigma * sigma * (1.0 + z * z))
    return total


@njit(cache=True, error_model="numpy", parallel=True)
def fit_normals(lights, values, normals, alphas, spread, floor, steps, rounds):
    """Improve normals (P, 3) in place; return the mean misfit (P,) and the coefficients (P, 1 + A).

    values is (P, N), floor (P,). A pattern search on the sphere, steps [rad] from coarse to fine, as the misfit has kinks where
    lights set.
    """
    num_pixels, num = values.shape
    terms = 1 + len(alphas)
    misfit, coefficients = np.empty(num_pixels), np.empty((num_pixels, terms))
    for i in prange(num_pixels):
        shade, gram, right, c, w = np.empty((num, terms)), np.empty((terms, terms)), np.empty(terms), np.zeros(terms), np.empty(num)
        y = values[i]
        start = np.empty(num)
        for j in range(num):
            start[j] = 1.0 / (spread * y[j] + floor[i]) ** 2
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        best = _misfit(n, lights, y, floor[i], spread, alphas, start, rounds, shade, gram, right, c, w)
        for step in steps:
            for _ in range(6):
                t, b = basis(n)
                centre, moved = n, False
                for k in range(8):
                    u, v = step * math.cos(k * math.pi / 4), step * math.sin(k * math.pi / 4)
                    q = normalize(
                        (
                            centre[0] + u * t[0] + v * b[0],
                            centre[1] + u * t[1] + v * b[1],
                            centre[2] + u * t[2] + v * b[2],
                        )
                    )
                    if q[2] < _LOWEST_COS:
                        continue
                    m = _misfit(q, lights, y, floor[i], spread, alphas, start, rounds, shade, gram, right, c, w)
                    if m < best:
                        best, n, moved = m, q, True
                if not moved:
                    break
        misfit[i] = _misfit(n, lights, y, floor[i], spread, alphas, start, rounds, shade, gram, right, c, w) / num
        for k in range(terms):
            coefficients[i, k] = c[k]
        normals[i, 0], normals[i, 1], normals[i, 2] = n
    return misfit, coefficients


@njit(cache=True, error_model="numpy", parallel=True)
def least_squares_normals(lights, values, used):
    """Return normals (P, 3), least squares over each pixel's lights `used` (P, M); null where undetermined."""
    num_pixels = len(values)
    out = np.zeros((num_pixels, 3))
    for i in prange(num_pixels):
        a = np.zeros((3, 3))
        y = np.zeros(3)
        for j in used[i]:
            for p in range(3):
                y[p] += lights[j, p] * values[i, j]
                for q in range(3):
                    a[p, q] += lights[j, p] * lights[j, q]
        # Cramer's rule; the determinant vanishes if the lights left lie in a plane
        cross = np.empty((3, 3))
        for p in range(3):
            r, s = (p + 1) % 3, (p + 2) % 3
            for q in range(3):
                t, u = (q + 1) % 3, (q + 2) % 3
                cross[q, p] = a[r, t] * a[s, u] - a[r, u] * a[s, t]
        determinant = a[0, 0] * cross[0, 0] + a[0, 1] * cross[1, 0] + a[0, 2] * cross[2, 0]
        if determinant > 1e-9 * (a[0, 0] + a[1, 1] + a[2, 2]) ** 3:
            for p in range(3):
                out[i, p] = cross[p, 0] * y[0] + cross[p, 1] * y[1] + cross[p, 2] * y[2]
            length = math.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
            if length > 0.0:
                for p in range(3):
                    out[i, p] /= length
    return out
