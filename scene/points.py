"""Point-cloud files: npz, KITTI bin, PLY, PCD and LAS/LAZ, read into one array.

The first three columns are x, y, z [m]; a fourth is the scanner's reflectance or intensity where the file has one. Rows
that are not finite (the "no return" of many drivers) are left out and counted in the log; a file that is truncated or
empty is refused, since a cloud with a part missing looks like a street with a part missing.
"""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import replacing
from materials.foundation.progress import logger

SUFFIXES = (".npz", ".bin", ".ply", ".pcd", ".las", ".laz")
# float32 resolves 2 mm at 16 km; farther out (map coordinates) a cloud must be moved to a near origin first.
FARTHEST = 16384.0
_INTENSITY = ("intensity", "reflectance", "reflectivity", "remission", "i", "scalar_intensity")


def read_points(path: str | Path) -> NDArray[np.float32]:
    """Read a point cloud.

    Parameters
    ----------
    path : path
        `.npz` with key `points` (N, 3+), `.bin` as KITTI writes it (N, 4), `.ply`, `.pcd` (ascii, binary,
        binary_compressed), `.las` or `.laz` (needs `lazrs` or `laszip` beside laspy).

    Returns
    -------
    points : (N, 3+) float32
        x, y, z [m], then what else the file holds per point: all columns of npz and bin, the intensity of the others.

    Raises
    ------
    InputError
        If the file is missing, truncated, of another kind, has fewer than three columns, holds no finite point, or lies
        so far from its origin that float32 would lose millimetres (`read_points_far` reads that).
    """
    points = read_points_far(path)
    farthest = float(np.abs(points[:, :3]).max())
    if farthest > FARTHEST:
        raise InputError(
            f"lie within {FARTHEST / 1000:.0f} km of its origin",
            got=f"a coordinate of {farthest:.0f} m",
            file=path,
            remedy="Subtract an offset (map coordinates do not fit float32).",
        )
    return points.astype(np.float32)


def read_points_far(path: str | Path) -> NDArray[np.float64]:
    """As `read_points`, in float64 and at any distance from the origin."""
    path = Path(path)
    if not path.is_file():
        raise InputError("exist", file=path, remedy="Check the path.")
    readers = {".npz": _npz, ".bin": _bin, ".ply": _ply, ".pcd": _pcd, ".las": _las, ".laz": _las}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"be one of {', '.join(SUFFIXES)}", got=path.suffix or "no suffix", file=path)
    points = reader(path)
    if len(points) == 0:
        raise InputError("hold points", got="an empty cloud", file=path)
    good = np.all(np.isfinite(points[:, :3]), axis=1)
    if not np.any(good):
        raise InputError("hold finite points", got="NaN or infinity in all of them", file=path)
    if not np.all(good):
        logger.info("%s: left out %d of %d points that are not finite", path, np.sum(~good), len(good))
        points = points[good]
    return np.ascontiguousarray(points, dtype=np.float64)


def write_points(path: str | Path, points: NDArray) -> None:
    """Write points (N, 3+) as `.npz` (key `points`), `.bin` (four columns, the fourth 0 if absent) or `.ply`.

    Raises
    ------
    InputError
        If the array is not (N, 3+) or the suffix is another.
    """
    path = Path(path)
    points = np.asarray(points, dtype=np.float32)
    if points.ndim != 2 or points.shape[1] < 3:
        raise InputError("have shape (N, 3+)", got=points.shape, key="points")
    with replacing(path) as temporary:
        if path.suffix.lower() == ".npz":
            with temporary.open("wb") as file:
                np.savez_compressed(file, points=points)
        elif path.suffix.lower() == ".bin":
            four = np.zeros((len(points), 4), np.float32)
            four[:, : min(4, points.shape[1])] = points[:, :4]
            temporary.write_bytes(four.astype("<f4").tobytes())
        elif path.suffix.lower() == ".ply":
            _write_ply(temporary, points)
        else:
            raise InputError("be .npz, .bin or .ply", got=path.suffix or "no suffix", file=path)


def _npz(path: Path) -> NDArray:
    try:
        # Opened here: NumPy leaves the file open if it turns out to be no archive.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            if "points" not in archive:
                raise InputError("hold an array `points`", got=", ".join(archive.files) or "nothing", file=path)
            points = archive["points"]
    except InputError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, KeyError) as error:
        raise InputError("be a whole npz file", got=error, file=path, remedy="Copy or export the file again.") from error
    if points.ndim != 2 or points.shape[1] < 3 or points.dtype.kind not in "fiu":
        raise InputError("have shape (N, 3+) and hold numbers", got=f"{points.shape} of {points.dtype}", file=path, key="points")
    return points


def _bin(path: Path) -> NDArray:
    size = path.stat().st_size
    if size % 16:
        raise InputError(
            "hold four float32 a point (x, y, z, reflectance)",
            got=f"{size} bytes",
            file=path,
            remedy="Copy the file again; it is truncated.",
        )
    return np.fromfile(path, dtype="<f4").reshape(-1, 4)


def _ply(path: Path) -> NDArray:
    import plyfile

    # Not scene.mesh.read_ply: that is float32 and refuses polygons, while a cloud may be far away and ignores faces.
    try:
        data = plyfile.PlyData.read(str(path))
    except (plyfile.PlyParseError, ValueError, UnicodeDecodeError, EOFError) as error:
        raise InputError("be a whole PLY file", got=error, file=path, remedy="Copy or export the file again.") from error
    if "vertex" not in data:
        raise InputError("have vertices", file=path)
    vertex = data["vertex"].data
    return _columns({n.lower(): vertex[n] for n in vertex.dtype.names}, path)


def _pcd(path: Path) -> NDArray:
    _check_pcd(path)
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.t.io.read_point_cloud(path, remove_nan_points=False, remove_infinite_points=False)
    if "positions" not in cloud.point:
        raise InputError("be a whole PCD file", got="nothing that can be read", file=path, remedy="Export the file again.")
    positions = cloud.point["positions"].numpy()
    columns = {"x": positions[:, 0], "y": positions[:, 1], "z": positions[:, 2]}
    columns |= {n: cloud.point[n].numpy()[:, 0] for n in _INTENSITY if n in cloud.point}
    return _columns(columns, path)


def _check_pcd(path: Path) -> None:
    """Refuse a PCD file whose data is shorter than its header says: Open3D fills the rest with zeros or reads nothing."""
    data = path.read_bytes()
    header: dict[str, list[str]] = {}
    start = 0
    while "DATA" not in header:
        end = data.find(b"\n", start)
        words = data[start:end].decode("ascii", errors="replace").split()
        if end < 0 or start > 10000:
            raise InputError("be a PCD file", got="no DATA line in its header", file=path)
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
        start = end + 1
    try:
        num_points = int(header.get("POINTS", ["-1"])[0])
        sizes = [int(s) for s in header["SIZE"]]
        counts = [int(c) for c in header.get("COUNT", ["1"] * len(sizes))]
        kind = header["DATA"][0].lower()
        fields = {name.lower() for name in header["FIELDS"]}
    except (KeyError, IndexError, ValueError) as error:
        raise InputError("be a PCD file", got=f"a header without {error}", file=path) from error
    if not {"x", "y", "z"} <= fields:
        raise InputError("have fields x, y, z", got=" ".join(sorted(fields)), file=path)
    if num_points == 0:
        raise InputError("hold points", got="an empty cloud", file=path)
    body = len(data) - start
    if kind == "ascii":
        whole = len(data[start:].split()) >= num_points * sum(counts)
    elif kind == "binary":
        whole = body >= num_points * sum(s * c for s, c in zip(sizes, counts, strict=True))
    else:
        whole = body >= 8 and body - 8 >= int.from_bytes(data[start : start + 4], "little")
    if not whole:
        raise InputError(
            f"hold the {num_points} points of its header", got="a truncated file", file=path, remedy="Copy the file again."
        )


def _las(path: Path) -> NDArray:
    import laspy

    try:
        cloud = laspy.read(path)
        columns = {"x": np.asarray(cloud.x), "y": np.asarray(cloud.y), "z": np.asarray(cloud.z)}
        columns["intensity"] = np.asarray(cloud.intensity)
        expected = cloud.header.point_count
    except laspy.errors.LaspyException as error:
        if path.suffix.lower() == ".laz" and not laspy.LazBackend.detect_available():
            raise InputError("be LAS, or laspy needs a LAZ backend", file=path, remedy="Install one: pip install lazrs.") from error
        raise InputError("be a whole LAS file", got=error, file=path, remedy="Copy or export the file again.") from error
    except Exception as error:  # the LAZ backends raise exceptions of their own, which laspy lets through
        raise InputError("be a whole LAS file", got=error, file=path, remedy="Copy or export the file again.") from error
    if len(columns["x"]) != expected:
        raise InputError(
            f"hold the {expected} points of its header", got=len(columns["x"]), file=path, remedy="Copy the file again."
        )
    return _columns(columns, path)


def _columns(columns: dict[str, NDArray], path: Path) -> NDArray[np.float64]:
    """Stack x, y, z and, if there is one, the intensity."""
    if not {"x", "y", "z"} <= set(columns):
        raise InputError("have x, y, z per point", got=", ".join(columns), file=path)
    names = ["x", "y", "z"] + [n for n in _INTENSITY if n in columns][:1]
    return np.stack([np.asarray(columns[n], dtype=np.float64) for n in names], axis=1)


def _write_ply(path: Path, points: NDArray[np.float32]) -> None:
    import plyfile

    names = ["x", "y", "z", "intensity"][: min(4, points.shape[1])]
    vertex = np.empty(len(points), dtype=[(n, "<f4") for n in names])
    for i, name in enumerate(names):
        vertex[name] = points[:, i]
    plyfile.PlyData([plyfile.PlyElement.describe(vertex, "vertex")], byte_order="<").write(str(path))
