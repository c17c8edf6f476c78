"""Direct light on gathered pieces of surface, with the reflectance that believed and supposed materials share."""

import math

from numba import njit, prange

from materials.kernels import ggx, oren_nayar
from materials.kernels.frames import dot, normalize
from materials.kernels.fresnel import normal_reflectance
from transport.kernels.shading import cross

from .fragments import LAMP_POWER, towards

# Columns of the table of surfaces, one row a shape.
SCALE, SIGMA, LOBE, ALPHA_U, ALPHA_V, ANGLE, ETA, FRESNEL = 0, 3, 4, 5, 6, 7, 8, 9
LOBE2, ALPHA2, RETRO, RETRO_WIDTH, MASKED, LOBE3, ALPHA3, ETA3 = 10, 11, 12, 13, 14, 15, 16, 17
NUM_SURFACE = 18


@njit(cache=True, error_model="numpy")
def _lobe(wo, wi, alpha_u, alpha_v, eta, rising):
    h = ggx.half_vector(wo, wi)
    f0 = normal_reflectance(eta)
    f = f0 + rising * (1.0 - f0) * max(1.0 - dot(wo, h), 0.0) ** 5
    return ggx.facets(wo, wi, h, alpha_u, alpha_v) * f


@njit(cache=True, error_model="numpy")
def reflectance(row, wo, wi, mask):
    """Return (diffuse factor, everything else) of a surface; the first is times albedo / pi."""
    diffuse = oren_nayar.evaluate(wo, wi, row[SIGMA]) if row[SIGMA] > 0.0 else 1.0 / math.pi
    gloss = 0.0
    if row[LOBE] > 0.0:
        gloss += row[LOBE] * _lobe(wo, wi, row[ALPHA_U], row[ALPHA_V], row[ETA], row[FRESNEL])
    if row[LOBE2] > 0.0:
        gloss += row[LOBE2] * _lobe(wo, wi, row[ALPHA2], row[ALPHA2], row[ETA], row[FRESNEL])
    if row[LOBE3] > 0.0 and mask > 0.0:
        gloss += mask * row[LOBE3] * _lobe(wo, wi, row[ALPHA3], row[ALPHA3], row[ETA3], 1.0)
    if row[RETRO] > 0.0:
        angle = math.acos(min(max(dot(wo, wi), -1.0), 1.0))
        gloss += row[RETRO] * math.exp(-0.5 * (angle / row[RETRO_WIDTH]) ** 2)
    return diffuse, gloss


@njit(cache=True, parallel=True, error_model="numpy")
def shade(
    start, pixels_per_frame, weight, shape, position, normal, tangent, view, albedo, visible,
    slots, lamps, surfaces, sky, factor, mask, bend, ambient, through, air, out,
):  # fmt: skip
    """Fill `out` (P, 3) with the mean radiance of each pixel.

    Arrays of pieces are (N, ...), those of pixel p from start[p] to start[p + 1]. `slots` (F, S) are the rows of `lamps` lit
    in each frame, `visible` (N, S) their visibility. `factor` (N, 3) on the albedo, `mask` (N,) of the third lobe,
    `bend` (N, 2) slopes of the normal, `ambient` (N, 3) irradiance over pi, `through` and `air` (N, 3) of the medium
    may have no rows: then they are not there. `sky` is the radiance beyond the world.
    """
    for p in prange(start.shape[0] - 1):
        frame = p // pixels_per_frame
        total_r, total_g, total_b = 0.0, 0.0, 0.0
        for k in range(start[p], start[p + 1]):
            s = shape[k]
            if s < 0:
                r, g, b = sky[0], sky[1], sky[2]
            else:
                row = surfaces[s]
                n = (float(normal[k, 0]), float(normal[k, 1]), float(normal[k, 2]))
                t = (float(tangent[k, 0]), float(tangent[k, 1]), float(tangent[k, 2]))
                bt = cross(n, t)
                if bend.shape[0] > 0:
                    x, y = bend[k, 0], bend[k, 1]
                    n = normalize((n[0] - x * t[0] - y * bt[0], n[1] - x * t[1] - y * bt[1], n[2] - x * t[2] - y * bt[2]))
                    along = dot(n, t)
                    t = normalize((t[0] - along * n[0], t[1] - along * n[1], t[2] - along * n[2]))
                    bt = cross(n, t)
                if row[ANGLE] != 0.0:
                    c, sn = math.cos(row[ANGLE]), math.sin(row[ANGLE])
                    t = (c * t[0] + sn * bt[0], c * t[1] + sn * bt[1], c * t[2] + sn * bt[2])
                    bt = cross(n, t)
                ar, ag, ab = albedo[k, 0] * row[SCALE], albedo[k, 1] * row[SCALE + 1], albedo[k, 2] * row[SCALE + 2]
                if factor.shape[0] > 0:
                    ar, ag, ab = ar * factor[k, 0], ag * factor[k, 1], ab * factor[k, 2]
                m = mask[k] if mask.shape[0] > 0 else 0.0
                v = (float(view[k, 0]), float(view[k, 1]), float(view[k, 2]))
                wo = (dot(v, t), dot(v, bt), max(dot(v, n), 1e-3))
                pt = (float(position[k, 0]), float(position[k, 1]), float(position[k, 2]))
                r, g, b = 0.0, 0.0, 0.0
                for i in range(slots.shape[1]):
                    lamp = slots[frame, i]
                    if lamp < 0:
                        continue
                    seen = visible[k, i]
                    if seen <= 0.0:
                        continue
                    w, distance = towards(lamps, lamp, pt)
                    wi = (dot(w, t), dot(w, bt), dot(w, n))
                    if wi[2] <= 0.0:
                        continue
                    e = wi[2] * seen
                    if not math.isinf(distance):
                        e /= distance * distance
                    diffuse, gloss = reflectance(row, wo, wi, m)
                    r += e * lamps[lamp, LAMP_POWER] * (ar * diffuse + gloss)
                    g += e * lamps[lamp, LAMP_POWER + 1] * (ag * diffuse + gloss)
                    b += e * lamps[lamp, LAMP_POWER + 2] * (ab * diffuse + gloss)
                if ambient.shape[0] > 0:
                    # A lobe sends on what surrounds it as if it were even.
                    f0 = normal_reflectance(row[ETA])
                    gloss = (row[LOBE] + row[LOBE2]) * (f0 + row[FRESNEL] * (1.0 - f0) * (1.0 - wo[2]) ** 5)
                    r += ambient[k, 0] * (ar + gloss)
                    g += ambient[k, 1] * (ag + gloss)
                    b += ambient[k, 2] * (ab + gloss)
            if through.shape[0] > 0:
                r = r * through[k, 0] + air[k, 0]
                g = g * through[k, 1] + air[k, 1]
                b = b * through[k, 2] + air[k, 2]
            total_r += weight[k] * r
            total_g += weight[k] * g
            total_b += weight[k] * b
        out[p, 0], out[p, 1], out[p, 2] = total_r, total_g, total_b
