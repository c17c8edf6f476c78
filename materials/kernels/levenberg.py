"""Levenberg and Marquardt's method for the cost of `brdf_fit`, within bounds, compiled as a whole.

The parameter vector x is that of `fit_problem.Problem`: diffuse (C), specular (L C), widths (L 2), the spread of an Oren-Nayar
base if there is one (the vector's length tells), three angles that turn the base frame. Cauchy's loss enters by weights
(iteratively reweighted least squares): with s the squared residual r of one sample, the gradient of log(1 + s / 4) is w r J,
and its Hessian is taken as w J J^T, w = 1 / (2 + s / 2).

References
----------
Marquardt (1963), An algorithm for least-squares estimation of nonlinear parameters. Nielsen (1999), Damping parameter in
Marquardt's method (how the damping follows the gain).
"""

import math

import numpy as np
from numba import njit

from .brdf_fit import _local
from .lobe_gradients import lobe
from .matte_gradients import matte

_INV_PI = 1.0 / math.pi
_MAX_TURN = 0.5
_APART = 0.1


@njit(cache=True)
def turned(base, a, b, c):
    """Return base Ry(a) Rx(b) Rz(c) and its derivatives by the angles (3, 3, 3)."""
    ca, sa, cb, sb, cc, sc = math.cos(a), math.sin(a), math.cos(b), math.sin(b), math.cos(c), math.sin(c)
    y, dy = np.eye(3), np.zeros((3, 3))
    y[0, 0], y[0, 2], y[2, 0], y[2, 2] = ca, sa, -sa, ca
    dy[0, 0], dy[0, 2], dy[2, 0], dy[2, 2] = -sa, ca, -ca, -sa
    x, dx = np.eye(3), np.zeros((3, 3))
    x[1, 1], x[1, 2], x[2, 1], x[2, 2] = cb, -sb, sb, cb
    dx[1, 1], dx[1, 2], dx[2, 1], dx[2, 2] = -sb, -cb, cb, -sb
    z, dz = np.eye(3), np.zeros((3, 3))
    z[0, 0], z[0, 1], z[1, 0], z[1, 1] = cc, -sc, sc, cc
    dz[0, 0], dz[0, 1], dz[1, 0], dz[1, 1] = -sc, -cc, cc, -sc
    by = np.empty((3, 3, 3))
    by[0] = base @ dy @ x @ z
    by[1] = base @ y @ dx @ z
    by[2] = base @ y @ x @ dz
    return base @ y @ x @ z, by


@njit(cache=True, error_model="numpy", nogil=True)
def normal_equations(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride, hessian, gradient, meat):
    """Return the cost; fill Hessian (P, P), gradient (P,) and, unless it is empty, the sum of (w r)^2 J J^T.

    Every `stride`-th sample is used. If `tied`, each lobe has one width, its first. All three are of the mean over samples and
    channels, `meat` over their number squared.
    """
    num, channels = value.shape
    size = len(x)
    first = channels * (1 + lobes)  # of the parameters that all channels share
    shared = size - first
    turn = shared - 3  # where the angles begin among these
    is_rough = turn > 2 * lobes
    frame, by_angle = turned(base, x[size - 3], x[size - 2], x[size - 1])
    hessian[:] = 0.0
    gradient[:] = 0.0
    meat[:] = 0.0
    with_meat = len(meat) > 0
    ks = np.empty(lobes)
    slopes = np.empty((lobes, 5))  # of one lobe by its widths and by the angles
    row = np.empty(shared)
    by_factor = np.empty(3)
    turn_i, turn_o = np.empty((3, 3)), np.empty((3, 3))  # how the local directions move with the angles
    linear = np.empty(1 + lobes)
    total, used = 0.0, 0
    for j in range(0, num, stride):
        used += 1
        a, b = (wi[j, 0], wi[j, 1], wi[j, 2]), (wo[j, 0], wo[j, 1], wo[j, 2])
        local_i, local_o = _local(frame, a), _local(frame, b)
        weight = a[2] * b[2] / loss_scale
        if local_i[2] <= 0.0 or local_o[2] <= 0.0:
            for c in range(channels):
                r = weight * value[j, c]
                total += math.log1p(0.25 * r * r)
            continue
        factor = local_i[2] / a[2]
        for m in range(3):
            for q in range(3):
                turn_i[m, q] = by_angle[m, 0, q] * a[0] + by_angle[m, 1, q] * a[1] + by_angle[m, 2, q] * a[2]
                turn_o[m, q] = by_angle[m, 0, q] * b[0] + by_angle[m, 1, q] * b[1] + by_angle[m, 2, q] * b[2]
            by_factor[m] = turn_i[m, 2] / a[2]
        for k in range(lobes):
            at = first + 2 * k
            alpha_v = x[at] if tied else x[at + 1]
            ks[k], du, dv, gi, go = lobe(kind, local_i, local_o, x[at], alpha_v, f0)
            slopes[k, 0], slopes[k, 1] = (du + dv, 0.0) if tied else (du, dv)
            for m in range(3):
                s = 0.0
                for q in range(3):
                    s += gi[q] * turn_i[m, q] + go[q] * turn_o[m, q]
                slopes[k, 2 + m] = s
        scaled = weight * factor
        base_value, m_sigma, m_i, m_o = _INV_PI, 0.0, 0.0, 0.0
        if is_rough:
            m_value, m_sigma, m_i, m_o = matte(local_i, local_o, x[size - 4])
            base_value *= m_value
        linear[0] = scaled * base_value
        for k in range(lobes):
            linear[1 + k] = scaled * ks[k]
        for c in range(channels):
            f = x[c] * base_value
            for m in range(3):
                row[turn + m] = 0.0
            if is_rough:
                d = scaled * x[c] * _INV_PI
                row[turn - 1] = d * m_sigma
                for m in range(3):
                    row[turn + m] = d * (m_i * turn_i[m, 2] + m_o * turn_o[m, 2])
            for k in range(lobes):
                s = x[channels * (1 + k) + c]
                f += s * ks[k]
                row[2 * k] = scaled * s * slopes[k, 0]
                row[2 * k + 1] = scaled * s * slopes[k, 1]
                for m in range(3):
                    row[turn + m] += scaled * s * slopes[k, 2 + m]
            for m in range(3):
                row[turn + m] += weight * by_factor[m] * f
            r = scaled * f - weight * value[j, c]
            s2 = 0.25 * r * r
            total += math.log1p(s2)
            w = 0.5 / (1.0 + s2)
            pull = w * r
            for p in range(1 + lobes):
                at = channels * p + c
                gradient[at] += pull * linear[p]
                v = w * linear[p]
                for q in range(p + 1):
                    hessian[at, channels * q + c] += v * linear[q]
                for q in range(shared):
                    hessian[first + q, at] += v * row[q]
            for p in range(shared):
                gradient[first + p] += pull * row[p]
                v = w * row[p]
                for q in range(p + 1):
                    hessian[first + p, first + q] += v * row[q]
            if with_meat:
                w2 = pull * pull
                for p in range(1 + lobes):
                    at = channels * p + c
                    v = w2 * linear[p]
                    for q in range(p + 1):
                        meat[at, channels * q + c] += v * linear[q]
                    for q in range(shared):
                        meat[first + q, at] += v * row[q]
                for p in range(shared):
                    v = w2 * row[p]
                    for q in range(p + 1):
                        meat[first + p, first + q] += v * row[q]
    scale = 1.0 / (max(used, 1) * channels)
    for p in range(size):
        gradient[p] *= scale
        for q in range(p + 1):
            hessian[p, q] *= scale
            hessian[q, p] = hessian[p, q]
            if with_meat:
                meat[p, q] *= scale * scale
                meat[q, p] = meat[p, q]
    return total * scale


@njit(cache=True, error_model="numpy")
def solve_damped(hessian, gradient, damping, free, step):
    """Fill `step` with -(H + damping diag H)^-1 g over the free parameters by Cholesky; return whether that was possible."""
    size = len(gradient)
    index = np.empty(size, np.int64)
    n = 0
    for p in range(size):
        step[p] = 0.0
        if free[p] and hessian[p, p] > 0.0:
            index[n] = p
            n += 1
    lower, y = np.empty((n, n)), np.empty(n)
    # Scaled to a unit diagonal, so that reflectances and angles weigh alike in the test for a singular matrix.
    for i in range(n):
        p = index[i]
        for j in range(i + 1):
            q = index[j]
            v = hessian[p, q] / math.sqrt(hessian[p, p] * hessian[q, q])
            if i == j:
                v = 1.0 + damping
            for k in range(j):
                v -= lower[i, k] * lower[j, k]
            if i == j:
                if v <= 1e-14:
                    return False
                lower[i, i] = math.sqrt(v)
            else:
                lower[i, j] = v / lower[j, j]
        v = -gradient[p] / math.sqrt(hessian[p, p])
        for k in range(i):
            v -= lower[i, k] * y[k]
        y[i] = v / lower[i, i]
    for i in range(n - 1, -1, -1):
        v = y[i]
        for k in range(i + 1, n):
            v -= lower[k, i] * y[k]
        y[i] = v / lower[i, i]
        step[index[i]] = y[i] / math.sqrt(hessian[index[i], index[i]])
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def minimise(wi, wo, value, kind, f0, tied, base, x, low, high, lobes, loss_scale, stride, tolerance, max_steps):
    """Move x to a minimum of the cost within [low, high]; return the cost and the number of evaluations.

    Ends when a step lowers the cost by less than `tolerance` of it, or cannot lower it at all.
    """
    size = len(x)
    hessian, gradient = np.empty((size, size)), np.empty(size)
    other_hessian, other_gradient = np.empty((size, size)), np.empty(size)
    none = np.empty((0, 0))
    step, at, free = np.empty(size), np.empty(size), np.empty(size, np.bool_)
    for p in range(size):
        x[p] = min(max(x[p], low[p]), high[p])
    cost = normal_equations(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride, hessian, gradient, none)
    damping, growth, evaluations = 1e-3, 2.0, 1
    while evaluations < max_steps:
        for p in range(size):
            edge = 1e-12 * (1.0 + abs(x[p]))
            inward = (x[p] > low[p] + edge or gradient[p] < 0.0) and (x[p] < high[p] - edge or gradient[p] > 0.0)
            free[p] = low[p] < high[p] and inward
        if not solve_damped(hessian, gradient, damping, free, step):
            damping *= 10.0
            if damping > 1e12:
                break
            continue
        expected, moved = 0.0, 0.0
        for p in range(size):
            if p >= size - 3:
                # An angle that hardly matters yet, as at equal widths, would spin.
                step[p] = min(max(step[p], -_MAX_TURN), _MAX_TURN)
            at[p] = min(max(x[p] + step[p], low[p]), high[p])
            step[p] = at[p] - x[p]
        for p in range(size):
            pulled = 0.0
            for q in range(size):
                pulled += hessian[p, q] * step[q]
            expected -= step[p] * (gradient[p] + 0.5 * pulled)
            moved += abs(step[p]) / (1e-3 + abs(x[p]))
        if moved < 1e-10:
            break
        new = normal_equations(
            wi, wo, value, kind, f0, tied, base, at, lobes, loss_scale, stride, other_hessian, other_gradient, none
        )
        evaluations += 1
        if new < cost:
            gain = cost - new
            x[:] = at
            hessian[:] = other_hessian
            gradient[:] = other_gradient
            ratio = gain / expected if expected > 0.0 else 1.0
            damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 2.0) - 1.0) ** 3), 1e-9)
            growth = 2.0
            done = gain <= tolerance * cost
            cost = new
            if done:
                break
        else:
            damping *= growth
            growth *= 2.0
            if damping > 1e12:
                break
    return cost, evaluations


@njit(cache=True, error_model="numpy", nogil=True)
def start_linear(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride):
    """Set albedo and scales of x to what least squares gives at its widths and angles, small ones to a small positive level."""
    size, channels = len(x), value.shape[1]
    first = channels * (1 + lobes)
    x[:first] = 0.0
    hessian, gradient, step = np.empty((size, size)), np.empty(size), np.empty(size)
    free = np.zeros(size, np.bool_)
    free[:first] = True
    normal_equations(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride, hessian, gradient, np.empty((0, 0)))
    solve_damped(hessian, gradient, 1e-9, free, step)
    # A scale of exactly 0 would leave its width without gradient.
    least = 1e-3 * max(value.mean(), 1e-9)
    for p in range(first):
        x[p] = max(step[p], least)


@njit(cache=True, error_model="numpy", nogil=True)
def start_tangent(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride):
    """Turn the tangent of x, whose lobes are round, to where drawing the first lobe's widths apart lowers the cost most.

    The derivative by the difference of the widths is A cos 2 (turn - best): two angles give it all. All widths are then set
    apart by a tenth, since round lobes have no derivative by the angle.
    """
    size, channels = len(x), value.shape[1]
    at = channels * (1 + lobes)
    hessian, gradient, none = np.empty((size, size)), np.empty(size), np.empty((0, 0))
    slope = np.empty(2)
    for k in range(2):
        x[size - 1] = 0.25 * math.pi * k
        normal_equations(wi, wo, value, kind, f0, tied, base, x, lobes, loss_scale, stride, hessian, gradient, none)
        slope[k] = gradient[at] - gradient[at + 1]
    x[size - 1] = 0.5 * math.atan2(-slope[1], -slope[0])
    for k in range(lobes):
        x[at + 2 * k] *= 1.0 + _APART
        x[at + 2 * k + 1] *= 1.0 - _APART
