"""Fitted reflectance of many texels at once."""

import math

import numpy as np
from numba import njit, prange

from .brdf_fit import _local
from .lobe_gradients import lobe
from .matte_gradients import matte

_INV_PI = 1.0 / math.pi


@njit(parallel=True, cache=True, error_model="numpy")
def reflect(kind, f0, diffuse, specular, alpha, sigma, frame, wi, wo):
    """Return f (wi . n) per texel: what a unit light sends towards wo; 0 below the fitted surface.

    diffuse (T, C), specular (T, L, C), alpha (T, L, 2), sigma (T,), frame (T, 3, 3); wi and wo (T, 3) in coordinates of the
    coarse surface.
    """
    num, channels = diffuse.shape
    lobes = alpha.shape[1]
    out = np.zeros((num, channels))
    for t in prange(num):
        local_i = _local(frame[t], (wi[t, 0], wi[t, 1], wi[t, 2]))
        local_o = _local(frame[t], (wo[t, 0], wo[t, 1], wo[t, 2]))
        if local_i[2] <= 0.0 or local_o[2] <= 0.0:
            continue
        m = matte(local_i, local_o, sigma[t])[0]
        for c in range(channels):
            out[t, c] = diffuse[t, c] * _INV_PI * m
        for k in range(lobes):
            value = lobe(kind, local_i, local_o, alpha[t, k, 0], alpha[t, k, 1], f0)[0]
            for c in range(channels):
                out[t, c] += specular[t, k, c] * value
        for c in range(channels):
            out[t, c] *= local_i[2]
    return out
