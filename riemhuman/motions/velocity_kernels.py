r"""Compiled matching of polygons by their square root velocities.

Two polygons with segments v_i and w_j have, after the best re-timing, the squared distance L + M −
2F of their lengths L, M and

.. math:: F = \max \int \cos^+\angle(v, w) \sqrt{ds\, dt}

over monotone matchings of arc lengths s and t. Within a pair of segments the cosine is constant, so
the best matching is a straight line through it (Lahiri, Robinson and Klassen, "Precise matching of
PL curves in R^N in the square root velocity framework", 2015). Its entry and exit are searched
among equally spaced positions on every side.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compiled import compiled


@compiled
def best_gain(products: ndarray, n_steps: int, lower: ndarray, left: ndarray) -> float:
    """Return F, and write the largest gains up to all points of the grid.

    Parameters
    ----------
    products : array, shape (n, m)
        Inner products of segments, each divided by the square roots of the lengths.
    n_steps : int
        Steps on the side of a cell.
    lower : array, shape (n + 1, m, n_steps + 1)
        Gains where i segments of the first polygon and a share of segment j of the second are
        done; written to.
    left : array, shape (n, m + 1, n_steps + 1)
        Gains where j segments of the second and a share of segment i of the first are done;
        written to.

    Returns
    -------
    float
    """
    n, m = products.shape
    roots = _roots(n_steps)
    lower[0] = 0.0
    left[:, 0] = 0.0
    for i in range(n):
        for j in range(m):
            gain = products[i, j]
            enter_low, enter_left = lower[i, j], left[i, j]
            leave_high, leave_right = lower[i + 1, j], left[i, j + 1]
            if gain <= 0.0:
                for k in range(n_steps + 1):
                    leave_high[k] = max(enter_left[n_steps], enter_low[k])
                    leave_right[k] = max(enter_low[n_steps], enter_left[k])
                continue
            for k in range(n_steps + 1):
                high = right = -math.inf
                for p in range(k + 1):
                    high = max(high, enter_low[p] + gain * roots[n_steps, k - p])
                    right = max(right, enter_left[p] + gain * roots[k - p, n_steps])
                for p in range(n_steps + 1):
                    high = max(high, enter_left[p] + gain * roots[n_steps - p, k])
                    right = max(right, enter_low[p] + gain * roots[k, n_steps - p])
                leave_high[k], leave_right[k] = high, right
    return max(lower[n, m - 1, n_steps], left[n - 1, m, n_steps])


@compiled
def trace_gain(
    products: ndarray, n_steps: int, lower: ndarray, left: ndarray, path: ndarray
) -> int:
    """Write the points where the best matching enters cells, from its end to its beginning.

    Parameters
    ----------
    products : array, shape (n, m)
        Inner products of segments, each divided by the square roots of the lengths.
    n_steps : int
        Steps on the side of a cell.
    lower, left : array
        Gains that `best_gain` wrote.
    path : array, shape (n + m + 2, 2)
        Places in segments of the first and of the second polygon; written to.

    Returns
    -------
    int
        Number of points.
    """
    n, m = products.shape
    roots = _roots(n_steps)
    # Where a cell is left: after `up` steps of the first polygon and `along` of the second.
    i, j, up, along = n - 1, m - 1, n_steps, n_steps
    path[0, 0], path[0, 1] = n, m
    length = 1
    while True:
        gain = max(products[i, j], 0.0)
        best, best_up, best_along = -math.inf, 0, 0
        for p in range(along + 1):
            value = lower[i, j, p] + gain * roots[up, along - p]
            if value > best:
                best, best_up, best_along = value, 0, p
        for p in range(up + 1):
            value = left[i, j, p] + gain * roots[up - p, along]
            if value > best:
                best, best_up, best_along = value, p, 0
        path[length, 0] = i + best_up / n_steps
        path[length, 1] = j + best_along / n_steps
        length += 1
        # Into the cell below, beside, or past the corner; along the border if there is none.
        if best_up == 0 and i > 0:
            i, up, along = i - 1, n_steps, best_along
            if best_along == 0 and j > 0:
                j, along = j - 1, n_steps
        elif best_along == 0 and j > 0:
            j, along, up = j - 1, n_steps, best_up
        else:
            if path[length - 1, 0] > 0.0 or path[length - 1, 1] > 0.0:
                path[length, 0], path[length, 1] = 0.0, 0.0
                length += 1
            return length


@compiled
def _roots(n_steps: int) -> ndarray:
    roots = np.empty((n_steps + 1, n_steps + 1))
    for k in range(n_steps + 1):
        for p in range(n_steps + 1):
            roots[k, p] = math.sqrt(k * p) / n_steps
    return roots
