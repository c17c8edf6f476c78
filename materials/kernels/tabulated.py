"""Surfaces that are tables: compressed BTFs, and textures of fitted parameters. Evaluate, pdf, and sample at a texture place.

Texels are looked up bilinearly and repeat. A BTF is decompressed for the four texels and three by three directions that are
asked for, and drawn from one lobe and a diffuse part that stand for all of its texels; a fitted surface is drawn from the lobes
of the four texels as they are. Directions are in the frame of the coarse surface, z = n; `f` has no cosine.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from . import cook_torrance, ggx, lobes, oren_nayar, phong, ward
from .direction_mesh import NODE, locate
from .fresnel import normal_reflectance
from .kinds import COOK_TORRANCE, GGX, PHONG, Surface
from .microfacet import ALPHA_MIN

# Columns of `rows`: which of ward, phong, … the lobes are, the texture's size, the first row of `texels`; of a BTF (LIGHTS
# at least 0) the sets of directions, the number of factors, and where they start. DECORRELATED: a group for each channel.
KIND, WIDTH, HEIGHT, TEXEL, LIGHTS, VIEWS, RANK, SPATIAL, ANGULAR, NUM_VIEWS, DECORRELATED = range(11)
NUM_COLUMNS = 11
# Columns of `texels`: the frame's are tangent, bitangent, normal, one after the other.
DIFFUSE, FIRST, SECOND, ALPHA, SECOND_ALPHA, SIGMA, FRAME = 0, 3, 6, 9, 11, 13, 14
NUM_TEXEL_VALUES = 23


class TableArrays(NamedTuple):
    """All tabulated surfaces of a world, one after the other.

    Factors of a BTF are stored as (texel, channel, rank) and (light, view, channel, rank), so that what is summed lies together;
    where channels share their spatial factors, as (texel, rank). What follows `factors` is as in `DirectionMeshes`: Numba takes no
    tuples within tuples into its threads.
    """

    rows: Any  # (R, NUM_COLUMNS) int64
    eta: Any  # (R,) float64: index of the lobes' Fresnel factor
    colour: Any  # (R, 3, 3) float64: from a BTF's channels to linear Rec. 709
    texels: Any  # (T, NUM_TEXEL_VALUES) float64
    factors: Any  # (N,) float32
    sets: Any
    nodes: Any
    triangles: Any
    neighbours: Any
    affine: Any
    starts: Any


@njit(cache=True)
def _corners(row, u, v):
    """Return the four texels around a place, row by row from 0, and their weights."""
    width, height = row[WIDTH], row[HEIGHT]
    x, y = u * width - 0.5, v * height - 0.5
    fx, fy = math.floor(x), math.floor(y)
    ax, ay = x - fx, y - fy
    x0, y0 = int(fx) % width, int(fy) % height
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    places = (y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1)
    return places, ((1.0 - ay) * (1.0 - ax), (1.0 - ay) * ax, ay * (1.0 - ax), ay * ax)


@njit(cache=True)
def _channel(tables, row, channel, places, lights, wl, views, wv):
    """Return a channel of a BTF at four texels, linear between three lights and three views."""
    rank, factors = row[RANK], tables.factors
    step = 3 * rank  # from a view to the next
    by_light = row[NUM_VIEWS] * step
    own, offset = (3 * rank, channel * rank) if row[DECORRELATED] else (rank, 0)
    s0 = row[SPATIAL] + places[0] * own + offset
    s1 = row[SPATIAL] + places[1] * own + offset
    s2 = row[SPATIAL] + places[2] * own + offset
    s3 = row[SPATIAL] + places[3] * own + offset
    base = row[ANGULAR] + channel * rank
    t0 = t1 = t2 = t3 = 0.0
    for k in range(rank):
        a = 0.0
        for i in range(3):
            if wl[i] > 0.0:
                at = base + lights[i] * by_light + k
                along = wv[0] * factors[at + views[0] * step]
                along += wv[1] * factors[at + views[1] * step] + wv[2] * factors[at + views[2] * step]
                a += wl[i] * along
        t0 += a * factors[s0 + k]
        t1 += a * factors[s1 + k]
        t2 += a * factors[s2 + k]
        t3 += a * factors[s3 + k]
    return t0, t1, t2, t3


@njit(cache=True)
def _btf(tables, which, u, v, wo, wi):
    """Return f cos_i of a BTF; what compression brought below 0 at a texel is 0 there."""
    row, m = tables.rows[which], tables.colour[which]
    lights, wl = locate(tables, row[LIGHTS], wi)
    views, wv = locate(tables, row[VIEWS], wo)
    fade = 1.0
    if lights[0] == lights[1]:
        # Beyond the rim of what was measured f stands, so that light fades to the horizon. On the disc, r^2 is 1 - cos.
        node = tables.nodes[tables.sets[row[LIGHTS], NODE] + lights[0]]
        fade = wi[2] / max(1.0 - node[0] * node[0] - node[1] * node[1], 1e-6)
    places, shares = _corners(row, u, v)
    c0 = _channel(tables, row, 0, places, lights, wl, views, wv)
    c1 = _channel(tables, row, 1, places, lights, wl, views, wv)
    c2 = _channel(tables, row, 2, places, lights, wl, views, wv)
    r = g = b = 0.0
    for k in range(4):
        r += shares[k] * max(m[0, 0] * c0[k] + m[0, 1] * c1[k] + m[0, 2] * c2[k], 0.0)
        g += shares[k] * max(m[1, 0] * c0[k] + m[1, 1] * c1[k] + m[1, 2] * c2[k], 0.0)
        b += shares[k] * max(m[2, 0] * c0[k] + m[2, 1] * c1[k] + m[2, 2] * c2[k], 0.0)
    return r * fade, g * fade, b * fade


@njit(cache=True)
def _turned(texel, w):
    """Return the coordinates of w in a texel's own frame."""
    x = w[0] * texel[FRAME] + w[1] * texel[FRAME + 1] + w[2] * texel[FRAME + 2]
    y = w[0] * texel[FRAME + 3] + w[1] * texel[FRAME + 4] + w[2] * texel[FRAME + 5]
    z = w[0] * texel[FRAME + 6] + w[1] * texel[FRAME + 7] + w[2] * texel[FRAME + 8]
    return x, y, z


@njit(cache=True, error_model="numpy")
def _lobe(kind, f0, wo, wi, alpha_u, alpha_v):
    alpha_u, alpha_v = max(alpha_u, ALPHA_MIN), max(alpha_v, ALPHA_MIN)
    if kind == GGX:
        return ggx.evaluate_schlick(wo, wi, f0, alpha_u, alpha_v)
    if kind == PHONG:
        return phong.evaluate(wo, wi, alpha_u)
    if kind == COOK_TORRANCE:
        return cook_torrance.evaluate(wo, wi, f0, alpha_u, alpha_v)
    return ward.evaluate(wo, wi, alpha_u, alpha_v, ward.BOUNDED)


@njit(cache=True)
def _is_glossy(texel, first):
    return texel[first] + texel[first + 1] + texel[first + 2] > 0.0


@njit(cache=True, error_model="numpy")
def _fitted(tables, which, u, v, wo, wi):
    """Return f cos_i of fitted parameters, each texel about its own normal."""
    row = tables.rows[which]
    f0 = normal_reflectance(tables.eta[which])
    places, shares = _corners(row, u, v)
    r = g = b = 0.0
    for k in range(4):
        texel = tables.texels[row[TEXEL] + places[k]]
        o, i = _turned(texel, wo), _turned(texel, wi)
        if o[2] <= 0.0 or i[2] <= 0.0:
            continue
        one = _lobe(row[KIND], f0, o, i, texel[ALPHA], texel[ALPHA + 1]) if _is_glossy(texel, FIRST) else 0.0
        two = 0.0
        if _is_glossy(texel, SECOND):
            two = _lobe(row[KIND], f0, o, i, texel[SECOND_ALPHA], texel[SECOND_ALPHA + 1])
        s, matte = shares[k] * i[2], oren_nayar.evaluate(o, i, texel[SIGMA])
        r += s * (texel[DIFFUSE] * matte + texel[FIRST] * one + texel[SECOND] * two)
        g += s * (texel[DIFFUSE + 1] * matte + texel[FIRST + 1] * one + texel[SECOND + 1] * two)
        b += s * (texel[DIFFUSE + 2] * matte + texel[FIRST + 2] * one + texel[SECOND + 2] * two)
    return r, g, b


@njit(cache=True, error_model="numpy")
def evaluate(tables, which, u, v, wo, wi):
    """Return f per channel; black below the coarse surface."""
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return (0.0, 0.0, 0.0)
    if tables.rows[which, LIGHTS] >= 0:
        r, g, b = _btf(tables, which, u, v, wo, wi)
    else:
        r, g, b = _fitted(tables, which, u, v, wo, wi)
    s = 1.0 / wi[2]
    return (r * s, g * s, b * s)


@njit(cache=True)
def _mean(texel, first):
    return (texel[first] + texel[first + 1] + texel[first + 2]) / 3.0


@njit(cache=True)
def _guide(tables, which, texel):
    """Return a grey surface with the lobes of a texel, from which directions are drawn."""
    d, s0, s1 = _mean(texel, DIFFUSE), _mean(texel, FIRST), _mean(texel, SECOND)
    more = (1.0, 1.0, 1.0, s1, texel[SECOND_ALPHA], texel[SECOND_ALPHA + 1], float(ward.BOUNDED), 0.0, 0.0, 0.0)
    alpha_u, alpha_v = texel[ALPHA], texel[ALPHA + 1]
    kind = tables.rows[which, KIND]
    return Surface(kind, d, d, d, s0, tables.eta[which], alpha_u, alpha_v, 1.33, 0.0, 0.0, 0.0, 0.0, more)


@njit(cache=True)
def _guides(tables, which, u, v, wo):
    """Return the texels to draw from, and their probabilities: those that face away from the view show nothing."""
    row = tables.rows[which]
    if row[LIGHTS] >= 0:
        first = row[TEXEL]
        return (first, first, first, first), (1.0, 0.0, 0.0, 0.0)
    places, shares = _corners(row, u, v)
    total = 0.0
    s0 = s1 = s2 = s3 = 0.0
    t0, t1, t2, t3 = row[TEXEL] + places[0], row[TEXEL] + places[1], row[TEXEL] + places[2], row[TEXEL] + places[3]
    if _turned(tables.texels[t0], wo)[2] > 0.0:
        s0 = shares[0]
    if _turned(tables.texels[t1], wo)[2] > 0.0:
        s1 = shares[1]
    if _turned(tables.texels[t2], wo)[2] > 0.0:
        s2 = shares[2]
    if _turned(tables.texels[t3], wo)[2] > 0.0:
        s3 = shares[3]
    total = s0 + s1 + s2 + s3
    scale = 1.0 / total if total > 0.0 else 0.0
    return (t0, t1, t2, t3), (s0 * scale, s1 * scale, s2 * scale, s3 * scale)


@njit(cache=True, error_model="numpy")
def pdf(tables, which, u, v, wo, wi):
    """Return the density of `sample` per solid angle."""
    if wo[2] <= 0.0 or wi[2] <= 0.0:
        return 0.0
    chosen, shares = _guides(tables, which, u, v, wo)
    density = 0.0
    for k in range(4):
        if shares[k] > 0.0:
            texel = tables.texels[chosen[k]]
            i = _turned(texel, wi)
            if i[2] > 0.0:
                density += shares[k] * lobes.pdf(_guide(tables, which, texel), _turned(texel, wo), i)
    return density


@njit(cache=True, error_model="numpy")
def sample(tables, which, u, v, wo, u0, u1, u2):
    """Return wi, the weight f cos_i / pdf per channel, and the pdf; a weight of 0 is light absorbed."""
    black = (0.0, 0.0, 0.0)
    if wo[2] <= 0.0:
        return (-wo[0], -wo[1], wo[2]), black, 0.0
    chosen, shares = _guides(tables, which, u, v, wo)
    k = 0
    while k < 3 and u2 >= shares[k]:
        u2 -= shares[k]
        k += 1
    if shares[k] <= 0.0:
        return (-wo[0], -wo[1], wo[2]), black, 0.0
    # What is left of the number that chose the texel chooses the lobe.
    u2 = min(u2 / shares[k], 1.0)
    texel = tables.texels[chosen[k]]
    w = lobes.sample(_guide(tables, which, texel), _turned(texel, wo), u0, u1, u2)
    wi = (
        w[0] * texel[FRAME] + w[1] * texel[FRAME + 3] + w[2] * texel[FRAME + 6],
        w[0] * texel[FRAME + 1] + w[1] * texel[FRAME + 4] + w[2] * texel[FRAME + 7],
        w[0] * texel[FRAME + 2] + w[1] * texel[FRAME + 5] + w[2] * texel[FRAME + 8],
    )
    density = pdf(tables, which, u, v, wo, wi)
    if w[2] <= 0.0 or density <= 0.0:
        return wi, black, 0.0
    f = evaluate(tables, which, u, v, wo, wi)
    s = wi[2] / density
    return wi, (f[0] * s, f[1] * s, f[2] * s), density
