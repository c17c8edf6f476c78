"""How far light gets in a medium before a particle stops it: flights and transmittances.

Where the optical depth has a closed form (even, or thinning with height) it is used and inverted. Elsewhere flights are
drawn by delta tracking (E. R. Woodcock et al., 1965) and transmittances estimated by ratio tracking (J. Novák, A. Selle and
W. Jarosz, "Residual Ratio Tracking for Estimating Attenuation in Participating Media", 2014): both unbiased, with upper
bounds of the extinction in the cells of a coarse grid that the ray is walked through. Extinction is the same in all
channels [1/m].
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from materials.kernels.lean import lean
from materials.kernels.phase import Phase
from scene.kernels import spray

from .emitters import FAR
from .sampler import hash2

EVEN, HEIGHT, GRID, SPRAY = 0, 1, 2, 3
_TO_UNIT = 2.0**-32


class MediumArrays(NamedTuple):
    """A medium in a box (infinite bounds: everywhere).

    EVEN has `sigma_t` in all of it; HEIGHT sigma_t exp(-(z - base_z) / scale_height); GRID sigma_t times `density`, whose
    (nz, ny, nx) values stand at the centres of as many cells of the box, trilinear between them; SPRAY has that of
    `scene.kernels.spray.extinction`, sigma_t being that of the mist at the ground.
    """

    kind: int
    sigma_t: float
    albedo: Any  # (3,) float64
    phase: Any  # (4,) float64: the fields of materials.kernels.phase.Phase
    low: Any  # (3,) float64
    high: Any  # (3,) float64
    scale_height: float
    base_z: float
    density: Any  # (nz, ny, nx) float32
    majorant: Any  # (mz, my, mx) float32, upper bounds of the extinction in the cells of the box [1/m]
    ground: Any  # (rows, cols) float32, height of the ground below spray [m]
    ground_frame: Any  # (3,) float64: x_min, y_min and cell of `ground`
    noise: Any  # (4,) float64: scale, exponent, octaves and contrast of spray
    seed: Any  # uint64, of that noise
    wakes: Any  # (K, scene.kernels.wakes.COLUMNS) float64, spray behind tyres
    wake_low: Any  # (3,) float64, corners of the box that holds all wakes; high below low without any
    wake_high: Any  # (3,) float64


@lean()
def phase_of(medium):
    """Return the phase function."""
    q = medium.phase
    return Phase(q[0], q[1], q[2], q[3])


@lean()
def uniform(state, k):
    """Return the k-th number in [0, 1) of a stream; tracking needs more of them than a sampler has dimensions."""
    return hash2(state, np.uint32(k)) * _TO_UNIT


@lean()
def tracking(stream, index, dimension):
    """Return the stream of numbers that tracks a ray; those of `draw1` and `draw2` are others, as they hash in another order."""
    return hash2(hash2(stream, np.uint32(index)), np.uint32(dimension))


@lean(error_model="numpy")
def span(medium, o, d, far):
    """Return where a ray enters and leaves the medium's box [m]; entry beyond exit is a miss."""
    return _span(medium.low, medium.high, o, d, far)


@lean(error_model="numpy")
def wake_span(medium, o, d, far):
    """As `span`, of the box that holds all wakes."""
    return _span(medium.wake_low, medium.wake_high, o, d, far)


@lean(error_model="numpy")
def _span(low, high, o, d, far):
    t0, t1 = 0.0, far
    for c in range(3):
        if d[c] == 0.0:
            if o[c] < low[c] or o[c] > high[c]:
                return FAR, 0.0
            continue
        a, b = (low[c] - o[c]) / d[c], (high[c] - o[c]) / d[c]
        t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
    return t0, t1


@lean(error_model="numpy")
def optical_depth(medium, o, d, t0, t1):
    """Return the integral of the extinction from t0 to t1, for kinds with a closed form."""
    if medium.kind == EVEN:
        return medium.sigma_t * (t1 - t0)
    start = medium.sigma_t * math.exp(-(o[2] + t0 * d[2] - medium.base_z) / medium.scale_height)
    rate = d[2] / medium.scale_height
    if rate == 0.0:
        return start * (t1 - t0)
    return -start * math.expm1(-rate * (t1 - t0)) / rate


@lean(error_model="numpy")
def density_at(medium, p):
    """Return the extinction at a point within the box, for kinds with a closed form [1/m]."""
    if medium.kind == EVEN:
        return medium.sigma_t
    return medium.sigma_t * math.exp(-(p[2] - medium.base_z) / medium.scale_height)


@lean(error_model="numpy")
def _distance_of(medium, o, d, t0, tau):
    """Return the distance at which the optical depth from t0 is tau, FAR where it never is."""
    if medium.sigma_t <= 0.0:
        return FAR
    if medium.kind == EVEN:
        return t0 + tau / medium.sigma_t
    start = medium.sigma_t * math.exp(-(o[2] + t0 * d[2] - medium.base_z) / medium.scale_height)
    if start <= 0.0:
        return FAR
    rate = d[2] / medium.scale_height
    x = rate * tau / start
    if x >= 1.0:  # the air above holds less than tau
        return FAR
    if abs(x) < 1e-9:
        return t0 + tau / start
    return t0 - math.log1p(-x) / rate


@lean()
def _cell(x, count):
    """Return the two neighbours and the weight of the second at x in [0, 1] among `count` cell centres."""
    x = min(max(x * count - 0.5, 0.0), count - 1.0)
    i = min(int(x), count - 1)
    return i, min(i + 1, count - 1), x - i


@lean(error_model="numpy")
def spray_extinction(medium, p, sigma, wakes):
    """Return the extinction of mist of `sigma` at the ground, and of some wakes [1/m]."""
    m = medium
    return spray.extinction(p, sigma, m.ground, m.ground_frame, m.scale_height, wakes, m.noise, m.seed)


@lean(error_model="numpy")
def extinction(medium, p):
    """Return the extinction at a point of the box of a medium that is tracked [1/m]."""
    if medium.kind == SPRAY:
        return spray_extinction(medium, p, medium.sigma_t, medium.wakes)
    q = medium.density
    k0, k1, w = _cell((p[2] - medium.low[2]) / (medium.high[2] - medium.low[2]), q.shape[0])
    j0, j1, v = _cell((p[1] - medium.low[1]) / (medium.high[1] - medium.low[1]), q.shape[1])
    i0, i1, u = _cell((p[0] - medium.low[0]) / (medium.high[0] - medium.low[0]), q.shape[2])
    below = (q[k0, j0, i0] * (1.0 - u) + q[k0, j0, i1] * u) * (1.0 - v) + (q[k0, j1, i0] * (1.0 - u) + q[k0, j1, i1] * u) * v
    above = (q[k1, j0, i0] * (1.0 - u) + q[k1, j0, i1] * u) * (1.0 - v) + (q[k1, j1, i0] * (1.0 - u) + q[k1, j1, i1] * u) * v
    return medium.sigma_t * (below * (1.0 - w) + above * w)


@lean(error_model="numpy")
def _axis(medium, c, count, x, d):
    """Return (cell, step, ray distance per cell, ray distance to the next border) of one axis of the walk at coordinate x."""
    size = (medium.high[c] - medium.low[c]) / count
    i = min(max(int((x - medium.low[c]) / size), 0), count - 1)
    if d == 0.0:
        return i, 0, FAR, FAR
    border = medium.low[c] + (i + (1 if d > 0.0 else 0)) * size
    return i, (1 if d > 0.0 else -1), size / abs(d), max((border - x) / d, 0.0)


@lean(error_model="numpy")
def _walk(medium, o, d, t0, t1, state, stops):
    """Walk through the cells; return (distance of the first collision or FAR, share of the light that gets through).

    With `stops` a tentative collision is real with probability extinction / bound, and ends the walk (delta tracking); else
    each leaves 1 - extinction / bound of the light (ratio tracking).
    """
    bound = medium.majorant
    mz, my, mx = bound.shape
    i, si, di, ti = _axis(medium, 0, mx, o[0] + t0 * d[0], d[0])
    j, sj, dj, tj = _axis(medium, 1, my, o[1] + t0 * d[1], d[1])
    k, sk, dk, tk = _axis(medium, 2, mz, o[2] + t0 * d[2], d[2])
    ti, tj, tk = t0 + ti, t0 + tj, t0 + tk
    t, share, draws = t0, 1.0, 1
    tau = -math.log(1.0 - uniform(state, 0))
    while t < t1:
        end = min(min(ti, tj), min(tk, t1))
        m = float(bound[k, j, i])
        while tau < m * (end - t):
            t += tau / m
            p = (o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2])
            real = extinction(medium, p) / m
            if stops:
                if uniform(state, draws) < real:
                    return t, 0.0
            else:
                share *= 1.0 - real
                if share < 0.05:  # roulette
                    if uniform(state, draws) < 0.5:
                        return FAR, 0.0
                    share *= 2.0
            tau = -math.log(1.0 - uniform(state, draws + 1))
            draws += 2
        tau -= m * (end - t)
        t = end
        if end >= t1:
            break
        if ti <= tj and ti <= tk:
            i, ti = i + si, ti + di
            if i < 0 or i >= mx:
                break
        elif tj <= tk:
            j, tj = j + sj, tj + dj
            if j < 0 or j >= my:
                break
        else:
            k, tk = k + sk, tk + dk
            if k < 0 or k >= mz:
                break
    return FAR, share


@lean(error_model="numpy")
def flight(medium, o, d, far, u, state):
    """Return the distance that light flies before it collides, FAR if it gets to `far`.

    The density is extinction times transmittance, so a collision weighs as much as the albedo, and its absence 1.
    """
    t0, t1 = span(medium, o, d, far)
    if t0 >= t1:
        return FAR
    if medium.kind >= GRID:
        return _walk(medium, o, d, t0, t1, state, True)[0]
    t = _distance_of(medium, o, d, t0, -math.log1p(-u))
    return t if t < t1 else FAR


@lean(error_model="numpy")
def transmittance(medium, o, d, far, state):
    """Return the share of the light that gets through to `far`: exact, or an unbiased estimate where it must be tracked."""
    t0, t1 = span(medium, o, d, far)
    if t0 >= t1:
        return 1.0
    if medium.kind >= GRID:
        return _walk(medium, o, d, t0, t1, state, False)[1]
    return math.exp(-optical_depth(medium, o, d, t0, t1))


@njit(cache=True)
def transmittance_many(medium, origins, directions, far, samples, seed, out):
    """Fill (N,) with the mean of `samples` estimates along each ray."""
    for n in range(len(far)):
        o = (origins[n, 0], origins[n, 1], origins[n, 2])
        d = (directions[n, 0], directions[n, 1], directions[n, 2])
        total = 0.0
        for i in range(samples):
            total += transmittance(medium, o, d, far[n], hash2(hash2(np.uint32(n), np.uint32(seed)), np.uint32(i)))
        out[n] = total / samples
