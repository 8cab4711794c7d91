"""Steps of the fit of a posed body to loose points, compiled: equations, assignment, annealing.

The equations are those of `riemhuman.bodies.fit_model`, here in loops that release the interpreter
lock, so that many starts run in parallel. Joints have rotation matrices, and a step rotates a joint
by a small δ in the axes of space: x moves by δ × a, with the lever

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

from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.registration._posed_body import (
    ModelSamples,
    Pose,
    joint_motions,
    multiply,
    pose_body,
    rotation,
    rotation_vector,
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


@compiled
def _add_equations(
    body: ModelSamples,
    pose: Pose,
    shares: np.ndarray,
    gaps: np.ndarray,
    directions: np.ndarray,
    along: float,
    matrix: np.ndarray,
    right: np.ndarray,
) -> None:
    """Add the normal equations of a step without the prior."""
    rotations, positions, shifts, shift_shapes, _ = joint_motions(body, pose)
    shaped = shaped_points(body, pose)
    n_joints, n_betas = len(body.parents), len(pose.betas)
    n_angles = 3 * n_joints
    n_columns = n_angles + n_betas + 3
    n_bones = body.bones.shape[1]
    patch = 256
    rows, sides = np.empty((3 * patch, n_columns)), np.empty(3 * patch)
    row = np.empty((3, n_columns))
    levers, moved, blended = np.empty((n_joints, 3)), np.empty(3), np.empty((3, 3))
    weight_below = np.empty(n_joints)
    root = math.sqrt(along)
    filled = 0
    for i in range(len(shares)):
        if shares[i] > 0.0:
            levers[:], weight_below[:], row[:], blended[:] = 0.0, 0.0, 0.0, 0.0
            for c in range(n_bones):
                weight = body.weights[i, c]
                if weight == 0.0:
                    continue
                k = body.bones[i, c]
                for x in range(3):
                    value = shifts[k, x]
                    for y in range(3):
                        value += rotations[k, x, y] * shaped[i, y]
                        blended[x, y] += weight * rotations[k, x, y]
                    moved[x] = weight * value
                    for b in range(n_betas):
                        row[x, n_angles + b] += weight * shift_shapes[k, x, b]
                while k >= 0:
                    for x in range(3):
                        levers[k, x] += moved[x]
                    weight_below[k] += weight
                    k = body.parents[k]
            for k in range(n_joints):
                if weight_below[k] > 0.0:
                    a = levers[k, 0] - weight_below[k] * positions[k, 0]
                    b = levers[k, 1] - weight_below[k] * positions[k, 1]
                    c = levers[k, 2] - weight_below[k] * positions[k, 2]
                    row[0, 3 * k + 1], row[0, 3 * k + 2] = c, -b
                    row[1, 3 * k], row[1, 3 * k + 2] = -c, a
                    row[2, 3 * k], row[2, 3 * k + 1] = b, -a
            for x in range(3):
                for y in range(3):
                    for b in range(n_betas):
                        row[x, n_angles + b] += blended[x, y] * body.shapedirs[i, y, b]
                row[x, n_columns - 3 + x] = 1.0
            scale = math.sqrt(shares[i])
            across = 0.0
            for x in range(3):
                across += directions[i, x] * gaps[i, x]
            for x in range(3):
                pull = scale * (1.0 - root) * directions[i, x]
                sides[3 * filled + x] = scale * root * gaps[i, x] + pull * across
                for column in range(n_columns):
                    value = scale * root * row[x, column]
                    for y in range(3):
                        value += pull * directions[i, y] * row[y, column]
                    rows[3 * filled + x, column] = value
            filled += 1
        if filled == patch or (i == len(shares) - 1 and filled):
            used = rows[: 3 * filled]
            matrix += used.T @ used
            right += used.T @ sides[: 3 * filled]
            filled = 0


@compiled
def _add_prior(
    body: ModelSamples, pose: Pose, prior: Prior, size: float, matrix: np.ndarray, right: np.ndarray
) -> None:
    """Add the equations of the prior, in the same coordinates."""
    axes = joint_motions(body, pose)[4]
    n_joints = len(body.parents)
    difference = np.empty((3, 3))
    for k in range(n_joints):
        precision = size * prior.precisions[k]
        if precision > 0.0:
            multiply(pose.local[k], prior.local[k].T, difference)
            away = rotation_vector(difference)
            for x in range(3):
                matrix[3 * k + x, 3 * k + x] += precision
                for y in range(3):
                    right[3 * k + x] -= precision * axes[k, x, y] * away[y]
    for b in range(len(pose.betas)):
        precision = size * prior.betas_precision
        matrix[3 * n_joints + b, 3 * n_joints + b] += precision
        right[3 * n_joints + b] -= precision * (pose.betas[b] - prior.betas[b])


@compiled(forceinline=True, fastmath=SUM)
def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve positive definite equations by Cholesky factors, which overwrite the matrix."""
    solution = right.copy()
    for i in range(len(right)):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(i):
            total -= matrix[i, k] * matrix[i, k]
            solution[i] -= matrix[i, k] * solution[k]
        matrix[i, i] = math.sqrt(total)
        solution[i] /= matrix[i, i]
    for i in range(len(right) - 1, -1, -1):
        for k in range(i + 1, len(right)):
            solution[i] -= matrix[k, i] * solution[k]
        solution[i] /= matrix[i, i]
    return solution


@compiled
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
    n_joints, n_betas = len(body.parents), len(pose.betas)
    n_columns = 3 * n_joints + n_betas + 3
    matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
    _add_equations(body, pose, shares, gaps, directions, along, matrix, right)
    _add_prior(body, pose, prior, prior_weight, matrix, right)
    for k in range(len(right)):
        matrix[k, k] += 1e-4 * matrix[k, k] + 1e-9
    step = _solve(matrix, right)
    axes = joint_motions(body, pose)[4]
    local = np.empty_like(pose.local)
    vector = np.empty(3)
    for k in range(n_joints):
        for x in range(3):
            vector[x] = 0.0
            for y in range(3):
                vector[x] += axes[k, y, x] * step[3 * k + y]
        angle = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
        if angle > longest:
            vector *= longest / angle
        multiply(rotation(vector), pose.local[k], local[k])
    return Pose(
        local,
        pose.betas + step[3 * n_joints : 3 * n_joints + n_betas],
        pose.trans + step[3 * n_joints + n_betas :],
    )


@compiled(forceinline=True, fastmath=SUM)
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


@compiled
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
    shares, gaps = np.empty(n), np.empty((n, 3))
    pose, likelihood = start, -np.inf
    for sigma in sigmas:
        points, normals = pose_body(body, pose)
        likelihood = assign(
            np.ascontiguousarray(points.T).astype(np.float32),
            np.ascontiguousarray(normals.T).astype(np.float32),
            areas,
            scan,
            scan_normals,
            sigma,
            signed,
            masses,
            targets,
        )
        for i in range(n):
            shares[i] = masses[i] / len(scan)
            for x in range(3):
                mean = targets[x, i] / masses[i] if masses[i] > 0.0 else 0.0
                gaps[i, x] = mean - points[i, x]
            if not math.isnan(landmarks[i, 0]):
                shares[i] = LANDMARK
                for x in range(3):
                    gaps[i, x] = landmarks[i, x] - points[i, x]
        weight = sigma * sigma / _WORTH
        pose = take_step(body, pose, prior, weight, shares, gaps, normals, 1.0, _LONGEST)
    return pose, likelihood
