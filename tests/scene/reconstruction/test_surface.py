from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.mesh import Mesh
from scene.reconstruction.build_settings import HeightFieldSettings, SurfaceSettings
from scene.reconstruction.surface import (
    distance_to_mesh,
    is_edge_manifold,
    normals,
    point_spacing,
    poisson_depth,
    reconstruct_environment,
    reconstruct_ground,
)


def wall(count: int = 6000, seed: int = 0) -> np.ndarray:
    """A wall 6 m long and 3 m high at x = 5, with 5 mm of noise, and a gap of 2 m in its middle."""
    rng = np.random.default_rng(seed)
    y = rng.uniform(-3, 3, count)
    y += np.where(y > 0, 1, -1)
    return np.column_stack([5 + rng.normal(0, 0.005, count), y, rng.uniform(0, 3, count)])


def test_normals_of_a_wall_point_to_the_scanner():
    points = wall()
    n = normals(points, towards=np.zeros_like(points))
    # At the rim and in noise of a tenth of the spacing, normals tilt by degrees, never past the wall's plane.
    assert (n[:, 0] < 0).all()
    assert np.median(-n[:, 0]) > 0.99


def test_normals_of_ground_point_up():
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(0, 5, (2000, 2)), rng.normal(0, 0.003, 2000)])
    assert (normals(points, up=True)[:, 2] > 0).all()


def test_a_wall_becomes_a_manifold_that_faces_the_scanner_and_keeps_its_gap():
    points = wall()
    mesh = reconstruct_environment(points, np.zeros_like(points), SurfaceSettings(environment_depth=7))
    assert is_edge_manifold(mesh)
    assert mesh.face_normals()[:, 0].mean() < -0.9
    distance = distance_to_mesh(points, mesh)
    assert np.median(distance) < 0.01  # twice the noise
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    # Trimming allows a few point spacings (about 5 cm) beyond the last point, and 0.15 m at least.
    assert not (np.abs(centre[:, 1]) < 0.6).any()


def test_reconstruction_gives_the_same_mesh_twice():
    points = wall(3000)
    settings = SurfaceSettings(environment_depth=6)
    first, second = (reconstruct_environment(points, np.zeros_like(points), settings) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.faces, second.faces)


def test_ground_by_poisson_lies_on_its_points_and_faces_up():
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(0, 6, (6000, 2)), rng.normal(0, 0.004, 6000)])
    settings = SurfaceSettings(ground_method="poisson", ground_depth=6)
    mesh, field = reconstruct_ground(points, np.zeros((0, 3)), settings, HeightFieldSettings())
    assert field is None
    assert mesh.face_normals()[:, 2].mean() > 0.98
    assert np.median(distance_to_mesh(points, mesh)) < 0.008


def test_a_handful_of_points_gives_no_environment():
    mesh = reconstruct_environment(np.zeros((5, 3)), np.ones((5, 3)))
    assert mesh.num_faces == 0
    assert np.isinf(distance_to_mesh(np.zeros((2, 3)), mesh)).all()


def test_octree_cells_match_the_spacing_of_points():
    grid = np.stack(np.meshgrid(np.arange(64.0), np.arange(64.0), [0.0]), axis=-1).reshape(-1, 3) * 0.1
    assert point_spacing(grid) == pytest.approx(0.1)
    depth = poisson_depth(grid, 12)
    cell = np.ptp(grid, axis=0).max() * 1.1 / 2**depth
    assert 0.1 <= cell < 0.2


def test_two_triangles_that_run_along_an_edge_alike_are_no_manifold():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    assert is_edge_manifold(Mesh(corners, np.array([[0, 1, 2], [1, 0, 3]], np.uint32)))
    assert not is_edge_manifold(Mesh(corners, np.array([[0, 1, 2], [0, 1, 3]], np.uint32)))


def test_normals_of_two_points_are_refused():
    with pytest.raises(InputError, match="at least 3 points"):
        normals(np.zeros((2, 3)))
