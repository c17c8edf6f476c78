"""The light that places on a world's surfaces send from each of many lights to each of many viewers, body and all.

As in `dome`, all lights shine at once on each path. Vertices after the first join only every `stride`-th light, begun at random
and weighted up: what they add is small and smooth, and the factorisation that follows averages their noise over texels.
"""

import numpy as np
from numba import njit, prange

from materials.kernels import phase
from materials.kernels.frames import dot, to_local, to_world
from materials.kernels.lean import lean

from . import scatter
from .bodies import fly, passage, scatter_in
from .emitters import FAR
from .media import tracking
from .path import scattering_frame
from .rays import ray_buffer
from .sampler import draw1, draw2, hash2
from .shading import hit_at, leave, surface_at
from .visibility import is_visible

# Dimensions of the sampler: 0 is the place within the texel, then a block per bounce.
_PER_BOUNCE = 16
_FLIGHT, _CHOICE, _DIRECTION, _LOBE, _ROULETTE = 0, 1, 2, 3, 4
_ROULETTE_FROM = 4
# Shadow rays' numbers, apart from all bounces.
_LIGHTS = 1 << 20


@lean()
def _lamp(directions, i, frame):
    """Return local direction i of a texel in the world."""
    x, y, n = frame
    a, b, c = directions[i, 0], directions[i, 1], directions[i, 2]
    return a * x[0] + b * y[0] + c * n[0], a * x[1] + b * y[1] + c * n[1], a * x[2] + b * y[2] + c * n[2]


@lean()
def _reaches(world, medium, bodies, body, is_filled, buffer, s, state, o, w):
    """Return the share of light from far away along w that reaches o."""
    if is_filled:
        return passage(world, medium, bodies, body, buffer, s, state, o, w, FAR)
    return 1.0 if is_visible(world, buffer, s, o, w, FAR) else 0.0


@lean()
def _gather_surface(
    world,
    tables,
    medium,
    bodies,
    body,
    is_filled,
    lights,
    texel,
    first,
    stride,
    buffer,
    s,
    state,
    hit,
    surface,
    frame,
    wo,
    beta,
    out,
):  # fmt: skip
    """Add to out (I, 3) what each light sends along wo from a surface, times beta."""
    t, b, n = frame
    start = leave(hit.p, hit.ng, hit.ng)
    for i in range(first, lights.shape[0], stride):
        w = _lamp(lights, i, texel)
        if dot(hit.ng, w) <= 0.0:
            continue
        wi = to_local(w, t, b, n)
        f = scatter.evaluate(tables, surface, wo, wi)
        if wi[2] <= 0.0 or f[0] + f[1] + f[2] <= 0.0:
            continue
        share = stride * wi[2] * _reaches(world, medium, bodies, body, is_filled, buffer, s, hash2(state, np.uint32(i)), start, w)
        for c in range(3):
            out[i, c] += share * beta[c] * f[c]


@lean()
def _gather_particle(world, medium, bodies, body, lights, texel, first, stride, buffer, s, state, p, d, turns, beta, out):
    """Add to out (I, 3) what each light sends against d from a particle at p, times beta."""
    for i in range(first, lights.shape[0], stride):
        w = _lamp(lights, i, texel)
        share = stride * phase.evaluate(turns, dot(d, w))
        share *= passage(world, medium, bodies, body, buffer, s, hash2(state, np.uint32(i)), p, w, FAR)
        for c in range(3):
            out[i, c] += share * beta[c]


@lean()
def _trace(world, tables, medium, bodies, is_filled, lights, texel, stride, buffer, s, stream, index, o, d, samples, bounces, out):
    """Add to out (I, 3) what one path finds under each light, a share of 1 / samples."""
    beta = (1.0 / samples, 1.0 / samples, 1.0 / samples)
    body = -1
    for bounce in range(bounces):
        dimension = 1 + bounce * _PER_BOUNCE
        if bounce >= _ROULETTE_FROM:
            survival = min(0.95, samples * max(beta[0], max(beta[1], beta[2])))
            if draw1(stream, index, dimension + _ROULETTE) >= survival:
                return
            beta = (beta[0] / survival, beta[1] / survival, beta[2] / survival)
        step = 1 if bounce == 0 else min(stride, lights.shape[0])
        first = int(draw1(stream, index, dimension + _CHOICE) * step)
        shadows = tracking(stream, index, _LIGHTS + dimension)
        u, state = draw1(stream, index, dimension + _FLIGHT), tracking(stream, index, dimension)
        u0, u1 = draw2(stream, index, dimension + _DIRECTION)
        collided, face, b1, b2, _, p, body, _ = fly(world, medium, bodies, body, buffer, s, u, state, o, d)
        if collided:
            albedo, turns = scatter_in(medium, bodies, body)
            beta = (beta[0] * albedo[0], beta[1] * albedo[1], beta[2] * albedo[2])
            at = (lights, texel, first, step, buffer, s, shadows, p, d, turns, beta, out)
            _gather_particle(world, medium, bodies, body, *at)
            o, d = p, phase.sample(turns, d, u0, u1)
            continue
        if face < 0:
            return
        hit = hit_at(world, face, b1, b2)
        wo_world = (-d[0], -d[1], -d[2])
        # A surface that is met from behind was started in: nothing is seen of it.
        if dot(hit.ng, wo_world) <= 0.0:
            return
        surface = surface_at(world, hit, False)
        frame = scattering_frame(world, hit, hit.ns, wo_world, surface.alpha_u != surface.alpha_v)
        t, b, n = frame
        wo = to_local(wo_world, t, b, n)
        at = (lights, texel, first, step, buffer, s, shadows, hit, surface, frame, wo, beta, out)
        _gather_surface(world, tables, medium, bodies, body, is_filled, *at)
        wi, weight, _, _ = scatter.sample(tables, surface, wo, u0, u1, draw1(stream, index, dimension + _LOBE))
        beta = (beta[0] * weight[0], beta[1] * weight[1], beta[2] * weight[2])
        d = to_world(wi, t, b, n)
        if beta[0] + beta[1] + beta[2] <= 0.0 or dot(hit.ng, d) <= 0.0:
            return
        o = leave(hit.p, hit.ng, d)


@lean()
def _row(array, i):
    return array[i, 0], array[i, 1], array[i, 2]


@njit(parallel=True, cache=True)
def acquire(
    world,
    tables,
    medium,
    bodies,
    is_filled,
    numbers,
    places,
    frames,
    edges,
    lights,
    views,
    reach,
    samples,
    bounces,
    stride,
    seed,
    out,
):  # fmt: skip
    """Fill out (T, I, O, 3) with the radiance under lights of unit irradiance, whose cosine is thus in.

    `numbers` (T,) choose the random numbers of a texel; `frames` (T, 3, 3) hold x, y, n in rows; `edges` (T, 2, 3) span the texel
    about its place. Rays towards it start `reach` above it along the view.
    """
    num_views, num_lights = views.shape[0], lights.shape[0]
    for job in prange(places.shape[0] * num_views):
        buffer, s = ray_buffer()
        k, v = job // num_views, job % num_views
        stream = hash2(hash2(np.uint32(seed), np.uint32(numbers[k])), np.uint32(v))
        texel = (_row(frames[k], 0), _row(frames[k], 1), _row(frames[k], 2))
        view = _lamp(views, v, texel)
        light = np.zeros((num_lights, 3))
        for index in range(samples):
            u0, u1 = draw2(stream, index, 0)
            p, e0, e1 = places[k], edges[k, 0], edges[k, 1]
            o0 = p[0] + (u0 - 0.5) * e0[0] + (u1 - 0.5) * e1[0] + reach * view[0]
            o1 = p[1] + (u0 - 0.5) * e0[1] + (u1 - 0.5) * e1[1] + reach * view[1]
            o2 = p[2] + (u0 - 0.5) * e0[2] + (u1 - 0.5) * e1[2] + reach * view[2]
            d = (-view[0], -view[1], -view[2])
            at = (buffer, s, stream, index, (o0, o1, o2), d, samples, bounces, light)
            _trace(world, tables, medium, bodies, is_filled, lights, texel, stride, *at)
        for i in range(num_lights):
            for c in range(3):
                out[k, i, v, c] = light[i, c]
