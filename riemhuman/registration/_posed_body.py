"""Points of a body model's surface in a pose, and the steps of its fit to loose points.

Registration follows a few hundred or a few thousand points of the surface instead of all its
vertices. Each has its skinning weights, shape directions, normal and share of the area. No coarser
mesh is needed, so that any `BodyModel` can be used.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.kernels.compilation import FUSED, compiled
from riemhuman.kernels.rotations import axial
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._constants import (
    DETAIL_LENGTH,
    DETAIL_METRES,
    MATCH_NORMAL_METRES,
    N_DETAILS,
)
from riemhuman.registration._scan_preparation import even_points


class ModelSamples(NamedTuple):
    """Points of a model's surface and its joints, in the rest pose and with zero betas."""

    numbers: Integers  # (n,) vertices of the model; -1 for a joint
    rest: Array  # (n, 3) positions, metres
    normals: Array  # (n, 3) unit normals; 0 for joints
    areas: Array  # (n,) shares of the surface, which sum to one; 0 for joints
    shapedirs: Array  # (n, 3, B)
    posedirs: Array  # (n, 3, P); P is 0 for a model without posedirs
    weights: Array  # (n, J) skinning weights
    detail: Array  # (n, K) smooth heights that people have and the model has not; 0 for joints
    skeleton: Skeleton

    def only(self, chosen: Booleans | Integers) -> ModelSamples:
        """Return some of the points."""
        points = {name: value for name, value in self._asdict().items() if name != "skeleton"}
        return self._replace(**{name: value[chosen] for name, value in points.items()})

    def showing(self, visible: Booleans) -> ModelSamples:
        """Return the points with areas, which sum to one, only at visible vertices, (V,)."""
        areas = self.areas * visible[self.numbers]
        return self._replace(areas=areas / areas.sum())


def sample_model(model: BodyModel, n_samples: int | None) -> ModelSamples:
    """Return points of the model's skin, followed by its joints."""
    template = model.template
    vertices, areas = template.vertices, template.vertex_areas
    normals = vertex_normals(vertices, template.faces)
    if n_samples is None or n_samples >= len(vertices):
        numbers = np.arange(len(vertices))
        shares = areas
    else:
        numbers = even_points(vertices, n_samples)
        # Neighbours are near in their normals too, so that the two sides of a thin part keep their
        # own areas.
        near = np.concatenate([vertices, MATCH_NORMAL_METRES * normals], axis=1)
        owners = cKDTree(near[numbers]).query(near)[1]
        shares = np.bincount(owners, areas, len(numbers)).astype(np.float64, copy=False)
    n_joints = model.n_joints
    skeleton = Skeleton(model, with_hands=True)
    n_features = 0 if model.posedirs is None else model.posedirs.shape[-1]
    posedirs = np.zeros((len(numbers), 3, 0)) if model.posedirs is None else model.posedirs[numbers]
    weights = np.concatenate([model.weights[numbers], np.eye(n_joints)])
    shapedirs = np.concatenate([skeleton.directions[numbers], skeleton.joint_shapes])
    detail = _smooth_heights(vertices, normals, numbers)
    return ModelSamples(
        numbers=np.concatenate([numbers, np.full(n_joints, -1)]),
        rest=np.concatenate([vertices[numbers], skeleton.rest_joints]),
        normals=np.concatenate([normals[numbers], np.zeros((n_joints, 3))]),
        areas=np.concatenate([shares / shares.sum(), np.zeros(n_joints)]),
        shapedirs=shapedirs,
        posedirs=np.concatenate([posedirs, np.zeros((n_joints, 3, n_features))]),
        weights=weights,
        detail=np.concatenate([detail, np.zeros((n_joints, detail.shape[1]), detail.dtype)]),
        skeleton=skeleton,
    )


def _smooth_heights(vertices: Array, normals: Array, numbers: Integers) -> Array:
    """Return heights of some vertices, (n, K), whose combinations are smooth random detail.

    With independent coefficients of variance s², heights of two vertices have the covariance
    s² exp(-d² / 2ℓ²) at the distance d of their places and normals, up to the error of Nyström's
    approximation from K vertices.
    """
    places = np.concatenate([vertices, MATCH_NORMAL_METRES * normals], axis=1)
    centres = places[even_points(vertices, N_DETAILS)]
    among = _covariance(centres, centres) + 1e-6 * np.eye(len(centres))
    heights: Array = np.linalg.solve(
        np.linalg.cholesky(among), _covariance(centres, places[numbers])
    ).T
    return heights.astype(np.float32)


def _covariance(first: Array, second: Array) -> Array:
    squares = cdist(first, second, "sqeuclidean")
    covariance: Array = np.exp(-0.5 * squares / DETAIL_LENGTH**2)
    return covariance


class Pose(NamedTuple):
    """Parameters of a body."""

    local: Array  # (J, 3, 3) rotation of each joint relative to its parent
    betas: Array  # (B,) coefficients of shape, then of hands
    trans: Array  # (3,) metres


class PosedBody(NamedTuple):
    """Points of a posed body, and what their derivatives need."""

    points: Array  # (n, 3)
    normals: Array  # (n, 3)
    pose: Pose
    shaped: Array  # (n, 3) points with shape and pose offsets, before the joints rotate
    blended: Array  # (n, 3, 3) rotation part of the skinning of each point
    motions: JointMotions  # before the translation
    body: ModelSamples


def pose_body(body: ModelSamples, pose: Pose) -> PosedBody:
    motions = JointMotions(body.skeleton, pose.local, pose.betas)
    posedirs = body.posedirs if body.posedirs.shape[2] else None
    shaped, blended, moved = motions.skin(body.rest, body.shapedirs, posedirs, body.weights)
    normals = unit_vectors(np.einsum("nxy,ny->nx", blended, body.normals))
    return PosedBody(moved + pose.trans, normals, pose, shaped, blended, motions, body)


class Prior(NamedTuple):
    """A normal prior of pose and shape."""

    local: Array  # (J, 3, 3) mean rotations of the joints
    # (J,) inverse variances, inverse squared radians; 0 for the root, as for the translation
    precisions: Array
    betas: Array  # (B,) mean
    betas_precisions: Array  # (B,) inverse variances


def _rotation_vectors(rotations: Array) -> Array:
    """Return axis-angle vectors; 0 for half turns, whose axis has no unique sign."""
    sines = axial(rotations)
    sine = np.linalg.norm(sines, axis=1, keepdims=True)
    cosine = 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    angles = np.arctan2(sine, cosine[:, np.newaxis])
    vectors: Array = sines * angles / np.maximum(sine, np.finfo(float).tiny)
    return vectors


def take_step(posed: PosedBody, equations: tuple[Array, Array], longest: float) -> Pose:
    """Return the parameters after one damped Gauss–Newton step by its `normal_equations`.

    No joint rotates by more than `longest`, radians.
    """
    step, pose = np.linalg.solve(*equations), posed.pose
    n_angles = 3 * len(pose.local)
    vectors = np.einsum("jyx,yj->jx", posed.motions.axes, step[:n_angles].reshape(3, -1))
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors *= longest / np.maximum(angles, longest)
    local = Rotation.from_rotvec(vectors).as_matrix() @ pose.local
    return Pose(local, pose.betas + step[n_angles:-3], pose.trans + step[-3:])


def normal_equations(
    posed: PosedBody,
    prior: Prior,
    prior_weight: float,
    shares: Array,
    gaps: Array,
    directions: Array,
    along: float,
    *,
    with_detail: bool = False,
) -> tuple[Array, Array]:
    """Return the matrix and right side of a step: the joints' angles, betas and translation."""
    # The step decreases Σ_i s_i (τ |r_i|² + (1 − τ) (d_i·r_i)²), with shares s, gaps r, directions
    # d and τ = `along`, plus `prior_weight` (square metres) times the prior. With detail, the gaps
    # are those that are left by the likeliest smooth heights along d: what skin explains twists no
    # joint.
    pose, body = posed.pose, posed.body
    # Single precision is enough for steps; the change of the pose offsets is ignored.
    rows = skinning_derivatives(
        posed.motions,
        posed.shaped,
        posed.blended,
        body.weights,
        body.shapedirs,
        body.skeleton.below,
        real=np.float32,
    )
    sides = np.empty((len(rows), 3), rows.dtype)
    _weigh(rows, sides, shares, gaps, directions, along)
    flat = rows.reshape(-1, rows.shape[2])
    matrix = (flat.T @ flat).astype(float)
    right = (flat.T @ sides.ravel()).astype(float)
    if with_detail:
        explained = _explained_by_detail(rows, sides, shares, directions, body.detail, prior_weight)
        matrix -= explained[:, :-1]
        right -= explained[:, -1]

    of_place = np.full(3, prior.precisions[body.skeleton.order[0]])
    precisions = np.concatenate([np.tile(prior.precisions, 3), prior.betas_precisions, of_place])
    away = _rotation_vectors(pose.local @ prior.local.transpose(0, 2, 1))
    in_space = np.einsum("jxy,jy->xj", posed.motions.axes, away)
    offsets = np.concatenate([in_space.ravel(), pose.betas - prior.betas, np.zeros(3)])
    right -= prior_weight * precisions * offsets
    diagonal = np.diag(matrix) + prior_weight * precisions
    np.fill_diagonal(matrix, 1.0001 * diagonal + 1e-9)
    return matrix, right


def _explained_by_detail(
    rows: Array,
    sides: Array,
    shares: Array,
    directions: Array,
    detail: Array,
    prior_weight: float,
) -> Array:
    """Return what smooth heights take from a step's matrix and, in the last column, right side."""
    # The Schur complement of their coefficients, which have a normal prior.
    directions = directions.astype(rows.dtype)
    along_normals = np.column_stack(
        [np.einsum("nxc,nx->nc", rows, directions), np.einsum("nx,nx->n", sides, directions)]
    )
    heights = np.sqrt(shares).astype(rows.dtype)[:, np.newaxis] * detail
    mixed = (heights.T @ along_normals).astype(float)
    matrix = (heights.T @ heights).astype(float)
    np.fill_diagonal(matrix, np.diag(matrix) + prior_weight / DETAIL_METRES**2)
    explained: Array = mixed[:, :-1].T @ np.linalg.solve(matrix, mixed)
    return explained


@compiled(fastmath=FUSED)
def _weigh(
    rows: Array,
    sides: Array,
    shares: Array,
    gaps: Array,
    directions: Array,
    along: float,
) -> None:
    """Multiply each point's rows and gap by the root of its share, less along the surface."""
    zero = np.float32(0.0)
    for i in range(len(rows)):
        size = math.sqrt(shares[i])
        within = np.float32(size * math.sqrt(along))
        across = np.float32(size) - within
        row, side = rows[i], sides[i]
        side[0], side[1], side[2] = gaps[i, 0], gaps[i, 1], gaps[i, 2]
        if across == zero:
            side *= within
            for x in range(3):
                for c in range(row.shape[1]):
                    row[x, c] *= within
            continue
        p, q, r = (
            np.float32(directions[i, 0]),
            np.float32(directions[i, 1]),
            np.float32(directions[i, 2]),
        )
        height = across * (p * side[0] + q * side[1] + r * side[2])
        side[0] = within * side[0] + height * p
        side[1] = within * side[1] + height * q
        side[2] = within * side[2] + height * r
        for c in range(row.shape[1]):
            height = across * (p * row[0, c] + q * row[1, c] + r * row[2, c])
            row[0, c] = within * row[0, c] + height * p
            row[1, c] = within * row[1, c] + height * q
            row[2, c] = within * row[2, c] + height * r
