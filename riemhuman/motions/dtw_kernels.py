"""Compiled dynamic programming of time warping: least sums of costs along monotone paths.

Weights are symmetric (Sakoe and Chiba, "Dynamic programming algorithm optimization for spoken word
recognition", IEEE TASSP 26, 1978): a step in both motions weighs 2, in one of them 1. Every path
from corner to corner therefore has the weight n + m.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compiled import compiled


@compiled
def accumulate(costs: ndarray, window: float, most: float, sums: ndarray) -> int:
    """Fill in the least sums of all paths that end in each cell.

    Parameters
    ----------
    costs : array, shape (n, m)
        Costs of cells.
    window : float
        Largest distance of matched frames, as a share of each motion; infinite for no limit.
    most : float
        The search stops when all sums exceed this.
    sums : array, shape (n, m)
        Least sums, infinite where no path leads; written to.

    Returns
    -------
    int
        Number of rows filled.
    """
    n, m = costs.shape
    for i in range(n):
        least = math.inf
        for j in range(m):
            best = math.inf
            if abs(i * (m - 1) - j * (n - 1)) <= window * (n - 1) * (m - 1):
                cost = costs[i, j]
                if i == 0 and j == 0:
                    best = 2.0 * cost
                if i > 0 and j > 0:
                    best = sums[i - 1, j - 1] + 2.0 * cost
                if i > 0:
                    best = min(best, sums[i - 1, j] + cost)
                if j > 0:
                    best = min(best, sums[i, j - 1] + cost)
            sums[i, j] = best
            least = min(least, best)
        if least > most:
            return i + 1
    return n


@compiled
def trace(costs: ndarray, sums: ndarray, path: ndarray) -> int:
    """Write the path of the least sum, from its last cell to its first.

    Parameters
    ----------
    costs, sums : array, shape (n, m)
        Costs of cells, and the sums that `accumulate` found.
    path : array of int, shape (n + m, 2)
        Cells, the last first; written to.

    Returns
    -------
    int
        Number of cells.
    """
    i, j = costs.shape[0] - 1, costs.shape[1] - 1
    length = 0
    while True:
        path[length, 0], path[length, 1] = i, j
        length += 1
        if i == 0 and j == 0:
            return length
        if i > 0 and j > 0 and sums[i, j] == sums[i - 1, j - 1] + 2.0 * costs[i, j]:
            i, j = i - 1, j - 1
        elif i > 0 and sums[i, j] == sums[i - 1, j] + costs[i, j]:
            i -= 1
        else:
            j -= 1


@compiled
def between_frames(costs: ndarray, steps_a: ndarray, steps_b: ndarray) -> ndarray:
    r"""Return the costs of frames, matched also with positions between frames.

    At the share s of the way from y to z, a frame x is at the squared distance (1 − s) d(x, y)² +
    s d(x, z)² − s (1 − s) d(y, z)², by Stewart's theorem, which holds in flat spaces. The cost of
    two frames is the mean of those of the first with places about the second and the other way.

    Parameters
    ----------
    costs : array, shape (n, m)
        Squared distances of frames.
    steps_a, steps_b : array, shape (n - 1,) and (m - 1,)
        Squared distances of consecutive frames.

    Returns
    -------
    array, shape (n, m)
    """
    n, m = costs.shape
    nearer = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            here = costs[i, j]
            one, other = here, here
            if j + 1 < m:
                one = min(one, _near(here, costs[i, j + 1], steps_b[j]))
            if j > 0:
                one = min(one, _near(here, costs[i, j - 1], steps_b[j - 1]))
            if i + 1 < n:
                other = min(other, _near(here, costs[i + 1, j], steps_a[i]))
            if i > 0:
                other = min(other, _near(here, costs[i - 1, j], steps_a[i - 1]))
            nearer[i, j] = 0.5 * (one + other)
    return nearer


@compiled
def _near(here: float, there: float, step: float) -> float:
    if step <= 0.0:
        return here
    share = min(max(0.5 * (here - there + step) / step, 0.0), 0.5)
    return max((1.0 - share) * here + share * there - share * (1.0 - share) * step, 0.0)


@compiled
def lower_bound(costs: ndarray, window: float) -> float:
    """Return a lower bound of the sums of all paths from corner to corner.

    Every frame has weight 1 in the cells it is matched in, and each of these costs at least the
    minimum within the window.

    Parameters
    ----------
    costs : array, shape (n, m)
        Costs of cells.
    window : float
        Largest distance of matched frames, as a share of each motion.

    Returns
    -------
    float
    """
    n, m = costs.shape
    in_rows = np.full(n, math.inf)
    in_columns = np.full(m, math.inf)
    for i in range(n):
        for j in range(m):
            if abs(i * (m - 1) - j * (n - 1)) <= window * (n - 1) * (m - 1):
                in_rows[i] = min(in_rows[i], costs[i, j])
                in_columns[j] = min(in_columns[j], costs[i, j])
    return in_rows.sum() + in_columns.sum()


@compiled
def follow(
    costs: ndarray, first: int, sums: ndarray, starts: ndarray, totals: ndarray, begins: ndarray
) -> None:
    """Extend paths that may begin at any frame of a long motion, and record those that end.

    Parameters
    ----------
    costs : array, shape (n, k)
        Costs of a query's frames with the next k frames of the motion.
    first : int
        Number of the first of these frames.
    sums : array, shape (n,)
        Least sums of paths up to each frame of the query, at the previous frame; updated.
    starts : array of int, shape (n,)
        Frames where these paths begin; updated.
    totals : array, shape (k,)
        Least sums of paths of the whole query that end at each frame; written to.
    begins : array of int, shape (k,)
        Frames where these begin; written to.
    """
    n, k = costs.shape
    for j in range(k):
        # Sums of the frame of the query before, at the frame of the motion before.
        corner, corner_start = math.inf, 0
        for i in range(n):
            beside, beside_start = sums[i], starts[i]
            cost = costs[i, j]
            best, start = beside + cost, beside_start
            if i == 0 and 2.0 * cost <= best:
                best, start = 2.0 * cost, first + j
            if i > 0:
                if corner + 2.0 * cost < best:
                    best, start = corner + 2.0 * cost, corner_start
                if sums[i - 1] + cost < best:
                    best, start = sums[i - 1] + cost, starts[i - 1]
            corner, corner_start = beside, beside_start
            sums[i], starts[i] = best, start
        totals[j], begins[j] = sums[n - 1], starts[n - 1]
