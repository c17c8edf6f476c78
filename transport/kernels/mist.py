"""A projected picture seen through mist: how much of it is let through, and what the mist scatters towards the camera.

The transmittance of a pixel multiplies its own light, so its noise would show in every detail. It is estimated by evenly
spaced, jittered points along the ray, whose mean optical depth is nearly free of noise, and made unbiased by a power
series that roulette ends early: M. Kettunen et al., "An Unbiased Ray-Marching Transmittance Estimator", 2021. Scattered
light comes from delta tracking. Drops turn light by little, so most of it is that of the picture around the pixel: with
that guess for a control variate, the chance of a collision brings noise only where the guess is wrong.
"""

import math

import numpy as np
from numba import njit, prange

from materials.kernels import phase
from materials.kernels.frames import dot
from materials.kernels.lean import lean

from .emitters import FAR
from .media import flight, phase_of, span, spray_extinction, tracking, uniform, wake_span
from .optics import camera_ray
from .projected import GROUND, faces_viewer, nearest, role_of
from .rays import ray_buffer
from .sampler import draw1, draw2, hash2
from .tiles import TILE
from .wet import lobe_at, mirrored, reflected_radiance, water_at

# Distance of the points [m], about two of the noise's largest cells, and how many there are at the least and the most.
_SPACING, _FEWEST, _MOST = 1.0, 8, 256
# The same within the box of the wakes, which begin as narrow as a tyre and are half a metre wide soon.
_WAKE_SPACING = 0.25
# Chance to go on with the power series beyond its first term, which is always taken.
_GO_ON = 0.25
# Dimensions of the sampler besides 0, the pixel.
_FLIGHT, _TURN, _LOBE, _DEPTH = 40, 41, 1, 42
_NOWHERE = (0.0, 0.0, 0.0)


@lean(error_model="numpy")
def _depth(medium, sigma, wakes, spacing, o, d, t0, t1, u):
    """Return an unbiased estimate of the optical depth from t0 to t1 from points that u in [0, 1) moves along."""
    if t0 >= t1:
        return 0.0
    count = min(max(int((t1 - t0) / spacing), _FEWEST), _MOST)
    step = (t1 - t0) / count
    total = 0.0
    for i in range(count):
        t = t0 + (i + u) * step
        total += spray_extinction(medium, (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]), sigma, wakes)
    return total * step


@lean(error_model="numpy")
def _depths(medium, o, d, t0, t1, w0, w1, u):
    """Return the sum of the optical depths of mist, from t0 to t1, and of wakes, from w0 to w1."""
    none = medium.wakes[:0]
    total = _depth(medium, medium.sigma_t, none, _SPACING, o, d, t0, t1, u) if medium.sigma_t > 0.0 else 0.0
    return total + _depth(medium, 0.0, medium.wakes, _WAKE_SPACING, o, d, w0, w1, u)


@lean(error_model="numpy")
def even_transmittance(medium, o, d, far, state):
    """Return an unbiased estimate of the transmittance, of little noise, of spray and mist."""
    t0, t1 = span(medium, o, d, far)
    if t0 >= t1:
        return 1.0
    w0, w1 = wake_span(medium, o, d, far)
    # exp(-tau) = exp(-x0) exp(x0 - tau), the second factor as a power series in independent estimates of tau.
    x0 = _depths(medium, o, d, t0, t1, w0, w1, uniform(state, 0))
    series, term, k = 1.0, 1.0, 1
    while True:
        term *= (x0 - _depths(medium, o, d, t0, t1, w0, w1, uniform(state, 2 * k))) / k
        series += term
        if uniform(state, 2 * k + 1) >= _GO_ON:
            return math.exp(-x0) * series
        term /= _GO_ON
        k += 1


@lean()
def _through(world, picture, diffuse, ground, medium, buffer, s, stream, index, p, d, ng, weight, bounces):
    """As `reflected_radiance` through the medium; a function of its own keeps one copy of it."""
    return reflected_radiance(world, picture, diffuse, ground, medium, buffer, s, stream, index, p, d, ng, weight, bounces)


@lean()
def _gloss_change(world, picture, diffuse, ground, medium, buffer, s, stream, index, row, col, p, ng, d, bounces):
    """Return by how much mist changes the specular light of the ground that a ray of the camera sees at p."""
    wo = (-d[0], -d[1], -d[2])
    ng = faces_viewer(ng, wo)
    eta, roughness, n = lobe_at(ground, row, col, p, water_at(ground, p))
    u0, u1 = draw2(stream, index, _LOBE)
    wi, weight = mirrored(eta, roughness, n, ng, wo, u0, u1)
    if weight <= 0.0:
        return 0.0, 0.0, 0.0
    e = _through(world, picture, diffuse, ground, medium, buffer, s, stream, index, p, wi, ng, weight, bounces)
    f = reflected_radiance(world, picture, diffuse, ground, None, buffer, s, stream, index, p, wi, ng, weight, bounces)
    return e[0] - f[0], e[1] - f[1], e[2] - f[2]


@njit(cache=True, parallel=True)
def mist_pass(
    world, picture, diffuse, ground, medium, camera, around, count, every, seed, bounces, scattered, square, passed, gloss
):
    """Add `count` samples of every pixel to the sums; every `every`-th also estimates the transmittance.

    around : (H, W, 3) float32, a guess of the radiance that collisions turn to the camera
    scattered : (H, W, 3) float64, radiance that they do turn to it, less `around` for each collision
    square : (H, W, 3) float64, its square
    passed : (H, W) float64, transmittance, `ceil(count / every)` estimates
    gloss : (H, W, 3) float64, change of the ground's specular radiance where it leaves the ground
    """
    height, width = passed.shape
    tiles_x = (width + TILE - 1) // TILE
    tiles_y = (height + TILE - 1) // TILE
    for tile in prange(tiles_x * tiles_y):
        buffer, s = ray_buffer()
        x0, y0 = (tile % tiles_x) * TILE, (tile // tiles_x) * TILE
        for row in range(y0, min(y0 + TILE, height)):
            for col in range(x0, min(x0 + TILE, width)):
                stream = hash2(np.uint32(row * width + col), np.uint32(seed))
                for i in range(count):
                    jx, jy = draw2(stream, i, 0)
                    o, d = camera_ray(camera, col + jx, row + jy)
                    face, _, _, p, ng = nearest(picture, world, buffer, s, o, d, True)
                    x = (p[0] - o[0], p[1] - o[1], p[2] - o[2])
                    far = math.sqrt(dot(x, x)) if face >= 0 else FAR
                    if i % every == 0:
                        passed[row, col] += even_transmittance(medium, o, d, far, tracking(stream, i, _DEPTH))
                    if face >= 0 and role_of(picture, world, face) == GROUND:
                        e = _gloss_change(
                            world, picture, diffuse, ground, medium, buffer, s, stream, i, row, col, p, ng, d, bounces
                        )
                        for c in range(3):
                            gloss[row, col, c] += e[c]
                    t = flight(medium, o, d, far, draw1(stream, i, _FLIGHT), tracking(stream, i, _FLIGHT))
                    if t >= far:
                        continue
                    q = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
                    u0, u1 = draw2(stream, i, _TURN)
                    turned = phase.sample(phase_of(medium), d, u0, u1)
                    # Numbers of their own, or the path would share them with that of the gloss.
                    own = hash2(stream, np.uint32(_TURN))
                    weight = medium.albedo[0]
                    e = _through(world, picture, diffuse, ground, medium, buffer, s, own, i, q, turned, _NOWHERE, weight, bounces)
                    for c in range(3):
                        more = e[c] - around[row, col, c]
                        scattered[row, col, c] += more
                        square[row, col, c] += more * more
