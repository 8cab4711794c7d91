r"""Compiled dynamic programming over tables of costs between the frames of two motions.

Dynamic time warping uses the symmetric weights of Sakoe and Chiba ("Dynamic programming algorithm
optimization for spoken word recognition", IEEE TASSP 26, 1978): a step in both motions has weight
2, a step in one of them weight 1. Every path from corner to corner has the weight n + m.

Time warping of velocities minimises the squared distance of square root velocities
:math:`\sum |v| + |w| - 2 \max(\langle v, w \rangle, 0) / \sqrt{|v| |w|}` of the steps v of one
motion and chords w of another. The product of the step from a to a' with the chord from b to b' is

.. math:: \langle v, w \rangle = \tfrac12 (d(a, b')^2 + d(a', b)^2 - d(a, b)^2 - d(a', b')^2)

in flat spaces, and a definition in others (Berg and Nikolaev, "Quasilinearization and curvature of
Aleksandrov spaces", Geometriae Dedicata 133, 2008).
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.kernels.compilation import compiled

# Chords' ends are moved by 0, 1 or 2 steps either way; then the steps are halved.
_REACH = 2
_HALVINGS = 7

# Number of frames from which a position between frames is interpolated.
_NODES = 4


@compiled
def least_sums(costs: Array) -> Array:
    """Return the least sums of paths that end in each cell."""
    n, m = costs.shape
    sums = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            cost = costs[i, j]
            best = 2.0 * cost if i == j == 0 else math.inf
            if i > 0 and j > 0:
                best = sums[i - 1, j - 1] + 2.0 * cost
            if i > 0:
                best = min(best, sums[i - 1, j] + cost)
            if j > 0:
                best = min(best, sums[i, j - 1] + cost)
            sums[i, j] = best
    return sums


@compiled
def trace_path(costs: Array, sums: Array) -> Integers:
    """Return the cells of the path of the least sum, the last first."""
    i, j = costs.shape[0] - 1, costs.shape[1] - 1
    path, length = np.empty((i + j + 1, 2), dtype=np.int64), 0
    while True:
        path[length, 0], path[length, 1] = i, j
        length += 1
        if i == 0 and j == 0:
            return path[:length]
        if i > 0 and j > 0 and sums[i, j] == sums[i - 1, j - 1] + 2.0 * costs[i, j]:
            i, j = i - 1, j - 1
        elif i > 0 and sums[i, j] == sums[i - 1, j] + costs[i, j]:
            i -= 1
        else:
            j -= 1


@compiled
def costs_between_frames(costs: Array, steps_a: Array, steps_b: Array) -> Array:
    """Return mean costs of each motion's frames to positions about the frames of the other."""
    n, m = costs.shape
    result = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            here = about_a = about_b = costs[i, j]
            for side in (-1, 1):
                if 0 <= j + side < m:
                    step = steps_b[min(j, j + side)]
                    about_b = min(about_b, _least_on_step(here, costs[i, j + side], step))
                if 0 <= i + side < n:
                    step = steps_a[min(i, i + side)]
                    about_a = min(about_a, _least_on_step(here, costs[i + side, j], step))
            result[i, j] = 0.5 * (about_b + about_a)
    return result


@compiled
def _least_on_step(here: float, there: float, step: float) -> float:
    if step <= 0.0:
        return here
    # At the share s of the way from y to z, the squared distance of x is (1 − s) d(x, y)² +
    # s d(x, z)² − s (1 − s) d(y, z)², by Stewart's theorem.
    share = min(max(0.5 * (here - there + step) / step, 0.0), 0.5)
    return max((1.0 - share) * here + share * there - share * (1.0 - share) * step, 0.0)


@compiled
def extend_paths(
    costs: Array,
    first: int,
    longest_run: int,
    sums: Array,
    starts: Integers,
    totals: Array,
    begins: Integers,
) -> None:
    """Extend paths of a query, which begin anywhere in a long motion, by its next frames.

    At most `longest_run` frames of the query are matched with one frame of the motion.
    """
    n, k = costs.shape
    # Sums of paths that end with so many frames of the query at this frame of the motion.
    runs, run_starts = np.empty(longest_run), np.empty(longest_run, np.int64)
    for j in range(k):
        # Sums at the previous frame of the motion, for the previous frame of the query.
        corner, corner_start = math.inf, 0
        runs[:] = math.inf
        run_starts[:] = 0
        for i in range(n):
            beside, beside_start = sums[i], starts[i]
            cost = costs[i, j]
            best, start = beside + cost, beside_start
            if i == 0 and 2.0 * cost <= best:
                best, start = 2.0 * cost, first + j
            if i > 0 and corner + 2.0 * cost < best:
                best, start = corner + 2.0 * cost, corner_start
            for length in range(longest_run - 1, 0, -1):
                runs[length] = runs[length - 1] + cost
                run_starts[length] = run_starts[length - 1]
            runs[0], run_starts[0] = best, start
            for length in range(1, longest_run):
                if runs[length] < best:
                    best, start = runs[length], run_starts[length]
            corner, corner_start = beside, beside_start
            sums[i], starts[i] = best, start
        totals[j], begins[j] = sums[n - 1], starts[n - 1]


def match_chords(costs: Array, steps: Array, within: Array) -> tuple[float, Array]:
    """Return the least sum over chords, and the position (n,) of each frame on the other motion."""
    # The ends of the best chords from frame to frame move between frames: by dynamic programming
    # over a few positions near the last ones, ever closer together.
    _, places = match_frames(costs, steps, within)
    shape = len(costs), 2 * _REACH + 1
    numbers, whole_numbers = np.zeros((5, *shape)), np.zeros((2, *shape), np.int64)
    tables = tuple(numbers), tuple(whole_numbers), np.zeros((*shape, _NODES))
    falls = costs[:-1] - costs[1:]
    return _move_places(falls, steps, within, places, tables), places


def match_frames(costs: Array, steps: Array, within: Array) -> tuple[float, Array]:
    """Return the least sum over chords from frame to frame, and their ends; see `match_chords`."""
    sums: Array = np.full(costs.shape, math.inf)
    before: Integers = np.zeros(costs.shape, np.int64)
    places = np.zeros(len(costs))
    _match_frames(costs, steps, np.sqrt(within), (sums, before), places)
    return float(sums[-1, -1]), places


@compiled
def _match_frames(
    costs: Array,
    steps: Array,
    lengths: Array,
    tables: tuple[Array, Integers],
    places: Array,
) -> None:
    n, m = costs.shape
    sums, before = tables
    sums[0, 0] = 0.0
    for k in range(n - 1):
        for j in range(m):
            best, best_place = math.inf, 0
            for i in range(j + 1):
                if sums[k, i] < best:
                    product = costs[k, j] + costs[k + 1, i] - costs[k, i] - costs[k + 1, j]
                    value = sums[k, i] + _apart(steps[k], lengths[i, j], 0.5 * product)
                    if value < best:
                        best, best_place = value, i
            sums[k + 1, j], before[k + 1, j] = best, best_place
    place = m - 1
    for k in range(n - 1, -1, -1):
        places[k] = place
        place = before[k, place]


PlaceTables: TypeAlias = tuple[tuple[Array, ...], tuple[Integers, ...], Array]
"""Numbers, whole numbers and weights of the candidates for places."""


@compiled
def _move_places(
    falls: Array, steps: Array, within: Array, places: Array, tables: PlaceTables
) -> float:
    """Move places to nearby ones with the least sum, ever closer together, and return it."""
    (candidates, spread, at_begin, at_end, sums), (firsts, before), weights = tables
    n, count = candidates.shape
    nodes, reach = min(_NODES, len(within)), 1.0
    for _ in range(_HALVINGS):
        reach *= 0.5
        for k in range(n):
            for p in range(count):
                place = places[k]
                if 0 < k < n - 1:
                    place = min(max(place + (p - _REACH) * reach, 0.0), len(within) - 1.0)
                first = min(max(math.floor(place) - 1, 0), len(within) - nodes)
                candidates[k, p], firsts[k, p] = place, first
                at_begin[k, p], at_end[k, p] = 0.0, 0.0
                for i in range(nodes):
                    weight = 1.0  # of a Lagrange polynomial
                    for j in range(nodes):
                        if j != i:
                            weight *= (place - first - j) / (i - j)
                    weights[k, p, i] = weight
                    if k < n - 1:
                        at_begin[k, p] += weight * falls[k, first + i]
                    if k > 0:
                        at_end[k, p] += weight * falls[k - 1, first + i]
                spread[k, p] = 0.5 * _between(within, firsts, weights, (k, p), (k, p))
        for k in range(n - 1):
            for q in range(count):
                best, best_place = math.inf, 0
                for p in range(count):
                    if candidates[k, p] > candidates[k + 1, q]:
                        continue
                    squared = _between(within, firsts, weights, (k, p), (k + 1, q))
                    squared -= spread[k, p] + spread[k + 1, q]
                    product = 0.5 * (at_end[k + 1, q] - at_begin[k, p])
                    value = sums[k, p] + _apart(steps[k], math.sqrt(max(squared, 0.0)), product)
                    if value < best:
                        best, best_place = value, p
                sums[k + 1, q], before[k + 1, q] = best, best_place
        # The ends do not move: their place is the middle candidate.
        best_place = _REACH
        for k in range(n - 1, -1, -1):
            places[k] = candidates[k, best_place]
            best_place = before[k, best_place]
    least: float = sums[n - 1, _REACH]
    return least


@compiled
def _apart(step: float, chord: float, product: float) -> float:
    """Return the squared distance of the square root velocities of a step and a chord."""
    scale = math.sqrt(step * chord)
    if scale > 0.0 and product > 0.0:
        # In curved spaces this product may exceed the product of the lengths.
        return step + chord - 2.0 * min(product / scale, scale)
    return step + chord


@compiled
def _between(
    within: Array,
    firsts: Integers,
    weights: Array,
    place: tuple[int, int],
    next_place: tuple[int, int],
) -> float:
    """Return the squared distance between two places, interpolated between frames."""
    k, p = place
    h, q = next_place
    total = 0.0
    first, second = firsts[k, p], firsts[h, q]
    nodes = min(_NODES, len(within))
    for i in range(nodes):
        at_second = 0.0
        for j in range(nodes):
            at_second += weights[h, q, j] * within[first + i, second + j]
        total += weights[k, p, i] * at_second
    return total
