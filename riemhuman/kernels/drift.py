"""Rigid motions of the surfaces of a path that a metric does not see."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array, Points
from riemhuman.kernels.rotations import nearest_rotations

_N_ROUNDS = 60
# The motion of a surface is found from about this many of its vertices.
_N_VERTICES = 2000
# Rounds end when no vertex moves by more than this share of the body's size.
_TOLERANCE = 1e-5
# Distances below this share of the body's size count as none.
_SMALLEST = 1e-4


def still_path(path: Points, weights: Array, *, rotations: bool) -> Array:
    r"""Move interior surfaces rigidly, as near as possible to the straight path.

    Each surface f_i takes the rigid motion of least :math:`\sum_v w_v \|R f_i(v) + b - l_i(v)\|`,
    with l the straight path between the ends, by reweighted Procrustes alignment. The sum of
    distances, unlike that of their squares, leaves a resting part of the body at rest while
    another part moves.
    """
    moved = path.copy()
    if len(path) < 3:
        return moved
    times = np.linspace(0.0, 1.0, len(path))[1:-1, None, None]
    straight = (1.0 - times) * path[0] + times * path[-1]
    turns, shifts = rigid_motions(path[1:-1], straight, weights, rotations=rotations)
    moved[1:-1] = path[1:-1] @ turns + shifts
    return moved


def rigid_motions(
    surfaces: Points, target: Points, weights: Array, *, rotations: bool
) -> tuple[Array, Array]:
    r"""Return R and b of least :math:`\sum_v w_v \|f(v) R + b - l(v)\|` for surfaces f.

    They start from the motions of least squares, so that they turn with what they are given. The
    target l is one surface or one for each; R has shape (n, 3, 3) and b shape (n, 1, 3).
    """
    size = np.ptp(surfaces[0], axis=0).max()
    every_few = slice(None, None, max(1, surfaces.shape[1] // _N_VERTICES))
    f, shares = surfaces[:, every_few], weights[every_few]
    target = np.broadcast_to(target, surfaces.shape)[:, every_few]
    # Least squares with weights w/r minimise the sum of w r.
    reweighted = np.broadcast_to(shares, f.shape[:2])
    moved_before = f
    for _ in range(_N_ROUNDS):
        turns, shifts = least_squares_motions(f, target, reweighted, rotations=rotations)
        moved = f @ turns + shifts
        if np.abs(moved - moved_before).max() <= _TOLERANCE * size:
            break
        distances = np.linalg.norm(moved - target, axis=2)
        reweighted = shares / np.maximum(distances, _SMALLEST * size)
        moved_before = moved
    return turns, shifts


def steady_path(path: Points, weights: Array) -> Array:
    """Translate interior surfaces so that the centroid moves uniformly between the ends."""
    centroids = centroid(path, weights)
    times = np.linspace(0.0, 1.0, len(path))[:, None, None]
    moved = path + ((1.0 - times) * centroids[:1] + times * centroids[-1:] - centroids)
    moved[[0, -1]] = path[[0, -1]]
    return moved


def centroid(f: Points, weights: Array) -> Array:
    """Return the weighted mean of vertices."""
    shares: Array = (weights / weights.sum())[None]
    return shares @ f


def least_squares_motions(
    f: Points, target: Points, weights: Array, *, rotations: bool = True
) -> tuple[Array, Array]:
    """Return R and b of least weighted squared distance between f R + b and the target.

    Target and weights are those of all surfaces f, or have an entry for each.
    """
    shares = (weights / weights.sum(axis=-1, keepdims=True))[..., None, :]
    centre, goal = shares @ f, shares @ target
    if not rotations:
        return np.eye(3), goal - centre
    covariance = (np.swapaxes(f - centre, 1, 2) * shares) @ (target - goal)
    turns = nearest_rotations(covariance)
    return turns, goal - centre @ turns
