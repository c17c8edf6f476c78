"""The path tracer: next-event estimation and multiple importance sampling over any number of bounces.

Everything is estimated at once by paths from the camera: J. T. Kajiya, "The Rendering Equation", 1986; combination of
strategies by the power heuristic: E. Veach, thesis, 1997, section 9.2. Where `medium` (and with it `bodies`) is None, Numba
compiles the tracer without a trace of media.
"""

import math

import numpy as np
from numba import njit, prange

from materials.kernels import bsdf, phase
from materials.kernels.frames import basis, dot, to_local, to_world
from materials.kernels.kinds import SECOND_ALPHA_U, SECOND_ALPHA_V

from .airlight import airlight
from .arrays import ONE_SIDED, SUN_POWER
from .bodies import body_behind, fly, passage, scatter_in
from .emitters import emitted, sphere_seen, surface_density
from .lights import environment_pdf, environment_radiance, num_lights, sample_light, sun_pdf
from .media import tracking
from .optics import central_ray, sample_ray
from .rays import ray_buffer
from .sampler import draw1, draw2, hash2
from .shading import (
    Hit,
    cross,
    emits,
    film_coverage,
    film_normal,
    has_relief,
    hit_at,
    hit_tangent,
    is_two_faced,
    leave,
    power_heuristic,
    surface_at,
    valid_normal,
    without_diffuse,
)
from .visibility import first_hit, is_visible

TILE = 16
# Dimensions of the sampler: 0 is the pixel, then a block per bounce.
_PER_BOUNCE = 16
_FLIGHT, _CHOICE, _DIRECTION, _LOBE, _ROULETTE, _LIGHTS = 0, 1, 2, 3, 4, 5


@njit(cache=True)
def beyond(world, lights, o, d, pdf, is_delta):
    """Return the radiance of glowing spheres, sky and sun discs along a ray that met no surface.

    `pdf` is the density with which the last surface, about `o`, chose the ray; what next-event estimation could have found
    too is weighted against it.
    """
    is_met, e, density = sphere_seen(lights, world, o, d)
    if is_met:
        w = 1.0 if is_delta else power_heuristic(pdf, density)
        return e[0] * w, e[1] * w, e[2] * w
    r, g, b = environment_radiance(lights.panorama, d[0], d[1], d[2])
    if lights.panorama.shape[0] > 0 and not is_delta:
        w = power_heuristic(pdf, environment_pdf(lights.panorama, lights.row_cdf, lights.col_cdf, d[0], d[1], d[2]))
        r, g, b = r * w, g * w, b * w
    for i in range(lights.suns.shape[0]):
        density = sun_pdf(lights.suns, i, d[0], d[1], d[2])
        if density > 0.0:
            # density is 1 / solid angle, so SUN_POWER * density is the radiance of the disc.
            w = density if is_delta else density * power_heuristic(pdf, density)
            r += lights.suns[i, SUN_POWER] * w
            g += lights.suns[i, SUN_POWER + 1] * w
            b += lights.suns[i, SUN_POWER + 2] * w
    return r, g, b


@njit(cache=True)
def glow(world, lights, hit, d, distance, pdf, is_delta):
    """Return the radiance of a glowing surface met after `distance`, weighted as in `beyond`."""
    e = emitted(world, hit, d)
    if is_delta:
        return e
    w = power_heuristic(pdf, surface_density(world, lights, hit, d, distance))
    return e[0] * w, e[1] * w, e[2] * w


@njit(cache=True)
def _facing(ng, two_faced, w):
    """Return whether w leaves a reflecting surface on the side of its geometric normal; glass lets it pass anywhere."""
    return two_faced or dot(ng, w) > 0.0


@njit(cache=True)
def direct(world, lights, medium, bodies, body, buffer, s, stream, index, dimension, hit, surface, frame, wo, two_faced):
    """Return the light that reaches a surface straight from the lights, through the medium, and leaves it along wo."""
    t, bt, n = frame
    r = g = b = 0.0
    # Lamps are aimed at from where the ray will start: a lamp seen edge-on would else stop the ray that is to reach it.
    p = hit.p if two_faced else leave(hit.p, hit.ng, hit.ng)
    for i in range(num_lights(lights)):
        # Lights are summed, so two may share numbers; running into the next bounce's block would tie bounces together.
        u0, u1 = draw2(stream, index, dimension + _LIGHTS + i % (_PER_BOUNCE - _LIGHTS))
        d, far, e, density = sample_light(lights, i, p, u0, u1)
        if e[0] + e[1] + e[2] <= 0.0 or not _facing(hit.ng, two_faced, d):
            continue
        wi = to_local(d, t, bt, n)
        f = bsdf.evaluate(surface, wo, wi)
        if f[0] + f[1] + f[2] <= 0.0:
            continue
        o = leave(hit.p, hit.ng, d) if two_faced else p
        if medium is None:
            passed = 1.0 if is_visible(world, buffer, s, o, d, far) else 0.0
        else:
            # Behind glass lies what is behind it, before it what the path came through.
            within = body_behind(bodies, hit.material, hit.ng, d) if two_faced else body
            state = tracking(stream, index, dimension + _LIGHTS + i)
            passed = passage(world, medium, bodies, within, buffer, s, state, o, d, far)
        if passed <= 0.0:
            continue
        w = abs(wi[2])
        if density < math.inf:
            w *= power_heuristic(density, bsdf.pdf(surface, wo, wi))
        if medium is not None:
            w *= passed
        r += f[0] * e[0] * w
        g += f[1] * e[1] * w
        b += f[2] * e[2] * w
    return r, g, b


@njit(cache=True)
def _flip(v):
    return (-v[0], -v[1], -v[2])


@njit(cache=True)
def scattering_frame(world, hit, normal, wo_world, anisotropic):
    """Return (t, b, n) with n on the viewer's side; where the shading normal turns away, the geometric one serves."""
    n = normal
    if has_relief(world, hit.material):
        n = valid_normal(n, hit.ng, wo_world)
    if dot(n, wo_world) <= 1e-4:
        n = hit.ng
    if anisotropic:
        t = hit_tangent(world, hit, n)
        return t, cross(n, t), n
    t, b = basis(n)
    return t, b, n


@njit(cache=True)
def radiance(
    world, lights, medium, bodies, buffer, s, stream, index, origin, direction, max_bounces, roulette_from, specular_only, clamp
):
    """Return an estimate (r, g, b) of the radiance that arrives at `origin` from `direction`.

    With `specular_only` the first surface scatters by its specular lobes alone; as radiance is linear in the lobes,
    the difference to the whole is its diffuse part. What reaches the first surface by way of another is cut off at
    `clamp` (infinity: unbiased): rare paths that find the sun in a mirror otherwise show as isolated bright pixels.
    """
    lr = lg = lb = 0.0
    br = bg = bb = 1.0
    o, d = origin, direction
    pdf = 0.0
    is_delta = True
    body = -1
    for bounce in range(max_bounces + 1):
        if bounce >= roulette_from:
            survival = min(0.95, max(br, max(bg, bb)))
            if draw1(stream, index, 1 + (bounce - 1) * _PER_BOUNCE + _ROULETTE) >= survival:
                return lr, lg, lb
            br /= survival
            bg /= survival
            bb /= survival
        dimension = 1 + bounce * _PER_BOUNCE
        if medium is None:
            face, b1, b2, distance = first_hit(world, buffer, s, o, d)
        else:
            u, state = draw1(stream, index, dimension + _FLIGHT), tracking(stream, index, dimension)
            collided, face, b1, b2, distance, p, body = fly(world, medium, bodies, body, buffer, s, u, state, o, d)
            if collided:
                if bounce == max_bounces:
                    return lr, lg, lb
                albedo, turns = scatter_in(medium, bodies, body)
                br *= albedo[0]
                bg *= albedo[1]
                bb *= albedo[2]
                first, count = dimension + _LIGHTS, _PER_BOUNCE - _LIGHTS
                e = airlight(world, lights, medium, bodies, body, buffer, s, stream, index, first, count, p, d)
                limit = clamp if bounce > 0 else math.inf
                lr += min(br * e[0], limit)
                lg += min(bg * e[1], limit)
                lb += min(bb * e[2], limit)
                u0, u1 = draw2(stream, index, dimension + _DIRECTION)
                turned = phase.sample(turns, d, u0, u1)
                pdf, is_delta = phase.evaluate(turns, dot(d, turned)), False
                o, d = p, turned
                continue
        if face < 0:
            e = beyond(world, lights, o, d, pdf, is_delta)
            limit = clamp if bounce > 1 else math.inf
            return lr + min(br * e[0], limit), lg + min(bg * e[1], limit), lb + min(bb * e[2], limit)
        hit = hit_at(world, face, b1, b2)
        wo_world = _flip(d)
        kind = world.material_kind[hit.material]
        two_faced = is_two_faced(kind)
        if emits(kind):
            e = glow(world, lights, hit, d, distance, pdf, is_delta)
            limit = clamp if bounce > 1 else math.inf
            return lr + min(br * e[0], limit), lg + min(bg * e[1], limit), lb + min(bb * e[2], limit)
        if bounce == max_bounces:
            return lr, lg, lb
        if not two_faced and dot(hit.ng, wo_world) < 0.0:
            if world.material_values[hit.material, ONE_SIDED] > 0.5:
                return lr, lg, lb
            hit = Hit(hit.face, hit.material, hit.u, hit.v, hit.p, _flip(hit.ng), _flip(hit.ns))
        coverage = film_coverage(world, hit)
        below_film = coverage > 0.0 and draw1(stream, index, dimension + _CHOICE) < coverage
        surface = surface_at(world, hit, below_film)
        if bounce == 0 and specular_only:
            surface = without_diffuse(surface)
        if two_faced:
            t, b = basis(hit.ns)
            frame = (t, b, hit.ns)
        else:
            normal = film_normal(world, hit) if below_film else hit.ns
            brushed = surface.alpha_u != surface.alpha_v or surface.more[SECOND_ALPHA_U] != surface.more[SECOND_ALPHA_V]
            frame = scattering_frame(world, hit, normal, wo_world, brushed)
        t, b, n = frame
        wo = to_local(wo_world, t, b, n)
        if not bsdf.is_specular(surface):
            e = direct(world, lights, medium, bodies, body, buffer, s, stream, index, dimension, hit, surface, frame, wo, two_faced)
            limit = clamp if bounce > 0 else math.inf
            lr += min(br * e[0], limit)
            lg += min(bg * e[1], limit)
            lb += min(bb * e[2], limit)
        u0, u1 = draw2(stream, index, dimension + _DIRECTION)
        wi, weight, pdf, is_delta = bsdf.sample(surface, wo, u0, u1, draw1(stream, index, dimension + _LOBE))
        br *= weight[0]
        bg *= weight[1]
        bb *= weight[2]
        d = to_world(wi, t, b, n)
        if br + bg + bb <= 0.0 or not _facing(hit.ng, two_faced, d):
            return lr, lg, lb
        o = leave(hit.p, hit.ng, d)
        if medium is not None and two_faced:
            body = body_behind(bodies, hit.material, hit.ng, d)
    return lr, lg, lb


@njit(cache=True, parallel=True)
def render(
    world,
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
    total,
    square,
):
    """Add `count` samples, numbered from `first`, to the sums of radiance and of its square over some rows of pixels.

    Each pixel is summed by one thread in the order of its samples: the number of threads cannot change a bit.
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
                    e = radiance(
                        world, lights, medium, bodies, buffer, s, stream, i, o, d, max_bounces, roulette_from, specular_only, clamp
                    )
                    for c in range(3):
                        total[row, col, c] += e[c]
                        square[row, col, c] += e[c] * e[c]


@njit(cache=True, parallel=True)
def primary(world, camera, optics, face, b1, b2, distance):
    """Fill (H, W) arrays with what each pixel's centre sees: face (-1: nothing), barycentric coordinates, distance [m]."""
    for row in prange(camera.height):
        buffer, s = ray_buffer()
        for col in range(camera.width):
            o, d = central_ray(camera, optics, col + 0.5, row + 0.5)
            face[row, col], b1[row, col], b2[row, col], distance[row, col] = first_hit(world, buffer, s, o, d)
