from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.mesh import Mesh
from scene.reconstruction.export import write_glb

SIZES = {5121: 1, 5125: 4, 5126: 4}
COUNTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def square() -> Mesh:
    corners = np.array([[0, 0, 1], [2, 0, 1], [2, 2, 1], [0, 2, 1]], np.float32)
    fill = {f"fill_{c}": np.array([0.0, 0.5, 2.0, 1.0], np.float32) for c in "rgb"}
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), attributes={**fill, "fill_w": np.ones(4, np.float32)})
    return mesh.with_smooth_normals()


def read_glb(path):
    data = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    document = json.loads(data[20 : 20 + size])
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0"
    assert binary_size == document["buffers"][0]["byteLength"]
    return document, data[28 + size : 28 + size + binary_size]


def test_every_accessor_of_the_file_lies_aligned_within_its_buffer(tmp_path):
    write_glb(tmp_path / "scene.glb", {"ground": square(), "environment": square()})
    document, binary = read_glb(tmp_path / "scene.glb")
    assert [mesh["name"] for mesh in document["meshes"]] == ["ground", "environment"]
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
        assert view["byteLength"] == accessor["count"] * COUNTS[accessor["type"]] * SIZES[accessor["componentType"]]


def test_positions_and_colours_come_back(tmp_path):
    write_glb(tmp_path / "scene.glb", {"ground": square()})
    document, binary = read_glb(tmp_path / "scene.glb")
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    view = document["bufferViews"][document["accessors"][attributes["POSITION"]]["bufferView"]]
    positions = np.frombuffer(binary, "<f4", 12, view["byteOffset"]).reshape(4, 3)
    assert np.array_equal(positions, square().vertices)
    view = document["bufferViews"][document["accessors"][attributes["COLOR_0"]]["bufferView"]]
    assert np.frombuffer(binary, np.uint8, 16, view["byteOffset"]).reshape(4, 4)[:, 0].tolist() == [0, 128, 255, 255]


def test_the_root_turns_z_up_to_y_up(tmp_path):
    from scipy.spatial.transform import Rotation

    write_glb(tmp_path / "scene.glb", {"ground": square()})
    document, _ = read_glb(tmp_path / "scene.glb")
    assert np.allclose(Rotation.from_quat(document["nodes"][0]["rotation"]).apply([0, 0, 1]), [0, 1, 0])


def test_a_scene_without_triangles_is_refused(tmp_path):
    empty = Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    with pytest.raises(InputError, match="hold a mesh with triangles"):
        write_glb(tmp_path / "scene.glb", {"ground": empty})
    assert not (tmp_path / "scene.glb").exists()
