"""What pixels see by way of one mirroring surface."""

from numba import njit, prange

from materials.kernels.frames import dot
from materials.kernels.kinds import EMISSION, LAMBERT, OREN_NAYAR

from .optics import central_ray
from .rays import ray_buffer
from .shading import film_coverage, film_normal, hit_at, leave
from .visibility import first_hit

NO_MIRROR, SURFACE, SKY = 0, 1, 2


@njit(cache=True)
def _mirrors(world, hit):
    """Return whether a surface has lobes about the mirrored direction."""
    kind = world.material_kind[hit.material]
    return kind not in (LAMBERT, OREN_NAYAR, EMISSION) or film_coverage(world, hit) > 0.0


@njit(cache=True, parallel=True)
def mirrored(world, camera, optics, xy, kind, face, place, length):
    """Follow the rays through pixel positions (N, 2) to a first surface and, mirrored there, to what it shows.

    Fills kind (N,): NO_MIRROR, SURFACE or SKY; face (N,) of what is shown; place (N, 3), its point in the world [m], of the
    sky the direction; length (N,) of the way there [m].
    """
    for i in prange(len(xy)):
        buffer, s = ray_buffer()
        kind[i], face[i], length[i] = NO_MIRROR, -1, 0.0
        o, d = central_ray(camera, optics, xy[i, 0], xy[i, 1])
        if not (abs(d[0]) <= 1.0):  # no ray has this position
            continue
        seen, b1, b2, distance = first_hit(world, buffer, s, o, d)
        if seen < 0:
            continue
        hit = hit_at(world, seen, b1, b2)
        if not _mirrors(world, hit):
            continue
        n = film_normal(world, hit) if film_coverage(world, hit) > 0.0 else hit.ns
        c = 2.0 * dot(n, d)
        w = (d[0] - c * n[0], d[1] - c * n[1], d[2] - c * n[2])
        # On the viewer's side: light that is mirrored into the surface shows nothing.
        if dot(hit.ng, w) * dot(hit.ng, d) >= 0.0:
            continue
        p = leave(hit.p, hit.ng, w)
        shown, b1, b2, further = first_hit(world, buffer, s, p, w)
        if shown < 0:
            kind[i] = SKY
            for c in range(3):
                place[i, c] = w[c]
            continue
        kind[i], face[i], length[i] = SURFACE, shown, distance + further
        for c in range(3):
            place[i, c] = p[c] + further * w[c]
