"""A photograph put back into the world: the radiance of any surface point as the picture, other frames, or a mean says.

A point takes its colour from the frame's picture if the camera sees it there (inside the frustum, at the depth of what
the pixel shows, and of the same moving object); else from its vertices' fill colour, which other frames saw; else from
the mean of its class (thesis 6.4.1).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from materials.kernels.frames import dot, normalize
from materials.kernels.lean import lean

from .lights import environment_radiance
from .rays import hit_normal, intersect
from .shading import leave

GROUND, ENVIRONMENT, CARDBOARD, HULL, UNDERSIDE = 0, 1, 2, 3, 4


# Columns of Picture.texels. One texel is half a cache line: a look-up of colour, depths and instance costs one miss.
_NEAR, _FAR, _INSTANCE, _TEXEL = 3, 4, 5, 8


class Picture(NamedTuple):
    """A frame and what stands behind it."""

    texels: Any  # (H, W, 8) float32: linear RGB, bounds of the depth around the pixel [m], instance; see `pack`
    num_ground_faces: int
    moving_box: Any  # (2, 3) float64, around all that moves; empty (low above high) without
    P: Any  # (3, 4) float64, world to pixels times depth
    role: Any  # (S,) int64
    shape_instance: Any  # (S,) int32
    mean: Any  # (S, 3) float64
    fill: Any  # (V, 4) float32, linear RGB and weight
    sky: Any  # (h, w, 3) float32, complete


def pack(image, near, far, instance):
    """Return texels (H, W, 8) of a picture.

    image : (H, W, 3), linear
    near, far : (H, W), bounds of the depth around each pixel; inf where it sees nothing
    instance : (H, W), moving objects' ids, 0 = static; exact in float32 below 2^24
    """
    texels = np.zeros((*instance.shape, _TEXEL), np.float32)
    texels[..., :3] = image
    texels[..., _NEAR], texels[..., _FAR], texels[..., _INSTANCE] = near, far, instance
    return texels


@lean(forceinline=True)
def project(P, p):
    """Return pixel position and depth of a world point."""
    x = P[0, 0] * p[0] + P[0, 1] * p[1] + P[0, 2] * p[2] + P[0, 3]
    y = P[1, 0] * p[0] + P[1, 1] * p[1] + P[1, 2] * p[2] + P[1, 3]
    z = P[2, 0] * p[0] + P[2, 1] * p[1] + P[2, 2] * p[2] + P[2, 3]
    if z <= 0.05:
        return -1.0, -1.0, z
    return x / z, y / z, z


@lean(forceinline=True)
def sample_image(image, texels, x, y, wanted):
    """Return a picture at a position, bilinear over those of the four pixels that show instance `wanted`."""
    height, width = texels.shape[0], texels.shape[1]
    fx, fy = x - 0.5, y - 0.5
    x0, y0 = math.floor(fx), math.floor(fy)
    ax, ay = fx - x0, fy - y0
    r = g = b = total = 0.0
    for j in range(2):
        row = min(max(y0 + j, 0), height - 1)
        wy = ay if j == 1 else 1.0 - ay
        for i in range(2):
            col = min(max(x0 + i, 0), width - 1)
            if texels[row, col, _INSTANCE] == wanted:
                w = wy * (ax if i == 1 else 1.0 - ax)
                total += w
                r += w * image[row, col, 0]
                g += w * image[row, col, 1]
                b += w * image[row, col, 2]
    if total <= 0.0:
        row, col = min(int(y), height - 1), min(int(x), width - 1)
        return float(image[row, col, 0]), float(image[row, col, 1]), float(image[row, col, 2])
    return r / total, g / total, b / total


@lean(forceinline=True)
def _is_inside(picture, x, y):
    return 0.0 <= x < picture.texels.shape[1] and 0.0 <= y < picture.texels.shape[0]


@lean(forceinline=True)
def instance_at(picture, x, y):
    """Return the moving object that the pixel at a position shows; -1 outside the picture."""
    if not _is_inside(picture, x, y):
        return -1
    return int(picture.texels[int(y), int(x), _INSTANCE])


@lean(forceinline=True)
def is_seen(picture, x, y, z, instance):
    """Return whether the camera sees a point that projects to (x, y) at depth z, rather than something before it."""
    if not _is_inside(picture, x, y):
        return False
    row, col = int(y), int(x)
    if picture.texels[row, col, _INSTANCE] != instance:
        return False
    if instance != 0:
        return True
    slack = 0.05 + 0.01 * z
    return picture.texels[row, col, _NEAR] - slack <= z <= picture.texels[row, col, _FAR] + slack


@lean(forceinline=True)
def _fill(picture, faces, face, b1, b2):
    """Return fill colour and weight at barycentric coordinates, from those vertices that have one."""
    r = g = b = total = 0.0
    for k in range(3):
        v = faces[face, k]
        w = (1.0 - b1 - b2 if k == 0 else (b1 if k == 1 else b2)) * picture.fill[v, 3]
        total += w
        r += w * picture.fill[v, 0]
        g += w * picture.fill[v, 1]
        b += w * picture.fill[v, 2]
    if total <= 1e-6:
        return 0.0, 0.0, 0.0, 0.0
    return r / total, g / total, b / total, total


@lean(forceinline=True)
def role_of(picture, world, face):
    """Return the role of a face; static ones, which count first, need no look-up."""
    if face < picture.num_ground_faces:
        return GROUND
    if face < world.num_static_faces:
        return ENVIRONMENT
    return picture.role[world.face_shape[face]]


@lean(forceinline=True)
def radiance_of(picture, image, world, face, b1, b2, p):
    """Return the radiance of a surface point; `image` is the picture (its texels) or a layer of it."""
    role = role_of(picture, world, face)
    shape = world.face_shape[face] if role > ENVIRONMENT else role
    if role <= CARDBOARD:
        x, y, z = project(picture.P, p)
        instance = picture.shape_instance[shape]
        if is_seen(picture, x, y, z, instance):
            return sample_image(image, picture.texels, x, y, instance)
        if role <= ENVIRONMENT:
            r, g, b, w = _fill(picture, world.faces, face, b1, b2)
            if w > 0.0:
                return r, g, b
    return picture.mean[shape, 0], picture.mean[shape, 1], picture.mean[shape, 2]


@lean(forceinline=True)
def sky_radiance(picture, d):
    """Return the radiance from beyond all meshes: the picture where it shows the sky there, else the panorama."""
    P = picture.P
    z = P[2, 0] * d[0] + P[2, 1] * d[1] + P[2, 2] * d[2]
    if z > 1e-3:
        x = (P[0, 0] * d[0] + P[0, 1] * d[1] + P[0, 2] * d[2]) / z
        y = (P[1, 0] * d[0] + P[1, 1] * d[1] + P[1, 2] * d[2]) / z
        if _is_inside(picture, x, y):
            row, col = int(y), int(x)
            if picture.texels[row, col, _INSTANCE] == 0 and math.isinf(picture.texels[row, col, _FAR]):
                return sample_image(picture.texels, picture.texels, x, y, 0)
    return environment_radiance(picture.sky, d[0], d[1], d[2])


@lean(forceinline=True)
def is_there(picture, world, face, p, from_camera):
    """Return whether a hit counts.

    Cardboards and hulls exist only where their mask shows them; the underside of a vehicle darkens the ground below it
    but must not hide that ground from the camera, which sees it between the wheels.
    """
    if face < world.num_static_faces:
        return True
    shape = world.face_shape[face]
    if picture.role[shape] == UNDERSIDE:
        return not from_camera
    x, y, _ = project(picture.P, p)
    return instance_at(picture, x, y) == picture.shape_instance[shape]


@lean(forceinline=True, error_model="numpy")
def _meets_box(box, o, d):
    """Return whether a ray meets a box; the empty box, its low corner above its high one, is met by none."""
    near, far = 0.0, math.inf
    for c in range(3):
        if box[0, c] > box[1, c]:
            return False
        if d[c] == 0.0:
            if o[c] < box[0, c] or o[c] > box[1, c]:
                return False
            continue
        t0, t1 = (box[0, c] - o[c]) / d[c], (box[1, c] - o[c]) / d[c]
        near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
    return near <= far


@lean(forceinline=True)
def nearest(picture, world, buffer, s, o, d, from_camera):
    """Return (face, b1, b2, p, ng) of the nearest thing that is there; face -1 is none."""
    # Few rays pass the moving things; a test of their box is cheaper than Embree's call.
    moving = world.dynamic_scene if world.dynamic_scene != 0 and _meets_box(picture.moving_box, o, d) else 0
    for _ in range(64):
        face, t, b1, b2 = intersect(
            world.static_scene, moving, world.num_static_faces, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], 1e30
        )
        if face < 0:
            break
        p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
        ng = normalize(hit_normal(buffer, s))
        if is_there(picture, world, face, p, from_camera):
            return face, b1, b2, p, ng
        o = leave(p, ng, d)
    return -1, 0.0, 0.0, o, d


@lean(forceinline=True)
def faces_viewer(n, w):
    """Return n turned to the side of w."""
    return n if dot(n, w) >= 0.0 else (-n[0], -n[1], -n[2])
