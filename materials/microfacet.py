"""The GGX distribution of microfacets, its shadowing, and the normals that a viewer sees.

References
----------
Walter, B. et al. (2007), Microfacet models for refraction through rough surfaces. Heitz, E. (2014), Understanding the
masking-shadowing function in microfacet-based BRDFs. Heitz, E. (2018), Sampling the GGX distribution of visible normals.
Dupuy, J. and Benyoub, A. (2023), Sampling visible GGX normals with spherical caps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .foundation.checks import check_range, check_unit
from .kernels import arrays as kernel

Floats = NDArray[np.float64]


def ggx_d(h: ArrayLike, alpha_u: ArrayLike, alpha_v: ArrayLike | None = None) -> Floats:
    """Return the area of microfacets with normal h per area of surface and solid angle [1/sr].

    Parameters
    ----------
    h : (..., 3) float
        Unit normals of microfacets, z = n.
    alpha_u, alpha_v : (...) float
        Widths along and across, in (0, 1]; `alpha_v` defaults to `alpha_u`.

    Examples
    --------
    >>> np.allclose(ggx_d([0.0, 0.0, 1.0], 0.5), 1 / (np.pi * 0.25))
    True
    """
    (flat,), u, v, shape = _flat([("h", h)], alpha_u, alpha_v)
    return kernel.ggx_d(flat, u, v).reshape(shape)


def smith_g1(w: ArrayLike, alpha_u: ArrayLike, alpha_v: ArrayLike | None = None) -> Floats:
    """Return the share of microfacets that is not hidden from w."""
    (flat,), u, v, shape = _flat([("w", w)], alpha_u, alpha_v)
    return (1 / (1 + kernel.smith_lambda(flat, u, v))).reshape(shape)


def smith_g2(wo: ArrayLike, wi: ArrayLike, alpha_u: ArrayLike, alpha_v: ArrayLike | None = None) -> Floats:
    """Return the share of microfacets hidden from neither direction, heights correlated (Heitz 2014, eq. 99)."""
    (flat_o, flat_i), u, v, shape = _flat([("wo", wo), ("wi", wi)], alpha_u, alpha_v)
    return (1 / (1 + kernel.smith_lambda(flat_o, u, v) + kernel.smith_lambda(flat_i, u, v))).reshape(shape)


def pdf_visible(wo: ArrayLike, h: ArrayLike, alpha_u: ArrayLike, alpha_v: ArrayLike | None = None) -> Floats:
    """Return the density of normals seen from wo, per solid angle of h [1/sr]."""
    (flat_o, flat_h), u, v, shape = _flat([("wo", wo), ("h", h)], alpha_u, alpha_v)
    return kernel.pdf_visible(flat_o, flat_h, u, v).reshape(shape)


def sample_visible(wo: ArrayLike, xi: ArrayLike, alpha_u: ArrayLike, alpha_v: ArrayLike | None = None) -> Floats:
    """Draw normals (..., 3) as seen from wo.

    Parameters
    ----------
    wo : (..., 3) float
        Unit directions above the surface.
    xi : (..., 2) float
        Uniform variates in [0, 1).
    alpha_u, alpha_v : (...) float
        Widths.
    """
    check_range("xi", xi, "[0, 1)")
    variates = np.asarray(xi, dtype=np.float64)
    directions, _ = np.broadcast_arrays(np.asarray(wo, dtype=np.float64), variates[..., :1])
    (flat,), u, v, shape = _flat([("wo", directions)], alpha_u, alpha_v)
    check_range("wo[..., 2]", flat[:, 2], "(0, 1.001)")
    flat_xi = np.ascontiguousarray(np.broadcast_to(variates, (*shape, 2))).reshape(-1, 2)
    return kernel.sample_visible(flat, u, v, flat_xi).reshape(*shape, 3)


def alpha_of(roughness: ArrayLike) -> Floats:
    """Return the GGX width of a perceptual roughness in [0, 1]: its square."""
    check_range("roughness", roughness, "[0, 1]")
    return np.asarray(roughness, dtype=np.float64) ** 2


def _flat(
    vectors: list[tuple[str, ArrayLike]], alpha_u: ArrayLike, alpha_v: ArrayLike | None
) -> tuple[list[Floats], Floats, Floats, tuple[int, ...]]:
    alpha_v = alpha_u if alpha_v is None else alpha_v
    check_range("alpha_u", alpha_u, "(0, 1]")
    check_range("alpha_v", alpha_v, "(0, 1]")
    for name, w in vectors:
        check_unit(name, w)
    arrays = [np.asarray(w, dtype=np.float64) for _, w in vectors]
    u, v = np.asarray(alpha_u, dtype=np.float64), np.asarray(alpha_v, dtype=np.float64)
    shape = np.broadcast_shapes(*(a.shape[:-1] for a in arrays), u.shape, v.shape)
    flat = [np.ascontiguousarray(np.broadcast_to(a, (*shape, 3))).reshape(-1, 3) for a in arrays]
    return flat, np.broadcast_to(u, shape).ravel(), np.broadcast_to(v, shape).ravel(), shape
