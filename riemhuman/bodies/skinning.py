"""Linear blend skinning: rigid motions of joints along a tree, and vertices that follow them.

Autograd can differentiate the functions. The equations are those of Loper, Mahmood, Romero,
Pons-Moll and Black, "SMPL: A Skinned Multi-Person Linear Model", ACM Trans. Graphics 34(6), 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import autograd.numpy as np


def chained_motions(
    joints: Any, rotations: Any, parents: Any, order: Sequence[int]
) -> tuple[Any, Any]:
    """Return every joint's rotation in space and its place (equations 3 and 4).

    Parameters
    ----------
    joints : array, shape (..., J, 3)
        Joints in the rest pose.
    rotations : array, shape (..., J, 3, 3)
        Rotation of each joint relative to its parent.
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.
    order : sequence of int
        All joints, parents before children.

    Returns
    -------
    turns : array, shape (..., J, 3, 3)
        Rotations in space.
    places : array, shape (..., J, 3)
        Joints in the pose.
    """
    shape = np.broadcast_shapes(np.shape(joints)[:-2], np.shape(rotations)[:-3])
    joints = joints + np.zeros((*shape, 1, 1), dtype=joints.dtype)
    rotations = rotations + np.zeros((*shape, 1, 1, 1), dtype=rotations.dtype)
    turns: list[Any] = [None] * len(parents)
    places: list[Any] = [None] * len(parents)
    for joint in order:
        parent = parents[joint]
        turns[joint], places[joint] = rotations[..., joint, :, :], joints[..., joint, :]
        if parent >= 0:
            bone = places[joint] - joints[..., parent, :]
            places[joint] = places[parent] + _apply(turns[parent], bone)
            turns[joint] = np.matmul(turns[parent], turns[joint])
    return np.stack(turns, axis=-3), np.stack(places, axis=-2)


def skinned(surface: Any, weights: Any, joints: Any, turns: Any, places: Any) -> Any:
    """Move every vertex with the mean of its joints' rigid motions (equation 2).

    Parameters
    ----------
    surface : array, shape (..., V, 3)
        Vertices in the rest pose.
    weights : array, shape (V, J)
        Skinning weights.
    joints : array, shape (..., J, 3)
        Joints in the rest pose.
    turns : array, shape (..., J, 3, 3)
        Rotations of the joints in space.
    places : array, shape (..., J, 3)
        Joints in the pose.

    Returns
    -------
    surface : array, shape (..., V, 3)
        Vertices in the pose.
    """
    # Joint j moves x to R_j (x - J_j) + place_j.
    shifts = places - _apply(turns, joints)
    motions = np.concatenate([turns, shifts[..., None]], axis=-1)
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


def _apply(matrices: Any, vectors: Any) -> Any:
    return np.matmul(matrices, vectors[..., None])[..., 0]
