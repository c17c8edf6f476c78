"""Tables over half and difference angles (Rusinkiewicz 1998), as MERL and the polarimetric files use them, to samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..directions import spherical

Floats = NDArray[np.float64]


def directions_of(theta_h: Floats, theta_d: Floats, phi_d: Floats) -> tuple[Floats, Floats]:
    """Return wi and wo (N, 3) of half angle theta_h (azimuth 0), difference angle theta_d and its azimuth phi_d [rad].

    `wi` may lie below the horizon, and so may `wo`: not every cell of such a table exists.
    """
    d = spherical(theta_d, phi_d)
    c, s = np.cos(theta_h), np.sin(theta_h)

    def turned(v: Floats) -> Floats:
        return np.stack([c * v[:, 0] + s * v[:, 2], v[:, 1], -s * v[:, 0] + c * v[:, 2]], axis=-1)

    return turned(d), turned(d * (-1, -1, 1))


def half_angles(wi: Floats, wo: Floats) -> tuple[Floats, Floats, Floats]:
    """Return theta_h, theta_d and phi_d [rad] of pairs of directions (N, 3); phi_d lies in (-pi, pi]."""
    h = wi + wo
    h /= np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
    theta_h = np.arccos(np.clip(h[:, 2], -1, 1))
    theta_d = np.arccos(np.clip((wi * h).sum(axis=-1), -1, 1))
    phi_h = np.arctan2(h[:, 1], h[:, 0])
    c, s = np.cos(phi_h), np.sin(phi_h)
    x, y = c * wi[:, 0] + s * wi[:, 1], -s * wi[:, 0] + c * wi[:, 1]
    x = np.cos(theta_h) * x - np.sin(theta_h) * wi[:, 2]
    return theta_h, theta_d, np.arctan2(y, x)


def from_half_angles(
    theta_h: Floats,
    theta_d: Floats,
    phi_d: Floats,
    value: NDArray[np.float32],
    measured: NDArray[np.bool_],
    channels: tuple[str, ...],
    unit: str,
    name: str,
) -> ABRDF:
    """Return the samples (N, C) of a table whose directions both lie above the horizon, those measured marked valid.

    The weight is that of a cell of a table even in all three angles, up to a factor: sin theta_h sin theta_d cos theta_d,
    the Jacobian from (h, d) to (wi, wo) without its constant 4, scaled so that all weights sum to (2 pi)².
    """
    wi, wo = directions_of(theta_h, theta_d, phi_d)
    above = (wi[:, 2] > 1e-6) & (wo[:, 2] > 1e-6)
    weight = (np.sin(theta_h) * np.sin(theta_d) * np.cos(theta_d))[above]
    weight *= (2 * np.pi) ** 2 / weight.sum()
    valid = measured[above]
    kept = np.where(valid[:, None], value[above], 0).astype(np.float32)
    return ABRDF(wi[above], wo[above], kept, valid, weight, channels, unit, isotropic=True, name=name)
