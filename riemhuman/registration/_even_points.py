"""Points spread evenly over a surface, chosen among those of a scan or a body, as indices."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array, Integers


def even_points(points: Array, n_points: int) -> Integers:
    """Return the indices of about this many points, spread evenly over the surface."""
    return thin_points(points, n_points, np.random.default_rng(0))


def thin_points(points: Array, n_points: int, rng: np.random.Generator) -> Integers:
    """Return the indices of about a given number of evenly spread points, in ascending order."""
    # One in each cube of a grid, whose width is found by bisection.
    if len(points) <= n_points:
        return np.arange(len(points))
    order = rng.permutation(len(points))
    shuffled = points[order] - points.min(axis=0)
    low, high = 0.0, float(shuffled.max())
    # The first estimate assumes a surface, where the number of cubes grows as 1/width².
    width = high / np.sqrt(n_points)
    best: Integers = order[:n_points]
    for _ in range(12):
        cubes = (shuffled / width).astype(np.int64)
        extent = cubes.max(axis=0) + 1
        keys = (cubes[:, 0] * extent[1] + cubes[:, 1]) * extent[2] + cubes[:, 2]
        first = np.unique(keys, return_index=True)[1]
        best = order[first]
        if abs(len(first) - n_points) <= 0.03 * n_points:
            break
        low, high = (low, width) if len(first) < n_points else (width, high)
        width = np.clip(width * np.sqrt(len(first) / n_points), 0.0, None)
        if not low < width < high:
            width = 0.5 * (low + high)
    return np.sort(best)
