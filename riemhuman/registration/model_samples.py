"""Evenly spread points of a body model's surface, with everything that moves them.

Registration follows a few hundred or a few thousand points of the surface instead of all its
vertices. Each has its skinning weights, shape directions, normal and share of the area. No coarser
mesh is needed, so that any `BodyModel` can be used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.bodies import BodyModel
from riemhuman.bodies.joint_motions import Skeleton
from riemhuman.kernels.vertex_normals import vertex_normals
from riemhuman.registration.surface_points import thinned


class ModelSamples(NamedTuple):
    """Points of a model's surface, in the rest pose and with zero betas.

    Attributes
    ----------
    numbers : array of int, shape (n,)
        Vertices of the model; -1 for a joint.
    rest, normals : array, shape (n, 3)
        Positions, metres, and unit normals.
    areas : array, shape (n,)
        Shares of the surface, which sum to one; 0 for joints.
    shapedirs : array, shape (n, 3, B)
        Displacement for each shape coefficient.
    posedirs : array, shape (n, 3, P)
        Displacement for each entry of R - I of the joints; P is 0 for a model without posedirs.
    bones : array of int, shape (n, k)
        Joints that move the point.
    weights : array, shape (n, k)
        Skinning weights of these joints.
    rest_joints : array, shape (J, 3)
        The joints, metres.
    joint_shapes : array, shape (J, 3, B)
        Their displacement for each shape coefficient.
    parents, order : array of int, shape (J,)
        The parent of each joint, -1 for the root; and the joints, each after its parent.
    """

    numbers: np.ndarray
    rest: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    shapedirs: np.ndarray
    posedirs: np.ndarray
    bones: np.ndarray
    weights: np.ndarray
    rest_joints: np.ndarray
    joint_shapes: np.ndarray
    parents: np.ndarray
    order: np.ndarray


def sample_model(model: BodyModel, n_samples: int | None, skeleton: Skeleton) -> ModelSamples:
    """Return points of the model's skin, followed by its joints.

    Parameters
    ----------
    model : BodyModel
        The model.
    n_samples : int or None
        Approximate number of vertices to take; None for all.
    skeleton : Skeleton
        The joints of the model.

    Returns
    -------
    samples : ModelSamples
        Vertices, then one point for every joint.
    """
    template = model.template
    vertices, areas = template.vertices, template.vertex_areas
    normals = vertex_normals(vertices, template.faces)
    if n_samples is None or n_samples >= len(vertices):
        numbers = np.arange(len(vertices))
        shares = areas
    else:
        numbers = thinned(vertices, n_samples, np.random.default_rng(0))
        # Neighbours are near in their normals too, so that the two sides of a thin part keep their
        # own areas.
        near = np.concatenate([vertices, 0.05 * normals], axis=1)
        owners = cKDTree(near[numbers]).query(near)[1]
        shares = np.bincount(owners, areas, len(numbers))
    n_joints, n_betas = model.n_joints, model.n_betas
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
        rest=np.concatenate([vertices[numbers], skeleton.rest_joints]),
        normals=np.concatenate([normals[numbers], np.zeros((n_joints, 3))]),
        areas=np.concatenate([shares / shares.sum(), np.zeros(n_joints)]),
        shapedirs=np.concatenate([model.shapedirs[numbers], skeleton.joint_shapes]).reshape(
            -1, 3, n_betas
        ),
        posedirs=np.concatenate([posedirs, np.zeros((n_joints, 3, n_features))]),
        bones=np.concatenate([bones, of_joints]).astype(np.int64),
        weights=np.concatenate([weights, own]),
        rest_joints=skeleton.rest_joints,
        joint_shapes=skeleton.joint_shapes,
        parents=np.array(skeleton.parents),
        order=np.array(skeleton.order),
    )
