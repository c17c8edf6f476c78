from __future__ import annotations

import numpy as np
import pytest

from materials.foundation.errors import InputError
from scene.reconstruction.build_settings import HeightFieldSettings
from scene.reconstruction.ground_mesh import edge_components, triangulate
from scene.reconstruction.height_field import block_levels, fit_height_field
from scene.reconstruction.surface import is_edge_manifold

from ..synthetic_street import HALF_ROAD, ring_points, street_height

SETTINGS = HeightFieldSettings(surface_near=8.0)


@pytest.fixture(scope="module")
def fitted():
    rng = np.random.default_rng(1)
    path_x = np.arange(0.0, 31.0, 6.0)
    points = np.concatenate([ring_points(rng, x) for x in path_x])
    path = np.column_stack([path_x, np.zeros_like(path_x), street_height(path_x, 0 * path_x) + 1.7])
    return fit_height_field(points, path, SETTINGS), points


def test_ground_between_the_rings_is_known_to_half_the_noise(fitted):
    field, _ = fitted
    rng = np.random.default_rng(2)
    places = np.column_stack([rng.uniform(4, 26, 4000), rng.uniform(-3.6, 3.6, 4000)])
    error = field.at(places) - street_height(places[:, 0], places[:, 1])
    # Points have 10 mm of noise; the fit averages several within its bending length of some 0.3 m.
    assert np.sqrt(np.mean(error**2)) < 0.005


def test_a_kerb_stays_a_step(fitted):
    field, _ = fitted
    x = np.linspace(4, 26, 50)
    for side in (-1, 1):
        road = field.at(np.column_stack([x, np.full(50, side * (HALF_ROAD - 0.15))]))
        pavement = field.at(np.column_stack([x, np.full(50, side * (HALF_ROAD + 0.15))]))
        # The true rise over these 30 cm is 14 cm less 0.15 m of camber and pavement slope: 13.9 cm. A kerb may lean over
        # four to five cells of 10 cm, smoothness elsewhere being worth more: two thirds of the rise within three.
        assert np.median(pavement - road) > 0.139 * 2 / 3


def test_mesh_is_manifold_and_faces_up_across_changes_of_resolution(fitted):
    field, _ = fitted
    assert len(np.unique(field.level)) > 2
    mesh = triangulate(field)
    assert is_edge_manifold(mesh)
    assert (mesh.face_normals()[:, 2] > 0).all()
    assert mesh.normals is not None
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    # No crack between resolutions: nearly all ground hangs together by edges.
    assert np.bincount(edge_components(mesh)).max() > 0.95 * mesh.num_faces


def test_ground_below_a_parked_vehicle_is_closed():
    rng = np.random.default_rng(3)
    xy = rng.uniform((-10, -6), (10, 6), (30000, 2))
    hidden = (np.abs(xy[:, 0]) < 2.2) & (np.abs(xy[:, 1] - 2) < 0.9)
    points = np.column_stack([xy, np.zeros(len(xy))])[~hidden]
    field = fit_height_field(points, np.array([[-8.0, -2, 1.7], [8, -2, 1.7]]), SETTINGS)
    mesh = triangulate(field)
    corners = mesh.vertices[mesh.faces] * (1, 1, 0)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(20 * 12, rel=0.03)  # the outer rim is rounded to cells


def test_ground_ends_where_the_points_end():
    rng = np.random.default_rng(4)
    left, right = rng.uniform((0, 0), (8, 8), (8000, 2)), rng.uniform((16, 0), (24, 8), (8000, 2))
    points = np.column_stack([np.concatenate([left, right]), np.zeros(16000)])
    mesh = triangulate(fit_height_field(points, np.array([[2.0, 4, 1.7], [22, 4, 1.7]]), SETTINGS))
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    assert not ((centre[:, 0] > 8.5) & (centre[:, 0] < 15.5)).any()


def test_the_fit_is_the_same_every_time(fitted):
    _, points = fitted
    some = points[np.abs(points[:, 0] - 15) < 8]
    first, second = (fit_height_field(some, np.array([[15.0, 0, 1.7]]), SETTINGS) for _ in range(2))
    assert np.array_equal(first.height, second.height)


def test_neighbouring_blocks_differ_by_one_level_at_most():
    distance = np.zeros((20, 20))
    distance[:, 10:] = 1000.0
    level = block_levels(distance, 10.0)
    assert np.abs(np.diff(level, axis=1)).max() == 1
    assert level.max() == 3


def test_too_few_points_are_refused():
    with pytest.raises(InputError, match="at least 10 points"):
        fit_height_field(np.zeros((3, 3)), np.zeros((0, 3)))
