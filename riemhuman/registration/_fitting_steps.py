"""Steps of the fit of a posed body to loose points: equations, assignment, annealing.

The equations are those of `riemhuman.bodies.fit_model`. Joints have rotation matrices, and a step
rotates a joint by a small δ in the axes of space: x moves by δ × a, with the lever

    a = Σ_k w_k (G_k v + t_k − p_j)   over the joints k below j (j included).

In the soft assignment, a scan point x with normal m belongs to the body's point v with normal n and
share of area A with the probability P ∝ A exp(−|v − x|²/2σ² + κ (n·m − 1)); a uniform density
models points that belong to none. This is the mixture of coherent point drift (Myronenko and Song
2010, equations 2 to 4) with areas as weights and a von Mises–Fisher factor for the normals.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import rotation_matrix
from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.registration._posed_body import (
    JointMotions,
    ModelSamples,
    Pose,
    blended_rotations,
    from_parents,
    joint_motions,
    pose_body,
    shaped_points,
)

# Concentration κ of the normals.
KAPPA = 2.0
# Expected share of scan points that do not belong to the body, spread over a cubic metre.
OUTLIERS = 0.05
# Number of independent points that the scan counts as, relative to the prior.
_WORTH = 300.0
# Largest rotation of a joint in a step, radians.
_LONGEST = 0.6
# Weight of a landmark, as a share of all scan points.
LANDMARK = 0.03


class Prior(NamedTuple):
    """A normal prior of pose and shape."""

    local: np.ndarray  # (J, 3, 3) mean rotations of the joints
    precisions: np.ndarray  # (J,) inverse variances, inverse squared radians; 0 for the root
    betas: np.ndarray  # (B,) mean
    betas_precision: float  # inverse variance


def _derivatives(body: ModelSamples, pose: Pose, motions: JointMotions) -> np.ndarray:
    """Return derivatives (n, 3, c) of the points by rotations in space, betas and trans.

    The change of the pose offsets is left out. Single precision suffices for steps.
    """
    n, n_joints = body.weights.shape
    n_angles, n_betas = 3 * n_joints, len(pose.betas)
    rows = np.zeros((n, 3, n_angles + n_betas + 3), np.float32)

    by_bone = shaped_points(body, pose) @ motions.rotations.transpose(2, 1, 0).reshape(3, -1)
    by_bone = by_bone.reshape(n, 3, n_joints) + motions.shifts.T
    levers = (by_bone * body.weights[:, np.newaxis]) @ body.below
    levers -= motions.positions.T * (body.weights @ body.below)[:, np.newaxis]
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows[:, x, y:n_angles:3] = levers[:, z]
        rows[:, y, x:n_angles:3] = -levers[:, z]

    axes, rotations = motions.axes, motions.rotations
    bones = (axes @ from_parents(body, body.joint_shapes)).reshape(n_joints, -1)
    shifts = body.below @ bones - (rotations @ body.joint_shapes).reshape(n_joints, -1)
    of_betas = rows[:, :, n_angles : n_angles + n_betas]
    of_betas[:] = (body.weights @ shifts).reshape(n, 3, n_betas)
    of_betas += blended_rotations(body, motions) @ body.shapedirs
    rows[:, :, -3:] = np.eye(3)
    return rows


def take_step(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    prior_weight: float,
    shares: np.ndarray,
    gaps: np.ndarray,
    directions: np.ndarray,
    along: float,
    longest: float,
) -> Pose:
    """Return the parameters after one damped Gauss–Newton step.

    It decreases Σ_i s_i (τ |r_i|² + (1 − τ) (d_i·r_i)²), with shares s, gaps r, directions d and
    τ = `along`, plus `prior_weight` (square metres) times the prior. No joint rotates by more than
    `longest`, radians.
    """
    n_angles = 3 * len(body.parents)
    motions = joint_motions(body, pose)
    rows = _derivatives(body, pose, motions)
    root = math.sqrt(along)
    scale = np.sqrt(shares)[:, np.newaxis, np.newaxis]
    weighted = scale * (
        root * np.eye(3)
        + (1.0 - root) * directions[:, :, np.newaxis] * directions[:, np.newaxis]
    )
    rows = (weighted.astype(np.float32) @ rows).reshape(-1, rows.shape[2])
    matrix = (rows.T @ rows).astype(float)
    right = rows.T @ (weighted @ gaps[:, :, np.newaxis]).ravel().astype(np.float32)

    precisions = prior_weight * np.concatenate(
        [
            np.repeat(prior.precisions, 3),
            np.full(len(pose.betas), prior.betas_precision),
            np.zeros(3),
        ]
    )
    away = Rotation.from_matrix(pose.local @ prior.local.transpose(0, 2, 1)).as_rotvec()
    in_space = np.einsum("jxy,jy->jx", motions.axes, away)
    offsets = np.concatenate([in_space.ravel(), pose.betas - prior.betas, np.zeros(3)])
    right -= precisions * offsets
    diagonal = np.diag(matrix) + precisions
    matrix += np.diag(precisions + 1e-4 * diagonal + 1e-9)
    step = np.linalg.solve(matrix, right)

    vectors = np.einsum("jyx,jy->jx", motions.axes, step[:n_angles].reshape(-1, 3))
    angles = np.linalg.norm(vectors, axis=1, keepdims=True)
    vectors *= longest / np.maximum(angles, longest)
    return Pose(
        rotation_matrix(vectors) @ pose.local, pose.betas + step[n_angles:-3], pose.trans + step[-3:]
    )


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
    """Fill masses and targets of the body's points, and return the mean log-likelihood.

    Masses are the expected numbers of scan points that belong to each point of the body, targets
    the sums of these scan points. Points and normals of the body are float32, shape (3, n).
    """
    n = points.shape[1]
    share = np.empty(n, np.float32)
    # exp(−t) as (1 − t/1024)^1024, which needs only multiplications.
    scale = np.float32(0.5 / (sigma * sigma) / 1024.0)
    angular = np.float32(KAPPA / 1024.0)
    one, zero = np.float32(1.0), np.float32(0.0)
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
            t = t if t > zero else zero
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
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
    start: Pose,
    prior: Prior,
    scan: np.ndarray,
    scan_normals: np.ndarray,
    sigmas: np.ndarray,
    signed: bool,
    landmarks: np.ndarray,
) -> tuple[Pose, float]:
    """Fit a body to a scan, and return it with the mean log-likelihood before the last step.

    There is a step for each standard deviation, metres. Landmarks are known positions of points of
    the body, shape (n, 3), NaN for all others. `signed` is whether the signs of the scan's normals
    are known.
    """
    n = len(body.areas)
    areas = body.areas.astype(np.float32)
    masses, targets = np.empty(n, np.float32), np.empty((3, n), np.float32)
    known = ~np.isnan(landmarks[:, 0])
    pose, likelihood = start, -np.inf
    for sigma in sigmas:
        points, normals = pose_body(body, pose)
        likelihood = assign(
            np.ascontiguousarray(points.T, np.float32),
            np.ascontiguousarray(normals.T, np.float32),
            areas,
            scan,
            scan_normals,
            sigma,
            signed,
            masses,
            targets,
        )
        # The smallest positive number stands for a mass of 0, whose share is 0.
        means = targets.T / np.maximum(masses, np.finfo(np.float32).tiny)[:, np.newaxis]
        gaps = np.where(known[:, np.newaxis], landmarks, means) - points
        shares = np.where(known, LANDMARK, masses / len(scan))
        weight = sigma * sigma / _WORTH
        pose = take_step(body, pose, prior, weight, shares, gaps, normals, 1.0, _LONGEST)
    return pose, likelihood
