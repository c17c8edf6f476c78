"""Shooting rays at Embree scenes from compiled code.

A world has two scenes: what stands still and is built once, and what moves and is built per frame. A ray goes through
both; as Embree shortens the ray at each hit, the nearest of the two remains. Geometry ids 0 and 1 tell them apart.
"""

import numpy as np
from numba import njit, types

from materials.kernels.lean import lean

_pointers = types.void(types.intp, types.intp, types.intp)
rtcIntersect1 = types.ExternalFunction("rtcIntersect1", _pointers)
rtcOccluded1 = types.ExternalFunction("rtcOccluded1", _pointers)

# An RTCRayHit is 84 bytes at an address divisible by 16; threads get 128 bytes each, so as not to share cache lines.
STRIDE = 32
_INVALID = np.uint32(0xFFFFFFFF)


@njit(cache=True)
def ray_buffer():
    """Return a float32 buffer and the index at which its aligned RTCRayHit starts."""
    buffer = np.zeros(STRIDE + 4, np.float32)
    start = ((16 - buffer.ctypes.data % 16) % 16) // 4
    return buffer, start


@lean()
def _load(buffer, words, s, ox, oy, oz, dx, dy, dz, far):
    buffer[s] = ox
    buffer[s + 1] = oy
    buffer[s + 2] = oz
    buffer[s + 3] = 0.0
    buffer[s + 4] = dx
    buffer[s + 5] = dy
    buffer[s + 6] = dz
    buffer[s + 7] = 0.0
    buffer[s + 8] = far
    words[s + 9] = _INVALID
    words[s + 10] = np.uint32(0)
    words[s + 11] = np.uint32(0)


@lean()
def intersect(static_scene, dynamic_scene, num_static_faces, buffer, s, ox, oy, oz, dx, dy, dz, far):
    """Return (face, distance, u, v) of the nearest hit; face is -1 for none, and counts dynamic faces after static."""
    words = buffer.view(np.uint32)
    _load(buffer, words, s, ox, oy, oz, dx, dy, dz, far)
    words[s + 17] = _INVALID
    words[s + 18] = _INVALID
    words[s + 19] = _INVALID
    pointer = buffer.ctypes.data + 4 * s
    rtcIntersect1(static_scene, pointer, 0)
    if dynamic_scene != 0:
        rtcIntersect1(dynamic_scene, pointer, 0)
    if words[s + 18] == _INVALID:
        return -1, 0.0, 0.0, 0.0
    face = np.int64(words[s + 17])
    if words[s + 18] == 1:
        face += num_static_faces
    return face, np.float64(buffer[s + 8]), np.float64(buffer[s + 15]), np.float64(buffer[s + 16])


@lean()
def hit_normal(buffer, s):
    """Return the geometric normal of the hit that `intersect` found last, of any length and on either side.

    Embree has it at hand; from the mesh it would cost four cache misses.
    """
    return (np.float64(buffer[s + 12]), np.float64(buffer[s + 13]), np.float64(buffer[s + 14]))


@lean()
def occluded(static_scene, dynamic_scene, buffer, s, ox, oy, oz, dx, dy, dz, far):
    """Return whether anything lies on the ray before distance `far`."""
    words = buffer.view(np.uint32)
    pointer = buffer.ctypes.data + 4 * s
    _load(buffer, words, s, ox, oy, oz, dx, dy, dz, far)
    rtcOccluded1(static_scene, pointer, 0)
    # Embree marks an occluded ray by a negative far end.
    if buffer[s + 8] < 0.0:
        return True
    if dynamic_scene != 0:
        rtcOccluded1(dynamic_scene, pointer, 0)
        return buffer[s + 8] < 0.0
    return False
