"""Media inside bodies: milk, wax, a cloud with a border; behind glass, or behind a surface that bends and mirrors nothing.

A body is told by the index of its material, -1 is the air between bodies. Faces look outwards, so a ray that crosses one
says by its side where it is then; bodies that overlap, or hold others, are not told apart. A surface of index 1 around a
medium ("matched") is no surface to light: shadow rays pass it too.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from materials.kernels.frames import dot
from materials.kernels.lean import lean
from materials.kernels.phase import Phase

from .emitters import FAR, spheres_block
from .media import flight, phase_of, transmittance, uniform
from .sampler import hash2
from .shading import leave, point_at
from .visibility import first_hit

_AIR = -1
# Matched surfaces that a ray may pass on its way.
_CROSSINGS = 256


class BodyArrays(NamedTuple):
    """What is inside the bodies, a row per material; sigma_t is 0 where there is nothing."""

    sigma_t: Any  # (M,) float64
    albedo: Any  # (M, 3) float64
    phase: Any  # (M, 4) float64
    matched: Any  # (M,) bool


@lean()
def body_behind(bodies, material, ng, d):
    """Return the body that a ray along d is in after it has crossed a face with the outward normal ng."""
    return material if dot(ng, d) < 0.0 and bodies.sigma_t[material] > 0.0 else _AIR


@lean()
def scatter_in(medium, bodies, body):
    """Return albedo and phase function of what fills a body, or of the air."""
    if body == _AIR:
        return (medium.albedo[0], medium.albedo[1], medium.albedo[2]), phase_of(medium)
    a, q = bodies.albedo[body], bodies.phase[body]
    return (a[0], a[1], a[2]), Phase(q[0], q[1], q[2], q[3])


@lean()
def _crossed(world, bodies, face, b1, b2, d):
    """Return (is matched, start of the ray behind, body behind) of a face that a ray meets."""
    material = world.shape_material[world.face_shape[face]]
    p, ng = point_at(world, face, b1, b2)
    return bodies.matched[material], leave(p, ng, d), body_behind(bodies, material, ng, d)


@lean()
def fly(world, medium, bodies, body, buffer, s, u, state, o, d):
    """Follow a ray to its first collision, or to the first surface that is one to light.

    Returns (is collision, face, b1, b2, distance, place of the collision, body then, far); face and distance as `first_hit`,
    and `far` is where the ray meets its first face, matched or not.
    """
    travelled = first = 0.0
    for k in range(_CROSSINGS):
        step = hash2(state, np.uint32(k))
        face, b1, b2, distance = first_hit(world, buffer, s, o, d)
        far = distance if face >= 0 or distance > 0.0 else FAR
        if k > 0:
            u = uniform(step, 1)
        else:
            first = far
        if body == _AIR:
            t = flight(medium, o, d, far, u, step)
        else:
            t = -math.log1p(-u) / bodies.sigma_t[body]
        if t < far:
            return True, -1, 0.0, 0.0, travelled + t, (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]), body, first
        if face < 0:
            return False, -1, 0.0, 0.0, travelled + distance if distance > 0.0 else 0.0, o, body, first
        matched, behind, body_then = _crossed(world, bodies, face, b1, b2, d)
        travelled += distance
        if not matched:
            return False, face, b1, b2, travelled, o, body, first
        o, body = behind, body_then
    return False, -1, 0.0, 0.0, 0.0, o, body, first


@lean()
def passage(world, medium, bodies, body, buffer, s, state, o, d, far):
    """Return the share of the light that gets from o along d to `far`: 0 behind a surface, less than 1 through media."""
    if spheres_block(world.spheres, o, d, far):
        return 0.0
    share = 1.0
    for k in range(_CROSSINGS):
        face, b1, b2, distance = first_hit(world, buffer, s, o, d)
        is_free = face < 0 or distance >= far
        length = far if is_free else distance
        if body == _AIR:
            share *= transmittance(medium, o, d, length, hash2(state, np.uint32(k)))
        else:
            share *= math.exp(-bodies.sigma_t[body] * length)
        if is_free or share == 0.0:
            return share
        matched, o, body = _crossed(world, bodies, face, b1, b2, d)
        if not matched:
            return 0.0
        far -= distance
    return 0.0
