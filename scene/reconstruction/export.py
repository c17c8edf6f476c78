"""The scene as one binary glTF file (.glb), for any viewer: meshes with vertex colours, boards of one frame."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from materials.foundation.errors import InputError
from materials.foundation.files import replacing

from ..mesh import Mesh
from ..scene_file import Scene, cardboard_mesh

_FLOAT, _UINT, _UBYTE = 5126, 5125, 5121
_VERTICES, _INDICES = 34962, 34963


def write_glb(path: str | Path, meshes: dict[str, Mesh]) -> None:
    """Write meshes as binary glTF 2.0.

    Positions, normals, indices and, where a mesh has `fill_r, fill_g, fill_b`, colours (linear, as glTF wants them,
    clipped to [0, 1] in 8 bits). The world's z axis points up; glTF's y does, so the root node is turned.

    Raises
    ------
    InputError
        If no mesh has a triangle.
    """
    meshes = {name: mesh for name, mesh in meshes.items() if mesh.num_faces}
    if not meshes:
        raise InputError("hold a mesh with triangles", got="none", file=path)
    blob = bytearray()
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []

    def add(values: NDArray, component: int, kind: str, target: int, **extra: Any) -> int:
        blob.extend(b"\0" * (-len(blob) % 4))
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": values.nbytes, "target": target})
        blob.extend(values.tobytes())
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind, **extra})
        return len(accessors) - 1

    out: list[dict[str, Any]] = []
    for name, mesh in meshes.items():
        positions = np.ascontiguousarray(mesh.vertices, "<f4")
        low, high = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        attributes = {"POSITION": add(positions, _FLOAT, "VEC3", _VERTICES, min=low, max=high)}
        if mesh.normals is not None:
            attributes["NORMAL"] = add(_unit(mesh.normals), _FLOAT, "VEC3", _VERTICES)
        if "fill_r" in mesh.attributes:
            attributes["COLOR_0"] = add(_colours(mesh), _UBYTE, "VEC4", _VERTICES, normalized=True)
        indices = add(np.ascontiguousarray(mesh.faces, "<u4").reshape(-1), _UINT, "SCALAR", _INDICES)
        out.append({"name": name, "primitives": [{"attributes": attributes, "indices": indices, "material": 0}]})
    blob.extend(b"\0" * (-len(blob) % 4))
    half = 0.5**0.5
    nodes: list[dict[str, Any]] = [{"name": "world", "rotation": [-half, 0, 0, half], "children": list(range(1, len(out) + 1))}]
    nodes += [{"name": mesh["name"], "mesh": i} for i, mesh in enumerate(out)]
    document = {
        "asset": {"version": "2.0", "generator": "meniscus"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": out,
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}, "doubleSided": True}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(blob)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(blob), b"BIN\0") + bytes(blob))


def export_scene(path: str | Path, scene: Scene, frame: int = 0) -> None:
    """Write ground, environment and the boards of one frame as .glb."""
    meshes = {"ground": scene.ground, "environment": scene.environment}
    if scene.cardboards and scene.cardboards[frame]:
        meshes["cardboards"] = cardboard_mesh(scene.cardboards[frame])
    write_glb(path, meshes)


def _unit(normals: NDArray) -> NDArray[np.float32]:
    """Return normals of unit length as the format demands; those without direction point up."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-20), (0, 0, 1)).astype("<f4")


def _colours(mesh: Mesh) -> NDArray[np.uint8]:
    rgb = np.column_stack([mesh.attributes[f"fill_{c}"] for c in "rgb"])
    seen = mesh.attributes.get("fill_w", np.ones(len(rgb))) > 0
    rgb = np.where(seen[:, None], rgb, 0.2)
    return np.column_stack([np.rint(np.clip(rgb, 0, 1) * 255), np.full(len(rgb), 255)]).astype(np.uint8)
