"""Rigid motions of the surfaces of a path that a metric does not see."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

_N_ROUNDS = 60
# Rounds end when no vertex moves by more than this share of the body's size.
_TOLERANCE = 1e-6
# Distances below this share of the body's size count as none.
_SMALLEST = 1e-4


def still_path(path: ndarray, weights: ndarray, *, rotations: bool) -> ndarray:
    r"""Move interior surfaces rigidly so that as much as can be stays on the straight path.

    Each surface f_i takes the rigid motion of least :math:`\sum_v w_v \|R f_i(v) + b - l_i(v)\|`,
    with l the straight path between the ends, by reweighted Procrustes alignment. The sum of
    distances, unlike that of their squares, leaves a resting part of the body at rest while
    another part moves.

    Parameters
    ----------
    path : array, shape (n_times, V, 3)
        Path.
    weights : array, shape (V,)
        Weights w of the vertices.
    rotations : bool
        Whether to rotate surfaces, or to translate them only.

    Returns
    -------
    array, shape (n_times, V, 3)
        Path with the same ends.
    """
    moved = path.copy()
    size = np.ptp(path[0], axis=0).max()
    for i, t in enumerate(np.linspace(0.0, 1.0, len(path))[1:-1], start=1):
        target = (1.0 - t) * path[0] + t * path[-1]
        pull = weights
        for _ in range(_N_ROUNDS):
            fitted = _fit(path[i], target, pull / pull.sum(), rotations)
            step = np.abs(fitted - moved[i]).max()
            moved[i] = fitted
            if step <= _TOLERANCE * size:
                break
            distances = np.linalg.norm(fitted - target, axis=1)
            pull = weights / np.maximum(distances, _SMALLEST * size)
    return moved


def _fit(f: ndarray, target: ndarray, weights: ndarray, rotations: bool) -> ndarray:
    """Return f after the rigid motion of least weighted squared distance to the target."""
    centre, goal = weights @ f, weights @ target
    if not rotations:
        return f + (goal - centre)
    centred = f - centre
    left, _, right = np.linalg.svd((centred * weights[:, None]).T @ (target - goal))
    sign = 1.0 if np.linalg.det(left @ right) > 0 else -1.0
    return centred @ ((left * [1.0, 1.0, sign]) @ right) + goal
