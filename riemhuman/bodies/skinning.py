"""Linear blend skinning: a tree of joints, their rigid motions, and vertices that follow them.

Autograd can differentiate the functions. The equations are those of Loper, Mahmood, Romero,
Pons-Moll and Black, "SMPL: A Skinned Multi-Person Linear Model", ACM Trans. Graphics 34(6), 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import autograd.numpy as np
import numpy as onp

from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError

# The root's parent, -1, as an unsigned number.
_UNSIGNED_ROOT = 2**32 - 1


def joint_motions(
    joints: Any, rotations: Any, parents: Any, order: Sequence[int]
) -> tuple[Any, Any]:
    """Return the rotation in space and the position of every joint (Loper et al., equations 3, 4).

    Parameters
    ----------
    joints : array, shape (..., J, 3)
        Joints in the rest pose.
    rotations : array, shape (..., J, 3, 3)
        Rotation of each joint relative to its parent.
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.
    order : sequence of int
        All joints, parents before children: `BodyModel.joint_order`.

    Examples
    --------
    >>> joints, still = np.array([[0.0, 0, 0], [0, 1, 0]]), np.tile(np.eye(3), (2, 1, 1))
    >>> _, positions = rh.bodies.joint_motions(joints, still, [-1, 0], (0, 1))
    >>> positions[1].tolist()
    [0.0, 1.0, 0.0]
    """
    joints, rotations = (
        array if hasattr(array, "dtype") else real_array(array, name)
        for array, name in ((joints, "joints"), (rotations, "rotations"))
    )
    shape = np.broadcast_shapes(np.shape(joints)[:-2], np.shape(rotations)[:-3])
    joints = joints + np.zeros((*shape, 1, 1), dtype=joints.dtype)
    rotations = rotations + np.zeros((*shape, 1, 1, 1), dtype=rotations.dtype)
    in_space: list[Any] = [None] * len(parents)
    positions: list[Any] = [None] * len(parents)
    for joint in order:
        parent = parents[joint]
        in_space[joint], positions[joint] = rotations[..., joint, :, :], joints[..., joint, :]
        if parent >= 0:
            bone = positions[joint] - joints[..., parent, :]
            positions[joint] = positions[parent] + _apply(in_space[parent], bone)
            in_space[joint] = np.matmul(in_space[parent], in_space[joint])
    return np.stack(in_space, axis=-3), np.stack(positions, axis=-2)


def skin_surface(surface: Any, weights: Any, joints: Any, rotations: Any, positions: Any) -> Any:
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
    # Joint j moves x to R_j (x - J_j) + position_j.
    shifts = positions - _apply(rotations, joints)
    motions = np.concatenate([rotations, shifts[..., None]], axis=-1)
    lead = np.shape(motions)[:-3]
    n_vertices, n_joints = np.shape(weights)
    blended = np.matmul(weights, np.reshape(motions, (*lead, n_joints, 12)))
    blended = np.reshape(blended, (*lead, n_vertices, 3, 4))
    return (
        blended[..., 0] * surface[..., 0:1]
        + blended[..., 1] * surface[..., 1:2]
        + blended[..., 2] * surface[..., 2:3]
        + blended[..., 3]
    )


def joints_between(parents: Any, first: int, last: int) -> list[int]:
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
    to_root = []
    for joint in (first, last):
        path = [joint]
        while parents[path[-1]] >= 0:
            path.append(int(parents[path[-1]]))
        to_root.append(path)
    up, down = to_root
    shared = next(joint for joint in up if joint in down)
    return up[: up.index(shared) + 1] + down[: down.index(shared)][::-1]


def joint_parents(kintree_table: Any, n_joints: int) -> onp.ndarray:
    """Return the index of each joint's parent, -1 for the root, from SMPL's table (2, J)."""
    table = integer_array(kintree_table, "kintree_table", (2, n_joints))
    index = {int(number): j for j, number in enumerate(table[1])}
    if len(index) != n_joints:
        raise ArgumentError("kintree_table numbers a joint twice in its second row")
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


def parents_first(parents: onp.ndarray) -> tuple[int, ...]:
    """Return the joints ordered so that parents precede children."""
    order = onp.flatnonzero(parents < 0).tolist()
    for joint in order:
        order.extend(onp.flatnonzero(parents == joint).tolist())
    if len(order) != len(parents):
        cycle = sorted(set(range(len(parents))) - set(order))
        raise ArgumentError(f"kintree_table has a cycle: joints {cycle} never reach the root")
    return tuple(order)


def _apply(matrices: Any, vectors: Any) -> Any:
    return np.matmul(matrices, vectors[..., None])[..., 0]
