"""measurement/1: reflectance without a picture, as a table beside a small JSON file (docs/formats.md).

The table's rows are directions (`wi_x wi_y wi_z wo_x wo_y wo_z wavelength value sigma`) or conditions such as moisture
(`condition wavelength value sigma`).
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from ..abrdf import ABRDF, isotropic_weights
from ..foundation.errors import InputError
from ..foundation.typed_json import read_typed_json

Floats = NDArray[np.float64]
_NM = {"m": 1e9, "um": 1e3, "nm": 1.0}
_DIRECTIONS = ("wi_x", "wi_y", "wi_z", "wo_x", "wo_y", "wo_z")
_MAX_ROWS = 100_000_000


class MeasurementJson(msgspec.Struct, forbid_unknown_fields=True):
    """The JSON file, key by key."""

    format: Literal["measurement/1"]
    table: str
    name: str = ""
    unit: Literal["1/sr", "relative"] = "1/sr"
    cosine: bool = False
    isotropic: bool = True
    wavelength_unit: Literal["m", "um", "nm"] = "nm"
    condition: str = ""
    condition_unit: str = "1"
    model: dict[str, Any] | None = None


@dataclass(frozen=True)
class Conditions:
    """A quantity measured under conditions.

    Attributes
    ----------
    condition : (N,) float64
        The condition of each row.
    wavelength_nm : (K,) float64
        Rising.
    value, sigma : (N, K) float64
        A row per condition as it came; NaN where not measured; sigma is NaN where not given.
    name, unit : str
        Of the condition.
    """

    condition: Floats
    wavelength_nm: Floats
    value: Floats
    sigma: Floats
    name: str
    unit: str


@dataclass(frozen=True)
class MeasurementFile:
    """What a measurement/1 holds: samples over directions, or over conditions; and the model that was believed, if any."""

    name: str
    samples: ABRDF | None
    sigma: NDArray[np.float32] | None
    conditions: Conditions | None
    model: dict[str, Any] | None


def read_measurement(path: str | Path) -> MeasurementFile:
    """Read a measurement/1.

    Parameters
    ----------
    path : path
        `measurement.json`, or the folder that holds it.

    Returns
    -------
    measurement : MeasurementFile
        `samples` has one texel and a channel per wavelength; rows of equal directions are one sample.

    Raises
    ------
    InputError
        If a file is missing, a key or a column is unknown or missing, a number is NaN or of the wrong sign, a direction is not
        of unit length or below the horizon, or the table leaves the folder.
    """
    path = Path(path)
    path = path / "measurement.json" if path.is_dir() else path
    head = read_typed_json(path, MeasurementJson)
    table_file = path.parent / head.table
    if not table_file.resolve().is_relative_to(path.parent.resolve()):
        raise InputError("stay below the folder of the JSON", got=head.table, file=path, key="table")
    columns = _npz(table_file) if table_file.suffix == ".npz" else _csv(table_file)
    name = head.name or path.parent.resolve().name
    required = {"value", "wavelength"} | (set() if "condition" in columns else set(_DIRECTIONS))
    if missing := sorted(required - columns.keys()):
        remedy = "Give wi_x … wo_z, or condition; then wavelength, value and, if known, sigma."
        raise InputError("have the column " + missing[0], file=table_file, remedy=remedy)
    if unknown := sorted(columns.keys() - {"condition", "wavelength", "value", "sigma", *_DIRECTIONS}):
        raise InputError("be a known column", file=table_file, key=unknown[0])
    for key, column in columns.items():
        if not np.isfinite(column).all():
            raise InputError("be finite", file=table_file, key=f"{key}, row {int(np.argmin(np.isfinite(column))) + 1}")
    for key in ("value", "sigma", "wavelength"):
        if key in columns and (columns[key] < 0).any():
            row = int(np.argmax(columns[key] < 0))
            raise InputError("not be negative", got=columns[key][row], file=table_file, key=f"{key}, row {row + 1}")
    columns["wavelength"] = columns["wavelength"] * _NM[head.wavelength_unit]
    if "condition" in columns:
        return MeasurementFile(name, None, None, _conditions(columns, head), head.model)
    samples, sigma = _samples(columns, head, name, table_file)
    return MeasurementFile(name, samples, sigma, None, head.model)


def _conditions(columns: dict[str, Floats], head: MeasurementJson) -> Conditions:
    wavelength, column = np.unique(columns["wavelength"], return_inverse=True)
    # A condition may have been met more than once: the k-th time it comes with the same wavelength, it is another row.
    order = np.lexsort((np.arange(len(column)), column, columns["condition"]))
    same = (np.diff(columns["condition"][order]) == 0) & (np.diff(column[order]) == 0)
    repeat = np.zeros(len(column), np.int64)
    count = 0
    for i, again in enumerate(same):
        count = count + 1 if again else 0
        repeat[order[i + 1]] = count
    rows, row = np.unique(np.stack([columns["condition"], repeat], axis=1), axis=0, return_inverse=True)
    value = np.full((len(rows), len(wavelength)), np.nan)
    sigma = value.copy()
    value[row.reshape(-1), column] = columns["value"]
    if "sigma" in columns:
        sigma[row.reshape(-1), column] = columns["sigma"]
    return Conditions(rows[:, 0].astype(np.float64), wavelength, value, sigma, head.condition or "condition", head.condition_unit)


def _samples(columns: dict[str, Floats], head: MeasurementJson, name: str, file: Path) -> tuple[ABRDF, NDArray[np.float32] | None]:
    directions = np.stack([columns[key] for key in _DIRECTIONS], axis=1)
    pairs, row = np.unique(np.round(directions, 9), axis=0, return_inverse=True)
    wavelength, column = np.unique(columns["wavelength"], return_inverse=True)
    row = row.reshape(-1)
    value = np.full((len(pairs), len(wavelength)), np.nan)
    value[row, column] = columns["value"]
    valid = np.asarray(np.isfinite(value).all(axis=1))
    sigma = None
    if "sigma" in columns:
        sigma = np.full(value.shape, np.nan, np.float32)
        sigma[row, column] = columns["sigma"]
    wi, wo = pairs[:, :3], pairs[:, 3:]
    names = tuple(f"{w:g} nm" for w in wavelength)
    try:
        weight = isotropic_weights(wi, wo)
        kept = np.where(valid[:, None], value, 0).astype(np.float32)
        unit, plain = head.unit, not head.cosine
        abrdf = ABRDF(wi, wo, kept, valid, weight, names, unit, plain, isotropic=head.isotropic, name=name)
    except InputError as error:
        raise error.at(file=file) from error
    return abrdf, sigma


def _csv(path: Path) -> dict[str, Floats]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = [line for line in csv.reader(file) if line and not line[0].startswith("#")]
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check `table` in the JSON.") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError("be a CSV table", got=error, file=path) from error
    if len(lines) < 2:
        raise InputError("hold a row of names and rows of numbers", got=f"{len(lines)} rows", file=path)
    names = [name.strip() for name in lines[0]]
    if len(set(names)) != len(names):
        raise InputError("name each column once", got=", ".join(names), file=path)
    for i, line in enumerate(lines):
        if len(line) != len(names):
            raise InputError(f"have {len(names)} cells", got=len(line), file=path, key=f"row {i}")
    try:
        table = np.array(lines[1:], dtype=np.float64)
    except ValueError as error:
        raise InputError("hold numbers", got=error, file=path) from error
    return dict(zip(names, table.T.copy(), strict=True))


def _npz(path: Path) -> dict[str, Floats]:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {key: np.asarray(file[key], np.float64) for key in file.files}
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check `table` in the JSON.") from error
    except (ValueError, OSError, KeyError, EOFError) as error:
        raise InputError("be an npz archive of numbers", got=error, file=path) from error
    for key in ("wi", "wo"):  # as one array (N, 3), or as columns
        if key in arrays:
            if arrays[key].ndim != 2 or arrays[key].shape[1] != 3:
                raise InputError("have shape (N, 3)", got=arrays[key].shape, file=path, key=key)
            arrays.update({f"{key}_{axis}": arrays[key][:, k] for k, axis in enumerate("xyz")})
            del arrays[key]
    lengths = {len(column) if column.ndim == 1 else -1 for column in arrays.values()}
    if len(lengths) != 1 or not 0 < min(lengths) <= _MAX_ROWS:
        raise InputError("hold columns of one length", got=sorted(lengths), file=path)
    return arrays
