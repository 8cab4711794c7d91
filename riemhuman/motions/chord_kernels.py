r"""Compiled matching of the steps of one motion with chords of another.

Steps v and chords w add up, over all steps, to

.. math:: \sum |v| + |w| - 2 \max(\langle v, w \rangle, 0) / \sqrt{|v| |w|},

the squared distance of the square root velocities of two polygons, where each side of one is
matched with one side of the other. Inner products come from squared distances of frames: that of
the step from a to a' with the chord from b to b' is

.. math:: \langle v, w \rangle = \tfrac12 (d(a, b')^2 + d(a', b)^2 - d(a, b)^2 - d(a', b')^2)

in flat spaces, and a definition in others (Berg and Nikolaev, "Quasilinearization and curvature of
Aleksandrov spaces", Geometriae Dedicata 133, 2008).
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compiled import compiled

# Places are moved by 0, 1 or 2 steps either way; then steps are halved.
_REACH = 2
_HALVINGS = 7

# Frames that a place between frames is interpolated from.
_NODES = 4


@compiled
def match_chords(costs: ndarray, steps: ndarray, within: ndarray, places: ndarray) -> float:
    """Return the least sum, and write the position of each frame of one motion on the other.

    Dynamic programming finds the best chords from frame to frame. Their ends are then moved between
    frames, by dynamic programming over a few positions near the last ones, ever closer together.

    Parameters
    ----------
    costs : array, shape (n, m)
        Squared distances between the frames of the motion with steps and of that with chords.
    steps : array, shape (n - 1,)
        Lengths of the steps.
    within : array, shape (m, m)
        Squared distances between the frames of the motion with chords.
    places : array, shape (n,)
        Positions, in frames, from 0 to m - 1 and not decreasing; written to.

    Returns
    -------
    float
    """
    total = _match_frames(costs, steps, within, places)
    reach = 0.5
    for _ in range(_HALVINGS):
        total = _move_places(costs, steps, within, reach, places)
        reach *= 0.5
    return total


@compiled
def _match_frames(costs: ndarray, steps: ndarray, within: ndarray, places: ndarray) -> float:
    n, m = costs.shape
    lengths = np.sqrt(within)
    sums = np.full((n, m), math.inf)
    before = np.zeros((n, m), dtype=np.int64)
    sums[0, 0] = 0.0
    for k in range(n - 1):
        for j in range(m):
            best, chosen = math.inf, 0
            for i in range(j + 1):
                if sums[k, i] < best:
                    product = costs[k, j] + costs[k + 1, i] - costs[k, i] - costs[k + 1, j]
                    value = sums[k, i] + _apart(steps[k], lengths[i, j], 0.5 * product)
                    if value < best:
                        best, chosen = value, i
            sums[k + 1, j], before[k + 1, j] = best, chosen
    place = m - 1
    for k in range(n - 1, -1, -1):
        places[k] = place
        place = before[k, place]
    return sums[n - 1, m - 1]


@compiled
def _move_places(
    costs: ndarray, steps: ndarray, within: ndarray, reach: float, places: ndarray
) -> float:
    n, m = costs.shape
    count = 2 * _REACH + 1
    tried = np.empty((n, count))
    firsts = np.empty((n, count), dtype=np.int64)
    weights = np.empty((n, count, _NODES))
    spread = np.empty((n, count))
    for k in range(n):
        for p in range(count):
            place = places[k] + (p - _REACH) * reach
            tried[k, p] = min(max(place, 0.0), m - 1.0) if 0 < k < n - 1 else places[k]
            firsts[k, p] = _interpolate(tried[k, p], m, weights[k, p])
            here = firsts[k, p], weights[k, p]
            spread[k, p] = 0.5 * _between(within, here, here)
    sums = np.zeros((n, count))
    before = np.zeros((n, count), dtype=np.int64)
    for k in range(n - 1):
        towards = costs[k] - costs[k + 1]
        for q in range(count):
            end = firsts[k + 1, q], weights[k + 1, q]
            at_end = _at(towards, end)
            best, chosen = math.inf, 0
            for p in range(count):
                if tried[k, p] > tried[k + 1, q]:
                    continue
                begin = firsts[k, p], weights[k, p]
                squared = _between(within, begin, end) - spread[k, p] - spread[k + 1, q]
                length = math.sqrt(max(squared, 0.0))
                product = 0.5 * (at_end - _at(towards, begin))
                value = sums[k, p] + _apart(steps[k], length, product)
                if value < best:
                    best, chosen = value, p
            sums[k + 1, q], before[k + 1, q] = best, chosen
    # Of places with the least sum, the one that was there first.
    chosen = _REACH
    for k in range(n - 1, -1, -1):
        places[k] = tried[k, chosen]
        chosen = before[k, chosen]
    return sums[n - 1, _REACH]


@compiled
def _apart(step: float, chord: float, product: float) -> float:
    """Return the squared distance of the square root velocities of a step and a chord."""
    scale = math.sqrt(step * chord)
    if scale > 0.0 and product > 0.0:
        # In curved spaces products may be above what angles allow.
        return step + chord - 2.0 * min(product / scale, scale)
    return step + chord


@compiled
def _interpolate(place: float, m: int, weights: ndarray) -> int:
    """Write the weights of the frames around a place, by Lagrange; return the first of these."""
    nodes = min(_NODES, m)
    first = min(max(int(place) - 1, 0), m - nodes)
    weights[:] = 0.0
    for i in range(nodes):
        weight = 1.0
        for j in range(nodes):
            if j != i:
                weight *= (place - first - j) / (i - j)
        weights[i] = weight
    return first


@compiled
def _at(row: ndarray, place: tuple[int, ndarray]) -> float:
    first, weights = place
    total = 0.0
    for i in range(min(_NODES, len(row))):
        total += weights[i] * row[first + i]
    return total


@compiled
def _between(within: ndarray, one: tuple[int, ndarray], other: tuple[int, ndarray]) -> float:
    first, weights = one
    total = 0.0
    for i in range(min(_NODES, len(within))):
        total += weights[i] * _at(within[first + i], other)
    return total
