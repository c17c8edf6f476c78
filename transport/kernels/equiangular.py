"""Light of points scattered once along a stretch of a ray, drawn by the angle under which the light sees it.

C. Kulla and M. Fajardo, "Importance Sampling Techniques for Path Tracing in Participating Media", 2012, section 4.1: equal angles
get equal shares, which cancels the 1 / r^2 that makes collisions near a point of light rare and bright. Collisions (density:
extinction times transmittance) draw the same integral, and are better far from the light: both are combined by the power
heuristic. For media whose optical depth has a closed form, in the air.
"""

import math

from materials.kernels import phase
from materials.kernels.frames import dot
from materials.kernels.lean import lean

from .arrays import POINT_POSITION
from .bodies import passage
from .lights import first_point, sample_light
from .media import GRID, density_at, optical_depth, phase_of, span, tracking
from .shading import power_heuristic

_AIR = -1


@lean()
def stretch(medium, body, o, d, far):
    """Return where the stretch of a ray begins and ends along which points are drawn; (0, 0) where they are not."""
    if body != _AIR or medium.kind >= GRID or medium.sigma_t <= 0.0:
        return 0.0, 0.0
    t0, t1 = span(medium, o, d, far)
    return (t0, t1) if t0 < t1 else (0.0, 0.0)


@lean(error_model="numpy")
def _angles(lights, k, o, d, t0, t1):
    """Return (nearest place on the ray, distance of light k from it, angles of both ends from there); distance 0: on the ray."""
    row = lights.points[k]
    q = (row[POINT_POSITION] - o[0], row[POINT_POSITION + 1] - o[1], row[POINT_POSITION + 2] - o[2])
    near = dot(q, d)
    x = (q[0] - near * d[0], q[1] - near * d[1], q[2] - near * d[2])
    height = math.sqrt(dot(x, x))
    if height <= 1e-9:
        return near, 0.0, 0.0, 0.0
    return near, height, math.atan((t0 - near) / height), math.atan((t1 - near) / height)


@lean(error_model="numpy")
def angle_density(lights, k, o, d, t0, t1, t):
    """Return the density [1/m] with which point light k draws a distance t; 0 without a stretch, or where it is on the ray."""
    if t0 >= t1:
        return 0.0
    near, height, a, b = _angles(lights, k, o, d, t0, t1)
    if height == 0.0 or b <= a:
        return 0.0
    x = (t - near) / height
    return 1.0 / ((b - a) * height * (1.0 + x * x))


@lean(error_model="numpy")
def scattered_light(world, lights, medium, bodies, buffer, s, stream, index, dimension, u, o, d, t0, t1):
    """Return the light of all points that is scattered once between t0 and t1 and turned against a ray along d.

    The part of it that is drawn by angle; `airlight` adds that of collisions. `u` in [0, 1) chooses the places.
    """
    r = g = b = 0.0
    turns = phase_of(medium)
    for k in range(lights.points.shape[0]):
        near, height, a0, a1 = _angles(lights, k, o, d, t0, t1)
        if height == 0.0 or a1 <= a0:
            continue
        # Not the number itself for every light: two lights close together would share their noise.
        v = u + 0.6180339887498949 * k
        x = math.tan(a0 + (v - math.floor(v)) * (a1 - a0))
        t = min(max(near + height * x, t0), t1)
        density = 1.0 / ((a1 - a0) * height * (1.0 + x * x))
        p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
        sigma, through = density_at(medium, p), math.exp(-optical_depth(medium, o, d, t0, t))
        if sigma * through <= 0.0:
            continue
        i = first_point(lights) + k
        wi, far, e, _ = sample_light(lights, i, p, 0.0, 0.0)
        w = power_heuristic(density, sigma * through) * phase.evaluate(turns, dot(d, wi)) * sigma * through / density
        if w * (e[0] + e[1] + e[2]) <= 0.0:
            continue
        w *= passage(world, medium, bodies, _AIR, buffer, s, tracking(stream, index, dimension + k), p, wi, far)
        r += w * medium.albedo[0] * e[0]
        g += w * medium.albedo[1] * e[1]
        b += w * medium.albedo[2] * e[2]
    return r, g, b
