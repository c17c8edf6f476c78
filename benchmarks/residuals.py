"""The residuals of a fit and their derivatives, compiled, for solvers that want them one by one."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from materials.kernels.brdf_fit import _local
from materials.kernels.levenberg import turned
from materials.kernels.lobe_gradients import lobe

_INV_PI = 1.0 / math.pi


@njit(cache=True, error_model="numpy", nogil=True)
def residuals(wi, wo, value, kind, f0, base, x, lobes, out, jacobian):
    """Fill out (N C,) and, unless it is empty, jacobian (N C, P).

    A residual is the root of log(1 + s / 4), so that half the sum of its squares is the cost of a fit times N C / 2: what a
    solver for plain least squares needs to minimise Cauchy's loss.
    """
    num, channels = value.shape
    size = len(x)
    first = channels * (1 + lobes)
    frame, by_angle = turned(base, x[size - 3], x[size - 2], x[size - 1])
    with_slopes = len(jacobian) > 0
    row = np.empty(size)
    for j in range(num):
        a, b = (wi[j, 0], wi[j, 1], wi[j, 2]), (wo[j, 0], wo[j, 1], wo[j, 2])
        local_i, local_o = _local(frame, a), _local(frame, b)
        lit = local_i[2] > 0.0 and local_o[2] > 0.0
        weight = a[2] * b[2]
        factor = local_i[2] / a[2] if lit else 0.0
        for c in range(channels):
            f = 0.0
            row[:] = 0.0
            if lit:
                f = x[c] * _INV_PI
                row[c] = weight * factor * _INV_PI
                for k in range(lobes):
                    at = first + 2 * k
                    value_k, du, dv, gi, go = lobe(kind, local_i, local_o, x[at], x[at + 1], f0)
                    s = x[channels * (1 + k) + c]
                    f += s * value_k
                    row[channels * (1 + k) + c] = weight * factor * value_k
                    row[at], row[at + 1] = weight * factor * s * du, weight * factor * s * dv
                    for m in range(3):
                        slope = 0.0
                        for q in range(3):
                            slope += gi[q] * (by_angle[m, 0, q] * a[0] + by_angle[m, 1, q] * a[1] + by_angle[m, 2, q] * a[2])
                            slope += go[q] * (by_angle[m, 0, q] * b[0] + by_angle[m, 1, q] * b[1] + by_angle[m, 2, q] * b[2])
                        row[size - 3 + m] += weight * factor * s * slope
                for m in range(3):
                    by_factor = (by_angle[m, 0, 2] * a[0] + by_angle[m, 1, 2] * a[1] + by_angle[m, 2, 2] * a[2]) / a[2]
                    row[size - 3 + m] += weight * by_factor * f
            r = weight * (factor * f - value[j, c])
            loss = math.log1p(0.25 * r * r)
            root = math.sqrt(loss) if r >= 0.0 else -math.sqrt(loss)
            out[j * channels + c] = root
            if with_slopes:
                # d root / dr = r / (4 (1 + r^2 / 4) root), which tends to 1 / 2
                slope = 0.25 * r / ((1.0 + 0.25 * r * r) * root) if abs(root) > 1e-12 else 0.5
                for p in range(size):
                    jacobian[j * channels + c, p] = slope * row[p]
