"""The dome around bodies against closed forms and the path tracer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from materials.btf_tiles import compress_tiles
from materials.foundation.errors import InputError
from scene.camera import Camera
from scene.mesh import Mesh
from scene.simulation import DirectionalLight, Material, Shape, Simulation
from scene.transforms import look_at
from transport.measured import render_measured
from transport.mesh_dome import MeshDome, MeshDomeSettings, texels_of
from transport.render import render
from transport.world import compile_world

FEW = MeshDomeSettings(lights=19, views=19, samples=1, bounces=2, rank=19, some=96)


def ball(columns: int = 32, rows: int = 16) -> Mesh:
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    theta, phi = np.pi * (0.02 + 0.96 * v.ravel()), 2 * np.pi * u.ravel()
    n = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1).astype(np.float32)
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    faces = np.concatenate([np.stack([a, a + columns + 2, a + 1], 1), np.stack([a, a + columns + 1, a + columns + 2], 1)])
    return Mesh(n, faces.astype(np.uint32), n, np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32))


def plate(turned: float) -> Mesh:
    """A square whose u runs at an angle [rad] to x."""
    c, s = np.cos(turned), np.sin(turned)
    flat = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    places = np.column_stack([flat @ [[c, s], [-s, c]], np.zeros(4)]).astype(np.float32)
    up = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
    return Mesh(places, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), up, ((flat + 1) / 2).astype(np.float32))


def body(mesh: Mesh, material: Material) -> Simulation:
    return Simulation((Shape("body", mesh, "own"),), {"own": material})


def test_a_matte_ball_reflects_alike_wherever_it_is_lit_and_seen_from():
    dome = MeshDome(body(ball(), Material("lambert", (0.6, 0.4, 0.2))), 0.05, FEW)
    # Texels of half a degree: normals turn by as much within them.
    which = np.random.default_rng(1).permutation(512 * 256)[:96]
    found = dome.measure(texels_of(ball(), 512, 256), which).value.reshape(96, 19, 19, 3)
    expected = np.array([0.6, 0.4, 0.2]) / np.pi * dome.wi[:, None, None, 2]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=0.02 * 0.6 / np.pi)


def test_frames_are_those_that_pictures_of_the_field_are_rendered_in():
    # Brushed across u, which runs at an angle to the axes: frames that are turned or swapped would show.
    brushed = Material("ggx", (0.05, 0.05, 0.05), alpha_u=0.6, alpha_v=0.15, specular_scale=1.0, eta=2.0)
    mesh = plate(0.5)
    settings = replace(FEW, lights=151, views=151, rank=8, some=64, bounces=1)
    field = MeshDome(body(mesh, brushed), 0.05, settings).btf(mesh, 8, 8)
    assert field.relative_error < 0.02
    camera = Camera("PINHOLE", 24, 24, look_at(np.array([1.2, -2.0, 2.2]), np.zeros(3)), 60.0, 60.0, 12.0, 12.0)
    lights = [DirectionalLight(d, (1.0, 1.0, 1.0)) for d in ((0.55, -0.5, -1.0), (-0.6, 0.9, -1.0))]
    ours = render_measured(mesh, field, camera, lights)
    lamps = {f"sun{i}": light for i, light in enumerate(lights)}

    def traced(material):
        return render(compile_world(replace(body(mesh, material), lights=lamps)), camera, 16, 1, 1).radiance

    seen = ours.max(axis=-1) > 0
    right = traced(brushed)
    swapped = traced(replace(brushed, alpha_u=0.15, alpha_v=0.6))
    error = np.abs(ours - right)[seen].mean() / right[seen].mean()
    # Linear between directions nine degrees apart.
    assert error < 0.15
    assert np.abs(swapped - right)[seen].mean() / right[seen].mean() > 2 * error


def test_texels_off_the_charts_have_the_place_of_the_nearest_on_them():
    mesh = plate(0.0)
    half = replace(mesh, uv=mesh.uv * np.array([0.5, 1.0], np.float32))
    texels = texels_of(half, 8, 4)
    assert texels.places.shape == (32, 3)
    x = texels.places.reshape(4, 8, 3)[..., 0]
    np.testing.assert_allclose(x[:, :4], np.tile([-0.75, -0.25, 0.25, 0.75], (4, 1)), atol=1e-6)
    np.testing.assert_allclose(x[:, 4:], 0.75, atol=1e-6)
    np.testing.assert_allclose(texels.edges[0], [[0.5, 0, 0], [0, 0.5, 0]], atol=1e-6)


def test_tiles_are_compressed_as_the_whole():
    dome = MeshDome(body(plate(0.0), Material("lambert", (0.6, 0.4, 0.2))), 0.05, FEW)
    texels = texels_of(plate(0.0), 6, 4)
    whole = dome.measure(texels, np.arange(24))
    mask = np.ones((4, 6), bool)
    tiles = (dome.measure(texels, np.arange(k, k + 8)) for k in (0, 8, 16))
    btf = compress_tiles(whole, tiles, mask, 4)
    error = np.abs(btf.decompress().value - whole.with_cosine().flat().value).max()
    assert error < 1e-5 * whole.value.max()
    with pytest.raises(InputError, match="have 24 texels"):
        compress_tiles(whole, iter([dome.measure(texels, np.arange(8))]), mask, 4)


@pytest.mark.parametrize(
    ("mesh", "material", "words"),
    [
        (ball(), Material("dielectric", eta=1.5), "index-matched around a medium"),
        (ball(), Material("emission", emission=(1.0, 1.0, 1.0)), "be opaque"),
        (replace(ball(), uv=None), Material("lambert"), "have normals and u, v"),
    ],
)
def test_what_the_dome_cannot_measure_is_refused(mesh, material, words):
    with pytest.raises(InputError, match=words):
        MeshDome(body(mesh, material), 0.05, FEW).btf(mesh, 4, 4)
