"""Tensor files, the container of measured materials for Mitsuba (`*.bsdf`, `*.pbsdf`), and the polarimetric BRDFs in them.

Little-endian: `tensor_file\\0`, version (2 bytes), number of fields (uint32); per field the length of its name (uint16), the
name, the number of dimensions (uint16), a type (uint8), the offset of its data (uint64) and the shape (uint64 each).

References
----------
Dupuy and Jakob (2018), An Adaptive Parameterization for Efficient Material Acquisition and Rendering. Baek et al. (2020),
Image-Based Acquisition and Modeling of Polarimetric Reflectance. Rusinkiewicz (1998), A New Change of Variables for
Efficient BRDF Representation.
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

_MAGIC = b"tensor_file\0"
_TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8")
_FIRST_TYPE = 1
_MAX_FIELDS, _MAX_DIMENSIONS = 1024, 16


def read_tensor_file(path: str | Path) -> dict[str, NDArray]:
    """Read all fields of a tensor file.

    Returns
    -------
    fields : dict of str to array
        In the order of the file; fields without data (a grid's bare shape) hold zeros of that shape if it is empty.

    Raises
    ------
    InputError
        If the magic, a type, an offset or a shape is wrong, or the file ends early. Sizes are checked against the file's
        length before any memory is taken.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    if data[: len(_MAGIC)] != _MAGIC:
        raise InputError("be a tensor file", got=f"the bytes {data[:12]!r}", file=path)
    try:
        return _fields(data, path)
    except (struct.error, UnicodeDecodeError) as error:
        raise InputError("be whole", got="a truncated header", file=path, remedy="Copy the file again.") from error


def _fields(data: bytes, path: Path) -> dict[str, NDArray]:
    major, _, count = struct.unpack_from("<BBI", data, len(_MAGIC))
    if major != 1:
        raise InputError("have version 1", got=major, file=path)
    if count > _MAX_FIELDS:
        raise InputError(f"have at most {_MAX_FIELDS} fields", got=count, file=path)
    at = len(_MAGIC) + 6
    fields: dict[str, NDArray] = {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        num_dimensions, kind, offset = struct.unpack_from("<HBQ", data, at + 2 + length)
        if num_dimensions > _MAX_DIMENSIONS:
            raise InputError(f"have at most {_MAX_DIMENSIONS} dimensions", got=num_dimensions, file=path, key=name)
        shape = struct.unpack_from(f"<{num_dimensions}Q", data, at + 13 + length)
        at += 13 + length + 8 * num_dimensions
        if not _FIRST_TYPE <= kind < _FIRST_TYPE + len(_TYPES):
            raise InputError("have a known type", got=kind, file=path, key=name)
        dtype = np.dtype("<" + _TYPES[kind - _FIRST_TYPE])
        size = math.prod(shape)
        if offset + size * dtype.itemsize > len(data):
            got = f"shape {shape} at byte {offset} of {len(data)}"
            raise InputError("lie within the file", got=got, file=path, key=name, remedy="Copy the file again.")
        fields[name] = np.frombuffer(data, dtype, size, offset).reshape(shape)
    return fields


def write_tensor_file(path: str | Path, fields: dict[str, NDArray]) -> None:
    """Write arrays of plain numbers as a tensor file, in the order given.

    Raises
    ------
    InputError
        If an array has a type that the format lacks.
    """
    head, body = _MAGIC + struct.pack("<BBI", 1, 0, len(fields)), b""
    start = len(head) + sum(2 + len(name.encode()) + 11 + 8 * array.ndim for name, array in fields.items())
    for name, array in fields.items():
        kind = array.dtype.str.lstrip("<|=")
        if kind not in _TYPES:
            raise InputError(f"have one of the types {', '.join(_TYPES)}", got=array.dtype, key=name)
        body += b"\0" * (-(start + len(body)) % 8)
        head += struct.pack("<H", len(name.encode())) + name.encode()
        head += struct.pack("<HBQ", array.ndim, _FIRST_TYPE + _TYPES.index(kind), start + len(body))
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += np.ascontiguousarray(array).tobytes()
    with replacing(path) as temporary:
        temporary.write_bytes(head + body)


def read_pbsdf(path: str | Path) -> ABRDF:
    """Read the unpolarised reflectance of a polarimetric BRDF: element 00 of its Mueller matrices.

    Returns
    -------
    abrdf : ABRDF
        One texel, isotropic, one channel per wavelength. The unit is `relative`: the absolute scale of published files has
        not been established. Cells whose directions fall below the horizon, and cells that are not positive (never
        measured), are not valid.

    Raises
    ------
    InputError
        As `read_tensor_file`; or if a field is missing or the shapes disagree.
    """
    fields = read_tensor_file(path)
    for name in ("phi_d", "theta_d", "theta_h", "wvls", "M"):
        if name not in fields:
            raise InputError("be a field of the file", file=path, key=name, remedy="Give a polarimetric BRDF (.pbsdf).")
    mueller, wavelengths = fields["M"], np.asarray(fields["wvls"], np.float64).reshape(-1)
    counts = tuple(fields[name].shape[-1] for name in ("phi_d", "theta_d", "theta_h"))
    if mueller.shape != (*counts, len(wavelengths), 4, 4):
        raise InputError(f"have shape {(*counts, len(wavelengths), 4, 4)}", got=mueller.shape, file=path, key="M")
    if min(counts) < 2:
        raise InputError("have at least 2 angles each way", got=counts, file=path, key="M")
    value = np.asarray(mueller[..., 0, 0], np.float32)
    if not np.isfinite(value).all():
        raise InputError("be finite", got="NaN or infinity", file=path, key="M")
    # Uniform grids: phi_d over a full turn, the thetas over a quarter, both ends included.
    phi_d = np.linspace(0, 2 * np.pi, counts[0])
    theta = [np.linspace(0, np.pi / 2, n) for n in counts[1:]]
    d_phi, d_theta, h_theta = np.meshgrid(phi_d, *theta, indexing="ij")
    names = tuple(f"{w:g} nm" for w in wavelengths)
    flat = value.reshape(-1, len(wavelengths))
    return from_half_angles(
        h_theta.ravel(),
        d_theta.ravel(),
        d_phi.ravel(),
        flat,
        np.asarray((flat > 0).all(axis=1)),
        names,
        "relative",
        Path(path).stem,
    )
