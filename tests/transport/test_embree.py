"""Rays meet the triangles that are there, on every edge, and trees are given back."""

from __future__ import annotations

import gc

import numpy as np
from numba import njit

from tests.transport.worlds import ball, rectangle
from transport.embree import EmbreeScene, version
from transport.kernels.rays import intersect, occluded, ray_buffer


@njit
def shoot(static, dynamic, num_static, origins, directions, far):
    n = len(origins)
    face, distance, uv = np.empty(n, np.int64), np.empty(n), np.empty((n, 2))
    blocked = np.empty(n, np.bool_)
    buffer, s = ray_buffer()
    for i in range(n):
        o, d = origins[i], directions[i]
        face[i], distance[i], uv[i, 0], uv[i, 1] = intersect(
            static, dynamic, num_static, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], far
        )
        blocked[i] = occluded(static, dynamic, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], far)
    return face, distance, uv, blocked


def scene_of(mesh, geometry=0):
    return EmbreeScene(mesh.vertices, mesh.faces, geometry)


def directions(n, seed=0):
    w = np.random.default_rng(seed).normal(size=(n, 3))
    return w / np.linalg.norm(w, axis=1, keepdims=True)


def test_the_library_is_embree_4():
    assert 40000 <= version < 50000


def test_a_ray_meets_the_point_that_its_barycentric_coordinates_name():
    vertices = np.array([[0, 0, 2], [4, 0, 2], [0, 4, 6]], np.float32)
    scene = EmbreeScene(vertices, np.array([[0, 1, 2]], np.uint32))
    b = np.random.default_rng(1).dirichlet((1, 1, 1), 200)
    origins = np.tile([[1.0, 0.5, -3.0]], (200, 1))
    to = b @ vertices - origins
    distance = np.linalg.norm(to, axis=1)
    face, t, uv, blocked = shoot(scene.handle, 0, 1, origins, to / distance[:, None], 1e30)
    assert np.all(face == 0) and blocked.all()
    # Embree computes in float32: some units in the last place (6e-8) of lengths of 10.
    np.testing.assert_allclose(t, distance, rtol=1e-5)
    np.testing.assert_allclose(uv, b[:, 1:], atol=1e-5)


def test_a_ray_that_misses_or_ends_early_meets_nothing():
    scene = scene_of(rectangle((-1, -1, 5), (2, 0, 0), (0, 2, 0)))
    origins = np.zeros((3, 3))
    d = np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0]])
    face, _, _, blocked = shoot(scene.handle, 0, 2, origins, d, 1e30)
    assert list(face >= 0) == [True, False, False] and list(blocked) == [True, False, False]
    face, _, _, blocked = shoot(scene.handle, 0, 2, origins, d, 4.999)
    assert not (face >= 0).any() and not blocked.any()


def test_no_ray_leaves_a_closed_ball_through_its_edges():
    mesh = ball(3.0, subdivisions=3)
    scene = scene_of(mesh)
    d = directions(60_000)
    # Aimed at edges and corners too, where neighbours could each leave the ray to the other.
    corners = mesh.vertices[mesh.faces].astype(float)
    aims = np.concatenate([0.5 * (corners[:, 0] + corners[:, 1]), corners[:, 0], 0.3 * corners[:, 1] + 0.7 * corners[:, 2]])
    aims = np.tile(aims, (11, 1))
    d = np.concatenate([d, aims / np.linalg.norm(aims, axis=1, keepdims=True)])
    origins = 0.3 * directions(len(d), 2)
    origins[60_000:] = 0
    assert len(d) > 100_000
    face, distance, _, blocked = shoot(scene.handle, 0, mesh.num_faces, origins, d, 1e30)
    assert np.all(face >= 0) and np.all(blocked)
    points = origins + d * distance[:, None]
    # Chords of a facet of edge 0.5 lie at most 0.5^2 / (8 r) * 4/3 below the sphere.
    assert np.linalg.norm(points, axis=1).max() <= 3.0 + 1e-5
    assert np.linalg.norm(points, axis=1).min() > 2.98


def test_the_nearer_of_what_stands_and_what_moves_is_met_and_numbered_after_the_static_faces():
    near, far = rectangle((-1, -1, 2), (2, 0, 0), (0, 2, 0)), rectangle((-1, -1, 5), (2, 0, 0), (0, 2, 0))
    o, d = np.zeros((1, 3)), np.array([[0.1, 0.2, 1.0]])
    # The scenes are named, not temporary: a handle does not keep its tree alive.
    static = scene_of(far)
    face, t, _, _ = shoot(static.handle, 0, 2, o, d, 1e30)
    assert face[0] in (0, 1) and np.isclose(t[0], 5)
    static, moving = scene_of(far), scene_of(near, 1)
    face, t, _, blocked = shoot(static.handle, moving.handle, 2, o, d, 1e30)
    assert face[0] in (2, 3) and np.isclose(t[0], 2) and blocked[0]
    static, moving = scene_of(near), scene_of(far, 1)
    face, t, _, _ = shoot(static.handle, moving.handle, 2, o, d, 1e30)
    assert face[0] in (0, 1) and np.isclose(t[0], 2)


def resident_bytes():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


def test_a_tree_that_is_no_longer_needed_gives_its_memory_back():
    mesh = ball(subdivisions=5)  # 20 480 faces: a tree of some MB
    for _ in range(5):
        scene_of(mesh)
    gc.collect()
    before = resident_bytes()
    for _ in range(40):
        scene_of(mesh)
    gc.collect()
    # 40 kept trees would hold at least their triangles, 48 bytes each, 39 MB; the allocator may keep a few trees' worth.
    assert resident_bytes() - before < 20e6
