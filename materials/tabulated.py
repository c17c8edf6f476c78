"""Measured BTFs and fitted textures as surfaces that light can be traced over: f, the density of drawn directions, drawing.

Paths need more than a look-up: directions drawn about in proportion to the light that they bring, with a known density. Fitted
textures are drawn from their own lobes. A BTF is drawn from a diffuse part and one lobe of GGX that are fitted to the mean over
its texels; how well they fit decides the noise, never the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .btf import BTF
from .direction_mesh import direction_meshes
from .fit import fit_texel
from .fit_problem import KINDS
from .fit_settings import FitSettings
from .foundation.checks import check_finite, check_range, check_unit
from .foundation.errors import InputError
from .kernels import arrays as kernel
from .kernels import tabulated as k
from .scattering import Sample
from .svbrdf import SVBRDF

Floats = NDArray[np.float64]
Measured = BTF | SVBRDF
# Of what is drawn for a BTF, at least so much is drawn from the cosine, whatever the fit says: no direction is left out.
_LEAST_DIFFUSE = 0.25
_LEAST_ALPHA = 0.1


def compile_tables(materials: Sequence[Measured]) -> k.TableArrays:
    """Return materials as the kernels take them, in the order given.

    Raises
    ------
    InputError
        If a material has holes, other than three channels, or directions that span no triangle.
    """
    rows, texels, factors, sets = [], [], [], []
    num_texels = num_factors = 0
    for m in materials:
        if not m.mask.all():
            raise InputError("be known everywhere", got="a mask with holes", key="material")
        row = np.full(k.NUM_COLUMNS, -1, np.int64)
        row[k.WIDTH], row[k.HEIGHT], row[k.TEXEL] = m.mask.shape[1], m.mask.shape[0], num_texels
        if isinstance(m, BTF):
            spatial, angular = _factors(m)
            row[k.LIGHTS], row[k.VIEWS], row[k.NUM_VIEWS] = len(sets), len(sets) + 1, len(m.wo)
            row[k.RANK], row[k.DECORRELATED] = angular.shape[-1], spatial.ndim == 3
            row[k.SPATIAL], row[k.ANGULAR] = num_factors, num_factors + spatial.size
            sets += [m.wi, m.wo]
            factors += [spatial.ravel(), angular.ravel()]
            num_factors += spatial.size + angular.size
            guide = _guide(m)
        else:
            guide = m
        row[k.KIND] = KINDS[guide.model]
        texels.append(_texel_values(guide))
        num_texels += len(texels[-1])
        rows.append(row)
    eta = [m.eta if isinstance(m, SVBRDF) else 1.5 for m in materials]
    colour = [np.asarray(m.colour, np.float64) if isinstance(m, BTF) else np.eye(3) for m in materials]
    return k.TableArrays(
        np.array(rows, np.int64).reshape(-1, k.NUM_COLUMNS),
        np.array(eta, np.float64),
        np.array(colour).reshape(-1, 3, 3),
        np.concatenate([np.zeros((0, k.NUM_TEXEL_VALUES)), *texels]),
        np.concatenate([np.zeros(0, np.float32), *factors]).astype(np.float32),
        *direction_meshes(sets),
    )


def evaluate(tables: k.TableArrays, which: int, uv: ArrayLike, wo: ArrayLike, wi: ArrayLike) -> Floats:
    """Return f (Q, 3) [1/sr, or relative] of one of the materials.

    Parameters
    ----------
    which : int
        Place in the sequence that was compiled.
    uv : (Q, 2) or (2,) float
        Texture coordinates, v = 0 at the first row.
    wo, wi : (Q, 3) or (3,) float
        Unit directions in the frame of the coarse surface.

    Raises
    ------
    InputError
        If a direction is not of unit length.
    """
    places, o, i = _alike(uv, wo, wi)
    return kernel.evaluate_tables(tables, which, places, o, i)


def pdf(tables: k.TableArrays, which: int, uv: ArrayLike, wo: ArrayLike, wi: ArrayLike) -> Floats:
    """Return the density (Q,) with which `sample` draws wi [1/sr]. Arguments as `evaluate`."""
    places, o, i = _alike(uv, wo, wi)
    return kernel.pdf_tables(tables, which, places, o, i)


def sample(tables: k.TableArrays, which: int, uv: ArrayLike, wo: ArrayLike, xi: ArrayLike) -> Sample:
    """Draw directions; `xi` (Q, 3) are uniform variates in [0, 1), the third of which chooses texel and lobe."""
    numbers = np.asarray(xi, np.float64)
    check_range("xi", numbers, "[0, 1)")
    towards = np.broadcast_to(np.asarray(wo, np.float64), numbers.shape)
    places, o, _ = _alike(uv, towards, towards)
    wi, weight, density = kernel.sample_tables(tables, which, places, o, np.ascontiguousarray(numbers))
    return Sample(wi, weight, density, np.zeros(len(wi), bool))


def _alike(uv: ArrayLike, wo: ArrayLike, wi: ArrayLike) -> tuple[Floats, Floats, Floats]:
    o, i = np.asarray(wo, np.float64), np.asarray(wi, np.float64)
    check_unit("wo", o)
    check_unit("wi", i)
    places = np.asarray(uv, np.float64)
    check_finite("uv", places)
    count = max(a.shape[0] if a.ndim == 2 else 1 for a in (places, o, i))
    shapes = ((places, 2), (o, 3), (i, 3))
    p, o, i = (np.ascontiguousarray(np.broadcast_to(a, (count, c))) for a, c in shapes)
    return p, o, i


def _factors(m: BTF) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return spatial (T, K) or (T, 3, K), and angular (I, O, 3, K), factors; groups of unequal rank are filled with zeros."""
    channels = sum(a.shape[3] for a in m.angular)
    if channels != 3 or len(m.spatial) not in (1, 3):
        raise InputError("have three channels, in one group or in three", got=f"{channels} in {len(m.spatial)}", key="material")
    rank = max(s.shape[1] for s in m.spatial)
    spatial = np.stack([np.pad(s, ((0, 0), (0, rank - s.shape[1]))) for s in m.spatial], axis=1)
    wide = [np.pad(a, ((0, rank - len(a)), (0, 0), (0, 0), (0, 0))) for a in m.angular]
    angular = np.concatenate(wide, axis=3).transpose(1, 2, 3, 0)
    return (spatial[:, 0] if len(m.spatial) == 1 else spatial), np.ascontiguousarray(angular)


def _guide(m: BTF) -> SVBRDF:
    """Return one texel of GGX that stands for the mean over a BTF's, to draw from."""
    means = tuple(s.mean(axis=0, keepdims=True).astype(np.float32) for s in m.spatial)
    mean = replace(m, spatial=means, mask=np.ones((1, 1), bool)).decompress()
    try:
        # About the coarse normal: a bent one would leave directions out that the BTF may send light to.
        found = fit_texel(mean, 0, FitSettings(model="ggx", lobes=1, constrained=False, threads=1))
        diffuse, specular, alpha, frame = found.diffuse, found.specular, found.alpha, found.frame
    except InputError:  # too few directions for a fit: the cosine alone
        diffuse, specular, alpha, frame = np.ones(3), np.zeros((1, 3)), np.ones((1, 2)), np.eye(3)
    # Linear interpolation spreads a narrow lobe over the gaps between directions, 9.4 degrees in the dome of the thesis.
    alpha = np.maximum(alpha, _LEAST_ALPHA)
    # The least share is that of an upright view, where Fresnel's factor of 1.5 is 0.04.
    least = _LEAST_DIFFUSE / (1 - _LEAST_DIFFUSE) * 0.04 * specular.mean()
    diffuse = np.maximum(diffuse, max(float(least), 1e-6))
    none = np.zeros(1)
    return SVBRDF("ggx", 1.5, np.ones((1, 1), bool), diffuse[None], specular[None], alpha[None], frame[None], none, none)


def _texel_values(m: SVBRDF) -> Floats:
    """Return rows of `TableArrays.texels`."""
    out = np.zeros((len(m.diffuse), k.NUM_TEXEL_VALUES))
    out[:, k.ALPHA : k.ALPHA + 4] = 1.0
    out[:, k.DIFFUSE : k.DIFFUSE + 3], out[:, k.FIRST : k.FIRST + 3] = m.diffuse, m.specular[:, 0]
    out[:, k.ALPHA : k.ALPHA + 2] = m.alpha[:, 0]
    out[:, k.SIGMA] = m.spread
    if m.lobes > 1:
        out[:, k.SECOND : k.SECOND + 3], out[:, k.SECOND_ALPHA : k.SECOND_ALPHA + 2] = m.specular[:, 1], m.alpha[:, 1]
    out[:, k.FRAME :] = m.frame.transpose(0, 2, 1).reshape(-1, 9)
    return out
