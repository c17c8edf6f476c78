"""A small material of all kinds of texels, and reflectance written down from the formats' own texts."""

from __future__ import annotations

import numpy as np

from materials.directions import even_directions
from materials.fit_run import frames_of
from materials.svbrdf import SVBRDF

VIEWS = [(np.array(i), np.array(o)) for i in even_directions(6, 60) for o in even_directions(5, 60)]


def sample(model: str = "ggx", lobes: int = 1, isotropic: bool = False, seed: int = 0) -> SVBRDF:
    """Return 3 x 4 texels, one of them without surface."""
    rng = np.random.default_rng(seed)
    mask = np.ones((3, 4), bool)
    mask[2, 3] = False
    n = np.concatenate([rng.uniform(-0.25, 0.25, (11, 2)), np.ones((11, 1))], axis=1)
    frame = frames_of(n / np.linalg.norm(n, axis=1, keepdims=True))
    alpha = np.stack([rng.uniform(0.15, 0.5, (11, 2)), rng.uniform(0.5, 0.9, (11, 2))], axis=1)[:, :lobes]
    if isotropic:
        alpha[..., 1] = alpha[..., 0]
    specular, diffuse = rng.uniform(0.3, 0.9, (11, lobes, 3)), rng.uniform(0.1, 0.7, (11, 3))
    return SVBRDF(model, 1.5, mask, diffuse, specular, alpha, frame, np.zeros(11), np.zeros(11), name="sample 1")


def ggx(wi, wo, tangent, normal, alpha_t, alpha_b):
    """Return D V of GGX with height-correlated Smith, V without the 4 cos cos; per texel (T,), and cos(wi, h)."""
    bitangent = np.cross(normal, tangent)
    h = (wi + wo) / np.linalg.norm(wi + wo)
    ht, hb, hn = tangent @ h, bitangent @ h, normal @ h
    d = 1 / (np.pi * alpha_t * alpha_b * ((ht / alpha_t) ** 2 + (hb / alpha_b) ** 2 + hn**2) ** 2)

    def length(w):
        return np.sqrt((alpha_t * (tangent @ w)) ** 2 + (alpha_b * (bitangent @ w)) ** 2 + (normal @ w) ** 2)

    v = 0.5 / ((normal @ wi) * length(wo) + (normal @ wo) * length(wi))
    return d * v, float(wi @ h)


def relative_rms(a, b) -> float:
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))
