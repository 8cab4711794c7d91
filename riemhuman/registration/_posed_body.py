"""Evenly spread points of a body model's surface, and their positions in a pose, compiled.

Registration follows a few hundred or a few thousand points of the surface instead of all its
vertices. Each has its skinning weights, shape directions, normal and share of the area. No coarser
mesh is needed, so that any `BodyModel` can be used.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.bodies import BodyModel
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._scan_preparation import thin_points


class ModelSamples(NamedTuple):
    """Points of a model's surface and its joints, in the rest pose and with zero betas."""

    numbers: np.ndarray  # (n,) vertices of the model; -1 for a joint
    rest: np.ndarray  # (n, 3) positions, metres
    normals: np.ndarray  # (n, 3) unit normals
    areas: np.ndarray  # (n,) shares of the surface, which sum to one; 0 for joints
    shapedirs: np.ndarray  # (n, 3, B)
    posedirs: np.ndarray  # (n, 3, P); P is 0 for a model without posedirs
    bones: np.ndarray  # (n, k) joints that move the point
    weights: np.ndarray  # (n, k) skinning weights of these joints
    rest_joints: np.ndarray  # (J, 3) metres
    joint_shapes: np.ndarray  # (J, 3, B) displacements of joints for each shape coefficient
    parents: np.ndarray  # (J,) -1 for the root
    order: np.ndarray  # (J,) joints, parents before children


def sample_model(model: BodyModel, n_samples: int | None) -> ModelSamples:
    """Return points of the model's skin, followed by its joints."""
    template = model.template
    vertices, areas = template.vertices, template.vertex_areas
    normals = vertex_normals(vertices, template.faces)
    if n_samples is None or n_samples >= len(vertices):
        numbers = np.arange(len(vertices))
        shares = areas
    else:
        numbers = thin_points(vertices, n_samples, np.random.default_rng(0))
        # Neighbours are near in their normals too, so that the two sides of a thin part keep their
        # own areas.
        near = np.concatenate([vertices, 0.05 * normals], axis=1)
        owners = cKDTree(near[numbers]).query(near)[1]
        shares = np.bincount(owners, areas, len(numbers))
    n_joints, n_betas = model.n_joints, model.n_betas
    rest_joints = model.joint_regressor @ vertices
    joint_shapes = np.einsum("jv,vxb->jxb", model.joint_regressor, model.shapedirs)
    n_features = 0 if model.posedirs is None else model.posedirs.shape[-1]
    posedirs = np.zeros((len(numbers), 3, 0)) if model.posedirs is None else model.posedirs[numbers]
    n_bones = int((model.weights > 0).sum(axis=1).max())
    bones = np.argsort(-model.weights[numbers], axis=1, kind="stable")[:, :n_bones]
    weights = np.take_along_axis(model.weights[numbers], bones, axis=1)
    own = np.zeros((n_joints, n_bones))
    own[:, 0] = 1.0
    of_joints = np.tile(np.arange(n_joints)[:, None], (1, n_bones))
    return ModelSamples(
        numbers=np.concatenate([numbers, np.full(n_joints, -1)]),
        rest=np.concatenate([vertices[numbers], rest_joints]),
        normals=np.concatenate([normals[numbers], np.zeros((n_joints, 3))]),
        areas=np.concatenate([shares / shares.sum(), np.zeros(n_joints)]),
        shapedirs=np.concatenate([model.shapedirs[numbers], joint_shapes]).reshape(-1, 3, n_betas),
        posedirs=np.concatenate([posedirs, np.zeros((n_joints, 3, n_features))]),
        bones=np.concatenate([bones, of_joints]).astype(np.int64),
        weights=np.concatenate([weights, own]),
        rest_joints=rest_joints,
        joint_shapes=joint_shapes,
        parents=np.array(model.parents),
        order=np.array(model.joint_order),
    )


class Pose(NamedTuple):
    """Parameters of a body."""

    local: np.ndarray  # (J, 3, 3) rotation of each joint relative to its parent
    betas: np.ndarray  # (B,)
    trans: np.ndarray  # (3,) metres


@compiled
def joint_motions(
    body: ModelSamples, pose: Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return rotations in space, positions, shifts, their derivatives by betas, and axes.

    Joint k moves x to rotation[k] x + shift[k]; axes[k] is the rotation of its parent.
    """
    n_joints, n_betas = body.joint_shapes.shape[0], body.joint_shapes.shape[2]
    joints = body.rest_joints.copy()
    for k in range(n_joints):
        for x in range(3):
            for b in range(n_betas):
                joints[k, x] += body.joint_shapes[k, x, b] * pose.betas[b]
    rotations, axes = np.empty((n_joints, 3, 3)), np.empty((n_joints, 3, 3))
    positions, shifts = joints.copy(), np.empty((n_joints, 3))
    shapes = body.joint_shapes.copy()
    shift_shapes = np.empty((n_joints, 3, n_betas))
    for k in body.order:
        parent = body.parents[k]
        for x in range(3):
            for y in range(3):
                own = 1.0 if x == y else 0.0
                axes[k, x, y] = rotations[parent, x, y] if parent >= 0 else own
        if parent >= 0:
            for x in range(3):
                position = positions[parent, x]
                for y in range(3):
                    position += axes[k, x, y] * (joints[k, y] - joints[parent, y])
                positions[k, x] = position
                for b in range(n_betas):
                    value = shapes[parent, x, b]
                    for y in range(3):
                        difference = body.joint_shapes[k, y, b] - body.joint_shapes[parent, y, b]
                        value += axes[k, x, y] * difference
                    shapes[k, x, b] = value
        multiply(axes[k], pose.local[k], rotations[k])
        for x in range(3):
            shifts[k, x] = positions[k, x]
            for y in range(3):
                shifts[k, x] -= rotations[k, x, y] * joints[k, y]
            for b in range(n_betas):
                shift_shapes[k, x, b] = shapes[k, x, b]
                for y in range(3):
                    shift_shapes[k, x, b] -= rotations[k, x, y] * body.joint_shapes[k, y, b]
    return rotations, positions, shifts, shift_shapes, axes


@compiled
def shaped_points(body: ModelSamples, pose: Pose) -> np.ndarray:
    """Return the points of the body with its shape and pose offsets, before its joints turn."""
    n, n_betas = body.rest.shape[0], len(pose.betas)
    shaped = body.rest.copy().reshape(3 * n)
    if n_betas:
        shaped += body.shapedirs.reshape(3 * n, n_betas) @ pose.betas
    n_features = body.posedirs.shape[2]
    if n_features:
        feature = np.empty(n_features)
        position = 0
        for k in range(len(body.parents)):
            if body.parents[k] >= 0:
                for x in range(3):
                    for y in range(3):
                        feature[position] = pose.local[k, x, y] - (1.0 if x == y else 0.0)
                        position += 1
        shaped += body.posedirs.reshape(3 * n, n_features) @ feature
    return shaped.reshape(n, 3)


@compiled
def pose_body(body: ModelSamples, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a posed body and their normals."""
    rotations, _, shifts, _, _ = joint_motions(body, pose)
    shaped = shaped_points(body, pose)
    n, n_bones = body.bones.shape
    points, normals = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        size = 0.0
        for x in range(3):
            position, normal = pose.trans[x], 0.0
            for c in range(n_bones):
                weight, k = body.weights[i, c], body.bones[i, c]
                moved, rotated = shifts[k, x], 0.0
                for y in range(3):
                    moved += rotations[k, x, y] * shaped[i, y]
                    rotated += rotations[k, x, y] * body.normals[i, y]
                position += weight * moved
                normal += weight * rotated
            points[i, x], normals[i, x] = position, normal
            size += normal * normal
        if size > 0.0:
            for x in range(3):
                normals[i, x] /= math.sqrt(size)
    return points, normals


@compiled
def rotation(vector: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of an axis-angle vector."""
    angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    sine, cosine = 1.0, 0.5  # sin(angle) / angle and (1 - cos(angle)) / angle²
    if angle > 1e-6:
        sine = math.sin(angle) / angle
        cosine = 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    x, y, z = vector
    matrix = sine * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # The square of the matrix of v × is v vᵀ − |v|².
    for i in range(3):
        matrix[i, i] += 1.0 - cosine * angle * angle
        for j in range(3):
            matrix[i, j] += cosine * vector[i] * vector[j]
    return matrix


@compiled
def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the axis-angle vector of a rotation by less than half a turn."""
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
def multiply(first: np.ndarray, second: np.ndarray, product: np.ndarray) -> None:
    """Fill the product of two matrices."""
    for x in range(3):
        for y in range(3):
            total = 0.0
            for z in range(3):
                total += first[x, z] * second[z, y]
            product[x, y] = total
