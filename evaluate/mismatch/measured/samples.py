"""A measurement as the diagnosis sees it: values with their noise, in blocks that are held out as a whole."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.measured.half_angles import half_angles
from materials.measured.measurement_file import Conditions, MeasurementFile
from materials.spectrum import wavelengths_of
from materials.wetness_fit import moisture_levels

from .noise import of_directions, of_levels, rising_share

Floats = NDArray[np.float64]
_MOST_BLOCKS = 8
_MOST_VALUES = 2_000_000


@dataclass(frozen=True)
class Samples:
    """Values of a quantity with what they were measured at.

    Attributes
    ----------
    kind : {"directions", "conditions"}
    value, sigma : (N, C) float64
        A row per pair of directions or per record, a column per channel.
    block : (N,) int
        What is held out together: incidence angles, or levels of the condition.
    block_names : tuple of str
    coordinates : dict
        By name (N,): what a residual may depend on.
    wi, wo : (N, 3) float64, or None
    condition : (N,) float64, or None
    condition_name, condition_unit : str
    channels : tuple of str
    model : dict
        What was believed.
    noise_estimated : bool
    slope : float
        By what share of the signal the noise rises.
    isotropic : bool
        Whether azimuths say nothing but their difference.
    notes : list of str
        What a report should say about the data.
    """

    kind: str
    name: str
    file: Path
    value: Floats
    sigma: Floats
    block: NDArray[np.int64]
    block_names: tuple[str, ...]
    coordinates: dict[str, Floats]
    channels: tuple[str, ...]
    model: dict[str, Any]
    noise_estimated: bool
    wi: Floats | None = None
    wo: Floats | None = None
    condition: Floats | None = None
    condition_name: str = ""
    condition_unit: str = "1"
    isotropic: bool = True
    relative: bool = False
    slope: float = 0.0
    notes: list[str] = field(default_factory=list)

    def sigma_at(self, prediction: Floats) -> Floats:
        """Return the standard deviation (N, C) that noise would have if a prediction (N, C) were right.

        Noise that rises with the signal is as large as the prediction asks for where that is above what was measured: or
        else a prediction could be wrong by any number of standard deviations above, and by a few only below.
        """
        above = np.maximum(prediction**2 - self.value**2, 0)
        return np.sqrt(self.sigma**2 + self.slope**2 * above)

    def z(self, prediction: Floats) -> Floats:
        """Return residuals (N, C) in units of noise."""
        return (self.value - prediction) / self.sigma_at(prediction)

    @property
    def wavelength_nm(self) -> Floats | None:
        """Of the channels (C,), if they have any."""
        return wavelengths_of(self.channels)


def samples_of(measured: MeasurementFile, file: Path) -> Samples:
    """Return a measurement ready for the diagnosis; noise that is not stated is estimated.

    Raises
    ------
    InputError
        If no model was believed, a sigma is 0, or there is too little or too much data.
    """
    if measured.model is None:
        remedy = 'Say what was believed, e.g. {"model": "lambert", "albedo": 0.2, "free": ["albedo"]}.'
        raise InputError("be given", file=file, key="model", remedy=remedy)
    if measured.conditions is not None:
        return _of_conditions(measured.conditions, measured.model, measured.name, file)
    assert measured.samples is not None
    abrdf = measured.samples.normalise()
    flat = abrdf.flat()
    keep = flat.valid[0]
    wi, wo, value = abrdf.wi[keep], abrdf.wo[keep], flat.value[0, keep].astype(np.float64)
    notes = (
        []
        if keep.all()
        else [f"{int((~keep).sum())} of {len(keep)} samples lack a wavelength or graze the surface; they were left out."]
    )
    _check_size(value, file)
    estimated = measured.sigma is None or not np.isfinite(measured.sigma[keep]).all()
    if estimated:
        sigma, words = of_directions(wi, wo, value)
        notes.append(words)
    else:
        assert measured.sigma is not None
        sigma = measured.sigma[keep].astype(np.float64)
        if not measured.samples.normalised:
            sigma = sigma / np.maximum(wi[:, 2:], 1e-3)
        _check_sigma(sigma, file)
    block, names = _incidence_blocks(wi, wo, notes)
    return Samples(
        "directions", measured.name, file, value, sigma, block, names, _angles(wi, wo), abrdf.channels, measured.model, estimated,
        wi, wo, isotropic=abrdf.isotropic, relative=abrdf.unit == "relative", slope=rising_share(sigma, value), notes=notes,
    )  # fmt: skip


def _of_conditions(c: Conditions, model: dict[str, Any], name: str, file: Path) -> Samples:
    keep: NDArray[np.bool_] = np.asarray(np.isfinite(c.value).all(axis=1))
    m, value = c.condition[keep], c.value[keep]
    notes = [] if keep.all() else [f"{int((~keep).sum())} of {len(keep)} records lack a wavelength; they were left out."]
    _check_size(value, file)
    level = moisture_levels(m, min(_MOST_BLOCKS, max(len(np.unique(m)) // 2, 1)))
    given, level = np.unique(level, return_inverse=True)
    names = tuple(f"{c.name} {m[level == k].min():g} to {m[level == k].max():g} {c.unit}" for k in range(len(given)))
    estimated = not np.isfinite(c.sigma[keep]).all()
    if estimated:
        sigma, words = of_levels(m, value)
        notes.append(words)
    else:
        sigma = c.sigma[keep]
        _check_sigma(sigma, file)
    if len(given) < 2:
        notes.append("There is one level of the condition only: nothing could be held out.")
    channels = tuple(f"{w:g} nm" for w in c.wavelength_nm)
    return Samples(
        "conditions", name, file, value, sigma, level, names, {c.name: m}, channels, model, estimated,
        condition=m, condition_name=c.name, condition_unit=c.unit,
        slope=rising_share(sigma, value), notes=notes,
    )  # fmt: skip


def _check_size(value: Floats, file: Path) -> None:
    if len(value) < 8:
        raise InputError("hold at least 8 complete samples", got=len(value), file=file)
    if value.size > _MOST_VALUES:
        remedy = "Keep every other direction, or average wavelengths."
        raise InputError(f"hold at most {_MOST_VALUES} values", got=value.size, file=file, remedy=remedy)
    if not (value > 0).any():
        raise InputError("hold a value above 0", got="zeros only", file=file)


def _check_sigma(sigma: Floats, file: Path) -> None:
    if not (sigma > 0).all():
        raise InputError(
            "be positive", got=float(sigma.min()), file=file, key="sigma", remedy="Leave the column out if it is not known."
        )


def _incidence_blocks(wi: Floats, wo: Floats, notes: list[str]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Return blocks of equal incidence angle; where there are many, of every eighth; where there is one, of viewing angles."""
    side, what = (wi, "incidence") if len(_distinct(wi)[0]) > 1 else (wo, "viewing angle")
    if what != "incidence":
        notes.append("There is one incidence angle only: viewing angles were held out instead, which says less.")
    theta, index = _distinct(side)
    if len(theta) <= _MOST_BLOCKS:
        return index, tuple(f"{what} {t:g}°" for t in theta)
    block = index % _MOST_BLOCKS
    return block, tuple(f"{what} {theta[k]:g}°, {theta[k + _MOST_BLOCKS]:g}°, …" if k + _MOST_BLOCKS < len(theta)
                        else f"{what} {theta[k]:g}°" for k in range(_MOST_BLOCKS))  # fmt: skip


def _distinct(w: Floats) -> tuple[Floats, NDArray[np.int64]]:
    theta = np.round(np.degrees(np.arccos(np.clip(w[:, 2], -1, 1))), 1)
    values, index = np.unique(theta, return_inverse=True)
    return np.asarray(values, np.float64), index.reshape(-1)


def _angles(wi: Floats, wo: Floats) -> dict[str, Floats]:
    theta_h, theta_d, _ = half_angles(wi.copy(), wo.copy())
    azimuth = np.arctan2(wi[:, 0] * wo[:, 1] - wi[:, 1] * wo[:, 0], (wi[:, :2] * wo[:, :2]).sum(axis=1))
    return {
        "half angle": np.degrees(theta_h),
        "difference angle": np.degrees(theta_d),
        "incidence angle": np.degrees(np.arccos(np.clip(wi[:, 2], -1, 1))),
        "viewing angle": np.degrees(np.arccos(np.clip(wo[:, 2], -1, 1))),
        "azimuth between light and view": np.degrees(np.abs(azimuth)),
        "azimuth of the light": np.degrees(np.arctan2(wi[:, 1], wi[:, 0])),
    }
