"""Vertices that move with the weighted mean of a few joints' motions, in compiled loops.

Most vertices follow one to four of a model's joints, and none of the open model more than seven,
so the loops visit only weights that are not zero. Autograd can differentiate `move` to any order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import autograd.numpy as np
import numpy as onp
from autograd.extend import defjvp, defvjp, primitive
from autograd.numpy.numpy_vjps import unbroadcast_f
from autograd.tracer import isbox

from riemhuman.arrays import Array, Integers, Points, TangentVectors
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import of_one_kind


class Followers(NamedTuple):
    """Which joints each vertex follows, vertex by vertex: those of v from starts[v]."""

    starts: Integers  # (V + 1,)
    joints: Integers  # (K,)
    n_joints: int

    @property
    def vertices(self) -> Integers:
        """The vertex of each pair of vertex and joint, shape (K,)."""
        return onp.repeat(onp.arange(len(self.starts) - 1), onp.diff(self.starts))


class SkinningWeights(NamedTuple):
    """The weights that are not zero, shape (K,), and the vertices and joints they belong to."""

    values: Array
    followers: Followers

    @classmethod
    def of_table(cls, weights: Array) -> SkinningWeights:
        """Return the entries of a table of weights, shape (V, J), that are not zero."""
        # The derivative by a weight may differ from zero where the weight does not.
        n_vertices, n_joints = np.shape(weights)
        follows = onp.ones((n_vertices, n_joints), bool) if isbox(weights) else weights != 0
        vertices, joints = onp.divmod(onp.flatnonzero(follows), n_joints)
        starts = onp.searchsorted(vertices, onp.arange(n_vertices + 1))
        return cls(weights[vertices, joints], Followers(starts, joints, n_joints))


@primitive
def move(points: Array, motions: Array, values: Array, followers: Followers) -> Array:
    """Return the means Σ_j w_j (A_j x + t_j), shape (..., V, 3), with motions [A t]."""
    real = onp.result_type(onp.float32, points, motions, values)
    lead, points, of_points, motions, of_motions = _aligned(points, 2, motions, 3)
    moved = onp.empty((len(of_points), *points.shape[1:]), real)
    starts, joints, _ = followers
    _move(points, of_points, motions, of_motions, values, starts, joints, moved)
    return moved.reshape(*lead, *points.shape[1:])


@compiled
def _move(
    points: Points,
    of_points: Integers,
    motions: Array,
    of_motions: Integers,
    values: Array,
    starts: Integers,
    joints: Integers,
    moved: Array,
) -> None:
    for i in range(len(moved)):
        body, motion = points[of_points[i]], motions[of_motions[i]]
        for v in range(moved.shape[1]):
            x, y, z = body[v, 0], body[v, 1], body[v, 2]
            a = b = c = 0.0
            for k in range(starts[v], starts[v + 1]):
                w, m = values[k], motion[joints[k]]
                a += w * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z + m[0, 3])
                b += w * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z + m[1, 3])
                c += w * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z + m[2, 3])
            moved[i, v, 0], moved[i, v, 1], moved[i, v, 2] = a, b, c


@primitive
def moments(vectors: Array, points: Array, values: Array, followers: Followers) -> Array:
    """Return Σ_v w_v y_v (x_v, 1)ᵀ, shape (..., J, 3, 4): `move` transposed in the motions."""
    real = onp.result_type(onp.float32, vectors, points, values)
    lead, vectors, of_vectors, points, of_points = _aligned(vectors, 2, points, 2)
    starts, joints, n_joints = followers
    totals = onp.zeros((len(of_points), n_joints, 3, 4), real)
    _add_moments(vectors, of_vectors, points, of_points, values, starts, joints, totals)
    return totals.reshape(*lead, n_joints, 3, 4)


@compiled
def _add_moments(
    vectors: TangentVectors,
    of_vectors: Integers,
    points: Points,
    of_points: Integers,
    values: Array,
    starts: Integers,
    joints: Integers,
    totals: Array,
) -> None:
    for i in range(len(totals)):
        vector, body = vectors[of_vectors[i]], points[of_points[i]]
        for v in range(len(starts) - 1):
            for k in range(starts[v], starts[v + 1]):
                total = totals[i, joints[k]]
                for row in range(3):
                    pull = values[k] * vector[v, row]
                    for column in range(3):
                        total[row, column] += pull * body[v, column]
                    total[row, 3] += pull


def _aligned(
    a: Array, n_axes_a: int, b: Array, n_axes_b: int
) -> tuple[tuple[int, ...], Array, Integers, Array, Integers]:
    """Return the common leading shape of arrays, and each as a list of items with the item of each.

    Items are broadcast by their numbers, and need not be copied.
    """
    lead = onp.broadcast_shapes(a.shape[:-n_axes_a], b.shape[:-n_axes_b])
    return lead, *_items(a, n_axes_a, lead), *_items(b, n_axes_b, lead)


def _items(array: Array, n_axes: int, lead: tuple[int, ...]) -> tuple[Array, Integers]:
    leading, item = array.shape[:-n_axes], array.shape[-n_axes:]
    numbers = onp.arange(math.prod(leading)).reshape(leading)
    items = of_one_kind(array).reshape(-1, *item)
    return items, of_one_kind(onp.broadcast_to(numbers, lead).ravel())


def _transposed(motions: Array) -> Array:
    """Return the motions [Aᵀ 0]."""
    turned = np.swapaxes(motions[..., :3], -1, -2)
    return np.concatenate([turned, np.zeros_like(motions[..., 3:])], axis=-1)


def _without_shifts(motions: Array) -> Array:
    return np.concatenate([motions[..., :3], np.zeros_like(motions[..., 3:])], axis=-1)


def _pairings(vectors: Array, points: Array, motions: Array, followers: Followers) -> Array:
    """Return ⟨y_v, A_j x_v + t_j⟩ for each vertex and joint it follows, summed over bodies."""
    vertices, joints = followers.vertices, followers.joints
    of_joints = motions[..., joints, :, :]
    moved = np.matmul(of_joints[..., :3], points[..., vertices, :, None])[..., 0]
    products = np.sum(vectors[..., vertices, :] * (moved + of_joints[..., 3]), axis=-1)
    return np.sum(np.reshape(products, (-1, len(vertices))), axis=0)


defvjp(
    move,
    lambda answer, points, motions, values, followers: unbroadcast_f(
        points, lambda upstream: move(upstream, _transposed(motions), values, followers)
    ),
    lambda answer, points, motions, values, followers: unbroadcast_f(
        motions, lambda upstream: moments(upstream, points, values, followers)
    ),
    lambda answer, points, motions, values, followers: (
        lambda upstream: _pairings(upstream, points, motions, followers)
    ),
)
defjvp(
    move,
    lambda tangent, answer, points, motions, values, followers: move(
        tangent, _without_shifts(motions), values, followers
    ),
    lambda tangent, answer, points, motions, values, followers: move(
        points, tangent, values, followers
    ),
    lambda tangent, answer, points, motions, values, followers: move(
        points, motions, tangent, followers
    ),
)
defvjp(
    moments,
    lambda answer, vectors, points, values, followers: unbroadcast_f(
        vectors, lambda upstream: move(points, upstream, values, followers)
    ),
    lambda answer, vectors, points, values, followers: unbroadcast_f(
        points, lambda upstream: move(vectors, _transposed(upstream), values, followers)
    ),
    lambda answer, vectors, points, values, followers: (
        lambda upstream: _pairings(vectors, points, upstream, followers)
    ),
)
