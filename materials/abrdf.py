"""Apparent BRDFs: reflectance as measured, for pairs of directions, at one point or at every texel of a surface.

All readers of measured reflectance return an `ABRDF`, and all fits take one. "Apparent" (Wong et al. 1997), since it holds
what the dome or camera saw: shading by unresolved relief, shadows, light that came from elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .directions import Interpolation, interpolation, solid_angles
from .foundation.checks import check_range, check_shape, check_unit
from .foundation.errors import InputError

Floats = NDArray[np.float64]
UNITS = ("1/sr", "relative")
_GRAZING = 1e-3
"""Below this cosine eq. 2.16 divides noise by next to nothing; such samples count as not measured."""
_PART = 1024


@dataclass(frozen=True)
class ABRDF:
    """Samples of apparent reflectance.

    Attributes
    ----------
    wi, wo : (N, 3) float64
        Unit directions of the samples, towards light and viewer, above the surface (z = coarse normal).
    value : (..., N, C) float32
        Reflectance; leading axes are texels. At least 0 where valid.
    valid : (..., N) bool
        Which samples were measured.
    weight : (N,) float64
        Solid angle of wi times that of wo [sr²], for means over directions.
    channels : tuple of str
        `("R", "G", "B")`, or wavelengths `("450 nm", ...)`.
    unit : {"1/sr", "relative"}
        Whether values are a BRDF on its absolute scale, or up to one common factor.
    normalised : bool
        Whether the irradiance's cosine has been divided out (eq. 2.16), so that values sample a BRDF.
    grid : (int, int), optional
        Numbers of wi and wo if the samples are all their pairs, wi slowest.
    mask : (H, W) bool, optional
        Where the texels (in its order) lie in a picture.
    isotropic : bool
        Whether only the azimuth between wi and wo was varied.
    name : str
        Of the material, for reports.
    """

    wi: Floats
    wo: Floats
    value: NDArray[np.float32]
    valid: NDArray[np.bool_]
    weight: Floats
    channels: tuple[str, ...] = ("R", "G", "B")
    unit: str = "1/sr"
    normalised: bool = True
    grid: tuple[int, int] | None = None
    mask: NDArray[np.bool_] | None = None
    isotropic: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        n, c = len(self.wi), len(self.channels)
        for key, w in (("wi", self.wi), ("wo", self.wo)):
            check_shape(key, w, (n, 3))
            check_unit(key, w)
            check_range(f"{key}'s z", w[:, 2], "[-1e-6, 1.0001]")
        if self.value.shape[-2:] != (n, c):
            raise InputError(f"have shape (..., {n}, {c})", got=self.value.shape, key="value")
        if self.valid.shape != self.value.shape[:-1]:
            raise InputError(f"have shape {self.value.shape[:-1]}", got=self.valid.shape, key="valid")
        check_shape("weight", self.weight, (n,))
        if self.unit not in UNITS:
            raise InputError(f"be one of {', '.join(UNITS)}", got=self.unit, key="unit")
        if self.grid is not None and self.grid[0] * self.grid[1] != n:
            raise InputError(f"have {n} pairs", got=self.grid, key="grid")
        if self.mask is not None and (self.value.ndim != 3 or int(self.mask.sum()) != len(self.value)):
            raise InputError("mark one place per texel", got=self.mask.shape, key="mask")
        # Looked at in parts: photographs of an object come close to the memory that a second copy would need.
        for part in range(0, len(self.value), _PART):
            texels, valid = self.value[part : part + _PART], self.valid[part : part + _PART]
            bad = valid & ~(np.isfinite(texels) & (texels >= 0)).all(axis=-1)
            if bad.any():
                index = tuple(int(i) for i in np.argwhere(bad)[0])
                raise InputError("be finite and not negative where valid", got=texels[index].tolist(), key="value")

    @property
    def num_texels(self) -> int:
        """Number of surface points."""
        return int(np.prod(self.value.shape[:-2], dtype=np.int64))

    def flat(self) -> ABRDF:
        """Return the same samples with one texel axis: value (T, N, C)."""
        n, c = self.value.shape[-2:]
        return replace(self, value=self.value.reshape(-1, n, c), valid=self.valid.reshape(-1, n), mask=self.mask)

    def normalise(self) -> ABRDF:
        """Divide out the irradiance on the coarse normal, f = A / cos theta_i (eq. 2.16).

        Samples whose light grazes the surface (cosine below 0.001) become invalid. Normalised samples come back as they are.
        """
        if self.normalised:
            return self
        cos_i = self.wi[:, 2]
        grazing = cos_i < _GRAZING
        value = self.value / np.where(grazing, 1, cos_i).astype(np.float32)[:, None]
        return replace(self, value=value, valid=self.valid & ~grazing, normalised=True)

    def with_cosine(self) -> ABRDF:
        """Multiply the irradiance's cosine back in: what a camera sees of a unit light."""
        if not self.normalised:
            return self
        return replace(self, value=self.value * self.wi[:, 2].astype(np.float32)[:, None], normalised=False)

    def select(self, keep: NDArray) -> ABRDF:
        """Return some of the samples, by a boolean mask or indices over directions."""
        return replace(
            self,
            wi=self.wi[keep],
            wo=self.wo[keep],
            value=self.value[..., keep, :],
            valid=self.valid[..., keep],
            weight=self.weight[keep],
            grid=None,
        )

    def resample(self, wi: ArrayLike, wo: ArrayLike) -> ABRDF:
        """Return the reflectance for all pairs of other directions, interpolated linearly.

        Parameters
        ----------
        wi : (I, 3) float
            Unit directions towards the light.
        wo : (O, 3) float
            Unit directions towards the viewer.

        Returns
        -------
        abrdf : ABRDF
            On the grid (I, O). Not valid outside the measured directions, or where a corner of the triangle or cell used
            is not.

        Raises
        ------
        InputError
            If the samples are neither a grid nor isotropic: then there is no natural neighbourhood.
        """
        wi, wo = np.asarray(wi, np.float64), np.asarray(wo, np.float64)
        if self.grid is not None:
            value, valid = self._resample_grid(wi, wo)
        elif self.isotropic:
            value, valid = self._resample_isotropic(wi, wo)
        else:
            raise InputError("be a grid of directions or isotropic", got="scattered pairs", key="the measurement")
        weight = np.outer(solid_angles(wi), solid_angles(wo)).reshape(-1)
        pairs_i, pairs_o = pairs(wi, wo)
        value = np.where(valid[..., None], value, 0).astype(np.float32)
        return replace(self, wi=pairs_i, wo=pairs_o, value=value, valid=valid, weight=weight, grid=(len(wi), len(wo)))

    def _resample_grid(self, wi: Floats, wo: Floats) -> tuple[NDArray, NDArray[np.bool_]]:
        num_i, num_o = self.grid or (0, 0)
        by_i = interpolation(self.wi[::num_o], wi)
        by_o = interpolation(self.wo[:num_o], wo)
        lead, c = self.value.shape[:-2], len(self.channels)

        def both(values: NDArray, axis: int, first: Interpolation, second: Interpolation) -> NDArray:
            return second(first(values, axis), axis + 1)

        axis = len(lead)
        value = both(self.value.reshape(*lead, num_i, num_o, c), axis, by_i, by_o)
        share = both(self.valid.reshape(*lead, num_i, num_o).astype(np.float64), axis, by_i, by_o)
        valid = (share > 1 - 1e-9) & by_i.inside[:, None] & by_o.inside[None, :]
        return value.reshape(*lead, -1, c), valid.reshape(*lead, -1)

    def _resample_isotropic(self, wi: Floats, wo: Floats) -> tuple[NDArray, NDArray[np.bool_]]:
        from scipy.interpolate import LinearNDInterpolator

        pairs_i, pairs_o = pairs(wi, wo)
        wanted = _isotropic_coordinates(pairs_i, pairs_o)
        known = _isotropic_coordinates(self.wi, self.wo)
        # Mirrored samples close the plane of incidence, across which an isotropic surface is symmetric.
        known = np.concatenate([known, known * (1, 1, -1)])
        flat = self.flat()
        value = np.zeros((flat.num_texels, len(wanted), len(self.channels)), np.float32)
        valid = np.zeros((flat.num_texels, len(wanted)), bool)
        for t in range(flat.num_texels):
            use = np.flatnonzero(flat.valid[t])
            places = known[np.concatenate([use, use + len(self.wi)])]
            values = np.tile(flat.value[t, use].astype(np.float64), (2, 1))
            places, first = np.unique(np.round(places, 9), axis=0, return_index=True)
            found = LinearNDInterpolator(places, values[first])(wanted)
            valid[t] = np.isfinite(found).all(axis=-1)
            value[t] = np.where(valid[t][:, None], found, 0)
        lead = self.value.shape[:-2]
        return value.reshape(*lead, len(wanted), -1), valid.reshape(*lead, len(wanted))


def pairs(wi: Floats, wo: Floats) -> tuple[Floats, Floats]:
    """Return all pairs of two direction sets as two lists (I O, 3), wi slowest."""
    return np.repeat(wi, len(wo), axis=0), np.tile(wo, (len(wi), 1))


def from_grid(wi: Floats, wo: Floats, value: NDArray, valid: NDArray[np.bool_] | None = None, **rest: object) -> ABRDF:
    """Return the ABRDF of values (..., I, O, C) at all pairs of directions, with their solid angles as weights."""
    num = (len(wi), len(wo))
    if value.shape[-3:-1] != num:
        raise InputError(f"have shape (..., {num[0]}, {num[1]}, C)", got=value.shape, key="value")
    weight = np.outer(solid_angles(wi), solid_angles(wo)).reshape(-1)
    pairs_i, pairs_o = pairs(wi, wo)
    flat = np.ascontiguousarray(value, np.float32).reshape(*value.shape[:-3], num[0] * num[1], value.shape[-1])
    if valid is None:
        valid = np.ones(value.shape[:-1], bool)
    return ABRDF(pairs_i, pairs_o, flat, valid.reshape(flat.shape[:-1]), weight, grid=num, **rest)  # type: ignore[arg-type]


def isotropic_weights(wi: Floats, wo: Floats) -> Floats:
    """Return weights [sr²] for scattered pairs of an isotropic surface whose lights lie at a few elevations.

    Each elevation of wi stands for its band of the hemisphere, halved between neighbours; within it, each wo for the part
    of the hemisphere nearest to it.
    """
    theta = np.round(np.arccos(np.clip(wi[:, 2], -1, 1)), 4)
    bands, group = np.unique(theta, return_inverse=True)
    edges = np.concatenate([[0], 0.5 * (bands[1:] + bands[:-1]), [np.pi / 2]])
    band = 2 * np.pi * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    out = np.empty(len(wi))
    for b in range(len(bands)):
        inside = group == b
        out[inside] = band[b] * solid_angles(wo[inside])
    return out


def _isotropic_coordinates(wi: Floats, wo: Floats) -> Floats:
    """Return where a pair lies if only elevations and the difference of azimuths count: theta_i, and wo in the plane."""
    theta_i = np.arccos(np.clip(wi[:, 2], -1, 1))
    phi = np.arctan2(wo[:, 1], wo[:, 0]) - np.arctan2(wi[:, 1], wi[:, 0])
    theta_o = np.arccos(np.clip(wo[:, 2], -1, 1))
    return np.stack([theta_i, theta_o * np.cos(phi), theta_o * np.sin(phi)], axis=-1)
