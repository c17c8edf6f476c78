"""The MERL database's files (`*.binary`): isotropic BRDFs on a grid of half and difference angles.

Three int32 (90, 90, 180: theta_h, theta_d, phi_d), then float64 for red, green and blue. theta_h is spaced by a square
root, phi_d covers half a turn (reciprocity gives the rest); a negative value marks a cell that was not measured.

References
----------
Matusik et al. (2003), A Data-Driven Reflectance Model.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF
from ..foundation.errors import InputError
from ..foundation.files import replacing
from .half_angles import from_half_angles

_SCALE = np.array([1.0, 1.15, 1.66]) / 1500
_MAX_CELLS = 90 * 90 * 360


def read_merl(path: str | Path, step: tuple[int, int, int] = (1, 1, 1)) -> ABRDF:
    """Read a BRDF.

    Parameters
    ----------
    path : path
        The `*.binary` file.
    step : (int, int, int)
        Take every so-manyth theta_h, theta_d and phi_d: all of the usual 1.46 million samples are seldom needed.

    Returns
    -------
    abrdf : ABRDF
        One texel, isotropic, RGB [1/sr].

    Raises
    ------
    InputError
        If the header is impossible (refused before memory is taken), the file is too short or too long, or holds NaN.
    """
    path = Path(path)
    if min(step) < 1:
        raise InputError("be at least 1 each", got=step, key="step")
    try:
        with path.open("rb") as file:
            head = file.read(12)
            if len(head) < 12:
                raise InputError("be whole", got=f"{len(head)} bytes", file=path, remedy="Copy the file again.")
            shape = struct.unpack("<3i", head)
            if min(shape) < 1 or math.prod(shape) > _MAX_CELLS:
                raise InputError("state a possible size, as 90 x 90 x 180", got=shape, file=path)
            want, got = 12 + 24 * math.prod(shape), path.stat().st_size
            if want != got:
                remedy = "Copy the file again."
                raise InputError(f"have {want} bytes, as its header says", got=got, file=path, remedy=remedy)
            table = np.frombuffer(file.read(), "<f8").reshape(3, *shape)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    table = table[:, :: step[0], :: step[1], :: step[2]]
    if not np.isfinite(table).all():
        raise InputError("be finite", got="NaN or infinity", file=path)
    num_h, num_d, num_phi = shape
    # Centres of the cells; the lookup of a half angle t is floor(sqrt(t / 90 deg) * 90).
    h = ((np.arange(num_h)[:: step[0]] + 0.5) / num_h) ** 2 * (np.pi / 2)
    d = (np.arange(num_d)[:: step[1]] + 0.5) / num_d * (np.pi / 2)
    phi = (np.arange(num_phi)[:: step[2]] + 0.5) / num_phi * np.pi
    grid_h, grid_d, grid_phi = (g.ravel() for g in np.meshgrid(h, d, phi, indexing="ij"))
    value = (table.reshape(3, -1) * _SCALE[:, None]).T
    abrdf = from_half_angles(
        grid_h, grid_d, grid_phi, value.astype(np.float32), np.asarray((value >= 0).all(axis=1)), ("R", "G", "B"), "1/sr", path.stem
    )
    # The square-root spacing makes a cell of theta_h as wide as the root of theta_h.
    theta_h = np.arccos(np.clip(_half_z(abrdf.wi, abrdf.wo), -1, 1))
    weight = abrdf.weight * np.sqrt(theta_h)
    return _with_weight(abrdf, weight * (2 * np.pi) ** 2 / weight.sum())


def write_merl(path: str | Path, table: NDArray) -> None:
    """Write a BRDF (theta_h, theta_d, phi_d, 3) [1/sr] as such a file; negative where not measured."""
    if table.ndim != 4 or table.shape[3] != 3:
        raise InputError("have shape (theta_h, theta_d, phi_d, 3)", got=table.shape, key="table")
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(struct.pack("<3i", *table.shape[:3]))
        for c in range(3):
            file.write(np.ascontiguousarray(table[..., c] / _SCALE[c], "<f8").tobytes())


def _half_z(wi: NDArray, wo: NDArray) -> NDArray:
    h = wi + wo
    return h[:, 2] / np.linalg.norm(h, axis=-1)


def _with_weight(abrdf: ABRDF, weight: NDArray) -> ABRDF:
    from dataclasses import replace

    return replace(abrdf, weight=weight)
