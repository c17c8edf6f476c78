"""What rays see of a mesh, and whether light reaches it: all that pictures of measured reflectance ask of Embree."""

import math

from numba import njit, prange

from .rays import intersect, occluded, ray_buffer


@njit(parallel=True, cache=True)
def nearest(scene, origins, directions, faces, coordinates):
    """Fill faces (Q,) with the nearest triangle of each ray, -1 for none, and coordinates (Q, 3): b1, b2, distance."""
    for k in prange(len(origins)):
        buffer, s = ray_buffer()
        o, d = origins[k], directions[k]
        face, distance, b1, b2 = intersect(scene, 0, 0, buffer, s, o[0], o[1], o[2], d[0], d[1], d[2], math.inf)
        faces[k] = face
        coordinates[k, 0], coordinates[k, 1], coordinates[k, 2] = b1, b2, distance


@njit(parallel=True, cache=True)
def blocked(scene, origins, direction, far, out):
    """Fill out (Q,) with whether anything lies between places and a light in one direction."""
    for k in prange(len(origins)):
        buffer, s = ray_buffer()
        o = origins[k]
        out[k] = occluded(scene, 0, buffer, s, o[0], o[1], o[2], direction[0], direction[1], direction[2], far)
