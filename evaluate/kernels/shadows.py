"""Shadows of bodies and lamps that nobody believed in: an unseen sphere, and lamps with an extent."""

import math

import numpy as np
from numba import njit, prange

from materials.kernels.frames import basis, dot, normalize
from transport.kernels.rays import occluded, ray_buffer
from transport.kernels.shading import leave

from .fragments import LAMP_PLACE, LAMP_POWER, towards


@njit(cache=True)
def _past(c, p, w, far):
    """Return how near the segment p + t w, 0 <= t <= far, comes to c, where (t), and in which direction from c."""
    d = (c[0] - p[0], c[1] - p[1], c[2] - p[2])
    t = min(max(dot(d, w), 0.0), far)
    e = (d[0] - t * w[0], d[1] - t * w[1], d[2] - t * w[2])
    length = math.sqrt(dot(e, e)) + 1e-12
    return length, t, (e[0] / length, e[1] / length, e[2] / length)


@njit(cache=True)
def _ramp(x, half):
    return min(max(0.5 + 0.5 * x / half, 0.0), 1.0)


@njit(cache=True, parallel=True)
def sphere_shadow(position, across, down, frame, slots, lamps, centre, radius, lit):
    """Fill `lit` (N, S), the share of each piece that lamps reach past a sphere.

    The border of the shadow is as wide as the piece is across it, so that the share is smooth in centre and radius: a box
    of two sides blurs an edge about as one of the root of their squares.
    """
    for k in prange(position.shape[0]):
        p = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
        for s in range(slots.shape[1]):
            lamp = slots[frame[k], s]
            lit[k, s] = 1.0
            if lamp < 0:
                continue
            w, far = towards(lamps, lamp, p)
            d, _, e = _past(centre, p, w, min(far, 1e9))
            a = across[k, 0] * e[0] + across[k, 1] * e[1] + across[k, 2] * e[2]
            b = down[k, 0] * e[0] + down[k, 1] * e[1] + down[k, 2] * e[2]
            lit[k, s] = _ramp(d - radius, 0.5 * math.sqrt(a * a + b * b) + 1e-6)


@njit(cache=True, parallel=True)
def sphere_in_view(eye, pixel_angle, view, distance, frame, slots, lamps, centre, radius, seen, light):
    """Fill `seen` (N,), the share of each piece that a sphere does not hide, and `light` (N, 3), the radiance of the sphere.

    The sphere is white and matte, and nothing shadows it but itself.
    """
    for k in prange(view.shape[0]):
        f = frame[k]
        o = (eye[f, 0], eye[f, 1], eye[f, 2])
        d = (-float(view[k, 0]), -float(view[k, 1]), -float(view[k, 2]))
        gap, t, _ = _past(centre, o, d, 1e9)
        free = 1.0
        if t > 0.0 and t - radius < distance[k]:
            free = _ramp(gap - radius, 0.5 * pixel_angle * t + 1e-9)
        seen[k] = free
        for c in range(3):
            light[k, c] = 0.0
        if free >= 1.0:
            continue
        # At the rim the middle of the pixel may pass by: the nearest point of the ray then stands for the surface.
        t -= math.sqrt(max(radius * radius - gap * gap, 0.0))
        p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
        n = normalize((p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]))
        for s in range(slots.shape[1]):
            lamp = slots[f, s]
            if lamp < 0:
                continue
            w, r = towards(lamps, lamp, p)
            e = max(dot(w, n), 0.0) / math.pi
            if not math.isinf(r):
                e /= r * r
            for c in range(3):
                light[k, c] += (1.0 - free) * e * lamps[lamp, LAMP_POWER + c]


@njit(cache=True, parallel=True)
def shadow_votes(position, gain, lamp_of, lamps, centres, radius, out):
    """Return into `out` how well a sphere about each centre explains dark and lit pieces.

    `gain` (N,) is the gain in chi-square if the piece is shadowed, negative where it is lit after all.
    """
    for c in prange(centres.shape[0]):
        centre = (centres[c, 0], centres[c, 1], centres[c, 2])
        total = 0.0
        for k in range(position.shape[0]):
            p = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
            w, far = towards(lamps, lamp_of[k], p)
            if _past(centre, p, w, min(far, 1e9))[0] < radius:
                total += gain[k]
        out[c] = total


@njit(cache=True, parallel=True)
def extent_share(world, rows, position, face_normal, across, down, lamp_of, lamps, radius, n, out):
    """Return into `out` the share of a ball about each lamp that each piece sees, by n x n rays.

    The ball is seen as the disc across its centre; the rays also spread over the piece.
    """
    for q in prange(rows.shape[0]):
        lamp = lamp_of[q]
        if lamp < 0:
            continue
        buffer, s = ray_buffer()
        f = rows[q]
        ng = (float(face_normal[f, 0]), float(face_normal[f, 1]), float(face_normal[f, 2]))
        free = 0
        for j in range(n):
            for i in range(n):
                # The lattice on the piece is turned against that on the disc, so that both are covered.
                a, b = (j + 0.5) / n - 0.5, ((i * 3 + j) % n + 0.5) / n - 0.5
                p = (
                    position[f, 0] + a * across[f, 0] + b * down[f, 0],
                    position[f, 1] + a * across[f, 1] + b * down[f, 1],
                    position[f, 2] + a * across[f, 2] + b * down[f, 2],
                )
                w, far = towards(lamps, lamp, p)
                t, u = basis(w)
                r, phi = math.sqrt((i + 0.5) / n) * radius, 2.0 * math.pi * ((j + 0.5) / n + 0.5 * i / n)
                x, y = r * math.cos(phi), r * math.sin(phi)
                if math.isinf(far):
                    d = normalize((w[0] + x * t[0] + y * u[0], w[1] + x * t[1] + y * u[1], w[2] + x * t[2] + y * u[2]))
                    end = np.inf
                else:
                    g = (
                        lamps[lamp, LAMP_PLACE] + x * t[0] + y * u[0] - p[0],
                        lamps[lamp, LAMP_PLACE + 1] + x * t[1] + y * u[1] - p[1],
                        lamps[lamp, LAMP_PLACE + 2] + x * t[2] + y * u[2] - p[2],
                    )
                    end = math.sqrt(dot(g, g)) * 0.999
                    d = normalize(g)
                o = leave(p, ng, d)
                free += not occluded(world.static_scene, world.dynamic_scene, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], end)
        out[q] = free / (n * n)
