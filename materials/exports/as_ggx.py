"""Any fitted material as GGX lobes, which is what other programs render."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF, pairs
from ..directions import even_directions
from ..fit import FitSettings, fit_where_possible
from ..foundation.progress import tracked
from ..svbrdf import SVBRDF

Floats = NDArray[np.float64]
_DIRECTIONS, _RIM_DEG = 24, 75.0
_BATCH = 512


@dataclass(frozen=True)
class AsGGX:
    """A material of GGX lobes that stands for another.

    Attributes
    ----------
    material : SVBRDF
        Model `ggx`, with the frames of the original.
    scale : float
        By which albedo and specular scales were multiplied: 1, or for data of unknown scale what brings the brightest albedo to 1.
    relative_variance : float
        Mean over the texels: squared weighted difference over squared weighted reflectance; 0 for what was GGX already.
    """

    material: SVBRDF
    scale: float
    relative_variance: float


def as_ggx(material: SVBRDF, lobes: int, base: str = "lambert") -> AsGGX:
    """Return the GGX material of one or two lobes that reflects most alike, texel by texel.

    Least squares over 24 x 24 directions up to 75 degrees, about the normals of the original.

    Parameters
    ----------
    material : SVBRDF
    lobes : int
        How many the other program knows at most.
    base : str
        The most general matte part that it knows: `lambert` or `oren_nayar`. A Lambert base stays one.
    """
    scale = 1.0
    if material.unit == "relative":
        brightest = float(np.quantile(material.diffuse.max(axis=1), 0.999))
        scale = 1 / brightest if brightest > 0 else 1.0
    scaled = replace(material, diffuse=scale * material.diffuse, specular=scale * material.specular)
    base = "lambert" if material.base == "lambert" else base
    if material.model == "ggx" and material.lobes <= lobes and material.base == base:
        return AsGGX(scaled, scale, 0.0)
    dome = even_directions(_DIRECTIONS, _RIM_DEG)
    wi, wo = pairs(dome, dome)
    upright = replace(scaled, frame=np.tile(np.eye(3), (len(scaled.cost), 1, 1)))
    num = len(scaled.cost)
    settings = FitSettings(model="ggx", base=base, constrained=False, lobes=lobes, eta=material.eta, free_angle_deg=_RIM_DEG + 1)
    diffuse, specular = scaled.diffuse.copy(), np.zeros((num, lobes, 3))
    sigma = None if base == "lambert" else np.zeros(num)
    alpha, frame, variance = np.full((num, lobes, 2), 0.5), scaled.frame.copy(), np.zeros(num)
    for first in tracked(range(0, num, _BATCH), "turning lobes into GGX"):
        texels = np.arange(first, min(first + _BATCH, num))
        value = np.stack([upright.reflect(wi, wo, np.full(len(wi), t)) / wi[:, 2:] for t in texels]).astype(np.float32)
        samples = ABRDF(wi, wo, value, np.ones(value.shape[:2], bool), np.ones(len(wi)))
        for t, fit in zip(texels, fit_where_possible(samples, settings), strict=True):
            if fit is not None:
                order = np.argsort(fit.alpha.prod(axis=1))  # the narrow lobe first
                diffuse[t], specular[t], alpha[t] = fit.diffuse, fit.specular[order], fit.alpha[order]
                frame[t] = scaled.frame[t] @ fit.frame
                variance[t] = fit.relative_variance
                if sigma is not None:
                    sigma[t] = fit.sigma
    out = replace(scaled, model="ggx", diffuse=diffuse, specular=specular, alpha=alpha, frame=frame, sigma=sigma)
    return AsGGX(out, scale, float(variance.mean()))
