"""What the variational flow algorithms spend their time on: sampling a moved picture, and relaxing the linear system.

All loops run in parallel over rows or strips of them; none reads what another thread writes meanwhile, so the number of
threads cannot change a bit.
"""

from numba import njit, prange

# Rows of a strip: few enough that its arrays stay in the cache of a core, many enough that its edges do not matter.
STRIP = 32


@njit(cache=True)
def _keys(t):
    """Return the four weights of cubic interpolation at t in [0, 1) between the second and the third sample (Keys 1981)."""
    t2, t3 = t * t, t * t * t
    return (
        -0.5 * t3 + t2 - 0.5 * t,
        1.5 * t3 - 2.5 * t2 + 1.0,
        -1.5 * t3 + 2.0 * t2 + 0.5 * t,
        0.5 * t3 - 0.5 * t2,
    )


@njit(cache=True, parallel=True)
def sample(stack, u, v, out, inside):
    """Interpolate each picture (C, H, W) at (column + u, row + v), as if its border went on for ever.

    `inside` tells which positions lie between the outermost pixel centres.
    """
    channels, height, width = stack.shape
    for i in prange(height):
        for j in range(width):
            x, y = j + u[i, j], i + v[i, j]
            inside[i, j] = x >= 0 and y >= 0 and x <= width - 1 and y <= height - 1
            x = min(max(x, 0.0), width - 1.0)
            y = min(max(y, 0.0), height - 1.0)
            j0, i0 = int(x), int(y)
            wx, wy = _keys(x - j0), _keys(y - i0)
            for c in range(channels):
                total = 0.0
                for a in range(4):
                    row = min(max(i0 + a - 1, 0), height - 1)
                    line = 0.0
                    for b in range(4):
                        line += wx[b] * stack[c, row, min(max(j0 + b - 1, 0), width - 1)]
                    total += wy[a] * line
                out[c, i, j] = total


@njit(cache=True, parallel=True)
def invert(d11, d12, d22, right, below, m11, m12, m22):
    """Write the inverse of each pixel's own 2 x 2 block of the system; 0 where it is singular."""
    height, width = d11.shape
    for i in prange(height):
        for j in range(width):
            weight = 0.0
            if j + 1 < width:
                weight += right[i, j]
            if j > 0:
                weight += right[i, j - 1]
            if i + 1 < height:
                weight += below[i, j]
            if i > 0:
                weight += below[i - 1, j]
            a11, a12, a22 = d11[i, j] + weight, d12[i, j], d22[i, j] + weight
            determinant = a11 * a22 - a12 * a12
            scale = 1.0 / determinant if determinant > 0.0 else 0.0
            m11[i, j], m12[i, j], m22[i, j] = scale * a22, -scale * a12, scale * a11


@njit(cache=True, parallel=True)
def relax(m11, m12, m22, b1, b2, right, below, u, v, du, dv, omega, sweeps, rounds):
    """Lower the quadratic energy in (du, dv) by successive over-relaxation, in place.

    The energy is the sum over pixels of `[du dv] D [du dv]' - 2 b [du dv]'` and over edges of
    `weight |(u + du, v + dv)_p - (u + du, v + dv)_q|²`; `right` and `below` are the weights of the edges to the next column
    and row. Each pixel's two unknowns are solved together. Every update minimises along its pixel exactly before it is
    over-relaxed, so for 0 < omega < 2 the energy never rises, in whatever order pixels come (Ostrowski 1954).

    That freedom saves waiting: strips of rows are relaxed several times before threads meet, first every other strip,
    then those between. Within a strip the pixels alternate like the squares of a chessboard.
    """
    height, width = u.shape
    strips = (height + STRIP - 1) // STRIP
    for step in range(2 * rounds):
        for k in prange((strips + 1 - step % 2) // 2):
            first = (2 * k + step % 2) * STRIP
            last = min(first + STRIP, height)
            for half in range(2 * sweeps):
                for i in range(first, last):
                    for j in range((i + half) % 2, width, 2):
                        su, sv = 0.0, 0.0
                        if j + 1 < width:
                            w = right[i, j]
                            su += w * (u[i, j + 1] + du[i, j + 1] - u[i, j])
                            sv += w * (v[i, j + 1] + dv[i, j + 1] - v[i, j])
                        if j > 0:
                            w = right[i, j - 1]
                            su += w * (u[i, j - 1] + du[i, j - 1] - u[i, j])
                            sv += w * (v[i, j - 1] + dv[i, j - 1] - v[i, j])
                        if i + 1 < height:
                            w = below[i, j]
                            su += w * (u[i + 1, j] + du[i + 1, j] - u[i, j])
                            sv += w * (v[i + 1, j] + dv[i + 1, j] - v[i, j])
                        if i > 0:
                            w = below[i - 1, j]
                            su += w * (u[i - 1, j] + du[i - 1, j] - u[i, j])
                            sv += w * (v[i - 1, j] + dv[i - 1, j] - v[i, j])
                        r1, r2 = b1[i, j] + su, b2[i, j] + sv
                        du[i, j] += omega * (m11[i, j] * r1 + m12[i, j] * r2 - du[i, j])
                        dv[i, j] += omega * (m12[i, j] * r1 + m22[i, j] * r2 - dv[i, j])
