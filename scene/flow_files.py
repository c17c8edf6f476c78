"""Files of optical flow: Middlebury `.flo`, Spring `.flo5`, KITTI's and HD1K's 16-bit PNG, `.pfm`, `.npy`, `.npz`.

In memory a flow field is (H, W, 2), x right, y down, in pixels, with a mask of where it is known; unknown vectors are NaN,
whatever marker the file has for them, so that none can enter a mean unnoticed.
"""

from __future__ import annotations

import io
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import replacing

from .images import read_raw, write_raw

SUFFIXES = (".flo", ".flo5", ".png", ".pfm", ".npy", ".npz")
# Middlebury: a vector is unknown if a component exceeds this; written files carry ten times as much (Baker et al. 2011).
UNKNOWN = 1e9
_FLO_MAGIC = b"PIEH"
# KITTI's 16 bits: px = (stored - 32768) / 64.
_OFFSET, _SCALE = 32768.0, 64.0
_KITTI_LARGEST = 511.9


@dataclass(frozen=True)
class Flow:
    """A flow field.

    Attributes
    ----------
    flow : (H, W, 2) float32
        x right, y down [px]; NaN where unknown.
    valid : (H, W) bool
        Where it is known.
    """

    flow: NDArray[np.float32]
    valid: NDArray[np.bool_]

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        return self.valid.shape[0], self.valid.shape[1]


def as_flow(values: ArrayLike, valid: ArrayLike | None = None, *, name: str = "flow") -> Flow:
    """Return a field with everything unknown marked as such.

    Parameters
    ----------
    values : (H, W, 2) float
        Components that are not finite or exceed 1e9 (Middlebury's marker) are unknown.
    valid : (H, W) bool, optional
        Where the field is known besides.

    Raises
    ------
    InputError
        If the shape is another.

    Examples
    --------
    >>> as_flow([[[1.0, 0.0], [1e10, 1e10]]]).valid
    array([[ True, False]])
    """
    array = np.asarray(values)
    if array.ndim != 3 or array.shape[2] != 2 or array.dtype.kind not in "fiu":
        remedy = "Move the axis of the two components last." if array.ndim == 3 and array.shape[0] == 2 else ""
        got = array.shape if array.dtype.kind in "fiu" else array.dtype
        raise InputError("be numbers of shape (height, width, 2)", got=got, key=name, remedy=remedy)
    if array.size == 0:
        raise InputError("have pixels", got=array.shape, key=name)
    known = np.asarray((np.abs(array) <= UNKNOWN).all(axis=-1))  # NaN compares false
    if valid is not None:
        mask = np.asarray(valid)
        if mask.shape != known.shape:
            raise InputError(f"have shape {known.shape}, as its flow", got=mask.shape, key=f"valid of {name}")
        known = known & (mask != 0)
    return Flow(np.where(known[..., None], array, np.nan).astype(np.float32), known)


def read_flow(path: str | Path) -> Flow:
    """Read a flow field; the suffix tells the format.

    Parameters
    ----------
    path : path
        `.flo` (Middlebury), `.flo5` (Spring: HDF5, dataset `flow`), `.png` (KITTI 2012/2015 and HD1K: 16-bit RGB of u, v,
        valid), `.pfm` (three channels, bottom row first), `.npy` (H, W, 2), `.npz` (`flow`, and `valid` if there is one).

    Raises
    ------
    InputError
        If the file is missing, truncated, of another kind than its suffix says, or no flow (an 8-bit or a grey PNG, a
        picture in 16 bits).
    """
    path = Path(path)
    readers = {".flo": _read_flo, ".flo5": _read_flo5, ".png": _read_png, ".pfm": _read_pfm, ".npy": _read_npy, ".npz": _read_npz}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"be one of {', '.join(SUFFIXES)}", got=path.suffix or "no suffix", file=path)
    if not path.is_file():
        raise InputError("exist" if not path.exists() else "be a file", file=path, remedy="Check the path.")
    try:
        return reader(path)
    except InputError as error:
        raise error.at(file=path) from error


def write_flow(path: str | Path, flow: Flow | NDArray) -> None:
    """Write a flow field; the suffix tells the format, as in `read_flow`.

    KITTI's PNG holds steps of 1/64 px within ±512 px: vectors beyond are written as unknown. The other formats keep float32
    as it is; unknown vectors become the format's marker (1e10 in `.flo`, NaN in the others).

    Raises
    ------
    InputError
        If the suffix names no format of flow.
    """
    path = Path(path)
    given = flow if isinstance(flow, Flow) else as_flow(flow)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"be one of {', '.join(SUFFIXES)}", got=path.suffix or "no suffix", file=path)
    if suffix == ".png":
        write_raw(path, kitti_stored(given))
        return
    with replacing(path) as temporary:
        if suffix == ".flo":
            marked = np.where(given.valid[..., None], given.flow, np.float32(10 * UNKNOWN)).astype("<f4")
            height, width = given.size
            temporary.write_bytes(_FLO_MAGIC + np.array([width, height], "<i4").tobytes() + marked.tobytes())
        elif suffix == ".flo5":
            import h5py

            with h5py.File(temporary, "w") as file:
                file.create_dataset("flow", data=given.flow, compression="gzip", compression_opts=5)
        elif suffix == ".pfm":
            height, width = given.size
            three = np.dstack([given.flow, np.zeros(given.size, np.float32)])[::-1]
            # A negative scale says little-endian.
            temporary.write_bytes(f"PF\n{width} {height}\n-1.0\n".encode() + three.astype("<f4").tobytes())
        elif suffix == ".npy":
            np.save(temporary, given.flow)
        else:
            np.savez_compressed(temporary, flow=given.flow, valid=given.valid)


def kitti_stored(flow: Flow) -> NDArray[np.uint16]:
    """Return (H, W, 3) uint16 as KITTI stores a field: u and v as `px * 64 + 32768`, and 1 where it is known."""
    known = flow.valid & (np.abs(np.nan_to_num(flow.flow)) < _KITTI_LARGEST).all(axis=-1)
    coded = np.rint(np.where(known[..., None], flow.flow, 0) * _SCALE + _OFFSET)
    return np.where(known[..., None], np.dstack([coded, np.ones(flow.size)]), 0).astype(np.uint16)


def read_uncertainty(path: str | Path, scale: float) -> NDArray[np.float32]:
    """Read the standard deviation of a true flow (H, W) [px], as HD1K gives it beside the flow; 0 where there is none.

    Parameters
    ----------
    path : path
        Image or `.npy`; of several channels the largest counts.
    scale : float
        px = stored / scale. The benchmark's files do not say it themselves, so there is no default.

    Raises
    ------
    InputError
        If the file is missing or damaged, or holds negative numbers.
    """
    path = Path(path)
    if not scale > 0:
        raise InputError("be positive", got=scale, key="scale")
    stored = np.asarray(_load(path) if path.suffix.lower() == ".npy" else read_raw(path), np.float32)
    if stored.ndim == 3:
        stored = stored.max(axis=-1)
    if stored.ndim != 2 or not np.all(stored >= 0):
        raise InputError("hold non-negative deviations of shape (height, width)", got=stored.shape, file=path)
    return (stored / np.float32(scale)).astype(np.float32)


def _read_flo(path: Path) -> Flow:
    data = path.read_bytes()
    if data[:4] != _FLO_MAGIC:
        raise InputError("begin as a Middlebury .flo file does (202021.25)", got=repr(data[:4]))
    width, height = (int(n) for n in np.frombuffer(data[4:12].ljust(8, b"\0"), "<i4"))
    wanted = 12 + 8 * width * height
    if width <= 0 or height <= 0 or len(data) != wanted:
        raise InputError(f"hold {wanted} bytes for {width} x {height} vectors", got=f"{len(data)} bytes", remedy="Copy it again.")
    return as_flow(np.frombuffer(data, "<f4", offset=12).reshape(height, width, 2))


def _read_flo5(path: Path) -> Flow:
    import h5py

    try:
        with h5py.File(path, "r") as file:
            if "flow" not in file:
                raise InputError("hold a dataset named flow", got=", ".join(file) or "none")
            return as_flow(np.asarray(file["flow"]))
    except OSError as error:
        raise InputError("be a whole HDF5 file", got=str(error).split("(")[-1].rstrip(")"), remedy="Copy it again.") from error


def _read_png(path: Path) -> Flow:
    stored = read_raw(path)  # RGB: OpenCV's BGR has been turned
    if stored.dtype != np.uint16 or stored.ndim != 3:
        kind = "a grey" if stored.ndim == 2 else "an RGB"
        raise InputError(
            "be a 16-bit RGB PNG, as KITTI stores flow",
            got=f"{kind} one of {stored.dtype}",
            remedy="Is it a picture or a disparity?",
        )
    if stored[..., 2].max() > 1:
        value = int(stored[..., 2].max())
        raise InputError(
            "have 0 or 1 in its third channel (valid)", got=value, remedy="Is it a picture? KITTI's flow is u, v, valid."
        )
    return as_flow((stored[..., :2].astype(np.float32) - _OFFSET) / _SCALE, stored[..., 2])


def _read_pfm(path: Path) -> Flow:
    data = path.read_bytes()
    head = re.match(rb"(P[Ff])\s+(\d+)\s+(\d+)\s+([-+0-9.eE]+)\s", data[:200])
    if head is None:
        raise InputError("have the header of a PFM file", got=repr(data[:16]))
    if head[1] == b"Pf":
        raise InputError("have three channels (PF)", got="one (Pf)", remedy="Is it a disparity?")
    width, height, scale = int(head[2]), int(head[3]), float(head[4])
    values = np.frombuffer(data[head.end() :][: 12 * width * height], "<f4" if scale < 0 else ">f4")
    if len(values) != 3 * width * height or len(values) == 0:
        raise InputError(f"hold {width} x {height} x 3 floats", got=len(values), remedy="Copy it again.")
    return as_flow(values.reshape(height, width, 3)[::-1, :, :2])


def _read_npy(path: Path) -> Flow:
    return as_flow(_load(path))


def _read_npz(path: Path) -> Flow:
    with _load(path) as arrays:
        if "flow" not in arrays:
            raise InputError("hold an array named flow", got=", ".join(arrays) or "none")
        return as_flow(arrays["flow"], arrays.get("valid"))


def _load(path: Path):
    try:
        # Through memory: NumPy leaves a file open when the archive in it is broken.
        return np.load(io.BytesIO(path.read_bytes()), allow_pickle=False)
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError("be a whole file of NumPy arrays", got=error, file=path, remedy="Copy it again.") from error
