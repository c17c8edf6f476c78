"""Reflectance of one flat patch under pairs of directions, part by part, from the same row of parameters as `shade`'s surfaces."""

import math

import numpy as np
from numba import njit

from . import shade

NUM_PARTS = 4
"""Diffuse, first lobe, second lobe, retroreflection."""


@njit(cache=True, error_model="numpy")
def parts(row, wo, wi):
    """Return each part (4, N) [1/sr] at scale 1: the sum over parts of scale times part is the BRDF; directions are (N, 3)."""
    out = np.zeros((4, len(wo)))
    c, s = math.cos(row[shade.ANGLE]), math.sin(row[shade.ANGLE])
    own = np.zeros(shade.NUM_SURFACE)
    for k in range(4):
        own[:] = row
        own[shade.LOBE] = 1.0 if k == 1 else 0.0
        own[shade.LOBE2] = 1.0 if k == 2 else 0.0
        own[shade.RETRO] = 1.0 if k == 3 else 0.0
        own[shade.LOBE3] = 0.0
        for i in range(len(wo)):
            # The tangent is turned by the angle: directions turn the other way.
            o = (c * wo[i, 0] + s * wo[i, 1], c * wo[i, 1] - s * wo[i, 0], max(wo[i, 2], 1e-3))
            w = (c * wi[i, 0] + s * wi[i, 1], c * wi[i, 1] - s * wi[i, 0], max(wi[i, 2], 1e-3))
            diffuse, gloss = shade.reflectance(own, o, w, 0.0)
            out[k, i] = diffuse if k == 0 else gloss
    return out
