"""Light from anywhere, one light at a time: a panorama sampled by its brightness, discs in the sky, points, lamps.

Panoramas run from the zenith (first row) to the nadir, columns from azimuth -pi to pi (azimuth = atan2(y, x)).
"""

import math

from materials.kernels.frames import basis
from materials.kernels.lean import lean

from .arrays import POINT_INTENSITY, POINT_POSITION, SUN_COS, SUN_DIRECTION, SUN_POWER, SUN_SOLID_ANGLE
from .emitters import FAR, find, sample_emitter


@lean()
def _texel(panorama, dx, dy, dz):
    """Return fractional (row, col) of a direction."""
    height, width = panorama.shape[0], panorama.shape[1]
    row = math.acos(min(1.0, max(-1.0, dz))) / math.pi * height
    col = (math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * width
    return row, col


@lean()
def environment_radiance(panorama, dx, dy, dz):
    """Return the panorama's radiance along a direction, bilinear."""
    height, width = panorama.shape[0], panorama.shape[1]
    if height == 0:
        return 0.0, 0.0, 0.0
    row, col = _texel(panorama, dx, dy, dz)
    y = min(max(row - 0.5, 0.0), height - 1.0)
    x = col - 0.5
    y0 = int(y)
    y1 = min(y0 + 1, height - 1)
    fx = math.floor(x)
    ax = x - fx
    ay = y - y0
    x0 = int(fx) % width
    x1 = (x0 + 1) % width
    w00 = (1.0 - ax) * (1.0 - ay)
    w01 = ax * (1.0 - ay)
    w10 = (1.0 - ax) * ay
    w11 = ax * ay
    r = panorama[y0, x0, 0] * w00 + panorama[y0, x1, 0] * w01 + panorama[y1, x0, 0] * w10 + panorama[y1, x1, 0] * w11
    g = panorama[y0, x0, 1] * w00 + panorama[y0, x1, 1] * w01 + panorama[y1, x0, 1] * w10 + panorama[y1, x1, 1] * w11
    b = panorama[y0, x0, 2] * w00 + panorama[y0, x1, 2] * w01 + panorama[y1, x0, 2] * w10 + panorama[y1, x1, 2] * w11
    return r, g, b


@lean()
def _texel_density(row_cdf, col_cdf, row, col, height, width):
    """Return the density per solid angle of directions in a texel: its probability over its solid angle."""
    probability = (row_cdf[row + 1] - row_cdf[row]) * (col_cdf[row, col + 1] - col_cdf[row, col])
    solid_angle = (math.cos(math.pi * row / height) - math.cos(math.pi * (row + 1) / height)) * 2.0 * math.pi / width
    return probability / solid_angle


@lean()
def environment_pdf(panorama, row_cdf, col_cdf, dx, dy, dz):
    """Return the density [1/sr] with which `sample_environment` gives a direction."""
    height, width = panorama.shape[0], panorama.shape[1]
    row, col = _texel(panorama, dx, dy, dz)
    return _texel_density(row_cdf, col_cdf, min(int(row), height - 1), min(int(col), width - 1), height, width)


@lean()
def sample_environment(panorama, row_cdf, col_cdf, u0, u1):
    """Return (direction, pdf): texels by brightness, uniform over the solid angle within one."""
    height, width = panorama.shape[0], panorama.shape[1]
    row = find(row_cdf, u0)
    span = row_cdf[row + 1] - row_cdf[row]
    a = (u0 - row_cdf[row]) / span if span > 0.0 else 0.5
    columns = col_cdf[row]
    col = find(columns, u1)
    span = columns[col + 1] - columns[col]
    b = (u1 - columns[col]) / span if span > 0.0 else 0.5
    # Uniform in cos(theta) between the texel's edges is uniform over its solid angle.
    top, bottom = math.cos(math.pi * row / height), math.cos(math.pi * (row + 1) / height)
    z = top + (bottom - top) * a
    s = math.sqrt(max(0.0, 1.0 - z * z))
    phi = ((col + b) / width - 0.5) * 2.0 * math.pi
    return s * math.cos(phi), s * math.sin(phi), z, _texel_density(row_cdf, col_cdf, row, col, height, width)


@lean()
def sample_sun(suns, i, u0, u1):
    """Return (direction, radiance over pdf) of a point on a sun's disc; a delta sun always gives its centre.

    The density is 1 / solid angle, so the quotient is radiance times solid angle, `SUN_POWER`.
    """
    dx, dy, dz = suns[i, SUN_DIRECTION], suns[i, SUN_DIRECTION + 1], suns[i, SUN_DIRECTION + 2]
    cos_max = suns[i, SUN_COS]
    if cos_max < 1.0:
        z = 1.0 - u0 * (1.0 - cos_max)
        s = math.sqrt(max(0.0, 1.0 - z * z))
        phi = 2.0 * math.pi * u1
        t, b = basis((dx, dy, dz))
        x, y = s * math.cos(phi), s * math.sin(phi)
        dx, dy, dz = x * t[0] + y * b[0] + z * dx, x * t[1] + y * b[1] + z * dy, x * t[2] + y * b[2] + z * dz
    return dx, dy, dz, suns[i, SUN_POWER], suns[i, SUN_POWER + 1], suns[i, SUN_POWER + 2]


@lean()
def sun_pdf(suns, i, dx, dy, dz):
    """Return the density [1/sr] of a direction under `sample_sun`: 0 outside the disc and for delta suns."""
    if suns[i, SUN_COS] >= 1.0:
        return 0.0
    c = dx * suns[i, SUN_DIRECTION] + dy * suns[i, SUN_DIRECTION + 1] + dz * suns[i, SUN_DIRECTION + 2]
    return 1.0 / suns[i, SUN_SOLID_ANGLE] if c >= suns[i, SUN_COS] else 0.0


@lean()
def num_lights(lights):
    """Return how many lights `sample_light` knows: the environment, the suns, the points, and all lamps as one."""
    others = lights.suns.shape[0] + lights.points.shape[0] + (1 if lights.emitter_total > 0.0 else 0)
    return (1 if lights.panorama.shape[0] > 0 else 0) + others


@lean()
def first_point(lights):
    """Return which light of `sample_light` is the first point."""
    return (1 if lights.panorama.shape[0] > 0 else 0) + lights.suns.shape[0]


@lean(error_model="numpy")
def sample_light(lights, i, p, u0, u1):
    """Return (direction, distance, radiance over pdf, pdf) of light i as seen from p; the pdf of delta lights is infinite."""
    if lights.panorama.shape[0] > 0:
        if i == 0:
            x, y, z, density = sample_environment(lights.panorama, lights.row_cdf, lights.col_cdf, u0, u1)
            if density <= 0.0:
                return (x, y, z), FAR, (0.0, 0.0, 0.0), 0.0
            e = environment_radiance(lights.panorama, x, y, z)
            return (x, y, z), FAR, (e[0] / density, e[1] / density, e[2] / density), density
        i -= 1
    if i < lights.suns.shape[0]:
        x, y, z, r, g, b = sample_sun(lights.suns, i, u0, u1)
        density = 1.0 / lights.suns[i, SUN_SOLID_ANGLE] if lights.suns[i, SUN_COS] < 1.0 else math.inf
        return (x, y, z), FAR, (r, g, b), density
    i -= lights.suns.shape[0]
    if i >= lights.points.shape[0]:
        return sample_emitter(lights, p, u0, u1)
    row = lights.points[i]
    x, y, z = row[POINT_POSITION] - p[0], row[POINT_POSITION + 1] - p[1], row[POINT_POSITION + 2] - p[2]
    r2 = x * x + y * y + z * z
    if r2 <= 0.0:
        return (0.0, 0.0, 1.0), 0.0, (0.0, 0.0, 0.0), math.inf
    r = math.sqrt(r2)
    e = (row[POINT_INTENSITY] / r2, row[POINT_INTENSITY + 1] / r2, row[POINT_INTENSITY + 2] / r2)
    return (x / r, y / r, z / r), r * (1.0 - 1e-5), e, math.inf
