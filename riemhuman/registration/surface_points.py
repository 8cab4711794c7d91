"""Points spread evenly over a surface."""

from __future__ import annotations

import numpy as np


def thinned(points: np.ndarray, n_points: int, rng: np.random.Generator) -> np.ndarray:
    """Return the numbers of about a given number of points, spread evenly.

    One point is kept in each cube of a grid, whose width is found by bisection, so that dense parts
    do not outweigh others.

    Parameters
    ----------
    points : array, shape (N, 3)
        Points.
    n_points : int
        Number of points to keep, within some per cent.
    rng : numpy.random.Generator
        Source of random numbers, which choose the point of a cube.

    Returns
    -------
    numbers : array of int, shape (n,)
        In ascending order; all if there are no more than `n_points`.
    """
    if len(points) <= n_points:
        return np.arange(len(points))
    order = rng.permutation(len(points))
    shuffled = points[order] - points.min(axis=0)
    low, high = 0.0, float(shuffled.max())
    # The first estimate assumes a surface, where the number of cubes grows as 1/width².
    width = high / np.sqrt(n_points)
    best: np.ndarray = order[:n_points]
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
