"""What each pixel sees, gathered to be shaded again and again: pieces of surface with their share of the pixel."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

from materials.kernels.frames import dot, normalize
from materials.kernels.kinds import EMISSION
from transport.kernels.arrays import ALBEDO_TEXTURE
from transport.kernels.optics import camera_ray, undistort
from transport.kernels.rays import intersect, occluded, ray_buffer
from transport.kernels.shading import cross, hit_at, leave, tangent
from transport.kernels.textures import lookup

MAX_PIECES = 6  # shapes in one pixel; what is beyond counts as the last
# Columns of the sums that `gather` returns.
POSITION, NORMAL, FACE_NORMAL, TANGENT, ALBEDO, UV, DISTANCE = 0, 3, 6, 9, 12, 15, 17
# No sums, but those of the first point: the mean of points of a curved body lies below its surface.
ANCHOR, ANCHOR_NORMAL = 18, 21
NUM_SUMS = 24
# Columns of a table of lamps: a direction towards the lamp, or its position.
LAMP_KIND, LAMP_PLACE, LAMP_POWER = 0, 1, 4
DIRECTIONAL, POINT = 0.0, 1.0
NUM_LAMP = 7


class Bend(NamedTuple):
    """Distortion of a lens (Brown-Conrady) and the intrinsics that it is defined by."""

    k1: float
    k2: float
    p1: float
    p2: float
    fx: float
    fy: float
    cx: float
    cy: float


@njit(cache=True)
def _ray(camera, bend, x, y):
    if bend.k1 != 0.0 or bend.k2 != 0.0 or bend.p1 != 0.0 or bend.p2 != 0.0:
        u, v = undistort(bend, (x - bend.cx) / bend.fx, (y - bend.cy) / bend.fy)
        x, y = u * bend.fx + bend.cx, v * bend.fy + bend.cy
    return camera_ray(camera, x, y)


@njit(cache=True)
def towards(lamps, i, p):
    """Return unit direction and distance to a lamp; a directional one is infinitely far."""
    x, y, z = lamps[i, LAMP_PLACE], lamps[i, LAMP_PLACE + 1], lamps[i, LAMP_PLACE + 2]
    if lamps[i, LAMP_KIND] == DIRECTIONAL:
        return (x, y, z), math.inf
    d = (x - p[0], y - p[1], z - p[2])
    r = math.sqrt(dot(d, d))
    return (d[0] / r, d[1] / r, d[2] / r), r


@njit(cache=True)
def _lit(world, buffer, s, lamps, i, p, ng):
    w, r = towards(lamps, i, p)
    o = leave(p, ng, w)
    far = np.inf if math.isinf(r) else r * 0.9999
    return not occluded(world.static_scene, world.dynamic_scene, buffer, s, o[0], o[1], o[2], w[0], w[1], w[2], far)


@njit(cache=True, parallel=True)
def gather(world, camera, bend, pixels, n, lamps, lit_by, shape, count, sums, visible):
    """Look through n x n points of each pixel.

    `lit_by` are the rows of `lamps` that are on. Filled, per pixel and piece: `shape` (-1 is beyond the world), `count` of
    points, `sums` over them, and `visible`, the number of points that each lamp reaches.
    """
    for q in prange(pixels.shape[0]):
        buffer, s = ray_buffer()
        row, col = pixels[q] // camera.width, pixels[q] % camera.width
        used = 0
        for j in range(n):
            for i in range(n):
                x, y = col + (i + 0.5) / n, row + (j + 0.5) / n
                o, d = _ray(camera, bend, x, y)
                face, t, b1, b2 = intersect(
                    world.static_scene, world.dynamic_scene, world.num_static_faces,
                    buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], np.inf,
                )  # fmt: skip
                k = -1 if face < 0 else np.int64(world.face_shape[face])
                g = 0
                while g < used and shape[q, g] != k:
                    g += 1
                if g == used:
                    if used < MAX_PIECES:
                        shape[q, g] = k
                        used += 1
                    else:
                        g = MAX_PIECES - 1
                count[q, g] += 1
                if face < 0:
                    continue
                hit = hit_at(world, face, b1, b2)
                a, b, c = world.faces[face, 0], world.faces[face, 1], world.faces[face, 2]
                v = world.vertices
                e1 = (float(v[b, 0] - v[a, 0]), float(v[b, 1] - v[a, 1]), float(v[b, 2] - v[a, 2]))
                e2 = (float(v[c, 0] - v[a, 0]), float(v[c, 1] - v[a, 1]), float(v[c, 2] - v[a, 2]))
                ns, ng = hit.ns, hit.ng
                if dot(ng, d) > 0.0:
                    ns, ng = (-ns[0], -ns[1], -ns[2]), (-ng[0], -ng[1], -ng[2])
                tg = tangent(world, a, b, c, e1, e2, ns)
                for m in range(3):
                    sums[q, g, POSITION + m] += hit.p[m]
                    sums[q, g, NORMAL + m] += ns[m]
                    sums[q, g, FACE_NORMAL + m] += ng[m]
                    sums[q, g, TANGENT + m] += tg[m]
                texture = world.material_textures[hit.material, ALBEDO_TEXTURE]
                for m in range(3):
                    value = 1.0
                    if texture >= 0:
                        value = lookup(world.texels, world.texture_info, texture, hit.u, hit.v, m)
                    sums[q, g, ALBEDO + m] += value
                if count[q, g] == 1:
                    sums[q, g, UV], sums[q, g, UV + 1] = hit.u, hit.v
                    for m in range(3):
                        sums[q, g, ANCHOR + m], sums[q, g, ANCHOR_NORMAL + m] = hit.p[m], ng[m]
                sums[q, g, DISTANCE] += t
                if world.material_kind[hit.material] != EMISSION:
                    for m in range(lit_by.shape[0]):
                        if lit_by[m] >= 0 and _lit(world, buffer, s, lamps, lit_by[m], hit.p, ng):
                            visible[q, g, m] += 1


@njit(cache=True, parallel=True)
def visibility(world, rows, position, face_normal, across, down, lamp_of, lamps, n, out):
    """Return into `out` the share of n x n points of each piece that its lamp reaches.

    `rows` are the pieces, `lamp_of` a row of `lamps` for each (negative: none); `across` and `down` span the piece.
    """
    for q in prange(rows.shape[0]):
        if lamp_of[q] < 0:
            continue
        buffer, s = ray_buffer()
        f = rows[q]
        ng = (float(face_normal[f, 0]), float(face_normal[f, 1]), float(face_normal[f, 2]))
        total = 0
        for j in range(n):
            for i in range(n):
                a, b = (i + 0.5) / n - 0.5, (j + 0.5) / n - 0.5
                p = (
                    position[f, 0] + a * across[f, 0] + b * down[f, 0],
                    position[f, 1] + a * across[f, 1] + b * down[f, 1],
                    position[f, 2] + a * across[f, 2] + b * down[f, 2],
                )
                total += _lit(world, buffer, s, lamps, lamp_of[q], p, ng)
        out[q] = total / (n * n)


@njit(cache=True, parallel=True)
def extents(camera, bend, pixel, position, face_normal, across, down):
    """Span each piece: how its point on the plane of the surface moves from one pixel to the next, right and down."""
    for q in prange(pixel.shape[0]):
        row, col = pixel[q] // camera.width, pixel[q] % camera.width
        ng = (face_normal[q, 0], face_normal[q, 1], face_normal[q, 2])
        p = (position[q, 0], position[q, 1], position[q, 2])
        for axis in range(2):
            ends = np.empty((2, 3))
            good = True
            for side in range(2):
                x, y = col + 0.5, row + 0.5
                if axis == 0:
                    x += side - 0.5
                else:
                    y += side - 0.5
                o, d = _ray(camera, bend, x, y)
                # Seen nearly edge on, a piece is as long as it is seen at 5 degrees.
                slope = min(dot(d, ng), -0.087)
                t = ((p[0] - o[0]) * ng[0] + (p[1] - o[1]) * ng[1] + (p[2] - o[2]) * ng[2]) / slope
                good = good and t > 0.0
                for m in range(3):
                    ends[side, m] = o[m] + t * d[m]
            for m in range(3):
                step = ends[1, m] - ends[0, m] if good else 0.0
                if axis == 0:
                    across[q, m] = step
                else:
                    down[q, m] = step


@njit(cache=True)
def cosine_direction(n, t, u0, u1):
    """Return a direction about n, dense as its cosine."""
    b = cross(n, t)
    r, phi = math.sqrt(u0), 2.0 * math.pi * u1
    x, y, z = r * math.cos(phi), r * math.sin(phi), math.sqrt(max(1.0 - u0, 0.0))
    return normalize((x * t[0] + y * b[0] + z * n[0], x * t[1] + y * b[1] + z * n[1], x * t[2] + y * b[2] + z * n[2]))
