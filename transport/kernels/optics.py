"""Rays of a camera with a lens that bends and blurs, and a shutter that takes its time."""

import math
from typing import Any, NamedTuple

from materials.kernels.frames import dot
from materials.kernels.lean import lean

from .sampler import draw1, draw2

# Dimensions of the sampler that no bounce reaches.
_LENS, _TIME = 0x7FFFFFF0, 0x7FFFFFF1


class OpticsArrays(NamedTuple):
    """Intrinsics, Brown-Conrady's distortion, a thin lens, and the way of the camera while its shutter is open.

    Times are shares of the way from `R`, `t` to the end: turned by `angle` about `axis` (in the camera's frame), moved by
    `way`. Row r of `rows` is exposed from `readout` r / rows on, for `exposure`.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    aperture_radius: float
    focus_distance: float
    rows: int
    R: Any  # (3, 3) float64, camera to world at the start
    t: Any  # (3,) float64
    axis: Any  # (3,) float64
    angle: float
    way: Any  # (3,) float64
    exposure: float
    readout: float


@lean()
def camera_ray(camera, x, y):
    """Return origin and unit direction of the ray through pixel position (x, y)."""
    c, sx, sy = camera.corner, camera.step_x, camera.step_y
    v = (c[0] + x * sx[0] + y * sy[0], c[1] + x * sx[1] + y * sy[1], c[2] + x * sx[2] + y * sy[2])
    if camera.orthographic:
        return v, (camera.forward[0], camera.forward[1], camera.forward[2])
    length = math.sqrt(dot(v, v))
    return (camera.origin[0], camera.origin[1], camera.origin[2]), (v[0] / length, v[1] / length, v[2] / length)


@lean(error_model="numpy")
def undistort(q, x, y):
    """Return the undistorted place of a distorted one, both at depth 1, by Newton's steps (as `Camera.rays`)."""
    u, v = x, y
    for _ in range(20):
        r2 = u * u + v * v
        radial, slope = 1.0 + r2 * (q.k1 + r2 * q.k2), 2.0 * q.k1 + 4.0 * r2 * q.k2
        ex = u * radial + 2.0 * q.p1 * u * v + q.p2 * (r2 + 2.0 * u * u) - x
        ey = v * radial + q.p1 * (r2 + 2.0 * v * v) + 2.0 * q.p2 * u * v - y
        a = radial + slope * u * u + 2.0 * q.p1 * v + 6.0 * q.p2 * u
        b = slope * u * v + 2.0 * q.p1 * u + 2.0 * q.p2 * v
        d = radial + slope * v * v + 6.0 * q.p1 * v + 2.0 * q.p2 * u
        det = a * d - b * b
        su, sv = (d * ex - b * ey) / det, (a * ey - b * ex) / det
        u, v = u - su, v - sv
        if abs(su) + abs(sv) < 1e-13:
            break
    return u, v


@lean()
def _turned(q, v, angle):
    """Return v turned about the axis (Rodrigues)."""
    k = (q.axis[0], q.axis[1], q.axis[2])
    c, s = math.cos(angle), math.sin(angle)
    kv = dot(k, v) * (1.0 - c)
    return (
        c * v[0] + s * (k[1] * v[2] - k[2] * v[1]) + kv * k[0],
        c * v[1] + s * (k[2] * v[0] - k[0] * v[2]) + kv * k[1],
        c * v[2] + s * (k[0] * v[1] - k[1] * v[0]) + kv * k[2],
    )


@lean(error_model="numpy")
def optics_ray(q, x, y, lens, time):
    """Return origin and unit direction of a ray through pixel position (x, y), a point of [0, 1)² on the lens, and a time."""
    u, v = (x - q.cx) / q.fx, (y - q.cy) / q.fy
    if q.k1 != 0.0 or q.k2 != 0.0 or q.p1 != 0.0 or q.p2 != 0.0:
        u, v = undistort(q, u, v)
    o, d = (0.0, 0.0, 0.0), (u, v, 1.0)
    if q.aperture_radius > 0.0:
        r, phi = q.aperture_radius * math.sqrt(lens[0]), 2.0 * math.pi * lens[1]
        o = (r * math.cos(phi), r * math.sin(phi), 0.0)
        # Every ray of the pixel meets the plane of focus at one point; infinity leaves them parallel.
        d = (u - o[0] / q.focus_distance, v - o[1] / q.focus_distance, 1.0)
    tau = q.readout * math.floor(y) / q.rows + q.exposure * time
    if q.angle != 0.0:
        o, d = _turned(q, o, tau * q.angle), _turned(q, d, tau * q.angle)
    R = q.R
    n = 1.0 / math.sqrt(dot(d, d))
    return (
        q.t[0] + tau * q.way[0] + R[0, 0] * o[0] + R[0, 1] * o[1] + R[0, 2] * o[2],
        q.t[1] + tau * q.way[1] + R[1, 0] * o[0] + R[1, 1] * o[1] + R[1, 2] * o[2],
        q.t[2] + tau * q.way[2] + R[2, 0] * o[0] + R[2, 1] * o[1] + R[2, 2] * o[2],
    ), (
        (R[0, 0] * d[0] + R[0, 1] * d[1] + R[0, 2] * d[2]) * n,
        (R[1, 0] * d[0] + R[1, 1] * d[1] + R[1, 2] * d[2]) * n,
        (R[2, 0] * d[0] + R[2, 1] * d[1] + R[2, 2] * d[2]) * n,
    )


@lean()
def sample_ray(camera, optics, stream, index, x, y):
    """Return the ray of a sample: that of the pinhole where `optics` is None, else one through lens and shutter."""
    if optics is None:
        return camera_ray(camera, x, y)
    return optics_ray(optics, x, y, draw2(stream, index, _LENS), draw1(stream, index, _TIME))


@lean()
def central_ray(camera, optics, x, y):
    """Return the ray through the middle of the lens, in the middle of the exposure."""
    if optics is None:
        return camera_ray(camera, x, y)
    # u0 = 0 is the middle of the lens.
    return optics_ray(optics, x, y, (0.0, 0.0), 0.5)
