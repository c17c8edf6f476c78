"""The specular light of dry and wet ground, traced in a world that a photograph lights (thesis 6.4.3, 6.4.4).

A ray through the pixel finds the ground; the water level there sets index, roughness and normal; per sample one visible
microfacet is drawn, and the mirrored ray brings the radiance of what it meets. Ground that is met again (a kerb) reflects
again. Dry and wet passes draw the same numbers, so where no water is they agree to the last bit.

Functions are inlined by force: their named tuples hold dozens of arrays, which calls would copy for every ray (measured:
1.6 times as fast).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit, prange

from materials.kernels import phase
from materials.kernels.frames import basis, dot, reflect, to_local, to_world
from materials.kernels.fresnel import dielectric
from materials.kernels.lean import lean
from materials.kernels.microfacet import sample_visible, smith_lambda
from materials.kernels.wetness import levels, wet_lobe

from .emitters import FAR
from .media import flight, phase_of, tracking, uniform
from .optics import camera_ray
from .projected import GROUND, faces_viewer, nearest, project, radiance_of, role_of, sky_radiance
from .rays import ray_buffer
from .sampler import draw2, hash2
from .shading import leave, shading_normal
from .tiles import TILE

_PER_BOUNCE = 4
# Below this width the lobe is narrower than a pixel's own angle; the floor keeps the microfacet formulas finite.
_ALPHA_MIN = 1e-3
# Mirrored rays per ray of the camera. The picture's noise comes from the lobe: two cost 12 % less time at equal error
# than one, four no less than two (measured on a KITTI drive at 16 and 64 samples).
SPLIT = 2
_COLLISIONS = 256


class WetGround(NamedTuple):
    """The ground of a frame: the picture's relief per pixel, and the water on the world-fixed grid."""

    roughness: Any  # (H, W) float32, perceptual
    normal: Any  # (H, W, 3) float32, world
    attenuation: Any  # (H, W, 3) float32: factor on diffuse light where the pores are full
    water: Any  # (rows, cols) float32: water level W
    water_normal: Any  # (rows, cols, 3) float32
    x_min: float
    y_min: float
    cell: float
    eta: float
    rho: float
    strength: float
    mean_roughness: float


@lean(forceinline=True)
def _grid_weights(ground, p):
    """Return (row0, row1, col0, col1, fraction along rows, along cols) of a world point on the grid, clamped to it."""
    rows, cols = ground.water.shape[0], ground.water.shape[1]
    y = min(max((p[1] - ground.y_min) / ground.cell - 0.5, 0.0), rows - 1.0)
    x = min(max((p[0] - ground.x_min) / ground.cell - 0.5, 0.0), cols - 1.0)
    r0, c0 = int(y), int(x)
    return r0, min(r0 + 1, rows - 1), c0, min(c0 + 1, cols - 1), y - r0, x - c0


@lean(forceinline=True)
def water_at(ground, p):
    """Return the water level at a world point, bilinear."""
    r0, r1, c0, c1, ay, ax = _grid_weights(ground, p)
    top = ground.water[r0, c0] * (1.0 - ax) + ground.water[r0, c1] * ax
    bottom = ground.water[r1, c0] * (1.0 - ax) + ground.water[r1, c1] * ax
    return top * (1.0 - ay) + bottom * ay


@lean(forceinline=True)
def _water_normal(ground, p):
    """Return the normal of the water's surface at a world point; the map varies over metres, the nearest cell will do."""
    r0, r1, c0, c1, ay, ax = _grid_weights(ground, p)
    r, c = r1 if ay > 0.5 else r0, c1 if ax > 0.5 else c0
    return (float(ground.water_normal[r, c, 0]), float(ground.water_normal[r, c, 1]), float(ground.water_normal[r, c, 2]))


@lean(forceinline=True)
def lobe_at(ground, row, col, p, level):
    """Return (eta, roughness, normal) of the ground that a pixel shows, under a water level at p."""
    n = (float(ground.normal[row, col, 0]), float(ground.normal[row, col, 1]), float(ground.normal[row, col, 2]))
    w_sat, w_acc = levels(level)
    water_n = _water_normal(ground, p) if w_acc > 0.0 else n
    return wet_lobe(ground.eta, ground.roughness[row, col], n, water_n, ground.rho, w_sat, w_acc, ground.strength)


@lean(forceinline=True)
def mirrored(eta, roughness, n, ng, wo, u0, u1):
    """Sample the specular lobe about n: return (direction, weight), weight 0 if the ray would enter the ground."""
    if dot(n, wo) < 0.01:
        # A relief seen at so low an angle that its facet turns away: the smooth ground is what remains visible.
        n = ng
    t, b = basis(n)
    o = to_local(wo, t, b, n)
    if o[2] <= 0.0:
        return n, 0.0
    alpha = max(roughness * roughness, _ALPHA_MIN)
    h = sample_visible(o, alpha, alpha, u0, u1)
    i = reflect(o, h)
    if i[2] <= 0.0:
        return n, 0.0
    d = to_world(i, t, b, n)
    if dot(d, ng) <= 0.0:
        return n, 0.0
    # f cos / pdf of a visible normal is F G2 / G1 (Heitz 2018), with the height-correlated G2.
    lo, li = smith_lambda(o, alpha, alpha), smith_lambda(i, alpha, alpha)
    return d, dielectric(dot(o, h), eta) * (1.0 + lo) / (1.0 + lo + li)


@lean()
def wander(picture, world, medium, buffer, s, state, o, d):
    """Follow a ray from particle to particle; return what it meets at last (as `nearest`), its direction then, and its weight.

    The weight is that of the albedos, which are grey here; 0 where the light is still under way after so many collisions
    that mist is a white wall.
    """
    weight = 1.0
    for k in range(_COLLISIONS):
        face, b1, b2, q, nq = nearest(picture, world, buffer, s, o, d, False)
        x, y, z = q[0] - o[0], q[1] - o[1], q[2] - o[2]
        far = math.sqrt(x * x + y * y + z * z) if face >= 0 else FAR
        step = hash2(state, np.uint32(k))
        t = flight(medium, o, d, far, uniform(step, 1), hash2(step, np.uint32(2)))
        if t >= far:
            return face, b1, b2, q, nq, d, weight
        weight *= medium.albedo[0]
        o = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
        d = phase.sample(phase_of(medium), d, uniform(step, 3), uniform(step, 4))
    return -1, 0.0, 0.0, o, d, d, 0.0


@lean(forceinline=True)
def reflected_radiance(world, picture, diffuse, ground, medium, buffer, s, stream, index, p, d, ng, weight, bounces):
    """Return the radiance that comes back along a mirrored ray, times `weight`.

    `diffuse` is the picture without the ground's own gloss; dry ground met on the way keeps its whole radiance. Where
    `medium` is not None, light collides in it on its way.
    """
    r = g = b = 0.0
    o = leave(p, ng, d)
    for bounce in range(1, bounces + 1):
        if medium is None:
            face, b1, b2, q, nq = nearest(picture, world, buffer, s, o, d, False)
        else:
            state = tracking(stream, index, 1 + bounce * _PER_BOUNCE)
            face, b1, b2, q, nq, d, albedo = wander(picture, world, medium, buffer, s, state, o, d)
            weight *= albedo
            if weight <= 0.0:
                return r, g, b
        if face < 0:
            e = sky_radiance(picture, d)
            return r + weight * e[0], g + weight * e[1], b + weight * e[2]
        water = water_at(ground, q) if role_of(picture, world, face) == GROUND else 0.0
        if water <= 0.0:
            e = radiance_of(picture, picture.texels, world, face, b1, b2, q)
            return r + weight * e[0], g + weight * e[1], b + weight * e[2]
        w_sat, w_acc = levels(water)
        # Where the path ends, the gloss that the picture shows stands in for the one that is not traced any more.
        layer = picture.texels if bounce == bounces else diffuse
        e = radiance_of(picture, layer, world, face, b1, b2, q)
        x, y, z = project(picture.P, q)
        inside = z > 0.05 and 0.0 <= x < diffuse.shape[1] and 0.0 <= y < diffuse.shape[0]
        for c in range(3):
            full = ground.attenuation[int(y), int(x), c] if inside else ground.rho
            v = weight * e[c] * (1.0 + (full - 1.0) * w_sat)
            if c == 0:
                r += v
            elif c == 1:
                g += v
            else:
                b += v
        if bounce == bounces:
            return r, g, b
        wo = (-d[0], -d[1], -d[2])
        ng = faces_viewer(nq, wo)
        n = faces_viewer(shading_normal(world, face, b1, b2), ng)
        eta, roughness, n = wet_lobe(
            ground.eta, ground.mean_roughness, n, _water_normal(ground, q), ground.rho, w_sat, w_acc, ground.strength
        )
        u0, u1 = draw2(stream, index, 1 + bounce * _PER_BOUNCE)
        d, f = mirrored(eta, roughness, n, ng, wo, u0, u1)
        if f <= 0.0:
            return r, g, b
        weight *= f
        o = leave(q, ng, d)
    return r, g, b


@njit(cache=True, parallel=True)
def specular_pass(
    world, picture, diffuse, ground, camera, wanted, first, count, seed, bounces, specular, square, dimming, share, wetness
):
    """Add samples `first` to `first + count` of every wanted pixel to the sums; `first` is a multiple of `SPLIT`.

    specular : (H, W, 3) float64, the ground's specular radiance
    square : (H, W, 3) float64, its mean over each camera ray, squared, times the samples of that ray; samples that share a
        ray are not independent, so their own squares would understate the noise where the ray finds the ground by chance
    dimming : (H, W, 3) float64, change of the factor on diffuse light (0 dry), set from the whole saturation
    share : (H, W) float64, samples that saw the ground
    wetness : (H, W, 2) float64, saturation and accumulation
    """
    height, width = wanted.shape
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (height + TILE - 1) // TILE
    for tile in prange(tiles_x * tiles_y):
        buffer, s = ray_buffer()
        x0, y0 = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        for row in range(y0, min(y0 + TILE, height)):
            for col in range(x0, min(x0 + TILE, width)):
                if not wanted[row, col]:
                    continue
                stream = hash2(np.uint32(row * width + col), np.uint32(seed))
                # Sums go on from where they stand, so that samples added later give the bits of one long run.
                r, g, b = specular[row, col, 0], specular[row, col, 1], specular[row, col, 2]
                rr, gg, bb = square[row, col, 0], square[row, col, 1], square[row, col, 2]
                saturation, accumulation = wetness[row, col, 0], wetness[row, col, 1]
                seen = 0
                for k in range(first // SPLIT, (first + count + SPLIT - 1) // SPLIT):
                    jx, jy = draw2(stream, k, 0)
                    o, d = camera_ray(camera, col + jx, row + jy)
                    face, _, _, p, ng = nearest(picture, world, buffer, s, o, d, True)
                    if face < 0 or role_of(picture, world, face) != GROUND:
                        continue
                    wo = (-d[0], -d[1], -d[2])
                    ng = faces_viewer(ng, wo)
                    level = water_at(ground, p)
                    w_sat, w_acc = levels(level)
                    eta, roughness, n = lobe_at(ground, row, col, p, level)
                    start, stop = max(first, k * SPLIT), min(first + count, (k + 1) * SPLIT)
                    er = eg = eb = 0.0
                    for i in range(start, stop):
                        seen += 1
                        saturation += w_sat
                        accumulation += w_acc
                        u0, u1 = draw2(stream, i, 1)
                        wi, weight = mirrored(eta, roughness, n, ng, wo, u0, u1)
                        if weight <= 0.0:
                            continue
                        e = reflected_radiance(
                            world, picture, diffuse, ground, None, buffer, s, stream, i, p, wi, ng, weight, bounces
                        )
                        er, eg, eb = er + e[0], eg + e[1], eb + e[2]
                    r, g, b = r + er, g + eg, b + eb
                    share_of_ray = 1.0 / (stop - start)
                    rr, gg, bb = rr + er * er * share_of_ray, gg + eg * eg * share_of_ray, bb + eb * eb * share_of_ray
                share[row, col] += seen
                wetness[row, col, 0], wetness[row, col, 1] = saturation, accumulation
                for c in range(3):
                    dimming[row, col, c] = (ground.attenuation[row, col, c] - 1.0) * saturation
                    specular[row, col, c] = r if c == 0 else (g if c == 1 else b)
                    square[row, col, c] = rr if c == 0 else (gg if c == 1 else bb)


@njit(cache=True, parallel=True)
def first_seen(world, picture, camera, face, b1, b2, depth):
    """Fill (H, W) arrays with what each pixel's centre sees through the cut-outs of the cardboards."""
    for row in prange(camera.height):
        buffer, s = ray_buffer()
        for col in range(camera.width):
            o, d = camera_ray(camera, col + 0.5, row + 0.5)
            f, u, v, p, _ = nearest(picture, world, buffer, s, o, d, True)
            face[row, col], b1[row, col], b2[row, col] = f, u, v
            depth[row, col] = project(picture.P, p)[2] if f >= 0 else math.inf
