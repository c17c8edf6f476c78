"""Light that particles in the air turn into a path: next-event estimation from a collision."""

import math

from materials.kernels import phase
from materials.kernels.frames import dot
from materials.kernels.lean import lean

from .bodies import passage, scatter_in
from .equiangular import angle_density
from .lights import first_point, num_lights, sample_light
from .media import density_at, optical_depth, tracking
from .sampler import draw2
from .shading import power_heuristic


@lean()
def airlight(world, lights, medium, bodies, body, buffer, s, stream, index, dimension, num_dimensions, p, o, d, t, t0, t1):
    """Return the light that comes straight from the lights to a particle at p and is turned against a ray along d.

    The particle is in a body, or in the air. The albedo is left to the caller. Lights share the numbers of
    `num_dimensions` dimensions, as on surfaces. The particle was found t after the ray's start o; where points are also drawn by
    angle from t0 to t1 (`equiangular`), they are weighted against that.
    """
    r = g = b = 0.0
    _, scatter = scatter_in(medium, bodies, body)
    points, collision = first_point(lights), 0.0
    if t0 < t1:
        collision = density_at(medium, p) * math.exp(-optical_depth(medium, o, d, t0, t))
    for i in range(num_lights(lights)):
        u0, u1 = draw2(stream, index, dimension + i % num_dimensions)
        wi, far, e, density = sample_light(lights, i, p, u0, u1)
        if e[0] + e[1] + e[2] <= 0.0:
            continue
        passed = passage(world, medium, bodies, body, buffer, s, tracking(stream, index, dimension + i), p, wi, far)
        if passed <= 0.0:
            continue
        # Light travels along -wi and is turned to -d: the same angle as from d to wi.
        f = phase.evaluate(scatter, dot(d, wi))
        w = f * passed
        if density < math.inf:
            w *= power_heuristic(density, f)
        elif collision > 0.0 and points <= i < points + lights.points.shape[0]:
            w *= power_heuristic(collision, angle_density(lights, i - points, o, d, t0, t1, t))
        r += w * e[0]
        g += w * e[1]
        b += w * e[2]
    return r, g, b
