"""Gauss–Newton equations and steps for the parameters of a posed body, compiled.

The equations are those of `riemhuman.bodies.fitting_equations`, here in loops that release the
interpreter lock, so that many starts run in parallel. Joints have rotation matrices, and a step
turns a joint by a small δ in the axes of space: x moves by δ × a, with the arm

    a = Σ_k w_k (G_k v + t_k − p_j)   over the joints k below j (j included).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from riemhuman.kernels.compiled import SUM, compiled
from riemhuman.registration.model_samples import ModelSamples
from riemhuman.registration.posing import (
    Pose,
    joint_motions,
    multiply,
    rotation,
    rotation_vector,
    shaped_points,
)


class Prior(NamedTuple):
    """A normal prior of pose and shape.

    Attributes
    ----------
    local : array, shape (J, 3, 3)
        Mean rotations of the joints.
    precisions : array, shape (J,)
        Inverse variances of the joints, in inverse squared radians; 0 for the root.
    betas : array, shape (B,)
        Mean of the betas.
    betas_precision : float
        Inverse variance of the betas.
    """

    local: np.ndarray
    precisions: np.ndarray
    betas: np.ndarray
    betas_precision: float


@compiled
def add_normal_equations(
    body: ModelSamples,
    pose: Pose,
    shares: np.ndarray,
    gaps: np.ndarray,
    directions: np.ndarray,
    along: float,
    matrix: np.ndarray,
    right: np.ndarray,
) -> None:
    """Add the equations of Σ_i s_i (τ |r_i|² + (1 − τ) (d_i·r_i)²) for small steps.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.
    shares : array, shape (n,)
        Weights s; points of weight zero are left out.
    gaps : array, shape (n, 3)
        Vectors r from the points to their targets.
    directions : array, shape (n, 3)
        Unit vectors d.
    along : float
        Weight τ across the directions d.
    matrix : array, shape (P, P)
        Matrix for turns of the joints in space, betas and trans, P = 3 J + B + 3; added to.
    right : array, shape (P,)
        Right-hand side; added to.
    """
    turns, places, shifts, shift_shapes, _ = joint_motions(body, pose)
    shaped = shaped_points(body, pose)
    n_joints, n_betas = len(body.parents), len(pose.betas)
    n_turns = 3 * n_joints
    n_columns = n_turns + n_betas + 3
    n_bones = body.bones.shape[1]
    patch = 256
    rows, sides = np.empty((3 * patch, n_columns)), np.empty(3 * patch)
    row = np.empty((3, n_columns))
    arms, carried, blended = np.empty((n_joints, 3)), np.empty(3), np.empty((3, 3))
    counted = np.empty(n_joints)
    root = math.sqrt(along)
    filled = 0
    for i in range(len(shares)):
        if shares[i] > 0.0:
            arms[:], counted[:], row[:], blended[:] = 0.0, 0.0, 0.0, 0.0
            for c in range(n_bones):
                weight = body.weights[i, c]
                if weight == 0.0:
                    continue
                k = body.bones[i, c]
                for x in range(3):
                    value = shifts[k, x]
                    for y in range(3):
                        value += turns[k, x, y] * shaped[i, y]
                        blended[x, y] += weight * turns[k, x, y]
                    carried[x] = weight * value
                    for b in range(n_betas):
                        row[x, n_turns + b] += weight * shift_shapes[k, x, b]
                while k >= 0:
                    for x in range(3):
                        arms[k, x] += carried[x]
                    counted[k] += weight
                    k = body.parents[k]
            for k in range(n_joints):
                if counted[k] > 0.0:
                    a = arms[k, 0] - counted[k] * places[k, 0]
                    b = arms[k, 1] - counted[k] * places[k, 1]
                    c = arms[k, 2] - counted[k] * places[k, 2]
                    row[0, 3 * k + 1], row[0, 3 * k + 2] = c, -b
                    row[1, 3 * k], row[1, 3 * k + 2] = -c, a
                    row[2, 3 * k], row[2, 3 * k + 1] = b, -a
            for x in range(3):
                for y in range(3):
                    for b in range(n_betas):
                        row[x, n_turns + b] += blended[x, y] * body.shapedirs[i, y, b]
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
def add_prior(
    body: ModelSamples, pose: Pose, prior: Prior, size: float, matrix: np.ndarray, right: np.ndarray
) -> None:
    """Add the equations of the prior, in the same coordinates.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.
    prior : Prior
        The prior.
    size : float
        Its weight, square metres.
    matrix : array, shape (P, P)
        Added to.
    right : array, shape (P,)
        Added to.
    """
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


@compiled
def stepped(
    body: ModelSamples, pose: Pose, matrix: np.ndarray, right: np.ndarray, longest: float
) -> Pose:
    """Return the parameters after the step that solves the equations.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.
    matrix : array, shape (P, P)
        Matrix of the normal equations, which is overwritten.
    right : array, shape (P,)
        Right-hand side.
    longest : float
        Largest turn of a joint, radians.
    """
    n_joints, n_betas = len(body.parents), len(pose.betas)
    for k in range(len(right)):
        matrix[k, k] += 1e-4 * matrix[k, k] + 1e-9
    step = _solved(matrix, right)
    axes = joint_motions(body, pose)[4]
    local = np.empty_like(pose.local)
    turn = np.empty(3)
    for k in range(n_joints):
        for x in range(3):
            turn[x] = 0.0
            for y in range(3):
                turn[x] += axes[k, y, x] * step[3 * k + y]
        angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
        if angle > longest:
            turn *= longest / angle
        multiply(rotation(turn), pose.local[k], local[k])
    return Pose(
        local,
        pose.betas + step[3 * n_joints : 3 * n_joints + n_betas],
        pose.trans + step[3 * n_joints + n_betas :],
    )


@compiled(forceinline=True, fastmath=SUM)
def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
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
