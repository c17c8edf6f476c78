"""Where paths end up: sums over the samples of each pixel, and what a pixel's centre sees."""

import numpy as np
from numba import njit, prange

from .optics import central_ray, sample_ray
from .path import LIGHT, PARTICLE, radiance
from .rays import ray_buffer
from .sampler import draw2, hash2
from .tiles import TILE
from .visibility import first_hit

# Columns of the sums: radiance, its square; what of the radiance the first surface mirrored, what was seen without any
# surface, what particles scattered first; the first surface's albedo and normal; and how many paths a particle met first.
RADIANCE, SQUARE, SPECULAR, SEEN, SCATTERED, ALBEDO, NORMAL, STOPPED = 0, 3, 6, 9, 12, 15, 18, 21
NUM_SUMS = 22


@njit(cache=True, parallel=True)
def expose(
    world,
    tables,
    lights,
    medium,
    bodies,
    camera,
    optics,
    first_row,
    last_row,
    first,
    count,
    seed,
    max_bounces,
    roulette_from,
    specular_only,
    clamp,
    sums,
):
    """Add `count` samples, numbered from `first`, to the sums (H, W, NUM_SUMS) of some rows of pixels.

    Each pixel is summed by one thread in the order of its samples: neither the number of threads nor the way in which
    samples are shared out among calls can change a bit.
    """
    width = camera.width
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (last_row - first_row + TILE - 1) // TILE
    for tile in prange(tiles_x * tiles_y):
        buffer, s = ray_buffer()
        x0, y0 = (tile % tiles_x) * TILE, first_row + (tile // tiles_x) * TILE
        for row in range(y0, min(y0 + TILE, last_row)):
            for col in range(x0, min(x0 + TILE, width)):
                stream = hash2(np.uint32(row * width + col), np.uint32(seed))
                for i in range(first, first + count):
                    jx, jy = draw2(stream, i, 0)
                    o, d = sample_ray(camera, optics, stream, i, col + jx, row + jy)
                    how = (max_bounces, roulette_from, specular_only, clamp)
                    found = radiance(world, tables, lights, medium, bodies, buffer, s, stream, i, o, d, *how)
                    for c in range(3):
                        e = found.radiance[c]
                        sums[row, col, RADIANCE + c] += e
                        sums[row, col, SQUARE + c] += e * e
                        sums[row, col, SPECULAR + c] += found.specular[c]
                        if found.first == LIGHT:
                            sums[row, col, SEEN + c] += e - found.scattered[c]
                        sums[row, col, SCATTERED + c] += found.scattered[c]
                        sums[row, col, ALBEDO + c] += found.albedo[c]
                        sums[row, col, NORMAL + c] += found.normal[c]
                    if found.first == PARTICLE:
                        sums[row, col, STOPPED] += 1.0


@njit(cache=True, parallel=True)
def primary(world, camera, optics, face, b1, b2, distance):
    """Fill (H, W) arrays with what each pixel's centre sees: face (-1: nothing), barycentric coordinates, distance [m]."""
    for row in prange(camera.height):
        buffer, s = ray_buffer()
        for col in range(camera.width):
            o, d = central_ray(camera, optics, col + 0.5, row + 0.5)
            face[row, col], b1[row, col], b2[row, col], distance[row, col] = first_hit(world, buffer, s, o, d)


@njit(cache=True)
def central_rays(camera, optics, origins, directions):
    """Fill (H, W, 3) arrays with the rays of all pixels' centres."""
    for row in range(camera.height):
        for col in range(camera.width):
            o, d = central_ray(camera, optics, col + 0.5, row + 0.5)
            for c in range(3):
                origins[row, col, c], directions[row, col, c] = o[c], d[c]
