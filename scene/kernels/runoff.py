"""Where rain runs and stands: priority flood of a height field, catchments, and the level of each hollow."""

import heapq

import numpy as np
from numba import njit


@njit(cache=True)
def priority_flood(z, is_outlet):
    """Fill a height field to its spill levels from the outlets inwards (Barnes, Lehman and Mulla 2014).

    Returns the filled heights, the cell each cell drains to (flat index, itself at an outlet), the hollow it lies in
    (0 = none; cells of one hollow share a level), the order in which cells were reached, and the number of hollows.
    """
    rows, cols = z.shape
    filled = z.copy()
    parent = np.full(rows * cols, -1, np.int64)
    hollow = np.zeros(rows * cols, np.int32)
    behind = np.zeros(rows * cols, np.int32)
    order = np.empty(rows * cols, np.int64)
    heap = [(np.float64(0.0), np.int64(0))]
    heap.pop()
    for i in range(rows):
        for j in range(cols):
            if is_outlet[i, j]:
                heapq.heappush(heap, (np.float64(z[i, j]), np.int64(i * cols + j)))
                parent[i * cols + j] = i * cols + j
    count = 0
    num_hollows = 0
    while len(heap) > 0:
        level, cell = heapq.heappop(heap)
        order[count] = cell
        count += 1
        i, j = cell // cols, cell % cols
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if a < 0 or b < 0 or a >= rows or b >= cols:
                    continue
                near = a * cols + b
                if parent[near] >= 0:
                    continue
                parent[near] = cell
                if z[a, b] < level:
                    filled[a, b] = level
                    # A cell of the rim stands for the one hollow behind it, whichever neighbour is met first.
                    if hollow[cell] == 0 and behind[cell] == 0:
                        num_hollows += 1
                        behind[cell] = num_hollows
                    hollow[near] = hollow[cell] if hollow[cell] > 0 else behind[cell]
                heapq.heappush(heap, (np.float64(filled[a, b]), near))
    return filled, parent, hollow.reshape(rows, cols), order[:count], num_hollows


@njit(cache=True)
def catchment(parent, order):
    """Return how many cells drain through each cell, itself included: children come after parents in `order`."""
    area = np.ones(len(parent), np.float64)
    for k in range(len(order) - 1, -1, -1):
        cell = order[k]
        if parent[cell] != cell:
            area[parent[cell]] += area[cell]
    return area


@njit(cache=True)
def hollow_levels(z, filled, hollow, area, num_hollows, excess, cell):
    """Return the water level of each hollow (index 0 unused) after `excess` metres of rain ran off.

    A hollow of capacity S with rain volume V arriving holds S (1 - exp(-V / S)) (Linsley, Kohler and Paulhus 1949); the
    level that volume reaches is found by bisection on the hollow's own cells.
    """
    rows, cols = z.shape
    capacity = np.zeros(num_hollows + 1)
    arriving = np.zeros(num_hollows + 1)
    low = np.full(num_hollows + 1, np.inf)
    high = np.full(num_hollows + 1, -np.inf)
    size = np.zeros(num_hollows + 2, np.int64)
    for i in range(rows):
        for j in range(cols):
            h = hollow[i, j]
            if h > 0:
                capacity[h] += (filled[i, j] - z[i, j]) * cell * cell
                arriving[h] = max(arriving[h], area[i * cols + j] * cell * cell * excess)
                low[h] = min(low[h], z[i, j])
                high[h] = max(high[h], filled[i, j])
                size[h + 1] += 1
    start = np.cumsum(size)
    heights = np.empty(start[-1])
    place = start.copy()
    for i in range(rows):
        for j in range(cols):
            h = hollow[i, j]
            if h > 0:
                heights[place[h]] = z[i, j]
                place[h] += 1
    level = np.full(num_hollows + 1, -np.inf)
    for h in range(1, num_hollows + 1):
        if capacity[h] <= 0.0:
            continue
        volume = capacity[h] * (1.0 - np.exp(-arriving[h] / capacity[h]))
        a, b = low[h], high[h]
        for _ in range(40):
            middle = 0.5 * (a + b)
            held = 0.0
            for k in range(start[h], start[h + 1]):
                held += max(middle - heights[k], 0.0)
            if held * cell * cell < volume:
                a = middle
            else:
                b = middle
        level[h] = 0.5 * (a + b)
    return level
