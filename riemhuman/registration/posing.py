"""Points and normals of a posed body, and rotations, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from riemhuman.kernels.compiled import compiled
from riemhuman.registration.model_samples import ModelSamples


class Pose(NamedTuple):
    """Parameters of a body.

    Attributes
    ----------
    local : array, shape (J, 3, 3)
        Rotation of each joint in the axes of the rest pose, which its parent turns.
    betas : array, shape (B,)
        Shape coefficients.
    trans : array, shape (3,)
        Translation, metres.
    """

    local: np.ndarray
    betas: np.ndarray
    trans: np.ndarray


@compiled
def joint_motions(
    body: ModelSamples, pose: Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the rigid motions of the joints, x ↦ turn x + shift, and their derivatives by betas.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.

    Returns
    -------
    turns : array, shape (J, 3, 3)
        Rotations in space.
    places, shifts : array, shape (J, 3)
        Positions of the joints, and shifts, metres.
    shift_shapes : array, shape (J, 3, B)
        Derivatives of the shifts by the betas.
    axes : array, shape (J, 3, 3)
        The turn of each joint's parent.
    """
    n_joints, n_betas = body.joint_shapes.shape[0], body.joint_shapes.shape[2]
    joints = body.rest_joints.copy()
    for k in range(n_joints):
        for x in range(3):
            for b in range(n_betas):
                joints[k, x] += body.joint_shapes[k, x, b] * pose.betas[b]
    turns, axes = np.empty((n_joints, 3, 3)), np.empty((n_joints, 3, 3))
    places, shifts = joints.copy(), np.empty((n_joints, 3))
    shapes = body.joint_shapes.copy()
    shift_shapes = np.empty((n_joints, 3, n_betas))
    for k in body.order:
        parent = body.parents[k]
        for x in range(3):
            for y in range(3):
                own = 1.0 if x == y else 0.0
                axes[k, x, y] = turns[parent, x, y] if parent >= 0 else own
        if parent >= 0:
            for x in range(3):
                place = places[parent, x]
                for y in range(3):
                    place += axes[k, x, y] * (joints[k, y] - joints[parent, y])
                places[k, x] = place
                for b in range(n_betas):
                    value = shapes[parent, x, b]
                    for y in range(3):
                        difference = body.joint_shapes[k, y, b] - body.joint_shapes[parent, y, b]
                        value += axes[k, x, y] * difference
                    shapes[k, x, b] = value
        multiply(axes[k], pose.local[k], turns[k])
        for x in range(3):
            shifts[k, x] = places[k, x]
            for y in range(3):
                shifts[k, x] -= turns[k, x, y] * joints[k, y]
            for b in range(n_betas):
                shift_shapes[k, x, b] = shapes[k, x, b]
                for y in range(3):
                    shift_shapes[k, x, b] -= turns[k, x, y] * body.joint_shapes[k, y, b]
    return turns, places, shifts, shift_shapes, axes


@compiled
def shaped_points(body: ModelSamples, pose: Pose) -> np.ndarray:
    """Return the points of the body with its shape and pose offsets, before its joints turn.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.

    Returns
    -------
    array, shape (n, 3)
    """
    n, n_betas = body.rest.shape[0], len(pose.betas)
    shaped = body.rest.copy().reshape(3 * n)
    if n_betas:
        shaped += body.shapedirs.reshape(3 * n, n_betas) @ pose.betas
    n_features = body.posedirs.shape[2]
    if n_features:
        feature = np.empty(n_features)
        place = 0
        for k in range(len(body.parents)):
            if body.parents[k] >= 0:
                for x in range(3):
                    for y in range(3):
                        feature[place] = pose.local[k, x, y] - (1.0 if x == y else 0.0)
                        place += 1
        shaped += body.posedirs.reshape(3 * n, n_features) @ feature
    return shaped.reshape(n, 3)


@compiled
def posed(body: ModelSamples, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a posed body and their normals.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.

    Returns
    -------
    points, normals : array, shape (n, 3)
    """
    turns, _, shifts, _, _ = joint_motions(body, pose)
    shaped = shaped_points(body, pose)
    n, n_bones = body.bones.shape
    points, normals = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        size = 0.0
        for x in range(3):
            place, normal = pose.trans[x], 0.0
            for c in range(n_bones):
                weight, k = body.weights[i, c], body.bones[i, c]
                moved, turned = shifts[k, x], 0.0
                for y in range(3):
                    moved += turns[k, x, y] * shaped[i, y]
                    turned += turns[k, x, y] * body.normals[i, y]
                place += weight * moved
                normal += weight * turned
            points[i, x], normals[i, x] = place, normal
            size += normal * normal
        if size > 0.0:
            for x in range(3):
                normals[i, x] /= math.sqrt(size)
    return points, normals


@compiled
def rotation(vector: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of an axis-angle vector.

    Parameters
    ----------
    vector : array, shape (3,)
        Radians.

    Returns
    -------
    array, shape (3, 3)
    """
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    first, second = 1.0, 0.5
    if angle > 1e-6:
        first = math.sin(angle) / angle
        second = 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    x, y, z = vector
    turn = first * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # The square of the matrix of v × is v vᵀ − |v|².
    for i in range(3):
        turn[i, i] += 1.0 - second * angle * angle
        for j in range(3):
            turn[i, j] += second * vector[i] * vector[j]
    return turn


@compiled
def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the axis-angle vector of a rotation by less than half a turn.

    Parameters
    ----------
    matrix : array, shape (3, 3)
        Rotation matrix.

    Returns
    -------
    array, shape (3,)
    """
    sines = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    size = math.sqrt(sines[0] ** 2 + sines[1] ** 2 + sines[2] ** 2)
    angle = math.atan2(size, matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - 1.0)
    if size < 1e-9:
        return 0.5 * sines
    return sines * (angle / size)


# A loop, since numba takes seconds to compile products of arrays.
@compiled
def multiply(one: np.ndarray, other: np.ndarray, product: np.ndarray) -> None:
    """Fill the product of two matrices.

    Parameters
    ----------
    one, other : array, shape (3, 3)
        The factors.
    product : array, shape (3, 3)
        The product, which is filled.
    """
    for x in range(3):
        for y in range(3):
            total = 0.0
            for z in range(3):
                total += one[x, z] * other[z, y]
            product[x, y] = total
