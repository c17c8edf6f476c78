"""Measured reflectance to a measurement/1, whatever file it came in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..foundation.errors import InputError
from ..foundation.files import make_folder, replacing, write_json
from ..spectrum import wavelengths_of

Floats = NDArray[np.float64]
# Dominant wavelengths of the primaries of Rec. 709: a number for each of three broad channels.
_RGB_NM = (611.4, 549.1, 464.2)
_MOST = 4_000_000


def write_measurement(
    folder: str | Path, samples: ABRDF, model: dict[str, Any] | None = None, sigma: NDArray | None = None
) -> Path:
    """Write the samples of one point as `measurement.json` and `samples.npz`, and return the JSON's path.

    Parameters
    ----------
    folder : path
        Made if it is not there.
    samples : ABRDF
        Of one texel; invalid samples are left out. The channels R, G, B are written as 611.4, 549.1 and 464.2 nm.
    model : dict, optional
        What is believed, as a material of simulation/1: `{"model": "lambert", "albedo": 0.2, "free": ["albedo"]}`.
    sigma : (N, C) float, optional
        Standard deviation of each value.

    Raises
    ------
    InputError
        If there is more than one texel, the channels are neither wavelengths nor R, G, B, or there are too many values.
    """
    if samples.num_texels != 1:
        raise InputError("have one texel", got=samples.num_texels, key="samples", remedy="Choose one, or take means over texels.")
    nm = np.array(_RGB_NM) if samples.channels == ("R", "G", "B") else wavelengths_of(samples.channels)
    if nm is None or len(nm) != len(samples.channels) or not np.isfinite(nm).all():
        raise InputError("be wavelengths, or R, G and B", got=", ".join(samples.channels), key="channels")
    flat = samples.flat()
    keep = flat.valid[0]
    value = flat.value[0, keep]
    if value.size > _MOST:
        raise InputError(f"hold at most {_MOST} values", got=value.size, key="samples", remedy="Use `select` to thin them out.")
    folder = make_folder(folder)
    columns = {
        "wi": np.repeat(samples.wi[keep], len(nm), axis=0),
        "wo": np.repeat(samples.wo[keep], len(nm), axis=0),
        "wavelength": np.tile(nm, len(value)),
        "value": value.reshape(-1),
    }
    if sigma is not None:
        columns["sigma"] = np.asarray(sigma)[keep].reshape(-1)
    with replacing(folder / "samples.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **columns)
    head = {"format": "measurement/1", "table": "samples.npz", "name": samples.name, "unit": samples.unit}
    head |= {"cosine": not samples.normalised, "isotropic": samples.isotropic} | ({"model": model} if model else {})
    write_json(folder / "measurement.json", head)
    return folder / "measurement.json"
