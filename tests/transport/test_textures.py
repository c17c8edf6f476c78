"""A texture answers exactly at its texels' centres, bilinearly between them, and repeats."""

from __future__ import annotations

import numpy as np
from numba import njit

from scene.simulation import Material, Shape, Simulation
from tests.transport.worlds import floor
from transport.kernels.textures import lookup
from transport.world import compile_world


@njit
def look(texels, info, texture, u, v, channel):
    return lookup(texels, info, texture, u, v, channel)


def compiled(*textures):
    materials = {f"m{i}": Material(albedo_texture=t) for i, t in enumerate(textures)}
    world = compile_world(Simulation((Shape("floor", floor(), "m0"),), materials))
    return world.arrays.texels, world.arrays.texture_info


RNG = np.random.default_rng(0)
COLOUR = RNG.random((3, 5, 3)).astype(np.float32)
GREY = RNG.random((4, 2)).astype(np.float32)


def test_texel_centres_give_the_texels_of_each_texture():
    texels, info = compiled(COLOUR, GREY)
    for texture, image in enumerate((COLOUR, GREY)):
        height, width = image.shape[:2]
        for row in range(height):
            for col in range(width):
                for c in range(3):
                    got = look(texels, info, texture, (col + 0.5) / width, (row + 0.5) / height, c)
                    want = image[row, col] if image.ndim == 2 else image[row, col, c]
                    assert abs(got - want) < 1e-6


def test_between_texels_it_is_bilinear_and_across_the_border_it_repeats():
    texels, info = compiled(COLOUR)
    half = look(texels, info, 0, 1.0 / 5, 0.5 / 3, 1)
    assert abs(half - 0.5 * (COLOUR[0, 0, 1] + COLOUR[0, 1, 1])) < 1e-6
    corner = look(texels, info, 0, 0.0, 0.0, 2)
    assert abs(corner - COLOUR[[0, 0, -1, -1], [0, -1, 0, -1], 2].mean()) < 1e-6
    u, v = 0.37, 0.81
    for du, dv in ((1, 0), (0, -1), (-3, 2)):
        assert abs(look(texels, info, 0, u + du, v + dv, 0) - look(texels, info, 0, u, v, 0)) < 1e-5


def test_the_same_array_is_stored_once():
    texels, info = compiled(COLOUR, COLOUR, GREY)
    assert len(info) == 2 and len(texels) == COLOUR.size + GREY.size
