"""Rigid motions of the surfaces of a path that a metric does not see."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

_N_ROUNDS = 60
# The motion of a surface is found from about this many of its vertices.
_N_VERTICES = 2000
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
    some = slice(None, None, max(1, path.shape[1] // _N_VERTICES))
    for i, t in enumerate(np.linspace(0.0, 1.0, len(path))[1:-1], start=1):
        f = path[i, some]
        target = (1.0 - t) * path[0, some] + t * path[-1, some]
        pull = weights[some]
        before = f
        for _ in range(_N_ROUNDS):
            rotation, shift = _rigid_motion(f, target, pull / pull.sum(), rotations)
            after = f @ rotation + shift
            if np.abs(after - before).max() <= _TOLERANCE * size:
                break
            distances = np.linalg.norm(after - target, axis=1)
            pull = weights[some] / np.maximum(distances, _SMALLEST * size)
            before = after
        moved[i] = path[i] @ rotation + shift
    return moved


def _rigid_motion(
    f: ndarray, target: ndarray, weights: ndarray, rotations: bool
) -> tuple[ndarray, ndarray]:
    """Return R and b of least weighted squared distance between f R + b and the target."""
    centre, goal = weights @ f, weights @ target
    if not rotations:
        return np.eye(3), goal - centre
    left, _, right = np.linalg.svd(((f - centre) * weights[:, None]).T @ (target - goal))
    sign = 1.0 if np.linalg.det(left @ right) > 0 else -1.0
    rotation = (left * [1.0, 1.0, sign]) @ right
    return rotation, goal - centre @ rotation
