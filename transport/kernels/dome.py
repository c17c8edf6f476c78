"""The light that a height field sends from each of many lights to each of many viewers.

All lights shine at once on each path: a vertex is joined with every light by a shadow ray, so that a path serves them all.
"""

import math

from numba import njit, prange

from materials.kernels import bsdf
from materials.kernels.frames import dot, normalize, to_local, to_world
from materials.kernels.kinds import Surface

from .rays import hit_normal, intersect, occluded, ray_buffer
from .sampler import draw1, draw2, hash2
from .shading import cross, leave, valid_normal

_ALBEDO, _SCALE, _ALPHA, _ACROSS = 0, 3, 4, 5


@njit(cache=True)
def _surface(maps, row, col, kind, eta, tint):
    """Return the surface of a cell; maps hold albedo (3), scale, and both widths."""
    m = maps[row, col]
    more = (tint[0], tint[1], tint[2], 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    r, g, b, s, u, v = m[_ALBEDO], m[_ALBEDO + 1], m[_ALBEDO + 2], m[_SCALE], m[_ALPHA], m[_ACROSS]
    return Surface(kind, r, g, b, s, eta, u, v, 1.33, 0.0, 0.0, 0.0, 0.0, more)


@njit(cache=True)
def _normal(slopes, x, y, texel):
    """Return the smooth normal at a place: slopes (H, W, 2) at cell centres, bilinear, repeating; row 0 is at the largest y."""
    height, width = slopes.shape[0], slopes.shape[1]
    c, r = x / texel - 0.5, height - y / texel - 0.5
    c0, r0 = math.floor(c), math.floor(r)
    fc, fr = c - c0, r - r0
    sx = sy = 0.0
    for i in range(2):
        for j in range(2):
            w = (fr if i else 1.0 - fr) * (fc if j else 1.0 - fc)
            row, col = (r0 + i) % height, (c0 + j) % width
            sx += w * slopes[row, col, 0]
            sy += w * slopes[row, col, 1]
    return normalize((-sx, -sy, 1.0))


@njit(cache=True)
def _cell(p, shape, texel):
    height, width = shape
    return math.floor(height - p[1] / texel) % height, math.floor(p[0] / texel) % width


@njit(cache=True)
def _meet(scene, slopes, maps, texel, kind, eta, tint, buffer, s, o, d):
    """Return whether a ray meets the surface, and there the place, geometric normal, frame and surface."""
    face, distance, _, _ = intersect(scene, 0, 0, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], math.inf)
    p = (o[0] + distance * d[0], o[1] + distance * d[1], o[2] + distance * d[2])
    ng = normalize(hit_normal(buffer, s))
    if ng[2] < 0.0:
        ng = (-ng[0], -ng[1], -ng[2])
    wo = (-d[0], -d[1], -d[2])
    n = valid_normal(_normal(slopes, p[0], p[1], texel), ng, wo)
    x = 1.0 - n[0] * n[0]
    t = normalize((x, -n[0] * n[1], -n[0] * n[2]))
    row, col = _cell(p, (slopes.shape[0], slopes.shape[1]), texel)
    found = face >= 0 and dot(ng, wo) > 0.0
    return found, p, ng, (t, cross(n, t), n), _surface(maps, row, col, kind, eta, tint)


@njit(cache=True)
def _gather(scene, lights, buffer, s, p, ng, frame, surface, wo, weight, out):
    """Add to out (I, 3) what each light sends along wo, times a weight."""
    t, b, n = frame
    start = leave(p, ng, ng)
    local_o = to_local(wo, t, b, n)
    for i in range(lights.shape[0]):
        w = (lights[i, 0], lights[i, 1], lights[i, 2])
        if dot(ng, w) <= 0.0:
            continue
        local_i = to_local(w, t, b, n)
        f = bsdf.evaluate(surface, local_o, local_i)
        if f[0] + f[1] + f[2] <= 0.0:
            continue
        if occluded(scene, 0, buffer, s, start[0], start[1], start[2], w[0], w[1], w[2], math.inf):
            continue
        for c in range(3):
            out[i, c] += weight[c] * f[c] * local_i[2]


@njit(parallel=True, cache=True)
def acquire(scene, slopes, maps, texel, top, kind, eta, tint, places, lights, views, samples, bounces, seed, out):
    """Fill out (T, I, O, 3) with the radiance under lights of unit irradiance, whose cosine is thus in.

    places (T, 2) are row and column of texels; a texel is seen through its square on the plane z = 0.
    """
    height = slopes.shape[0]
    num_views, num_lights = views.shape[0], lights.shape[0]
    for job in prange(places.shape[0] * num_views):
        buffer, s = ray_buffer()
        k, o = job // num_views, job % num_views
        stream = hash2(hash2(seed, places[k, 0] * slopes.shape[1] + places[k, 1]), o)
        light = out[k, :, o, :]
        view = (views[o, 0], views[o, 1], views[o, 2])
        for index in range(samples):
            u0, u1 = draw2(stream, index, 0)
            if samples == 1:
                u0 = u1 = 0.5
            x, y = (places[k, 1] + u0) * texel, (height - places[k, 0] - u1) * texel
            rise = 2.0 * top / view[2]
            origin = (x + rise * view[0], y + rise * view[1], rise * view[2])
            d = (-view[0], -view[1], -view[2])
            weight = (1.0 / samples, 1.0 / samples, 1.0 / samples)
            for bounce in range(bounces):
                found, p, ng, frame, surface = _meet(scene, slopes, maps, texel, kind, eta, tint, buffer, s, origin, d)
                if not found:
                    break
                wo = (-d[0], -d[1], -d[2])
                _gather(scene, lights, buffer, s, p, ng, frame, surface, wo, weight, light)
                if bounce == bounces - 1:
                    break
                v0, v1 = draw2(stream, index, 2 * bounce + 1)
                t, b, n = frame
                local, w, _, _ = bsdf.sample(surface, to_local(wo, t, b, n), v0, v1, draw1(stream, index, 2 * bounce + 2))
                d = to_world(local, t, b, n)
                if w[0] + w[1] + w[2] <= 0.0 or dot(d, ng) <= 0.0:
                    break
                weight = (weight[0] * w[0], weight[1] * w[1], weight[2] * w[2])
                origin = leave(p, ng, ng)
        for i in range(num_lights):
            for c in range(3):
                light[i, c] = max(light[i, c], 0.0)
