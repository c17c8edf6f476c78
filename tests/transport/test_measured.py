from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.btf import compress
from materials.foundation.errors import InputError
from materials.svbrdf import SVBRDF
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import DirectionalLight
from transport.dome import DomeSettings, Relief, acquire
from transport.measured import render_measured

LIGHT = DirectionalLight((0.5, -0.3, -1.0), (2.0, 1.0, 0.5))


def plate() -> Mesh:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    up = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), up, uv)


def camera(size: int = 8) -> Camera:
    # from above, its x the world's x, its y the world's -y
    pose = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 3], [0, 0, 0, 1.0]])
    return Camera("ORTHOGRAPHIC", size, size, cx=size / 2, cy=size / 2, pixel_size=2 / size, T_world_camera=pose)


def paint() -> SVBRDF:
    """Four texels, each another albedo, a lobe that is the same."""
    n, one = 4, np.ones((4, 1))
    diffuse = np.array([[0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8], [0.5, 0.5, 0.5]])
    frame = np.tile(np.eye(3), (n, 1, 1))
    return SVBRDF(
        "ggx",
        1.5,
        np.ones((2, 2), bool),
        diffuse,
        np.full((n, 1, 3), 0.5),
        np.full((n, 1, 2), 0.3),
        frame,
        0 * one[:, 0],
        0 * one[:, 0],
    )


def test_a_plate_shows_its_texels_the_right_way_up():
    image = render_measured(plate(), paint(), camera(2), [LIGHT])
    towards = np.array([-0.5, 0.3, 1.0]) / np.linalg.norm([-0.5, 0.3, 1.0])
    want = paint().reflect(towards, (0, 0, 1.0)) * np.array([2.0, 1.0, 0.5])
    # two pixels each way look at the four texels' centres
    assert np.allclose(image.reshape(4, 3), want, rtol=1e-5)


def test_a_btf_looks_as_the_material_that_the_dome_measured():
    shape = (4, 4)
    flat = Relief(np.zeros(shape), 1e-3, np.full((*shape, 3), 0.4), np.full(shape, 0.3), np.full((*shape, 2), 0.6))
    btf = compress(acquire(flat, DomeSettings(lights=300, views=12, samples=1)), 2)
    i = render_measured(plate(), btf, camera(4), [LIGHT])[2, 2]
    towards = np.array([-0.5, 0.3, 1.0]) / np.linalg.norm([-0.5, 0.3, 1.0])
    exact = btf.reflect([5], towards, (0, 0, 1.0))[0] * np.array([2.0, 1.0, 0.5])
    assert np.allclose(i, exact, rtol=1e-4)
    # 300 lights stand 6 degrees apart, and linear interpolation misses some of a lobe's bend; views as near are not there
    n = paint()
    truth = replace(n, diffuse=np.full((4, 3), 0.4), specular=np.full((4, 1, 3), 0.3), alpha=np.full((4, 1, 2), 0.6))
    assert np.allclose(i, truth.reflect(towards, (0, 0, 1.0))[0] * np.array([2.0, 1.0, 0.5]), rtol=0.05)


def test_a_lid_casts_its_shadow_and_the_back_is_dark():
    p = plate()
    lid = p.vertices * np.float32(0.5) + np.array([-0.5, 0, 1], np.float32)
    both = Mesh(
        np.concatenate([p.vertices, lid]), np.concatenate([p.faces, p.faces + 4]), np.tile(p.normals, (2, 1)), np.tile(p.uv, (2, 1))
    )
    sun = DirectionalLight((1.0, 0.0, -1.0), (1, 1, 1))  # the lid's shadow lies 1 to its right
    image = render_measured(both, paint(), camera(8), [sun])
    assert (image[3:5, 5:7] == 0).all() and (image[3:5, :3] > 0).all() and (image[0] > 0).all()
    below = DirectionalLight((0.0, 0.0, 1.0), (1, 1, 1))
    assert (render_measured(plate(), paint(), camera(4), [below]) == 0).all()


def test_meshes_without_coordinates_and_holes_are_refused():
    with pytest.raises(InputError, match="mesh must have normals and u, v"):
        render_measured(replace(plate(), uv=None), paint(), camera(), [LIGHT])
    with pytest.raises(InputError, match="material must be known everywhere"):
        render_measured(plate(), replace(paint(), mask=np.array([[True, False], [True, True]])), camera(), [LIGHT])
