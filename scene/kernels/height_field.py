"""A height field over a grid, by conjugate gradients without a matrix: data at points, thin-plate energy between nodes."""

import numpy as np
from numba import njit


@njit(cache=True)
def interpolate(h, rows, cols):
    """Return the field at fractional node positions (N,), bilinear."""
    out = np.empty(len(rows))
    last_row, last_col = h.shape[0] - 2, h.shape[1] - 2
    for n in range(len(rows)):
        i = min(max(int(np.floor(rows[n])), 0), last_row)
        j = min(max(int(np.floor(cols[n])), 0), last_col)
        a, b = rows[n] - i, cols[n] - j
        out[n] = (1 - a) * ((1 - b) * h[i, j] + b * h[i, j + 1]) + a * ((1 - b) * h[i + 1, j] + b * h[i + 1, j + 1])
    return out


@njit(cache=True)
def add_data(h, rows, cols, weights, values, out):
    """Add B^T W (B h - values) to `out`, B being bilinear interpolation; without values give zeros."""
    last_row, last_col = h.shape[0] - 2, h.shape[1] - 2
    for n in range(len(rows)):
        i = min(max(int(np.floor(rows[n])), 0), last_row)
        j = min(max(int(np.floor(cols[n])), 0), last_col)
        a, b = rows[n] - i, cols[n] - j
        w00, w01, w10, w11 = (1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b
        g = weights[n] * (w00 * h[i, j] + w01 * h[i, j + 1] + w10 * h[i + 1, j] + w11 * h[i + 1, j + 1] - values[n])
        out[i, j] += w00 * g
        out[i, j + 1] += w01 * g
        out[i + 1, j] += w10 * g
        out[i + 1, j + 1] += w11 * g


@njit(cache=True)
def add_bending(h, near, stiff_rows, stiff_cols, stiff_twist, out):
    """Add the gradient of the bending energy to `out`: weighted squares of the three second differences.

    `near` marks the nodes whose 3 x 3 neighbourhood is part of the problem; others carry no energy.
    """
    for i in range(1, h.shape[0] - 1):
        for j in range(1, h.shape[1] - 1):
            if not near[i, j]:
                continue
            g = stiff_rows[i, j] * (h[i - 1, j] - 2 * h[i, j] + h[i + 1, j])
            out[i - 1, j] += g
            out[i, j] -= 2 * g
            out[i + 1, j] += g
            g = stiff_cols[i, j] * (h[i, j - 1] - 2 * h[i, j] + h[i, j + 1])
            out[i, j - 1] += g
            out[i, j] -= 2 * g
            out[i, j + 1] += g
            g = 2 * stiff_twist[i, j] * (h[i, j] - h[i, j + 1] - h[i + 1, j] + h[i + 1, j + 1])
            out[i, j] += g
            out[i, j + 1] -= g
            out[i + 1, j] -= g
            out[i + 1, j + 1] += g


@njit(cache=True)
def diagonal(shape, rows, cols, weights, near, stiff_rows, stiff_cols, stiff_twist):
    """Return the diagonal of the system, the preconditioner."""
    out = np.zeros(shape)
    last_row, last_col = shape[0] - 2, shape[1] - 2
    for n in range(len(rows)):
        i = min(max(int(np.floor(rows[n])), 0), last_row)
        j = min(max(int(np.floor(cols[n])), 0), last_col)
        a, b = rows[n] - i, cols[n] - j
        out[i, j] += weights[n] * ((1 - a) * (1 - b)) ** 2
        out[i, j + 1] += weights[n] * ((1 - a) * b) ** 2
        out[i + 1, j] += weights[n] * (a * (1 - b)) ** 2
        out[i + 1, j + 1] += weights[n] * (a * b) ** 2
    for i in range(1, shape[0] - 1):
        for j in range(1, shape[1] - 1):
            if not near[i, j]:
                continue
            g = stiff_rows[i, j]
            out[i - 1, j] += g
            out[i, j] += 4 * g
            out[i + 1, j] += g
            g = stiff_cols[i, j]
            out[i, j - 1] += g
            out[i, j] += 4 * g
            out[i, j + 1] += g
            g = 2 * stiff_twist[i, j]
            out[i, j] += g
            out[i, j + 1] += g
            out[i + 1, j] += g
            out[i + 1, j + 1] += g
    return out


@njit(cache=True)
def conjugate_gradients(h, free, rows, cols, weights, values, near, stiff_rows, stiff_cols, stiff_twist, iterations, tolerance):
    """Improve `h` in place at its free nodes; return the iterations done.

    Stops when the preconditioned residual has fallen by `tolerance`. Serial on purpose: sums in one order give the same
    bits on any machine with any number of threads.
    """
    num_rows, num_cols = h.shape
    zeros = np.zeros(len(values))
    residual = np.zeros_like(h)
    add_data(h, rows, cols, weights, values, residual)
    add_bending(h, near, stiff_rows, stiff_cols, stiff_twist, residual)
    inverse = diagonal(h.shape, rows, cols, weights, near, stiff_rows, stiff_cols, stiff_twist)
    direction, product = np.zeros_like(h), np.zeros_like(h)
    rz = 0.0
    for i in range(num_rows):
        for j in range(num_cols):
            usable = free[i, j] and inverse[i, j] > 0
            inverse[i, j] = 1.0 / inverse[i, j] if usable else 0.0
            residual[i, j] = -residual[i, j] if usable else 0.0
            direction[i, j] = inverse[i, j] * residual[i, j]
            rz += residual[i, j] * direction[i, j]
    start = rz
    for iteration in range(iterations):
        if rz <= tolerance * tolerance * start or rz == 0:
            return iteration
        product[:] = 0
        add_data(direction, rows, cols, weights, zeros, product)
        add_bending(direction, near, stiff_rows, stiff_cols, stiff_twist, product)
        dp = 0.0
        for i in range(num_rows):
            for j in range(num_cols):
                dp += direction[i, j] * product[i, j]
        step = rz / dp
        new = 0.0
        for i in range(num_rows):
            for j in range(num_cols):
                if inverse[i, j] > 0:
                    h[i, j] += step * direction[i, j]
                    residual[i, j] -= step * product[i, j]
                    new += residual[i, j] * residual[i, j] * inverse[i, j]
        beta = new / rz
        rz = new
        for i in range(num_rows):
            for j in range(num_cols):
                direction[i, j] = inverse[i, j] * residual[i, j] + beta * direction[i, j]
    return iterations
