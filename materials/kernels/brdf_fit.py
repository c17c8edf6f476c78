"""The cost of a fit (thesis eq. 5.2, with eq. 5.3's turned normal) and its gradient, over all samples of one texel."""

import math

import numpy as np
from numba import njit

from .lobe_gradients import lobe
from .matte_gradients import matte

_INV_PI = 1.0 / math.pi


@njit(cache=True)
def _local(frame, w):
    """Return w in the frame whose columns are tangent, bitangent and normal."""
    return (
        frame[0, 0] * w[0] + frame[1, 0] * w[1] + frame[2, 0] * w[2],
        frame[0, 1] * w[0] + frame[1, 1] * w[1] + frame[2, 1] * w[2],
        frame[0, 2] * w[0] + frame[1, 2] * w[1] + frame[2, 2] * w[2],
    )


@njit(cache=True, error_model="numpy", nogil=True)
def cost(
    wi,
    wo,
    value,
    kind,
    f0,
    frame,
    diffuse,
    specular,
    alpha,
    sigma,
    loss_scale,
    by_diffuse,
    by_specular,
    by_alpha,
    by_sigma,
    by_frame,
):
    """Return the mean over samples and channels of log(1 + s / 4); fill its derivatives.

    s is the squared residual, times cos theta_i cos theta_o on the coarse normal and over loss_scale. value (N, C),
    diffuse (C,), specular (L, C), alpha (L, 2); sigma is the spread of the matte part's slopes (0 is Lambert's), by_sigma (1,);
    by_frame (3, 3) is the derivative by the matrix's elements.
    """
    num, channels = value.shape
    lobes = len(alpha)
    by_diffuse[:] = 0.0
    by_specular[:] = 0.0
    by_alpha[:] = 0.0
    by_sigma[:] = 0.0
    by_frame[:] = 0.0
    total = 0.0
    gi, go = np.empty(3), np.empty(3)
    ks = np.empty(lobes)
    for j in range(num):
        a, b = (wi[j, 0], wi[j, 1], wi[j, 2]), (wo[j, 0], wo[j, 1], wo[j, 2])
        local_i, local_o = _local(frame, a), _local(frame, b)
        lit = local_i[2] > 0.0 and local_o[2] > 0.0
        factor = local_i[2] / a[2] if lit else 0.0
        weight = a[2] * b[2] / loss_scale
        gi[:] = 0.0
        go[:] = 0.0
        model_slope = 0.0
        m, m_sigma, m_i, m_o = 1.0, 0.0, 0.0, 0.0
        if sigma > 0.0 and lit:
            m, m_sigma, m_i, m_o = matte(local_i, local_o, sigma)
        for k in range(lobes):
            ks[k] = 0.0
        pulls, matte_pull = 0.0, 0.0
        for c in range(channels):
            f = 0.0
            if lit:
                f = diffuse[c] * _INV_PI * m
                for k in range(lobes):
                    if c == 0:
                        ks[k] = lobe(kind, local_i, local_o, alpha[k, 0], alpha[k, 1], f0)[0]
                    f += specular[k, c] * ks[k]
            r = weight * (factor * f - value[j, c])
            total += math.log1p(0.25 * r * r)
            pull = 0.5 * r / (1.0 + 0.25 * r * r) * weight
            by_diffuse[c] += pull * factor * _INV_PI * m
            matte_pull += pull * factor * diffuse[c] * _INV_PI
            pulls += abs(pull)
            if lit:
                model_slope += pull * f
                for k in range(lobes):
                    by_specular[k, c] += pull * factor * ks[k]
        if not lit or pulls == 0.0:
            continue
        for k in range(lobes):
            pulled = 0.0
            for c in range(channels):
                f = diffuse[c] * _INV_PI * m
                for q in range(lobes):
                    f += specular[q, c] * ks[q]
                r = weight * (factor * f - value[j, c])
                pulled += 0.5 * r / (1.0 + 0.25 * r * r) * weight * specular[k, c]
            pulled *= factor
            _, du, dv, ki, ko = lobe(kind, local_i, local_o, alpha[k, 0], alpha[k, 1], f0)
            by_alpha[k, 0] += pulled * du
            by_alpha[k, 1] += pulled * dv
            for q in range(3):
                gi[q] += pulled * ki[q]
                go[q] += pulled * ko[q]
        by_sigma[0] += matte_pull * m_sigma
        gi[2] += model_slope / a[2] + matte_pull * m_i
        go[2] += matte_pull * m_o
        for p in range(3):
            for q in range(3):
                by_frame[p, q] += a[p] * gi[q] + b[p] * go[q]
    scale = 1.0 / (num * channels)
    by_diffuse *= scale
    by_specular *= scale
    by_alpha *= scale
    by_sigma *= scale
    by_frame *= scale
    return total * scale


@njit(cache=True, error_model="numpy", nogil=True)
def terms(wi, wo, kind, f0, frame, alpha):
    """Return per sample the factor (wi . n) / cos theta_i (0 where unlit) and, per lobe, K, dK/dalpha (2), dK/dwi, dK/dwo."""
    num, lobes = len(wi), len(alpha)
    factor, out = np.zeros(num), np.zeros((num, lobes, 9))
    for j in range(num):
        a, b = (wi[j, 0], wi[j, 1], wi[j, 2]), (wo[j, 0], wo[j, 1], wo[j, 2])
        local_i, local_o = _local(frame, a), _local(frame, b)
        if local_i[2] <= 0.0 or local_o[2] <= 0.0:
            continue
        factor[j] = local_i[2] / a[2]
        for k in range(lobes):
            value, du, dv, gi, go = lobe(kind, local_i, local_o, alpha[k, 0], alpha[k, 1], f0)
            out[j, k, 0], out[j, k, 1], out[j, k, 2] = value, du, dv
            for q in range(3):
                out[j, k, 3 + q], out[j, k, 6 + q] = gi[q], go[q]
    return factor, out


@njit(cache=True, error_model="numpy", nogil=True)
def misfit(wi, wo, value, kind, f0, frame, diffuse, specular, alpha, sigma):
    """Return the mean squares of the cosine-weighted residual and of the cosine-weighted values."""
    num, channels = value.shape
    lobes = len(alpha)
    ks = np.empty(lobes)
    residual, level = 0.0, 0.0
    for j in range(num):
        a, b = (wi[j, 0], wi[j, 1], wi[j, 2]), (wo[j, 0], wo[j, 1], wo[j, 2])
        local_i, local_o = _local(frame, a), _local(frame, b)
        lit = local_i[2] > 0.0 and local_o[2] > 0.0
        factor = local_i[2] / a[2] if lit else 0.0
        weight = a[2] * b[2]
        m = 1.0
        if lit:
            if sigma > 0.0:
                m = matte(local_i, local_o, sigma)[0]
            for k in range(lobes):
                ks[k] = lobe(kind, local_i, local_o, alpha[k, 0], alpha[k, 1], f0)[0]
        for c in range(channels):
            f = 0.0
            if lit:
                f = diffuse[c] * _INV_PI * m
                for k in range(lobes):
                    f += specular[k, c] * ks[k]
            residual += (weight * (factor * f - value[j, c])) ** 2
            level += (weight * value[j, c]) ** 2
    scale = 1.0 / max(num * channels, 1)
    return residual * scale, level * scale
