"""Lists of gonioreflectometer samples as Cornell's Program of Computer Graphics wrote them (`*.brdf`).

Text with `#` comments: the number of wavelengths, the wavelengths [nm], then rows
`theta_i phi_i theta_s phi_s value value ...` [rad, 1/sr]. The mirror direction of phi_i = 0 is phi_s = 180 degrees.

References
----------
Westin et al., Cornell University Program of Computer Graphics, reflectance data.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..abrdf import ABRDF, isotropic_weights
from ..directions import spherical
from ..foundation.errors import InputError

_MAX_WAVELENGTHS = 4096


def read_cornell(path: str | Path) -> ABRDF:
    """Read a list of samples of an isotropic surface.

    Parameters
    ----------
    path : path
        The `*.brdf` file.

    Returns
    -------
    abrdf : ABRDF
        One texel, isotropic, one channel per wavelength, [1/sr].

    Raises
    ------
    InputError
        If the file is missing or truncated, or holds NaN, a negative value, or a direction below the horizon; names the line.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except UnicodeDecodeError as error:
        raise InputError("be a text file", got="binary data", file=path) from error
    numbered = [(i + 1, words) for i, line in enumerate(lines) if (words := line.split("#")[0].split())]
    if not numbered:
        raise InputError("hold samples", got="nothing", file=path)
    count = _count(numbered[0], path)
    wavelengths: list[float] = []
    at = 1
    while len(wavelengths) < count:
        if at >= len(numbered):
            raise InputError(f"list {count} wavelengths", got=len(wavelengths), file=path, remedy="Copy the file again.")
        wavelengths += _numbers(numbered[at], path)
        at += 1
    if len(wavelengths) > count:
        raise InputError(f"list {count} wavelengths", got=f"{len(wavelengths)} or more", file=path)
    rows = []
    for line in numbered[at:]:
        row = _numbers(line, path)
        if len(row) != 4 + count:
            must = f"hold 4 angles and {count} values"
            raise InputError(must, got=f"{len(row)} numbers", file=path, key=f"line {line[0]}", remedy="Copy the file again.")
        _check_row(row, path, line[0])
        rows.append(row)
    if not rows:
        raise InputError("hold samples", got="a header only", file=path)
    table = np.array(rows)
    wi, wo = spherical(table[:, 0], table[:, 1]), spherical(table[:, 2], table[:, 3])
    value = table[:, 4:].astype(np.float32)
    names = tuple(f"{w:g} nm" for w in wavelengths)
    valid = np.ones(len(table), bool)
    return ABRDF(wi, wo, value, valid, isotropic_weights(wi, wo), names, isotropic=True, name=path.stem)


def _count(line: tuple[int, list[str]], path: Path) -> int:
    numbers = _numbers(line, path)
    if len(numbers) != 1 or numbers[0] != int(numbers[0]) or not 1 <= numbers[0] <= _MAX_WAVELENGTHS:
        got = " ".join(line[1])
        raise InputError("start with the number of wavelengths", got=got, file=path, key=f"line {line[0]}")
    return int(numbers[0])


def _numbers(line: tuple[int, list[str]], path: Path) -> list[float]:
    try:
        numbers = [float(word) for word in line[1]]
    except ValueError as error:
        raise InputError("hold numbers", got=" ".join(line[1]), file=path, key=f"line {line[0]}") from error
    if not np.isfinite(numbers).all():
        raise InputError("be finite", got=" ".join(line[1]), file=path, key=f"line {line[0]}")
    return numbers


def _check_row(row: list[float], path: Path, line: int) -> None:
    if not all(0 <= theta <= np.pi / 2 + 1e-6 for theta in (row[0], row[2])):
        got = f"theta {row[0]:g} and {row[2]:g} rad"
        raise InputError("have directions above the horizon", got=got, file=path, key=f"line {line}")
    if min(row[4:]) < 0:
        raise InputError("hold no negative reflectance", got=min(row[4:]), file=path, key=f"line {line}")
