"""Ground grown over a grid of lowest heights, cell by cell from seeds, each from the plane of its accepted neighbours."""

import numpy as np
from numba import njit


@njit(cache=True)
def lowest_heights(cell_start, z, support, band):
    """Return per cell the lowest height that is not alone, of points sorted by (cell, z); NaN where the cell is empty.

    A height counts if `support` further points of the cell lie within `band` above it (fewer where the cell has fewer):
    beams reflected twice give single points below the ground.
    """
    num_cells = len(cell_start) - 1
    low = np.full(num_cells, np.nan)
    for c in range(num_cells):
        first, last = cell_start[c], cell_start[c + 1]
        if first == last:
            continue
        need = min(support, last - first - 1)
        low[c] = z[first]
        for i in range(first, last - need):
            if z[i + need] - z[i] <= band:
                low[c] = z[i]
                break
    return low


@njit(cache=True)
def local_plane(low, accepted, row, col, radius, cell, stiffness):
    """Return height and slopes (z, dz/drow, dz/dcol) [m, 1, 1] of the accepted cells about one cell.

    `stiffness` pulls the slopes to 0: a plane through few or aligned cells must not tilt freely.
    """
    rows, cols = low.shape
    n, sx, sy, sz, sxx, sxy, syy, sxz, syz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(max(row - radius, 0), min(row + radius + 1, rows)):
        for j in range(max(col - radius, 0), min(col + radius + 1, cols)):
            if accepted[i, j]:
                x, y, z = (i - row) * cell, (j - col) * cell, low[i, j]
                n += 1
                sx += x
                sy += y
                sz += z
                sxx += x * x
                sxy += x * y
                syy += y * y
                sxz += x * z
                syz += y * z
    mx, my, mz = sx / n, sy / n, sz / n
    cxx = sxx - n * mx * mx + stiffness
    cyy = syy - n * my * my + stiffness
    cxy = sxy - n * mx * my
    cxz = sxz - n * mx * mz
    cyz = syz - n * my * mz
    det = cxx * cyy - cxy * cxy
    a = (cxz * cyy - cyz * cxy) / det
    b = (cyz * cxx - cxz * cxy) / det
    return mz - a * mx - b * my, a, b


@njit(cache=True)
def _continues(low, accepted, row, col, radius, cell, step, max_slope):
    """Return whether a cell rises and falls no more than a step and a slope allow against all ground within a radius.

    Against all, not only the nearest: else a hedge or a heap is climbed in steps.
    """
    rows, cols = low.shape
    for i in range(max(row - radius, 0), min(row + radius + 1, rows)):
        for j in range(max(col - radius, 0), min(col + radius + 1, cols)):
            if accepted[i, j]:
                away = cell * np.sqrt((i - row) ** 2 + (j - col) ** 2)
                if abs(low[row, col] - low[i, j]) > step + max_slope * away:
                    return False
    return True


@njit(cache=True)
def grow(low, is_foot, accepted, reach, cell, step, foot_step, step_per_metre, max_slope, stiffness):
    """Accept cells outwards from those already accepted, in place.

    Parameters
    ----------
    low : (rows, cols) lowest heights, NaN where empty [m]
    is_foot : (rows, cols) bool, something tall stands on the cell
    accepted : (rows, cols) bool, the seeds
    reach : (rows, cols) int, how many cells a gap may be wide there
    step, foot_step, step_per_metre : largest departure from the neighbours' plane [m] of open cells and of those below
        something tall, and its growth with the gap
    """
    rows, cols = low.shape
    queue = np.empty((rows * cols + 1, 2), np.int32)
    head, tail = 0, 0
    for i in range(rows):
        for j in range(cols):
            if accepted[i, j]:
                queue[tail, 0], queue[tail, 1] = i, j
                tail += 1
    while head < tail:
        i, j = queue[head]
        head += 1
        r = reach[i, j]
        _, a, b = local_plane(low, accepted, i, j, r + 2, cell, stiffness)
        length = np.sqrt(a * a + b * b)
        if length > max_slope:
            a, b = a * max_slope / length, b * max_slope / length
        for k in range(max(i - r, 0), min(i + r + 1, rows)):
            for m in range(max(j - r, 0), min(j + r + 1, cols)):
                if accepted[k, m] or np.isnan(low[k, m]):
                    continue
                x, y = (k - i) * cell, (m - j) * cell
                away = np.sqrt(x * x + y * y)
                allowed = (foot_step if is_foot[k, m] else step) + step_per_metre * away
                # From the cell's own height, not the plane's: a kerb must not push the whole neighbourhood up.
                if abs(low[k, m] - (low[i, j] + a * x + b * y)) > allowed:
                    continue
                if _continues(low, accepted, k, m, 6, cell, step, max_slope):
                    accepted[k, m] = True
                    queue[tail, 0], queue[tail, 1] = k, m
                    tail += 1
