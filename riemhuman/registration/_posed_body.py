"""Points of a body model's surface in a pose, and the steps of its fit to loose points.

Registration follows a few hundred or a few thousand points of the surface instead of all its
vertices. Each has its skinning weights, shape directions, normal and share of the area. No coarser
mesh is needed, so that any `BodyModel` can be used.

In the soft assignment, a scan point x with normal m belongs to the body's point v with normal n and
share of area A with the probability P ∝ A exp(−|v − x|²/2σ² + κ (n·m − 1)); a uniform density
models points that belong to none. This is the mixture of coherent point drift (Myronenko and Song
2010, equations 2 to 4) with areas as weights and a von Mises–Fisher factor for the normals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.kernels.rotations import axial
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._scan_preparation import PreparedScan, thin_points

# Concentration κ of the normals.
KAPPA = 2.0
# Expected share of scan points that do not belong to the body, spread over a cubic metre.
OUTLIERS = 0.05
# Number of independent points that the scan counts as, relative to the prior.
_WORTH = 300.0
# Largest rotation of a joint in a step, radians.
_LONGEST = 0.6
# A scan shows at least this share of the body.
_LEAST_SHOWN = 0.1
# Exponents that are larger count for nothing in the soft assignment: e⁻³⁰ is far below the share of
# outliers, and still smaller ones become denormal numbers, which are slow.
_NEGLIGIBLE = 30.0
# Weight of a landmark, as a share of all scan points.
_LANDMARK = 0.03
# Standard deviation of landmarks, and the distance beyond which none counts more, metres.
_MISS_METRES, _FAR_MISS = 0.04, 0.4


class ModelSamples(NamedTuple):
    """Points of a model's surface and its joints, in the rest pose and with zero betas."""

    numbers: np.ndarray  # (n,) vertices of the model; -1 for a joint
    rest: np.ndarray  # (n, 3) positions, metres
    normals: np.ndarray  # (n, 3) unit normals; 0 for joints
    areas: np.ndarray  # (n,) shares of the surface, which sum to one; 0 for joints
    shapedirs: np.ndarray  # (n, 3, B)
    posedirs: np.ndarray  # (n, 3, P); P is 0 for a model without posedirs
    weights: np.ndarray  # (n, J) skinning weights
    skeleton: Skeleton

    def only(self, chosen: np.ndarray) -> ModelSamples:
        """Return some of the points."""
        points = {name: value for name, value in self._asdict().items() if name != "skeleton"}
        return self._replace(**{name: value[chosen] for name, value in points.items()})


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
    skeleton = Skeleton(model, with_hands=True)
    n_features = 0 if model.posedirs is None else model.posedirs.shape[-1]
    posedirs = np.zeros((len(numbers), 3, 0)) if model.posedirs is None else model.posedirs[numbers]
    weights = np.concatenate([model.weights[numbers], np.eye(n_joints)])
    shapedirs = np.concatenate([skeleton.directions[numbers], skeleton.joint_shapes])
    return ModelSamples(
        numbers=np.concatenate([numbers, np.full(n_joints, -1)]),
        rest=np.concatenate([vertices[numbers], skeleton.rest_joints]),
        normals=np.concatenate([normals[numbers], np.zeros((n_joints, 3))]),
        areas=np.concatenate([shares / shares.sum(), np.zeros(n_joints)]),
        shapedirs=shapedirs,
        posedirs=np.concatenate([posedirs, np.zeros((n_joints, 3, n_features))]),
        weights=weights,
        skeleton=skeleton,
    )


class Pose(NamedTuple):
    """Parameters of a body."""

    local: np.ndarray  # (J, 3, 3) rotation of each joint relative to its parent
    betas: np.ndarray  # (B,) coefficients of shape, then of hands
    trans: np.ndarray  # (3,) metres


class PosedBody(NamedTuple):
    """Points of a posed body, and what its derivatives need."""

    points: np.ndarray  # (n, 3)
    normals: np.ndarray  # (n, 3)
    pose: Pose
    shaped: np.ndarray  # (n, 3) points with shape and pose offsets, before the joints rotate
    blended: np.ndarray  # (n, 3, 3) rotation part of the skinning of each point
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

    local: np.ndarray  # (J, 3, 3) mean rotations of the joints
    # (J,) inverse variances, inverse squared radians; 0 for the root, as for the translation
    precisions: np.ndarray
    betas: np.ndarray  # (B,) mean
    betas_precisions: np.ndarray  # (B,) inverse variances


def _rotation_vectors(rotations: np.ndarray) -> np.ndarray:
    """Return axis-angle vectors, 0 for half turns, whose axis has two signs."""
    sines = axial(rotations)
    sine = np.linalg.norm(sines, axis=1, keepdims=True)
    cosine = 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    angles = np.arctan2(sine, cosine[:, np.newaxis])
    return sines * angles / np.maximum(sine, np.finfo(float).tiny)


def take_step(
    posed: PosedBody,
    prior: Prior,
    prior_weight: float,
    shares: np.ndarray,
    gaps: np.ndarray,
    directions: np.ndarray,
    along: float,
    longest: float,
) -> Pose:
    """Return the parameters after one damped Gauss–Newton step."""
    # It decreases Σ_i s_i (τ |r_i|² + (1 − τ) (d_i·r_i)²), with shares s, gaps r, directions d and
    # τ = `along`, plus `prior_weight` (square metres) times the prior. No joint rotates by more
    # than `longest`, radians.
    pose, body = posed.pose, posed.body
    scale = np.sqrt(shares, dtype=np.float32)[:, np.newaxis]
    # In single precision, which suffices for steps, and without the change of the pose offsets.
    weights, below = body.weights.astype(np.float32), body.skeleton.below.astype(np.float32)
    shapedirs = body.shapedirs.astype(np.float32)
    rows = skinning_derivatives(
        posed.motions, posed.shaped, posed.blended, weights, shapedirs, below
    )
    rows *= scale
    sides = (gaps * scale).T
    if along < 1.0:
        root = math.sqrt(along)
        across = directions.astype(np.float32).T
        pull = (1.0 - root) * across
        along_normals = np.einsum("xn,xnc->nc", across, rows)
        rows *= root
        rows += pull[:, :, np.newaxis] * along_normals
        sides = root * sides + pull * np.einsum("xn,xn->n", across, sides)
    rows = rows.reshape(-1, rows.shape[2])
    matrix = (rows.T @ rows).astype(float)
    right = (rows.T @ sides.ravel().astype(np.float32)).astype(float)

    of_place = np.full(3, prior.precisions[body.skeleton.order[0]])
    precisions = np.concatenate([np.tile(prior.precisions, 3), prior.betas_precisions, of_place])
    away = _rotation_vectors(pose.local @ prior.local.transpose(0, 2, 1))
    in_space = np.einsum("jxy,jy->xj", posed.motions.axes, away)
    offsets = np.concatenate([in_space.ravel(), pose.betas - prior.betas, np.zeros(3)])
    right -= prior_weight * precisions * offsets
    diagonal = np.diag(matrix) + prior_weight * precisions
    np.fill_diagonal(matrix, 1.0001 * diagonal + 1e-9)
    step = np.linalg.solve(matrix, right)

    n_angles = 3 * len(pose.local)
    vectors = np.einsum("jyx,yj->jx", posed.motions.axes, step[:n_angles].reshape(3, -1))
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors *= longest / np.maximum(angles, longest)
    local = Rotation.from_rotvec(vectors).as_matrix() @ pose.local
    return Pose(local, pose.betas + step[n_angles:-3], pose.trans + step[-3:])


class End(NamedTuple):
    """A plane beyond which a scan shows nothing of a body."""

    direction: np.ndarray  # (3,) away from the scan
    height: float  # along the direction, metres

    def shows(self, points: np.ndarray, distance: float = 0.0) -> np.ndarray:
        """Return which points are at least so far before the plane, metres."""
        shown: np.ndarray = points @ self.direction <= self.height - distance
        return shown


@compiled(fastmath=SUM)
def assign(
    points: np.ndarray,
    normals: np.ndarray,
    areas: np.ndarray,
    scan: np.ndarray,
    scan_normals: np.ndarray,
    sigma: float,
    signed: bool,
    masses: np.ndarray,
    targets: np.ndarray,
) -> float:
    """Fill masses and targets of the body's points, and return the mean log-likelihood."""
    # Masses are the expected numbers of scan points that belong to each point of the body, targets
    # the sums of these scan points.
    n = points.shape[1]
    share = np.empty(n, np.float32)
    # exp(−t) as (1 − t/1024)^1024, which needs only multiplications.
    scale = np.float32(0.5 / (sigma * sigma) / 1024.0)
    angular = np.float32(KAPPA / 1024.0)
    one, zero = np.float32(1.0), np.float32(0.0)
    least = np.float32(1.0 - _NEGLIGIBLE / 1024.0)
    # The mean of exp(κ (n·m − 1)) over all directions.
    mean_angular = (1.0 - math.exp(-2.0 * KAPPA)) / (2.0 * KAPPA)
    volume = (2.0 * math.pi * sigma * sigma) ** 1.5 * mean_angular / (1.0 - OUTLIERS)
    outliers = np.float32(OUTLIERS * volume)
    point_x, point_y, point_z = points[0], points[1], points[2]
    normal_x, normal_y, normal_z = normals[0], normals[1], normals[2]
    target_x, target_y, target_z = targets[0], targets[1], targets[2]
    masses[:] = zero
    targets[:] = zero
    likelihood = 0.0
    for j in range(scan.shape[0]):
        x, y, z = scan[j, 0], scan[j, 1], scan[j, 2]
        p, q, r = scan_normals[j, 0], scan_normals[j, 1], scan_normals[j, 2]
        total = zero
        for i in range(n):
            dx, dy, dz = point_x[i] - x, point_y[i] - y, point_z[i] - z
            cosine = normal_x[i] * p + normal_y[i] * q + normal_z[i] * r
            cosine = cosine if signed else abs(cosine)
            t = one - (dx * dx + dy * dy + dz * dz) * scale - (one - cosine) * angular
            t = t if t > least else zero
            for _ in range(10):
                t *= t
            t *= areas[i]
            share[i] = t
            total += t
        likelihood += math.log(total + outliers)
        factor = one / (total + outliers)
        for i in range(n):
            t = share[i] * factor
            masses[i] += t
            target_x[i] += t * x
            target_y[i] += t * y
            target_z[i] += t * z
    return likelihood / scan.shape[0] - math.log(volume)


def anneal(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: PreparedScan,
    sigmas: np.ndarray,
    end: End | None,
) -> tuple[Pose, float]:
    """Fit a body to a scan by a step for each deviation but the last, that of the likelihood."""
    n, n_joints = body.weights.shape
    areas = body.areas.astype(np.float32)
    points, scan_normals = scan.points.astype(np.float32), scan.normals.astype(np.float32)
    masses, targets = np.empty(n, np.float32), np.empty((3, n), np.float32)
    landmarks = np.full((n, 3), np.nan)
    for joint, position in scan.landmarks.items():
        landmarks[n - n_joints + joint] = position
    known = ~np.isnan(landmarks[:, 0])
    for number, sigma in enumerate(sigmas):
        posed = pose_body(body, pose)
        if end is not None:
            shown = body.areas * end.shows(posed.points)
            areas = (shown / max(shown.sum(), _LEAST_SHOWN)).astype(np.float32)
        likelihood = assign(
            np.ascontiguousarray(posed.points.T, np.float32),
            np.ascontiguousarray(posed.normals.T, np.float32),
            areas,
            points,
            scan_normals,
            sigma,
            scan.signed,
            masses,
            targets,
        )
        if number == len(sigmas) - 1:
            likelihood -= _landmark_cost(posed.points[-n_joints:], scan.landmarks)
            break
        # The smallest positive number stands for a mass of 0, whose share is 0.
        means = targets.T / np.maximum(masses, np.finfo(np.float32).tiny)[:, np.newaxis]
        gaps = np.where(known[:, np.newaxis], landmarks, means) - posed.points
        shares = np.where(known, _LANDMARK, masses / len(points))
        if end is not None:
            # Near the end, the points that belong to a point of the body are on one side of it.
            shares = np.where(known | end.shows(posed.points, sigma), shares, 0.0)
        weight = sigma * sigma / _WORTH
        pose = take_step(posed, prior, weight, shares, gaps, posed.normals, 1.0, _LONGEST)
    return pose, likelihood


def _landmark_cost(joints: np.ndarray, landmarks: Mapping[int, np.ndarray]) -> float:
    """Return by how much landmarks far from their joints lower the log-likelihood."""
    misses = [np.linalg.norm(joints[joint] - place) for joint, place in landmarks.items()]
    return _LANDMARK * float(np.sum(np.minimum(misses, _FAR_MISS) ** 2)) / (2.0 * _MISS_METRES**2)
