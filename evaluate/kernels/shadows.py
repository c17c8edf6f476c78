"""Shadows of bodies and lamps that nobody believed in: an unseen sphere, and lamps with an extent."""

import math

import numpy as np
from numba import njit, prange

from materials.kernels.frames import basis, dot, normalize
from transport.kernels.rays import occluded, ray_buffer
from transport.kernels.shading import leave

from .fragments import LAMP_PLACE, towards


@njit(cache=True)
def _distance_to_segment(c, p, w, far):
    """Return how near the segment p + t w, 0 <= t <= far, comes to c."""
    d = (c[0] - p[0], c[1] - p[1], c[2] - p[2])
    t = min(max(dot(d, w), 0.0), far)
    e = (d[0] - t * w[0], d[1] - t * w[1], d[2] - t * w[2])
    return math.sqrt(dot(e, e))


@njit(cache=True, parallel=True)
def sphere_shadow(position, across, down, view, distance, frame, slots, lamps, centre, radius, lit, seen):
    """Fill `lit` (N, S), the share of each piece that lamps reach past a sphere, and `seen` (N,), that the camera does.

    The border of the shadow is smoothed over the extent of the piece, so that both are smooth in centre and radius.
    """
    for k in prange(position.shape[0]):
        p = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
        extent = 0.0
        for m in range(3):
            extent += across[k, m] * across[k, m] + down[k, m] * down[k, m]
        extent = 0.5 * math.sqrt(extent) + 1e-6
        v = (float(view[k, 0]), float(view[k, 1]), float(view[k, 2]))
        d = _distance_to_segment(centre, p, v, float(distance[k]))
        seen[k] = min(max(0.5 + 0.5 * (d - radius) / extent, 0.0), 1.0)
        for s in range(slots.shape[1]):
            lamp = slots[frame[k], s]
            lit[k, s] = 1.0
            if lamp < 0:
                continue
            w, far = towards(lamps, lamp, p)
            d = _distance_to_segment(centre, p, w, min(far, 1e9))
            lit[k, s] = min(max(0.5 + 0.5 * (d - radius) / extent, 0.0), 1.0)


@njit(cache=True, parallel=True)
def shadow_votes(position, weight_dark, weight_lit, lamp_of, lamps, centres, radius, out):
    """Return into `out` how well a sphere about each centre explains dark and lit pieces.

    `weight_dark` is the gain in chi-square if the piece is shadowed, negative where it is lit after all.
    """
    for c in prange(centres.shape[0]):
        centre = (centres[c, 0], centres[c, 1], centres[c, 2])
        total = 0.0
        for k in range(position.shape[0]):
            p = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
            w, far = towards(lamps, lamp_of[k], p)
            if _distance_to_segment(centre, p, w, min(far, 1e9)) < radius:
                total += weight_dark[k]
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
