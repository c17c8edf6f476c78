from __future__ import annotations

import numpy as np
import plyfile
import pytest

from materials.foundation.errors import InputError
from scene.mesh import Mesh, join, read_ply, write_ply

rng = np.random.default_rng(2)
TETRAHEDRON = Mesh(
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.uint32),
)
ASCII = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 1
property list uchar int {name}
end_header
0 0 0
1 0 0
1 1 0
0 1 0
{face}
"""


def test_faces_look_outside():
    centres = TETRAHEDRON.vertices[TETRAHEDRON.faces].mean(axis=1) - TETRAHEDRON.vertices.mean(axis=0)
    assert np.all((TETRAHEDRON.face_normals() * centres).sum(axis=1) > 0)


def test_a_triangle_without_area_has_no_normal():
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
    assert np.array_equal(flat.face_normals(), np.zeros((1, 3)))


def test_smooth_normals_of_an_octahedron_point_from_its_centre():
    vertices = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float32)
    faces = [[i, (i + 1) % 4, 4] for i in range(4)] + [[(i + 1) % 4, i, 5] for i in range(4)]
    mesh = Mesh(vertices, np.array(faces, np.uint32)).with_smooth_normals()
    assert np.allclose(mesh.normals, vertices, atol=1e-7)  # exact by symmetry, up to float32


def test_a_vertex_without_faces_looks_up():
    mesh = Mesh(np.zeros((1, 3), np.float32), np.zeros((0, 3), np.uint32)).with_smooth_normals()
    assert mesh.normals is not None and mesh.normals.tolist() == [[0, 0, 1]]


@pytest.mark.parametrize("rich", [False, True])
def test_a_mesh_read_again_is_the_same_to_the_bit(tmp_path, rich):
    mesh = TETRAHEDRON
    if rich:
        attributes = {
            "red": np.arange(4, dtype=np.uint8),
            "fill_w": rng.random(4).astype(np.float32),
            "instance": np.arange(4, dtype=np.int32),
        }
        mesh = Mesh(
            mesh.vertices, mesh.faces, rng.random((4, 3)).astype(np.float32), rng.random((4, 2)).astype(np.float32), attributes
        )
    write_ply(tmp_path / "a.ply", mesh)
    again = read_ply(tmp_path / "a.ply")
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)
    assert (again.normals is None) == (mesh.normals is None) and (again.uv is None) == (mesh.uv is None)
    if rich:
        assert np.array_equal(again.normals, mesh.normals) and np.array_equal(again.uv, mesh.uv)
    assert set(again.attributes) == set(mesh.attributes)
    for name, values in mesh.attributes.items():
        assert again.attributes[name].dtype == values.dtype
        assert np.array_equal(again.attributes[name], values)


def test_points_without_faces_are_a_mesh_too(tmp_path):
    write_ply(tmp_path / "a.ply", Mesh(TETRAHEDRON.vertices, np.zeros((0, 3), np.uint32)))
    assert read_ply(tmp_path / "a.ply").num_faces == 0


@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
def test_both_names_of_the_indices_are_read(tmp_path, name):
    (tmp_path / "a.ply").write_text(ASCII.format(name=name, face="3 0 1 2"))
    assert read_ply(tmp_path / "a.ply").faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("face", "name", "words"),
    [
        ("4 0 1 2 3", "vertex_indices", r"a\.ply: it must have triangles only, got faces of \[4\] vertices\. Triangulate it"),
        ("3 0 1 9", "vertex_indices", "vertex_indices must refer to vertices 0 to 3, got 9"),
        ("3 0 -1 2", "vertex_indices", "vertex_indices must refer to vertices 0 to 3, got -1"),
        ("3 0 1 2", "corners", "must have vertex_indices in its faces"),
        ("3 0 1", "vertex_indices", "must be a whole PLY file"),
    ],
)
def test_faces_that_make_no_mesh_are_refused(tmp_path, face, name, words):
    (tmp_path / "a.ply").write_text(ASCII.format(name=name, face=face))
    with pytest.raises(InputError, match=words):
        read_ply(tmp_path / "a.ply")


def test_polygons_in_a_binary_file_are_refused_in_the_same_words(tmp_path):
    vertex = np.zeros(4, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")])
    face = np.array([([0, 1, 2, 3],)], dtype=[("vertex_indices", "i4", (4,))])
    elements = [plyfile.PlyElement.describe(vertex, "vertex"), plyfile.PlyElement.describe(face, "face")]
    plyfile.PlyData(elements).write(str(tmp_path / "a.ply"))
    with pytest.raises(InputError, match=r"must have triangles only, got faces of \[4\] vertices"):
        read_ply(tmp_path / "a.ply")


@pytest.mark.parametrize("share", [0.1, 0.6, 0.99])
def test_a_truncated_file_is_refused(tmp_path, share):
    write_ply(tmp_path / "a.ply", Mesh(rng.random((500, 3)).astype(np.float32), rng.integers(0, 500, (900, 3)).astype(np.uint32)))
    data = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "b.ply").write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"b\.ply: it must be a whole PLY file"):
        read_ply(tmp_path / "b.ply")


def test_what_is_no_ply_or_has_no_positions_is_refused(tmp_path):
    with pytest.raises(InputError, match="must exist"):
        read_ply(tmp_path / "none.ply")
    (tmp_path / "a.ply").write_bytes(b"\x89PNG\r\n")
    with pytest.raises(InputError, match="must be a whole PLY file"):
        read_ply(tmp_path / "a.ply")
    vertex = np.zeros(2, dtype=[("x", "f4"), ("y", "f4")])
    plyfile.PlyData([plyfile.PlyElement.describe(vertex, "vertex")]).write(str(tmp_path / "b.ply"))
    with pytest.raises(InputError, match="must have vertices with x, y, z"):
        read_ply(tmp_path / "b.ply")


def test_joined_meshes_keep_what_all_of_them_have():
    with_normals = TETRAHEDRON.with_smooth_normals()
    both = join([with_normals, Mesh(*vars(with_normals).values())])
    assert both.normals is not None and both.num_faces == 8
    assert np.array_equal(both.vertices[both.faces[4:]], TETRAHEDRON.vertices[TETRAHEDRON.faces])
    assert join([with_normals, TETRAHEDRON]).normals is None
    assert join([]).num_faces == 0
