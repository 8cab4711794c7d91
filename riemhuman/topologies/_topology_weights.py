"""Weights that reconstruct the vertices of a finer mesh from those of a coarser one.

Between the vertices of a coarse mesh, flat triangles miss a body by several millimetres, in ways
that depend on the pose. People of a body model show what lies there: each vertex of the finer mesh
is an affine combination of vertices around its place, found by least squares over these people. The
weights of a vertex sum to one, so that they follow every rotation, translation and scale.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import BodyModel

# People that weights are learned from; more made no difference.
_N_PEOPLE = 40
_SEED = 49
# Rotations of joints, radians: most are small, some are large in each pose.
_SMALL_ROTATION, _LARGE_ROTATION, _SHARE_OF_LARGE = 0.15, 0.5, 0.3
_CLOSED_HANDS = 0.7
# Vertices of the coarser mesh that are combined, beside the corners of the triangle.
_N_NEIGHBOURS = 18
# Detail of real people that the model lacks, metres; it keeps weights near the triangle's.
_DETAIL = 5e-4
# Vertices of the finer mesh that are solved for at once, which bounds memory.
_N_TOGETHER = 512


def example_people(model: BodyModel) -> Array:
    """Return people of a model in random poses, shape (n, V, 3)."""
    rng = np.random.default_rng(_SEED)
    n_hands = model.hand_directions.shape[2]
    people = []
    for _ in range(_N_PEOPLE):
        is_large = rng.random((model.n_joints, 1)) < _SHARE_OF_LARGE
        angles = np.where(is_large, _LARGE_ROTATION, _SMALL_ROTATION)
        pose = angles * rng.standard_normal((model.n_joints, 3))
        hands = _CLOSED_HANDS * rng.random(n_hands) if n_hands else None
        people.append(model(rng.standard_normal(model.n_betas), pose, hands=hands))
    return np.stack(people).astype(np.float64)


def combined_vertices(
    target: Array, source: Array, corners: Integers, usable: Booleans
) -> Integers:
    """Return the source's vertices to combine for each vertex of the target, shape (n, k).

    The first three are the corners of its triangle, shape (n, 3); the others are nearest to it in a
    pose that both surfaces share, and may be corners too.
    """
    candidates = np.flatnonzero(usable)
    count = min(_N_NEIGHBOURS, len(candidates))
    near = candidates[cKDTree(source[candidates]).query(target, k=range(1, count + 1))[1]]
    return np.concatenate([corners, near], axis=1)


def learned_weights(sources: Array, targets: Array, columns: Integers, start: Array) -> Array:
    r"""Return weights, shape (n, k), of the vertices that are combined for each target vertex.

    Minimises :math:`\sum_p \|y_p - \sum_k w_k x_{pk}\|^2 + 3 n \sigma^2 \|w - b\|^2` over weights
    that sum to one, with the people's target vertex y, source vertices x, n people, the size σ of
    details that are in no model, and the barycentric coordinates b of the place.

    `sources` have shape (n_people, n_source, 3), `targets` shape (n_people, n, 3), `start` holds
    b, shape (n, k).
    """
    n_points, count = columns.shape
    weights = start.copy()
    centring = np.eye(count) - 1.0 / count  # changes of weights sum to zero
    detail = 3 * len(sources) * _DETAIL**2 * np.eye(count)
    for first in range(0, n_points, _N_TOGETHER):
        part = slice(first, first + _N_TOGETHER)
        around = sources[:, columns[part]]  # (people, points, k, 3)
        means = around.mean(axis=2)
        # A row for each person and coordinate, a column for each vertex that is combined.
        matrix = (around - means[:, :, np.newaxis]).transpose(1, 0, 3, 2)
        matrix = matrix.reshape(len(means[0]), -1, count)
        goal = (targets[:, part] - means).transpose(1, 0, 2).reshape(len(matrix), -1, 1)
        gaps = goal - matrix @ weights[part, :, np.newaxis]
        across = matrix.transpose(0, 2, 1)
        normal = centring @ (across @ matrix) @ centring + detail
        change = np.linalg.solve(normal, centring @ (across @ gaps))
        weights[part] += (centring @ change)[..., 0]
    return weights
