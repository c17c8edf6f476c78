"""Triangle meshes and their files (PLY with normals, `u, v`, and any per-vertex attribute)."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import replacing


@dataclass(frozen=True)
class Mesh:
    """Triangles with per-vertex attributes.

    Attributes
    ----------
    vertices : (V, 3) float32
        Positions [m].
    faces : (F, 3) uint32
        Counter-clockwise seen from outside.
    normals : (V, 3) float32 or None
        Unit shading normals.
    uv : (V, 2) float32 or None
        Texture coordinates, v = 0 at the first row.
    attributes : dict of (V,) arrays
        Further scalars per vertex by PLY name (`red`, `fill_r`, `quality`, …).
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32] | None = None
    uv: NDArray[np.float32] | None = None
    attributes: dict[str, NDArray] = field(default_factory=dict)

    @property
    def num_faces(self) -> int:
        return len(self.faces)

    def face_normals(self) -> NDArray[np.float64]:
        """Return unit geometric normals (F, 3); zero where a triangle has no area."""
        a, b, c = (self.vertices[self.faces[:, i]].astype(np.float64) for i in range(3))
        n = np.cross(b - a, c - a)
        length = np.linalg.norm(n, axis=1, keepdims=True)
        return np.divide(n, length, out=np.zeros_like(n), where=length > 0)

    def with_smooth_normals(self) -> Mesh:
        """Return the mesh with normals averaged over the faces around each vertex, weighted by area."""
        a, b, c = (self.vertices[self.faces[:, i]].astype(np.float64) for i in range(3))
        n = np.cross(b - a, c - a)
        total = np.zeros((len(self.vertices), 3))
        for i in range(3):
            for axis in range(3):
                total[:, axis] += np.bincount(self.faces[:, i], weights=n[:, axis], minlength=len(total))
        length = np.linalg.norm(total, axis=1, keepdims=True)
        unit = np.divide(total, length, out=np.tile([0.0, 0.0, 1.0], (len(total), 1)), where=length > 0)
        return Mesh(self.vertices, self.faces, unit.astype(np.float32), self.uv, self.attributes)


def join(meshes: list[Mesh]) -> Mesh:
    """Return one mesh of several; normals and uv are kept if all have them, attributes if all share their names."""
    if not meshes:
        return Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    names = set.intersection(*(set(m.attributes) for m in meshes))
    return Mesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + np.uint32(o) for m, o in zip(meshes, offsets, strict=True)]),
        np.concatenate([m.normals for m in meshes]) if all(m.normals is not None for m in meshes) else None,  # type: ignore[misc]
        np.concatenate([m.uv for m in meshes]) if all(m.uv is not None for m in meshes) else None,  # type: ignore[misc]
        {name: np.concatenate([m.attributes[name] for m in meshes]) for name in sorted(names)},
    )


def read_ply(path: str | Path) -> Mesh:
    """Read a PLY file, ASCII or binary; without faces it gives a mesh of points.

    Raises
    ------
    InputError
        If the file is missing, truncated, no PLY, not of triangles, or refers to vertices that do not exist.
    """
    import plyfile

    # Lists of one known length are read as an array; others row by row, a thousand times slower.
    triangles = {"face": {"vertex_indices": 3, "vertex_index": 3}}
    try:
        try:
            data = plyfile.PlyData.read(str(path), known_list_len=triangles)
        except plyfile.PlyElementParseError:  # a polygon, or the end of a truncated file: the slow way tells which
            data = plyfile.PlyData.read(str(path))
    except FileNotFoundError as error:
        raise InputError("exist", file=path, remedy="Check the path.") from error
    except (plyfile.PlyParseError, ValueError, UnicodeDecodeError, EOFError) as error:
        raise InputError("be a whole PLY file", got=error, file=path, remedy="Copy or export the file again.") from error
    if "vertex" not in data or not {"x", "y", "z"} <= set(data["vertex"].data.dtype.names):
        raise InputError("have vertices with x, y, z", file=path)
    vertex = data["vertex"].data
    columns = set(vertex.dtype.names)

    def stacked(*names: str) -> NDArray[np.float32] | None:
        return np.stack([vertex[n] for n in names], axis=1).astype(np.float32) if set(names) <= columns else None

    vertices = stacked("x", "y", "z")
    assert vertices is not None
    uv = stacked("u", "v")
    if uv is None:
        uv = stacked("s", "t")
    known = {"x", "y", "z", "nx", "ny", "nz", "u", "v", "s", "t"}
    attributes = {n: np.array(vertex[n]) for n in vertex.dtype.names if n not in known}
    return Mesh(vertices, _faces(data, len(vertices), path), stacked("nx", "ny", "nz"), uv, attributes)


def write_ply(path: str | Path, mesh: Mesh) -> None:
    """Write a binary PLY file with all that the mesh holds."""
    import plyfile

    columns: list[tuple[str, NDArray]] = [(n, mesh.vertices[:, i]) for i, n in enumerate("xyz")]
    if mesh.normals is not None:
        columns += [(n, mesh.normals[:, i]) for i, n in enumerate(("nx", "ny", "nz"))]
    if mesh.uv is not None:
        columns += [(n, mesh.uv[:, i]) for i, n in enumerate("uv")]
    columns += list(mesh.attributes.items())
    vertex = np.empty(len(mesh.vertices), dtype=[(n, c.dtype.newbyteorder("<")) for n, c in columns])
    for name, column in columns:
        vertex[name] = column
    # A row of a list is its length and its values. plyfile, which tells the header, would write them one by one.
    indices = ("vertex_indices", "<i4", (3,))
    face = np.empty(len(mesh.faces), dtype=[("length", "u1"), indices])
    face["length"], face["vertex_indices"] = 3, mesh.faces
    told = np.empty(len(mesh.faces), dtype=[indices])
    elements = [plyfile.PlyElement.describe(vertex, "vertex"), plyfile.PlyElement.describe(told, "face")]
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(f"{plyfile.PlyData(elements, byte_order='<').header}\n".encode())
        file.write(vertex.tobytes())
        file.write(face.tobytes())


def _faces(data, num_vertices: int, path: str | Path) -> NDArray[np.uint32]:
    if "face" not in data or len(data["face"].data) == 0:
        return np.zeros((0, 3), np.uint32)
    names = data["face"].data.dtype.names
    name = next((n for n in ("vertex_indices", "vertex_index") if n in names), None)
    if name is None:
        raise InputError("have vertex_indices in its faces", file=path)
    lists = data["face"].data[name]
    if lists.dtype == object:
        lengths = {len(face) for face in lists}
        if lengths != {3}:
            raise InputError("have triangles only", got=f"faces of {sorted(lengths)} vertices", file=path, remedy="Triangulate it.")
        lists = np.stack(lists)
    if lists.min() < 0 or lists.max() >= num_vertices:
        got = int(lists.min()) if lists.min() < 0 else int(lists.max())
        raise InputError(f"refer to vertices 0 to {num_vertices - 1}", got=got, file=path, key="vertex_indices")
    return lists.astype(np.uint32)
