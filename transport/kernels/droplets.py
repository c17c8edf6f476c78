"""Drops on the windshield: rays from a thin lens, refracted by water, to the world behind.

The glass itself is left out: its sheets bend no ray, they only shift it, and what it takes from the light the picture has
lost already. So light enters a drop through the flat face on the glass as from air, without loss, and leaves it through the
curved one, by Fresnel's shares.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange

from materials.kernels.frames import dot, normalize, refract
from materials.kernels.fresnel import dielectric
from materials.kernels.lean import lean

from .optics import camera_ray
from .rays import hit_normal, intersect, ray_buffer
from .sampler import draw2, hash2
from .tiles import TILE
from .wet import reflected_radiance

_FAR = 1e30
# Encounters of a ray with drops; what is still under way then has lost all but some 1e-4 of its light.
_ENCOUNTERS = 24
# Off the surface [m]: some units in the last place of float32 at 0.3 m, a hundredth of the smallest drop.
_STEP = 1e-6
_PIXEL, _LENS, _STREAM = 0, 50, 60
_NOWHERE = (0.0, 0.0, 0.0)


class DropArrays(NamedTuple):
    """The surface of all drops in the camera's frame, and the lens."""

    scene: int
    faces: Any  # (F, 3) uint32
    normals: Any  # (V, 3) float32
    glass_normal: Any  # (3,) float64, away from the camera
    R: Any  # (3, 3) float64, camera to world
    t: Any  # (3,) float64
    eta: float
    aperture_radius: float
    focus_distance: float


@lean()
def _world(drops, v):
    """Return a camera vector in the world."""
    R = drops.R
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@lean()
def _camera(drops, v):
    """Return a world vector in the camera's frame."""
    R = drops.R
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@lean()
def lens_ray(drops, d, u0, u1):
    """Return origin and direction, in the camera's frame, of a ray of the thin lens that meets the pinhole's d in focus."""
    r, phi = drops.aperture_radius * math.sqrt(u0), 2.0 * math.pi * u1
    o = (r * math.cos(phi), r * math.sin(phi), 0.0)
    s = drops.focus_distance / d[2]
    return o, normalize((s * d[0] - o[0], s * d[1] - o[1], s * d[2] - o[2]))


@lean()
def _normal(drops, face, b1, b2, ng):
    """Return the normal of a drop, outwards: that of the field, but on the glass the glass's."""
    if dot(ng, (drops.glass_normal[0], drops.glass_normal[1], drops.glass_normal[2])) < -0.999:
        return ng
    n, b0 = drops.normals, 1.0 - b1 - b2
    i, j, k = drops.faces[face, 0], drops.faces[face, 1], drops.faces[face, 2]
    m = normalize(
        (
            n[i, 0] * b0 + n[j, 0] * b1 + n[k, 0] * b2,
            n[i, 1] * b0 + n[j, 1] * b1 + n[k, 1] * b2,
            n[i, 2] * b0 + n[j, 2] * b1 + n[k, 2] * b2,
        )
    )
    return m if dot(m, ng) > 0.0 else ng


@lean()
def refracted(drops, buffer, s, state, o, d):
    """Return (number of encounters, origin, direction, weight) of a ray behind the drops; weight 0 is light that is lost."""
    inside = False
    for k in range(_ENCOUNTERS):
        face, t, b1, b2 = intersect(drops.scene, 0, 0, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], _FAR)
        if face < 0:
            # A ray within a drop cannot miss its surface but through a gap of rounding; it goes on as it is.
            towards = dot(d, (drops.glass_normal[0], drops.glass_normal[1], drops.glass_normal[2]))
            return k, o, d, 1.0 if towards > 0.0 else 0.0
        ng = normalize(hit_normal(buffer, s))
        p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
        # Faces look outwards, so the side that is met tells inside from outside, whatever rounding did before.
        inside = dot(ng, d) > 0.0
        n = _normal(drops, face, b1, b2, ng)
        if inside:
            n, ng = (-n[0], -n[1], -n[2]), (-ng[0], -ng[1], -ng[2])
        w = (-d[0], -d[1], -d[2])
        cos_w = dot(w, n)
        if cos_w <= 0.0:
            n, cos_w = ng, dot(w, ng)
        eta = 1.0 / drops.eta if inside else drops.eta
        bent, _ = refract(w, n, eta)
        on_glass = not inside and k == 0
        share = 0.0 if on_glass else dielectric(cos_w, eta)
        u, _ = draw2(state, np.uint32(k), 0)
        if u < share or dot(bent, ng) >= 0.0:
            d = normalize((d[0] + 2.0 * cos_w * n[0], d[1] + 2.0 * cos_w * n[1], d[2] + 2.0 * cos_w * n[2]))
            if dot(d, ng) <= 0.0:
                return k + 1, p, d, 0.0
            step = _STEP
        else:
            d = normalize(bent)
            step = -_STEP
        o = (p[0] + step * ng[0], p[1] + step * ng[1], p[2] + step * ng[2])
    return _ENCOUNTERS, o, d, 0.0


@njit(cache=True, parallel=True)
def droplet_pass(world, picture, diffuse, ground, medium, camera, drops, count, seed, bounces, light, square, covered):
    """Add `count` samples of every pixel to the sums.

    light : (H, W, 3) float64, radiance that comes through drops
    square : (H, W, 3) float64, its square
    covered : (H, W) float64, samples that met a drop
    """
    height, width = covered.shape
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (height + TILE - 1) // TILE
    for tile in prange(tiles_x * tiles_y):
        buffer, s = ray_buffer()
        x0, y0 = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        for row in range(y0, min(y0 + TILE, height)):
            for col in range(x0, min(x0 + TILE, width)):
                stream = hash2(np.uint32(row * width + col), np.uint32(seed))
                own = hash2(stream, np.uint32(_STREAM))
                for i in range(count):
                    jx, jy = draw2(stream, i, _PIXEL)
                    _, d = camera_ray(camera, col + jx, row + jy)
                    u0, u1 = draw2(stream, i, _LENS)
                    o, d = lens_ray(drops, _camera(drops, d), u0, u1)
                    met, o, d, weight = refracted(drops, buffer, s, hash2(own, np.uint32(i)), o, d)
                    if met == 0:
                        continue
                    covered[row, col] += 1.0
                    if weight <= 0.0:
                        continue
                    q, d = _world(drops, o), _world(drops, d)
                    p = (q[0] + drops.t[0], q[1] + drops.t[1], q[2] + drops.t[2])
                    e = reflected_radiance(
                        world, picture, diffuse, ground, medium, buffer, s, own, i, p, d, _NOWHERE, weight, bounces
                    )
                    for c in range(3):
                        light[row, col, c] += e[c]
                        square[row, col, c] += e[c] * e[c]
