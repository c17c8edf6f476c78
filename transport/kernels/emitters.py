"""Lamps with an extent: glowing triangles and spheres, drawn from one table by the power they send out.

A triangle is sampled evenly over its area, a sphere evenly over the cone in which it is seen (P. Shirley, C. Wang and K.
Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", 1996). As triangles are chosen by area times mean
radiance, the density per area is the same over all of a shape: its mean radiance over the sum of all weights.
"""

import math

from materials.kernels.frames import basis, dot, normalize
from materials.kernels.lean import lean

from .arrays import (
    EMISSION,
    EMISSION_MEAN,
    EMISSION_TEXTURE,
    EMITTER_CORNER,
    EMITTER_EDGE1,
    EMITTER_EDGE2,
    EMITTER_KIND,
    EMITTER_ONE_SIDED,
    EMITTER_RADIANCE,
    EMITTER_RADIUS,
    EMITTER_TEXTURE,
    EMITTER_UV,
    ONE_SIDED,
    SPHERE,
)
from .textures import lookup

FAR = 1e30
# A shadow ray ends this much before the lamp, so as not to be stopped by it.
SHORT = 1.0 - 1e-4
_BLACK = (0.0, 0.0, 0.0)


@lean()
def find(cdf, u):
    """Return the index of the interval of a cumulative distribution that holds u."""
    low, high = 0, len(cdf) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if cdf[middle] <= u:
            low = middle
        else:
            high = middle
    return low


@lean(error_model="numpy")
def meet_sphere(x, y, z, radius, o, d):
    """Return the distance to the first point of a sphere on a ray from outside, FAR for none; seen from inside there is none."""
    x, y, z = x - o[0], y - o[1], z - o[2]
    along = x * d[0] + y * d[1] + z * d[2]
    # the distance of the ray's line from the centre, from the rest of the vector: no cancellation far away
    rx, ry, rz = x - along * d[0], y - along * d[1], z - along * d[2]
    room = radius * radius - (rx * rx + ry * ry + rz * rz)
    if along <= 0.0 or room <= 0.0 or x * x + y * y + z * z <= radius * radius:
        return FAR
    return along - math.sqrt(room)


@lean()
def nearest_sphere(spheres, o, d):
    """Return (index, distance) of the first sphere on a ray; (-1, FAR) for none."""
    best, t = -1, FAR
    for i in range(spheres.shape[0]):
        s = meet_sphere(spheres[i, 0], spheres[i, 1], spheres[i, 2], spheres[i, 3], o, d)
        if s < t:
            best, t = i, s
    return best, t


@lean()
def spheres_block(spheres, o, d, far):
    """Return whether a glowing sphere stands in the way of a ray that is to end after `far`, perhaps on a sphere itself.

    The point it ends at was chosen from the surface, the ray starts a little off it: near the rim of the sphere in view
    that moves the crossing by more than any share of the distance (measured: 0.1 % of the light lost). So the sphere on which
    the ray ends is told by where that end lies.
    """
    for i in range(spheres.shape[0]):
        x, y, z, radius = spheres[i, 0], spheres[i, 1], spheres[i, 2], spheres[i, 3]
        if meet_sphere(x, y, z, radius, o, d) < far:
            x, y, z = o[0] + far * d[0] - x, o[1] + far * d[1] - y, o[2] + far * d[2] - z
            tolerance = 1e-3 * radius + 4.0 * (1.0 - SHORT) * far
            if abs(math.sqrt(x * x + y * y + z * z) - radius) > tolerance:
                return True
    return False


@lean(error_model="numpy")
def _cone(x, y, z, radius):
    """Return 1 - cos of the half angle under which a sphere at (x, y, z) is seen."""
    sin2 = min(radius * radius / (x * x + y * y + z * z), 1.0)
    return sin2 / (1.0 + math.sqrt(1.0 - sin2))


@lean(error_model="numpy")
def _glow(lights, row, u, v):
    r, g, b = row[EMITTER_RADIANCE], row[EMITTER_RADIANCE + 1], row[EMITTER_RADIANCE + 2]
    texture = int(row[EMITTER_TEXTURE])
    if texture >= 0:
        r *= lookup(lights.texels, lights.texture_info, texture, u, v, 0)
        g *= lookup(lights.texels, lights.texture_info, texture, u, v, 1)
        b *= lookup(lights.texels, lights.texture_info, texture, u, v, 2)
    return r, g, b


@lean(error_model="numpy")
def _sample_sphere(row, chance, p, u0, u1):
    """As `sample_emitter`, of a sphere chosen with probability `chance`."""
    radius = row[EMITTER_RADIUS]
    x, y, z = row[EMITTER_CORNER] - p[0], row[EMITTER_CORNER + 1] - p[1], row[EMITTER_CORNER + 2] - p[2]
    if x * x + y * y + z * z <= radius * radius:
        return (0.0, 0.0, 1.0), 0.0, _BLACK, 0.0
    width = _cone(x, y, z, radius)
    n = normalize((x, y, z))
    t, b = basis(n)
    down = u0 * width
    cos, phi = 1.0 - down, 2.0 * math.pi * u1
    sin = math.sqrt(max(down * (2.0 - down), 0.0))
    a, c = sin * math.cos(phi), sin * math.sin(phi)
    d = (a * t[0] + c * b[0] + cos * n[0], a * t[1] + c * b[1] + cos * n[1], a * t[2] + c * b[2] + cos * n[2])
    # along - root as in `meet_sphere`; rounding at the rim must not give the root a negative argument
    along = dot((x, y, z), d)
    far = along - math.sqrt(max(along * along - (x * x + y * y + z * z - radius * radius), 0.0))
    density = chance / (2.0 * math.pi * width)
    e = (row[EMITTER_RADIANCE] / density, row[EMITTER_RADIANCE + 1] / density, row[EMITTER_RADIANCE + 2] / density)
    return d, far * SHORT, e, density


@lean(error_model="numpy")
def sample_emitter(lights, p, u0, u1):
    """Return (direction, distance, radiance over pdf, pdf) of a point on a lamp as seen from p."""
    i = find(lights.emitter_cdf, u0)
    low, high = lights.emitter_cdf[i], lights.emitter_cdf[i + 1]
    chance = high - low
    # What is left of the number within its interval is as even as the number was.
    u0 = min((u0 - low) / chance, 1.0 - 1e-16)
    row = lights.emitters[i]
    if row[EMITTER_KIND] == SPHERE:
        return _sample_sphere(row, chance, p, u0, u1)
    s = math.sqrt(u0)
    b1, b2 = 1.0 - s, u1 * s
    e1 = (row[EMITTER_EDGE1], row[EMITTER_EDGE1 + 1], row[EMITTER_EDGE1 + 2])
    e2 = (row[EMITTER_EDGE2], row[EMITTER_EDGE2 + 1], row[EMITTER_EDGE2 + 2])
    x = row[EMITTER_CORNER] + b1 * e1[0] + b2 * e2[0] - p[0]
    y = row[EMITTER_CORNER + 1] + b1 * e1[1] + b2 * e2[1] - p[1]
    z = row[EMITTER_CORNER + 2] + b1 * e1[2] + b2 * e2[2] - p[2]
    n = (e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0])
    r2 = x * x + y * y + z * z
    if r2 <= 0.0:
        return (0.0, 0.0, 1.0), 0.0, _BLACK, 0.0
    r = math.sqrt(r2)
    d = (x / r, y / r, z / r)
    facing = -dot(n, d)  # twice the area, times the cosine at the lamp
    if facing == 0.0 or (facing < 0.0 and row[EMITTER_ONE_SIDED] > 0.5):
        return d, 0.0, _BLACK, 0.0
    density = 2.0 * chance * r2 / abs(facing)
    q = EMITTER_UV
    u = row[q] + b1 * row[q + 2] + b2 * row[q + 4]
    v = row[q + 1] + b1 * row[q + 3] + b2 * row[q + 5]
    glow = _glow(lights, row, u, v)
    return d, r * SHORT, (glow[0] / density, glow[1] / density, glow[2] / density), density


@lean(error_model="numpy")
def sphere_seen(lights, world, o, d):
    """Return (is met, radiance, pdf of `sample_emitter`) of the first glowing sphere on a ray."""
    i, _ = nearest_sphere(world.spheres, o, d)
    if i < 0:
        return False, _BLACK, 0.0
    # Spheres stand first among the emitters, in the order of `world.spheres`.
    row = lights.emitters[i]
    x, y, z = row[EMITTER_CORNER] - o[0], row[EMITTER_CORNER + 1] - o[1], row[EMITTER_CORNER + 2] - o[2]
    chance = lights.emitter_cdf[i + 1] - lights.emitter_cdf[i]
    density = chance / (2.0 * math.pi * _cone(x, y, z, row[EMITTER_RADIUS])) if lights.emitter_total > 0.0 else 0.0
    return True, (row[EMITTER_RADIANCE], row[EMITTER_RADIANCE + 1], row[EMITTER_RADIANCE + 2]), density


@lean()
def emitted(world, hit, d):
    """Return the radiance that a glowing surface sends against a ray along d."""
    row = world.material_values[hit.material]
    if row[ONE_SIDED] > 0.5 and dot(hit.ng, d) > 0.0:
        return _BLACK
    r, g, b = row[EMISSION], row[EMISSION + 1], row[EMISSION + 2]
    texture = world.material_textures[hit.material, EMISSION_TEXTURE]
    if texture >= 0:
        r *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 0)
        g *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 1)
        b *= lookup(world.texels, world.texture_info, texture, hit.u, hit.v, 2)
    return r, g, b


@lean(error_model="numpy")
def surface_density(world, lights, hit, d, distance):
    """Return the pdf [1/sr] with which `sample_emitter` finds the glowing point that a ray has met after `distance`."""
    if lights.emitter_total <= 0.0:
        return 0.0
    cos = abs(dot(hit.ng, d))
    if cos <= 0.0:
        return 0.0
    return world.material_values[hit.material, EMISSION_MEAN] / lights.emitter_total * distance * distance / cos
