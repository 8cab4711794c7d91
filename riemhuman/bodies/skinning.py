"""Linear blend skinning: a tree of joints, their rigid motions, and vertices that follow them.

Most vertices follow one to four of a model's joints, and none of the open model more than seven, so
the compiled loops visit only weights that are not zero. Autograd can differentiate the functions.
The equations are those of Loper, Mahmood, Romero, Pons-Moll and Black, "SMPL: A Skinned
Multi-Person Linear Model", ACM Trans. Graphics 34(6), 2015.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import autograd.numpy as np
import numpy as onp
from autograd.extend import defjvp, defvjp, primitive
from autograd.numpy.numpy_vjps import unbroadcast_f
from autograd.tracer import isbox
from numpy.typing import DTypeLike

from riemhuman.arrays import Array, ArrayLike, Integers, Points, TangentVectors
from riemhuman.checks import integer_array, joint_shape, real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.compilation import FUSED, compiled
from riemhuman.kernels.threads import of_one_kind

if TYPE_CHECKING:
    from riemhuman.bodies.body_model import BodyModel

# The root's parent, -1, as an unsigned number.
_UNSIGNED_ROOT = 2**32 - 1

# The first joints of SMPL, SMPL-H and SMPL-X by the names of the open model, and their parents.
SMPL_JOINTS = (
    "pelvis",
    "left_hip",
    "right_hip",
    "lower_spine",
    "left_knee",
    "right_knee",
    "middle_spine",
    "left_ankle",
    "right_ankle",
    "upper_spine",
    "left_toes",
    "right_toes",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
)
SMPL_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
LIMBS = (
    ("left_hip", "left_knee", "left_ankle"),
    ("right_hip", "right_knee", "right_ankle"),
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
)
"""Joints of legs and arms, by their usual names, from the trunk outward."""


def joint_motions(
    joints: Array,
    rotations: Array,
    parents: Sequence[int] | Integers,
) -> tuple[Array, Array]:
    """Return the rotation in space and the position of every joint (Loper et al., equations 3, 4).

    Parameters
    ----------
    joints : array, shape (..., J, 3)
        Joints in the rest pose.
    rotations : array, shape (..., J, 3, 3)
        Rotation of each joint relative to its parent.
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.

    Examples
    --------
    >>> joints, still = np.array([[0.0, 0, 0], [0, 1, 0]]), np.tile(np.eye(3), (2, 1, 1))
    >>> _, positions = rh.bodies.joint_motions(joints, still, [-1, 0])
    >>> positions[1].tolist()
    [0.0, 1.0, 0.0]
    """
    parents = check_parents(parents)
    n_joints = len(parents)
    joints = real_array(joints, "joints", (n_joints, 3))
    rotations = real_array(rotations, "rotations", (n_joints, 3, 3))
    joint_shape(
        joints=np.zeros(np.shape(joints)[:-2]), rotations=np.zeros(np.shape(rotations)[:-3])
    )
    return motions_of_joints(joints, rotations, parents, parents_first(parents, "parents"))


def motions_of_joints(
    joints: Array, rotations: Array, parents: Integers, order: Sequence[int]
) -> tuple[Array, Array]:
    """Return `joint_motions` of arrays that are checked already."""
    # Recording calls takes autograd longer than the calls, of which there are hundreds.
    numpy = np if isbox(joints) or isbox(rotations) else onp
    n_joints = len(parents)
    shape = np.broadcast_shapes(np.shape(joints)[:-2], np.shape(rotations)[:-3])
    joints = joints + np.zeros((*shape, 1, 1))
    rotations = rotations + np.zeros((*shape, 1, 1, 1))
    in_space: dict[int, Array] = {}
    positions: dict[int, Array] = {}
    for joint in order:
        parent = parents[joint]
        in_space[joint] = rotations[..., joint, :, :]
        positions[joint] = joints[..., joint, :]
        if parent >= 0:
            bone = positions[joint] - joints[..., parent, :]
            positions[joint] = positions[parent] + _apply(in_space[parent], bone)
            in_space[joint] = numpy.matmul(in_space[parent], in_space[joint])
    return (
        numpy.stack([in_space[joint] for joint in range(n_joints)], axis=-3),
        numpy.stack([positions[joint] for joint in range(n_joints)], axis=-2),
    )


def skin_surface(
    surface: Array, weights: Array, joints: Array, rotations: Array, positions: Array
) -> Array:
    """Move every vertex with the weighted mean of its joints' motions (Loper et al., equation 2).

    Parameters
    ----------
    surface : array, shape (..., V, 3)
        Vertices in the rest pose.
    weights : array, shape (V, J)
        Skinning weights.
    joints : array, shape (..., J, 3)
        Joints in the rest pose.
    rotations, positions : array, shape (..., J, 3, 3) and (..., J, 3)
        Rotations in space and positions of the joints in the pose, from `joint_motions`.

    Examples
    --------
    >>> joints, half_turn = np.zeros((1, 3)), np.diag([-1.0, -1.0, 1.0])[np.newaxis]
    >>> surface = np.array([[1.0, 0.0, 0.0]])
    >>> rh.bodies.skin_surface(surface, np.ones((1, 1)), joints, half_turn, joints)[0, 0]
    np.float64(-1.0)
    """
    table = real_array(weights, "weights", ("n_vertices", "n_joints"), batched=False)
    n_vertices, n_joints = np.shape(table)
    surface = real_array(surface, "surface", (n_vertices, 3))
    joints = real_array(joints, "joints", (n_joints, 3))
    rotations = real_array(rotations, "rotations", (n_joints, 3, 3))
    positions = real_array(positions, "positions", (n_joints, 3))
    joint_shape(
        surface=onp.zeros(np.shape(surface)[:-2]),
        joints=onp.zeros(np.shape(joints)[:-2]),
        rotations=onp.zeros(np.shape(rotations)[:-3]),
        positions=onp.zeros(np.shape(positions)[:-2]),
    )
    return skin_by(SkinningWeights.of_table(table), surface, joints, rotations, positions)


def skin_by(
    weights: SkinningWeights, surface: Array, joints: Array, rotations: Array, positions: Array
) -> Array:
    """Return `skin_surface` by weights that are known already."""
    # Joint j moves x to R_j (x - J_j) + position_j.
    shifts = positions - _apply(rotations, joints)
    motions = np.concatenate([rotations, shifts[..., None]], axis=-1)
    return move(surface, motions, weights.values, weights.followers)


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


class Skeleton:
    """The joints of a body model; coefficients of hand poses are betas that move no joint."""

    def __init__(self, model: BodyModel, with_hands: bool) -> None:
        self.model, self.parents, self.order = model, model.parents, model.joint_order
        self.limbs = onp.flatnonzero(model.parents >= 0)  # joints other than the root
        self.rest_joints = model.joint_regressor @ model.template.vertices
        self.directions = model.shapedirs
        self.joint_shapes = onp.einsum("jv,vxb->jxb", model.joint_regressor, model.shapedirs)
        if with_hands:
            hands = model.hand_directions
            self.directions = onp.concatenate([model.shapedirs, hands], axis=-1)
            self.joint_shapes = onp.pad(self.joint_shapes, ((0, 0), (0, 0), (0, hands.shape[-1])))
        self.n_joints, self.n_betas = model.n_joints, self.directions.shape[-1]
        self.bone_shapes = self.from_parents(self.joint_shapes)
        # below[j, k]: whether joint j moves with joint k.
        self.below = onp.eye(self.n_joints)
        for joint in self.order:
            if self.parents[joint] >= 0:
                self.below[joint] += self.below[self.parents[joint]]

    def from_parents(self, values: Array) -> Array:
        """Return the differences of values of joints from those of their parents."""
        differences: Array = values.copy()
        differences[self.limbs] -= values[self.parents[self.limbs]]
        return differences


class JointMotions:
    """The rigid motions of joints: joint k moves x to rotations[k] x + shifts[k]."""

    def __init__(self, skeleton: Skeleton, local: Array, betas: Array) -> None:
        self.skeleton, self.local, self.betas = skeleton, local, betas
        joints = skeleton.rest_joints + skeleton.joint_shapes @ betas
        # The axes of a joint's own rotation are those of its parent.
        self.rotations, self.axes = onp.empty_like(local), onp.empty_like(local)
        for k in skeleton.order:
            parent = skeleton.parents[k]
            self.axes[k] = self.rotations[parent] if parent >= 0 else onp.eye(3)
            self.rotations[k] = self.axes[k] @ local[k]
        bones = _apply(self.axes, skeleton.from_parents(joints))
        self.positions = skeleton.below @ bones
        self.shifts = self.positions - _apply(self.rotations, joints)

    @property
    def pose_feature(self) -> Array:
        """The entries of R - I, by which pose-dependent displacements are multiplied."""
        return (self.local[self.skeleton.limbs] - onp.eye(3)).ravel()

    def skin(
        self,
        rest: Array,
        shapedirs: Array,
        posedirs: Array | None,
        weights: Array,
        bones: Integers | slice[None, None, None] = slice(None),
    ) -> tuple[Array, Array, Array]:
        """Return points before the joints rotate, their blended rotations, and where they move."""
        shaped = rest + shapedirs @ self.betas
        if posedirs is not None:
            shaped += posedirs @ self.pose_feature
        blended = (weights @ self.rotations[bones].reshape(-1, 9)).reshape(-1, 3, 3)
        return shaped, blended, _apply(blended, shaped) + weights @ self.shifts[bones]

    @property
    def shift_shapes(self) -> Array:
        """Derivatives of the shifts with respect to the betas, shape (J, 3 B)."""
        n_joints, below = self.skeleton.n_joints, self.skeleton.below
        bones = (self.axes @ self.skeleton.bone_shapes).reshape(n_joints, -1)
        rotated = (self.rotations @ self.skeleton.joint_shapes).reshape(n_joints, -1)
        shapes: Array = below @ bones - rotated
        return shapes


# More than eight arguments: the arrays of one patch of points, each of its own shape.
def skinning_derivatives(
    motions: JointMotions,
    shaped: Array,
    blended: Array,
    weights: Array,
    shapedirs: Array,
    below: Array,
    bones: Integers | slice[None, None, None] = slice(None),
    active: Integers | slice[None, None, None] = slice(None),
    real: DTypeLike = float,
) -> Array:
    """Return derivatives (n, 3, c) of points by rotations in space, betas and trans."""
    # First all rotations about x, then y, then z. The points have weights for the joints `bones`,
    # and `below` says which of these move with the joints `active`. Sums are in double precision,
    # whatever the results are.
    n_columns = 3 * below.shape[1] + shapedirs.shape[-1] + 3
    rows = onp.empty((len(shaped), 3, n_columns), real)
    _fill_derivatives(
        shaped,
        blended,
        onp.ascontiguousarray(weights),
        shapedirs,
        onp.ascontiguousarray(below),
        motions.rotations[bones],
        motions.shifts[bones],
        motions.positions[active],
        motions.shift_shapes[bones].reshape(-1, 3, shapedirs.shape[-1]),
        rows,
    )
    return rows


# More than eight arguments: a compiled loop takes plain arrays.
@compiled(fastmath=FUSED)
def _fill_derivatives(
    shaped: Array,
    blended: Array,
    weights: Array,
    shapedirs: Array,
    below: Array,
    rotations: Array,
    shifts: Array,
    positions: Array,
    shift_shapes: Array,
    rows: Array,
) -> None:
    # Not 3 but n_axes: loops of known length are unrolled, which takes seconds to compile.
    n_axes, n_active, n_betas = rows.shape[1], below.shape[1], shapedirs.shape[2]
    of_betas, levers = onp.empty((3, n_betas)), onp.empty((3, n_active))
    for i in range(len(rows)):
        v, turned = shaped[i], blended[i]
        for x in range(n_axes):
            p, q, r = turned[x, 0], turned[x, 1], turned[x, 2]
            for b in range(n_betas):
                of_betas[x, b] = (
                    p * shapedirs[i, 0, b] + q * shapedirs[i, 1, b] + r * shapedirs[i, 2, b]
                )
        # A rotation of joint j by a small δ, in the axes of the posed body, moves a point by δ × a,
        # where a = Σ_k w_k (G_k v + t_k − p_j) over the joints k below j (j included), at p_j.
        levers[:] = 0.0
        for k in range(weights.shape[1]):
            w = weights[i, k]
            if w == 0.0:
                continue
            for x in range(n_axes):
                g = rotations[k, x]
                place = g[0] * v[0] + g[1] * v[1] + g[2] * v[2] + shifts[k, x]
                for j in range(n_active):
                    levers[x, j] += w * below[k, j] * (place - positions[j, x])
                for b in range(n_betas):
                    of_betas[x, b] += w * shift_shapes[k, x, b]
        row, betas = rows[i], 3 * n_active
        for j in range(n_active):
            a, b, c = levers[0, j], levers[1, j], levers[2, j]
            about_x, about_y, about_z = j, n_active + j, 2 * n_active + j
            row[0, about_x], row[0, about_y], row[0, about_z] = 0.0, c, -b
            row[1, about_x], row[1, about_y], row[1, about_z] = -c, 0.0, a
            row[2, about_x], row[2, about_y], row[2, about_z] = b, -a, 0.0
        # One by one: numba takes two seconds to compile the assignment of an array to a slice.
        for x in range(n_axes):
            for b in range(n_betas):
                row[x, betas + b] = of_betas[x, b]
            row[x, betas + n_betas :] = 0.0
            row[x, betas + n_betas + x] = 1.0


def joints_between(parents: Integers, first: int, last: int) -> list[int]:
    """Return the joints on the path from one joint to another, both included.

    Parameters
    ----------
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.
    first, last : int
        The ends of the path.

    Examples
    --------
    >>> rh.bodies.joints_between([-1, 0, 1, 0], 2, 3)
    [2, 1, 0, 3]
    """
    from_first = joints_to_root(parents, first)
    from_last = joints_to_root(parents, last)
    shared = next(joint for joint in from_first if joint in from_last)
    up = from_first[: from_first.index(shared) + 1]
    down = reversed(from_last[: from_last.index(shared)])
    return [*up, *down]


def joints_to_root(parents: Integers, joint: int) -> list[int]:
    """Return a joint and those between it and the root, in this order."""
    path = [joint]
    while parents[path[-1]] >= 0:
        path.append(int(parents[path[-1]]))
    return path


def usual_joint_names(model: BodyModel) -> tuple[str, ...]:
    """Return the names of a model's joints; those of SMPL's tree are named as in the open model."""
    names, n_body = tuple(model.joint_names), len(SMPL_JOINTS)
    if "left_shoulder" in names or tuple(model.parents[:n_body]) != SMPL_PARENTS:
        return names
    return (*SMPL_JOINTS, *names[n_body:])


def joint_parents(kintree_table: ArrayLike, n_joints: int) -> Integers:
    """Return the index of each joint's parent, -1 for the root, from SMPL's table (2, J)."""
    table = integer_array(kintree_table, "kintree_table", (2, n_joints))
    index = {int(number): j for j, number in enumerate(table[1])}
    if len(index) != n_joints:
        raise ArgumentError("kintree_table lists a joint twice in its second row")
    parents = onp.empty(n_joints, dtype=onp.int64)
    for joint, number in enumerate(table[0].tolist()):
        if number in (-1, _UNSIGNED_ROOT):
            parents[joint] = -1
        elif number in index:
            parents[joint] = index[number]
        else:
            raise ArgumentError(
                f"kintree_table names {number} as the parent of joint {joint}; no joint has "
                "that number"
            )
    roots = onp.flatnonzero(parents < 0).tolist()
    if len(roots) != 1:
        raise ArgumentError(f"kintree_table must have one root; found roots {roots}")
    return parents


def check_parents(parents: Sequence[int] | Integers) -> Integers:
    """Return the parents of joints, -1 for a root; raise an error if they form no trees."""
    numbers = integer_array(parents, "parents", ("n_joints",))
    wrong = onp.flatnonzero((numbers < -1) | (numbers >= len(numbers)))
    if len(wrong) or not len(numbers):
        found = f"{numbers[wrong[0]]} of joint {wrong[0]}" if len(wrong) else "no joint"
        raise ArgumentError(
            f"parents must be joints, from 0 to {max(len(numbers) - 1, 0)}, or -1 for a root; "
            f"found {found}"
        )
    parents_first(numbers, "parents")
    return numbers


def parents_first(parents: Integers, name: str = "kintree_table") -> tuple[int, ...]:
    """Return the joints ordered so that parents precede children; there must be no cycle."""
    by_parent = onp.argsort(parents, kind="stable")
    ends = onp.searchsorted(parents[by_parent], onp.arange(-1, len(parents)), side="right")
    order: list[int] = by_parent[: ends[0]].tolist()
    for joint in order:  # the list grows while it is read
        order.extend(by_parent[ends[joint] : ends[joint + 1]].tolist())
    if len(order) != len(parents):
        cycle = sorted(set(range(len(parents))) - set(order))
        raise ArgumentError(f"{name} has a cycle: joints {cycle} never reach the root")
    return tuple(order)


def _apply(matrices: Array, vectors: Array) -> Array:
    return (matrices @ vectors[..., None])[..., 0]
