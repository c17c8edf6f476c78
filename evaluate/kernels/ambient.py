"""Light that reaches pieces of surface from all around: the share of open sky, and what other surfaces send on."""

import math

import numpy as np
from numba import njit, prange

from materials.kernels.frames import basis, dot
from transport.kernels.arrays import ALBEDO_TEXTURE
from transport.kernels.rays import intersect, occluded, ray_buffer
from transport.kernels.sampler import draw2, hash2
from transport.kernels.shading import hit_at, leave
from transport.kernels.textures import lookup

from .fragments import LAMP_POWER, _lit, cosine_direction, towards


@njit(cache=True, parallel=True)
def open_sky(world, position, normal, face_normal, samples, seed, out):
    """Return into `out` the share of the cosine-weighted hemisphere that nothing blocks."""
    for q in prange(position.shape[0]):
        buffer, s = ray_buffer()
        p = (float(position[q, 0]), float(position[q, 1]), float(position[q, 2]))
        n = (float(normal[q, 0]), float(normal[q, 1]), float(normal[q, 2]))
        ng = (float(face_normal[q, 0]), float(face_normal[q, 1]), float(face_normal[q, 2]))
        t = basis(n)[0]
        stream = hash2(np.uint32(q), np.uint32(seed))
        free = 0
        for i in range(samples):
            u0, u1 = draw2(stream, i, 0)
            w = cosine_direction(n, t, u0, u1)
            if dot(w, ng) <= 0.0:
                continue
            o = leave(p, ng, w)
            free += not occluded(world.static_scene, world.dynamic_scene, buffer, s, o[0], o[1], o[2], w[0], w[1], w[2], np.inf)
        out[q] = free / samples


@njit(cache=True, parallel=True)
def bounced(world, scales, position, normal, face_normal, slot_rows, lamps, sky, bounces, samples, seed, out):
    """Return into `out` (N, B, 3) irradiance over pi that has met 1, ..., B other surfaces, all of them Lambertian.

    `slot_rows` (N, S) are the lamps that light each piece, `scales` (shapes, 3) the factors on textures.
    """
    for q in prange(position.shape[0]):
        buffer, s = ray_buffer()
        stream = hash2(np.uint32(q), np.uint32(seed))
        for i in range(samples):
            p = (float(position[q, 0]), float(position[q, 1]), float(position[q, 2]))
            n = (float(normal[q, 0]), float(normal[q, 1]), float(normal[q, 2]))
            ng = (float(face_normal[q, 0]), float(face_normal[q, 1]), float(face_normal[q, 2]))
            br, bg, bb = 1.0 / samples, 1.0 / samples, 1.0 / samples
            for depth in range(bounces):
                u0, u1 = draw2(stream, i, depth)
                w = cosine_direction(n, basis(n)[0], u0, u1)
                if dot(w, ng) <= 0.0:
                    break
                o = leave(p, ng, w)
                face, _, b1, b2 = intersect(
                    world.static_scene, world.dynamic_scene, world.num_static_faces,
                    buffer, s, o[0], o[1], o[2], w[0], w[1], w[2], np.inf,
                )  # fmt: skip
                if face < 0:
                    if depth > 0:
                        out[q, depth - 1, 0] += br * sky[0]
                        out[q, depth - 1, 1] += bg * sky[1]
                        out[q, depth - 1, 2] += bb * sky[2]
                    break
                hit = hit_at(world, face, b1, b2)
                p, n, ng = hit.p, hit.ns, hit.ng
                if dot(ng, w) > 0.0:
                    n, ng = (-n[0], -n[1], -n[2]), (-ng[0], -ng[1], -ng[2])
                texture = world.material_textures[hit.material, ALBEDO_TEXTURE]
                shape = world.face_shape[face]
                if texture >= 0:
                    br *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 0)
                    bg *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 1)
                    bb *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 2)
                br, bg, bb = br * scales[shape, 0], bg * scales[shape, 1], bb * scales[shape, 2]
                for m in range(slot_rows.shape[1]):
                    lamp = slot_rows[q, m]
                    if lamp < 0:
                        continue
                    wl, r = towards(lamps, lamp, p)
                    cos = dot(wl, n)
                    if cos <= 0.0 or not _lit(world, buffer, s, lamps, lamp, p, ng):
                        continue
                    e = cos / math.pi
                    if not math.isinf(r):
                        e /= r * r
                    out[q, depth, 0] += br * e * lamps[lamp, LAMP_POWER]
                    out[q, depth, 1] += bg * e * lamps[lamp, LAMP_POWER + 1]
                    out[q, depth, 2] += bb * e * lamps[lamp, LAMP_POWER + 2]
