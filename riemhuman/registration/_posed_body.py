"""Evenly spread points of a body model's surface, and their positions in a pose.

Registration follows a few hundred or a few thousand points of the surface instead of all its
vertices. Each has its skinning weights, shape directions, normal and share of the area. No coarser
mesh is needed, so that any `BodyModel` can be used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.bodies import BodyModel
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._scan_preparation import thin_points


class ModelSamples(NamedTuple):
    """Points of a model's surface and its joints, in the rest pose and with zero betas."""

    numbers: np.ndarray  # (n,) vertices of the model; -1 for a joint
    rest: np.ndarray  # (n, 3) positions, metres
    normals: np.ndarray  # (n, 3) unit normals; 0 for joints
    areas: np.ndarray  # (n,) shares of the surface, which sum to one; 0 for joints
    shapedirs: np.ndarray  # (n, 3, B)
    posedirs: np.ndarray  # (n, 3, P); P is 0 for a model without posedirs
    weights: np.ndarray  # (n, J) skinning weights
    rest_joints: np.ndarray  # (J, 3) metres
    joint_shapes: np.ndarray  # (J, 3, B) displacements of joints for each shape coefficient
    parents: np.ndarray  # (J,) -1 for the root
    order: tuple[int, ...]  # joints, parents before children
    below: np.ndarray  # (J, J) whether the joint of a row moves with that of a column


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
    n_joints = model.n_joints
    rest_joints = model.joint_regressor @ vertices
    joint_shapes = np.einsum("jv,vxb->jxb", model.joint_regressor, model.shapedirs)
    n_features = 0 if model.posedirs is None else model.posedirs.shape[-1]
    posedirs = np.zeros((len(numbers), 3, 0)) if model.posedirs is None else model.posedirs[numbers]
    below = np.eye(n_joints)
    for k in model.joint_order:
        if model.parents[k] >= 0:
            below[k] += below[model.parents[k]]
    return ModelSamples(
        numbers=np.concatenate([numbers, np.full(n_joints, -1)]),
        rest=np.concatenate([vertices[numbers], rest_joints]),
        normals=np.concatenate([normals[numbers], np.zeros((n_joints, 3))]),
        areas=np.concatenate([shares / shares.sum(), np.zeros(n_joints)]),
        shapedirs=np.concatenate([model.shapedirs[numbers], joint_shapes]),
        posedirs=np.concatenate([posedirs, np.zeros((n_joints, 3, n_features))]),
        weights=np.concatenate([model.weights[numbers], np.eye(n_joints)]),
        rest_joints=rest_joints,
        joint_shapes=joint_shapes,
        parents=model.parents,
        order=tuple(model.joint_order),
        below=below,
    )


class Pose(NamedTuple):
    """Parameters of a body."""

    local: np.ndarray  # (J, 3, 3) rotation of each joint relative to its parent
    betas: np.ndarray  # (B,)
    trans: np.ndarray  # (3,) metres


class JointMotions(NamedTuple):
    """Rigid motions of joints: joint k moves x to rotations[k] x + shifts[k]."""

    rotations: np.ndarray  # (J, 3, 3)
    shifts: np.ndarray  # (J, 3)
    positions: np.ndarray  # (J, 3)
    axes: np.ndarray  # (J, 3, 3) the rotation of each joint's parent


def joint_motions(body: ModelSamples, pose: Pose) -> JointMotions:
    """Return the motions of the joints, before the translation."""
    joints = body.rest_joints + body.joint_shapes @ pose.betas
    rotations, axes = np.empty_like(pose.local), np.empty_like(pose.local)
    for k in body.order:
        axes[k] = rotations[body.parents[k]] if body.parents[k] >= 0 else np.eye(3)
        rotations[k] = axes[k] @ pose.local[k]
    bones = (axes @ from_parents(body, joints)[:, :, np.newaxis])[:, :, 0]
    positions = body.below @ bones
    shifts = positions - (rotations @ joints[:, :, np.newaxis])[:, :, 0]
    return JointMotions(rotations, shifts, positions, axes)


def from_parents(body: ModelSamples, values: np.ndarray) -> np.ndarray:
    """Return the differences of values of joints from those of their parents."""
    differences: np.ndarray = values - values[body.parents]
    differences[body.parents < 0] = values[body.parents < 0]
    return differences


def blended_rotations(body: ModelSamples, motions: JointMotions) -> np.ndarray:
    """Return the rotation part of the skinning of every point, shape (n, 3, 3)."""
    return (body.weights @ motions.rotations.reshape(-1, 9)).reshape(-1, 3, 3)


def shaped_points(body: ModelSamples, pose: Pose) -> np.ndarray:
    """Return the points of the body with its shape and pose offsets, before its joints rotate."""
    shaped: np.ndarray = body.rest + body.shapedirs @ pose.betas
    if body.posedirs.shape[2]:
        feature = pose.local[body.parents >= 0] - np.eye(3)
        shaped += body.posedirs @ feature.ravel()
    return shaped


def pose_body(body: ModelSamples, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a posed body and their normals."""
    motions = joint_motions(body, pose)
    blended = blended_rotations(body, motions)
    points = np.einsum("nxy,ny->nx", blended, shaped_points(body, pose))
    points += body.weights @ motions.shifts + pose.trans
    return points, unit_vectors(np.einsum("nxy,ny->nx", blended, body.normals))
