"""The path tracer: next-event estimation and multiple importance sampling over any number of bounces.

Everything is estimated at once by paths from the camera: J. T. Kajiya, "The Rendering Equation", 1986; combination of
strategies by the power heuristic: E. Veach, thesis, 1997, section 9.2. Where `medium` (and with it `bodies`) is None, Numba
compiles the tracer without a trace of media; where `tables` is, without measured materials.
"""

import math
from typing import NamedTuple

from materials.kernels import bsdf, phase
from materials.kernels.frames import basis, dot, to_local, to_world
from materials.kernels.kinds import SECOND_ALPHA_U, SECOND_ALPHA_V, TABULATED
from materials.kernels.lean import lean

from . import scatter
from .airlight import airlight
from .arrays import ONE_SIDED, SUN_POWER
from .bodies import body_behind, fly, passage, scatter_in
from .emitters import emitted, sphere_seen, surface_density
from .equiangular import scattered_light, stretch
from .first_surface import specular_part, specular_share, without_diffuse
from .lights import environment_pdf, environment_radiance, num_lights, sample_light, sun_pdf
from .media import tracking
from .sampler import draw1, draw2
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
)
from .visibility import first_hit, is_visible

# Dimensions of the sampler: 0 is the pixel, then a block per bounce.
_PER_BOUNCE = 16
_FLIGHT, _CHOICE, _DIRECTION, _LOBE, _ROULETTE, _LIGHTS = 0, 1, 2, 3, 4, 5
# Points of light in the air, apart from all bounces.
_ANGLE = 1 << 20
# What a path met first: light itself (a lamp, the sky, nothing), a surface, or a particle in a medium.
LIGHT, SURFACE, PARTICLE = 0, 1, 2
_BLACK = (0.0, 0.0, 0.0)
_ALL = (1.0, 1.0, 1.0)


class Sample(NamedTuple):
    """What one path found; colours and vectors are 3-tuples.

    `specular` is what of the radiance the first surface turned by its specular lobes, `scattered` what particles in the air turned
    before any surface; `albedo` and `normal` are that surface's, 0 where the path met something else first.
    """

    radiance: tuple
    specular: tuple
    scattered: tuple
    first: int
    albedo: tuple
    normal: tuple


@lean()
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


@lean()
def glow(world, lights, hit, d, distance, pdf, is_delta):
    """Return the radiance of a glowing surface met after `distance`, weighted as in `beyond`."""
    e = emitted(world, hit, d)
    if is_delta:
        return e
    w = power_heuristic(pdf, surface_density(world, lights, hit, d, distance))
    return e[0] * w, e[1] * w, e[2] * w


@lean()
def _facing(ng, two_faced, w):
    """Return whether w leaves a reflecting surface on the side of its geometric normal; glass lets it pass anywhere."""
    return two_faced or dot(ng, w) > 0.0


@lean()
def direct(
    world, tables, lights, medium, bodies, body, buffer, s, stream, index, dimension, hit, surface, frame, wo, two_faced, splits
):
    """Return the light that reaches a surface straight from the lights, through the medium, and leaves it along wo.

    With `splits`, also what of it the specular lobes turn; black else.
    """
    t, bt, n = frame
    r = g = b = 0.0
    sr = sg = sb = 0.0
    # Lamps are aimed at from where the ray will start: a lamp seen edge-on would else stop the ray that is to reach it.
    p = hit.p if two_faced else leave(hit.p, hit.ng, hit.ng)
    for i in range(num_lights(lights)):
        # Lights are summed, so two may share numbers; running into the next bounce's block would tie bounces together.
        u0, u1 = draw2(stream, index, dimension + _LIGHTS + i % (_PER_BOUNCE - _LIGHTS))
        d, far, e, density = sample_light(lights, i, p, u0, u1)
        if e[0] + e[1] + e[2] <= 0.0 or not _facing(hit.ng, two_faced, d):
            continue
        wi = to_local(d, t, bt, n)
        f = scatter.evaluate(tables, surface, wo, wi)
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
            w *= power_heuristic(density, scatter.pdf(tables, surface, wo, wi))
        if medium is not None:
            w *= passed
        r += f[0] * e[0] * w
        g += f[1] * e[1] * w
        b += f[2] * e[2] * w
        if splits:
            f = specular_part(surface, wo, wi, f)
            sr += f[0] * e[0] * w
            sg += f[1] * e[1] * w
            sb += f[2] * e[2] * w
    return (r, g, b), (sr, sg, sb)


@lean()
def _gather(total, specular, beta, e, share, limit):
    """Return the sums of all and of specular light with e of weight beta added, cut off at `limit`."""
    r, g, b = min(beta[0] * e[0], limit), min(beta[1] * e[1], limit), min(beta[2] * e[2], limit)
    all_light = (total[0] + r, total[1] + g, total[2] + b)
    return all_light, (specular[0] + share[0] * r, specular[1] + share[1] * g, specular[2] + share[2] * b)


@lean()
def _times(a, b):
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@lean()
def _flip(v):
    return (-v[0], -v[1], -v[2])


@lean()
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


@lean()
def radiance(
    world,
    tables,
    lights,
    medium,
    bodies,
    buffer,
    s,
    stream,
    index,
    origin,
    direction,
    max_bounces,
    roulette_from,
    specular_only,
    clamp,
):
    """Return a `Sample`: an estimate of the radiance that arrives at `origin` from `direction`, and how it came about.

    With `specular_only` the first surface scatters by its specular lobes alone; as radiance is linear in the lobes,
    the difference to the whole is its diffuse part. What reaches the first surface by way of another is cut off at
    `clamp` (infinity: unbiased): rare paths that find the sun in a mirror otherwise show as isolated bright pixels.

    Specular light is a share of each estimate, that of the specular lobes in the first surface's f along its next
    direction: it costs no further path, and cannot exceed the whole.
    """
    total = specular = scattered = albedo = shown = _BLACK
    beta = _ALL
    share = _BLACK  # of specular light in what is still to come: nothing before the first surface
    first = LIGHT
    o, d = origin, direction
    pdf = 0.0
    is_delta = True
    body = -1
    for bounce in range(max_bounces + 1):
        if bounce >= roulette_from:
            survival = min(0.95, max(beta[0], max(beta[1], beta[2])))
            if draw1(stream, index, 1 + (bounce - 1) * _PER_BOUNCE + _ROULETTE) >= survival:
                break
            beta = (beta[0] / survival, beta[1] / survival, beta[2] / survival)
        dimension = 1 + bounce * _PER_BOUNCE
        if medium is None:
            face, b1, b2, distance = first_hit(world, buffer, s, o, d)
        else:
            u, state = draw1(stream, index, dimension + _FLIGHT), tracking(stream, index, dimension)
            started = body
            collided, face, b1, b2, distance, p, body, far = fly(world, medium, bodies, body, buffer, s, u, state, o, d)
            t0, t1 = 0.0, 0.0
            if lights.points.shape[0] > 0 and bounce < max_bounces:
                t0, t1 = stretch(medium, started, o, d, far)
                if t0 < t1:
                    v = draw1(stream, index, _ANGLE + dimension)
                    at = (stream, index, _ANGLE + dimension + _LIGHTS, v, o, d, t0, t1)
                    e = scattered_light(world, lights, medium, bodies, buffer, s, *at)
                    total, specular = _gather(total, specular, beta, e, share, clamp if bounce > 0 else math.inf)
                    if bounce == 0:
                        scattered = total
                    if distance > far:  # the particle is beyond another body's face, where nothing is drawn by angle
                        t0, t1 = 0.0, 0.0
            if collided:
                if bounce == 0:
                    first = PARTICLE
                if bounce == max_bounces:
                    break
                albedo_there, turns = scatter_in(medium, bodies, body)
                beta = _times(beta, albedo_there)
                near, count = dimension + _LIGHTS, _PER_BOUNCE - _LIGHTS
                at = (stream, index, near, count, p, o, d, distance, t0, t1)
                e = airlight(world, lights, medium, bodies, body, buffer, s, *at)
                total, specular = _gather(total, specular, beta, e, share, clamp if bounce > 0 else math.inf)
                u0, u1 = draw2(stream, index, dimension + _DIRECTION)
                turned = phase.sample(turns, d, u0, u1)
                pdf, is_delta = phase.evaluate(turns, dot(d, turned)), False
                o, d = p, turned
                continue
        if face < 0:
            e = beyond(world, lights, o, d, pdf, is_delta)
            total, specular = _gather(total, specular, beta, e, share, clamp if bounce > 1 else math.inf)
            break
        hit = hit_at(world, face, b1, b2)
        wo_world = _flip(d)
        kind = world.material_kind[hit.material]
        two_faced = is_two_faced(kind)
        if emits(kind):
            e = glow(world, lights, hit, d, distance, pdf, is_delta)
            total, specular = _gather(total, specular, beta, e, share, clamp if bounce > 1 else math.inf)
            break
        if bounce == 0:
            first = SURFACE
        elif bounce == max_bounces:
            break
        if not two_faced and dot(hit.ng, wo_world) < 0.0:
            if world.material_values[hit.material, ONE_SIDED] > 0.5:
                break
            hit = Hit(hit.face, hit.material, hit.u, hit.v, hit.p, _flip(hit.ng), _flip(hit.ns))
        coverage = film_coverage(world, hit)
        below_film = coverage > 0.0 and draw1(stream, index, dimension + _CHOICE) < coverage
        surface = surface_at(world, hit, below_film)
        if bounce == 0:
            albedo = scatter.colour(tables, surface)
            shown = hit.ns if dot(hit.ns, wo_world) > 0.0 else _flip(hit.ns)
            if max_bounces == 0:
                break
            if specular_only:
                surface = without_diffuse(surface)
        if two_faced:
            t, b = basis(hit.ns)
            frame = (t, b, hit.ns)
        else:
            normal = film_normal(world, hit) if below_film else hit.ns
            brushed = surface.alpha_u != surface.alpha_v or surface.more[SECOND_ALPHA_U] != surface.more[SECOND_ALPHA_V]
            frame = scattering_frame(world, hit, normal, wo_world, brushed or kind == TABULATED)
        t, b, n = frame
        wo = to_local(wo_world, t, b, n)
        if not bsdf.is_specular(surface):
            splits = bounce == 0
            at = (stream, index, dimension, hit, surface, frame, wo, two_faced, splits)
            e, mirrored = direct(world, tables, lights, medium, bodies, body, buffer, s, *at)
            total, specular = _gather(total, specular, beta, e, share, math.inf if splits else clamp)
            if splits:
                specular = mirrored
        u0, u1 = draw2(stream, index, dimension + _DIRECTION)
        u2 = draw1(stream, index, dimension + _LOBE)
        wi, weight, pdf, is_delta = scatter.sample(tables, surface, wo, u0, u1, u2)
        if bounce == 0:
            share = _ALL if is_delta else specular_share(surface, wo, wi, weight, pdf)
        beta = _times(beta, weight)
        d = to_world(wi, t, b, n)
        if beta[0] + beta[1] + beta[2] <= 0.0 or not _facing(hit.ng, two_faced, d):
            break
        o = leave(hit.p, hit.ng, d)
        if medium is not None and two_faced:
            body = body_behind(bodies, hit.material, hit.ng, d)
    if first == PARTICLE:
        scattered = total
    return Sample(total, specular, scattered, first, albedo, shown)
