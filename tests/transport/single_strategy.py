"""Twins of the path tracer that use one strategy only, for direct light on what the camera sees."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from materials.kernels import bsdf
from materials.kernels.frames import basis, to_local, to_world
from transport.kernels.lights import environment_radiance, num_lights, sample_light
from transport.kernels.optics import camera_ray
from transport.kernels.rays import ray_buffer
from transport.kernels.shading import hit_at, leave, surface_at
from transport.kernels.visibility import first_hit, is_visible

# Plain random numbers on purpose: the twins share neither the sampler nor the weights of the tracer.
_BY_LIGHTS, _BY_SURFACE, _WITHOUT_COSINE = 0, 1, 2


@njit
def _estimate(world, lights, camera, xi, total, strategy):
    buffer, s = ray_buffer()
    for row in range(camera.height):
        for col in range(camera.width):
            for x in xi[row, col]:
                o, d = camera_ray(camera, col + x[0], row + x[1])
                face, b1, b2, _ = first_hit(world, buffer, s, o, d)
                hit = hit_at(world, face, b1, b2)
                surface = surface_at(world, hit, False)
                t, b = basis(hit.ns)
                wo = to_local((-d[0], -d[1], -d[2]), t, b, hit.ns)
                u0, u1, u2 = x[2], x[3], x[4]
                if strategy == _BY_LIGHTS:
                    for i in range(num_lights(lights)):
                        to_light, far, e, _ = sample_light(lights, i, hit.p, u0, u1)
                        wi = to_local(to_light, t, b, hit.ns)
                        if wi[2] <= 0.0 or not is_visible(world, buffer, s, leave(hit.p, hit.ng, to_light), to_light, far):
                            continue
                        f = bsdf.evaluate(surface, wo, wi)
                        for c in range(3):
                            total[row, col, c] += f[c] * wi[2] * e[c]
                    continue
                if strategy == _BY_SURFACE:
                    wi, weight, _, _ = bsdf.sample(surface, wo, u0, u1, u2)
                else:
                    # Even over the hemisphere, with the weight of a cosine-weighted direction: the cosine is lost.
                    r = math.sqrt(1.0 - u0 * u0)
                    wi = (r * math.cos(2.0 * math.pi * u1), r * math.sin(2.0 * math.pi * u1), u0)
                    f = bsdf.evaluate(surface, wo, wi)
                    weight = (f[0] * 2.0 * math.pi, f[1] * 2.0 * math.pi, f[2] * 2.0 * math.pi)
                if wi[2] <= 0.0:
                    continue
                w = to_world(wi, t, b, hit.ns)
                e = environment_radiance(lights.panorama, w[0], w[1], w[2])
                for c in range(3):
                    total[row, col, c] += weight[c] * e[c]


def _numbers(camera, samples, seed):
    return np.random.default_rng(seed).random((camera.height, camera.width, samples, 5))


def by_lights(world, lights, camera, samples, total):
    """Add estimates that draw points on the lights, one of each."""
    _estimate(world, lights, camera, _numbers(camera, samples, _BY_LIGHTS), total, _BY_LIGHTS)


def by_surface(world, lights, camera, samples, total):
    """Add estimates that draw directions by the surface."""
    _estimate(world, lights, camera, _numbers(camera, samples, _BY_SURFACE), total, _BY_SURFACE)


def without_cosine(world, lights, camera, samples, total):
    """Add estimates that forget a cosine."""
    _estimate(world, lights, camera, _numbers(camera, samples, _WITHOUT_COSINE), total, _WITHOUT_COSINE)
