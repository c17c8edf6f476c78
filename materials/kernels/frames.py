"""Directions in the local frame of a surface, z = n: the change of frame, the mirror, and Snell's law."""

import math

from numba import njit

# Directions are 3-tuples of float64 throughout: Numba keeps them in registers.


@njit(cache=True)
def dot(a, b):
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def normalize(v):
    """Return v at unit length; a null vector becomes the normal, so that no NaN travels on."""
    length2 = dot(v, v)
    if length2 <= 0.0:
        return (0.0, 0.0, 1.0)
    s = 1.0 / math.sqrt(length2)
    return (v[0] * s, v[1] * s, v[2] * s)


@njit(cache=True, error_model="numpy")
def basis(n):
    """Return tangent t and bitangent b with t x b = n, without branches that lose precision (Duff et al. 2017)."""
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    c = n[0] * n[1] * a
    return (1.0 + sign * n[0] * n[0] * a, sign * c, -sign * n[0]), (c, sign + n[1] * n[1] * a, -n[1])


@njit(cache=True)
def to_local(w, t, b, n):
    """Return the coordinates of w in the frame (t, b, n)."""
    return (dot(w, t), dot(w, b), dot(w, n))


@njit(cache=True)
def to_world(w, t, b, n):
    """Return the vector whose coordinates in the frame (t, b, n) are w."""
    return (
        w[0] * t[0] + w[1] * b[0] + w[2] * n[0],
        w[0] * t[1] + w[1] * b[1] + w[2] * n[1],
        w[0] * t[2] + w[1] * b[2] + w[2] * n[2],
    )


@njit(cache=True)
def reflect(w, h):
    """Return w mirrored about h; both leave the surface."""
    d = 2.0 * dot(w, h)
    return (d * h[0] - w[0], d * h[1] - w[1], d * h[2] - w[2])


@njit(cache=True, error_model="numpy")
def refract(w, h, eta):
    """Return the direction behind h that w is bent into, and its cosine there (0: total internal reflection).

    w leaves the surface on the side of h; eta is the index behind h over the index before it; the result leaves the
    surface on the other side.
    """
    cos_w = dot(w, h)
    sin2_t = (1.0 - cos_w * cos_w) / (eta * eta)
    if sin2_t >= 1.0:
        return (0.0, 0.0, 0.0), 0.0
    cos_t = math.sqrt(1.0 - sin2_t)
    s = cos_w / eta - cos_t
    return (s * h[0] - w[0] / eta, s * h[1] - w[1] / eta, s * h[2] - w[2] / eta), cos_t
