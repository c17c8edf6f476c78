"""Loops over a top-view grid: heights of a mesh, filters, holes."""

import numpy as np
from numba import njit, prange


@njit(cache=True)
def rasterise_top(vertices, faces, x_min, y_min, cell, height):
    """Write the highest surface above each cell's centre into `height` (rows, cols), which starts as -inf."""
    rows, cols = height.shape
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        # In units of cells with centres at whole numbers.
        ax, ay, az = (vertices[i, 0] - x_min) / cell - 0.5, (vertices[i, 1] - y_min) / cell - 0.5, vertices[i, 2]
        bx, by, bz = (vertices[j, 0] - x_min) / cell - 0.5, (vertices[j, 1] - y_min) / cell - 0.5, vertices[j, 2]
        cx, cy, cz = (vertices[k, 0] - x_min) / cell - 0.5, (vertices[k, 1] - y_min) / cell - 0.5, vertices[k, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0.0:
            continue
        first_col, last_col = int(np.ceil(min(ax, bx, cx) - 1e-9)), int(np.floor(max(ax, bx, cx) + 1e-9))
        first_row, last_row = int(np.ceil(min(ay, by, cy) - 1e-9)), int(np.floor(max(ay, by, cy) + 1e-9))
        for row in range(max(first_row, 0), min(last_row, rows - 1) + 1):
            for col in range(max(first_col, 0), min(last_col, cols - 1) + 1):
                u = ((bx - col) * (cy - row) - (cx - col) * (by - row)) / area
                v = ((cx - col) * (ay - row) - (ax - col) * (cy - row)) / area
                w = 1.0 - u - v
                # A little slack, so that no cell falls between two triangles that share an edge.
                if u >= -1e-6 and v >= -1e-6 and w >= -1e-6:
                    z = u * az + v * bz + w * cz
                    if z > height[row, col]:
                        height[row, col] = z


@njit(cache=True, parallel=True)
def correlate_rows(source, taps, out):
    """Correlate along each row with an odd number of taps; beyond the border there is nothing (zeros).

    The taps are the outer loop: sums over neighbours cannot be vectorised, as their order would change; sums side by side can.
    """
    rows, cols = source.shape
    radius = len(taps) // 2
    for row in prange(rows):
        total = np.zeros(cols)
        for t in range(-radius, radius + 1):
            tap = taps[t + radius]
            for col in range(max(-t, 0), min(cols - t, cols)):
                total[col] += tap * source[row, col + t]
        out[row] = total


@njit(cache=True, parallel=True)
def correlate_columns(source, taps, out):
    """As `correlate_rows`, along the columns."""
    rows, cols = source.shape
    radius = len(taps) // 2
    for index in prange(rows):
        row = np.int64(index)  # the index of prange is unsigned: minus it would wrap
        total = np.zeros(cols)
        for t in range(max(-radius, -row), min(radius, rows - 1 - row) + 1):
            tap = taps[t + radius]
            for col in range(cols):
                total[col] += tap * source[row + t, col]
        out[row] = total


@njit(cache=True, parallel=True)
def local_plane(m, b, ridge, level, slope_x, slope_y):
    """Solve the weighted least squares plane of each cell from its moments.

    `m` (6, rows, cols) holds the moments of the weights 1, x, y, xx, xy, yy (x along columns), `b` (3, ...) those of weight
    times height 1, x, y, all in cells. Without any weight nearby the results are NaN.
    """
    rows, cols = level.shape
    for row in prange(rows):
        for col in range(cols):
            s, sx, sy = m[0, row, col], m[1, row, col], m[2, row, col]
            if s < 1e-4:
                level[row, col] = slope_x[row, col] = slope_y[row, col] = np.nan
                continue
            mx, my, mh = sx / s, sy / s, b[0, row, col] / s
            # About the centroid of the weights; the ridge keeps the slope finite where they lie on a line.
            xx = m[3, row, col] / s - mx * mx + ridge
            xy = m[4, row, col] / s - mx * my
            yy = m[5, row, col] / s - my * my + ridge
            xh = b[1, row, col] / s - mx * mh
            yh = b[2, row, col] / s - my * mh
            det = xx * yy - xy * xy
            gx, gy = (yy * xh - xy * yh) / det, (xx * yh - xy * xh) / det
            level[row, col] = mh - gx * mx - gy * my
            slope_x[row, col], slope_y[row, col] = gx, gy


@njit(cache=True)
def relax(values, known, sweeps):
    """Relax unknown cells in place towards the mean of their neighbours (Gauss-Seidel), known ones being fixed."""
    rows, cols = values.shape
    for _ in range(sweeps):
        for row in range(rows):
            for col in range(cols):
                if known[row, col]:
                    continue
                total, count = 0.0, 0
                if row > 0:
                    total, count = total + values[row - 1, col], count + 1
                if row < rows - 1:
                    total, count = total + values[row + 1, col], count + 1
                if col > 0:
                    total, count = total + values[row, col - 1], count + 1
                if col < cols - 1:
                    total, count = total + values[row, col + 1], count + 1
                values[row, col] = total / count if count > 0 else values[row, col]
