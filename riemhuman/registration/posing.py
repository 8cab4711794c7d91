"""Points of a posed body, their normals and derivatives, and Gauss–Newton steps: compiled.

The equations are those of `riemhuman.bodies.fitting_equations`, here in loops that release the
interpreter lock, so that many starts run side by side. Joints carry rotation matrices, and a step
turns a joint by a small δ in the axes of space: x moves by δ × a, where a is the arm

    a = Σ_k w_k (G_k v + t_k − p_j)   over the joints k below j (j included).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from riemhuman.kernels.compiled import SUM, compiled
from riemhuman.registration.model_samples import ModelSamples


class Pose(NamedTuple):
    """Parameters of a body.

    Attributes
    ----------
    local : array, shape (J, 3, 3)
        Rotation of each joint in the axes of the rest pose, carried along by its parent.
    betas : array, shape (B,)
        Shape coefficients.
    trans : array, shape (3,)
        Translation, metres.
    """

    local: np.ndarray
    betas: np.ndarray
    trans: np.ndarray


class Prior(NamedTuple):
    """What is known of a pose before a scan is seen.

    Attributes
    ----------
    local : array, shape (J, 3, 3)
        The pose that joints are drawn to.
    precisions : array, shape (J,)
        How strongly: inverse variances, in inverse squared radians; the root's is zero.
    betas : array, shape (B,)
        The shape that the betas are drawn to.
    betas_precision : float
        How strongly.
    """

    local: np.ndarray
    precisions: np.ndarray
    betas: np.ndarray
    betas_precision: float


@compiled
def joint_motions(
    body: ModelSamples, pose: Pose
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return turns, places, shifts, the derivatives of shifts for betas, and axes of the joints.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.

    Returns
    -------
    turns : array, shape (J, 3, 3)
    places, shifts : array, shape (J, 3)
    shift_shapes : array, shape (J, 3, B)
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
        _multiply(axes[k], pose.local[k], turns[k])
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
    """Return the points of the shaped body before its joints turn.

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
    """Return points of a posed body and their normals.

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
        From points to where they belong, r.
    directions : array, shape (n, 3)
        Unit vectors d.
    along : float
        Weight τ across the directions d.
    matrix : array, shape (P, P)
        Of turns of the joints in space, betas and trans: P = 3 J + B + 3.
    right : array, shape (P,)
        Right-hand side.
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
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    size: float,
    matrix: np.ndarray,
    right: np.ndarray,
) -> None:
    """Add the equations of the prior, in the same coordinates.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.
    prior : Prior
        What is known.
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
            _multiply(pose.local[k], prior.local[k].T, difference)
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
    body: ModelSamples,
    pose: Pose,
    matrix: np.ndarray,
    right: np.ndarray,
    longest: float,
) -> Pose:
    """Return the parameters after the step that solves the equations.

    Parameters
    ----------
    body : ModelSamples
        The model.
    pose : Pose
        Parameters.
    matrix : array, shape (P, P)
        Normal equations, changed.
    right : array, shape (P,)
        Right-hand side.
    longest : float
        Largest turn of a joint, radians.

    Returns
    -------
    Pose
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
        _multiply(rotation(turn), pose.local[k], local[k])
    return Pose(
        local,
        pose.betas + step[3 * n_joints : 3 * n_joints + n_betas],
        pose.trans + step[3 * n_joints + n_betas :],
    )


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
        [
            matrix[2, 1] - matrix[1, 2],
            matrix[0, 2] - matrix[2, 0],
            matrix[1, 0] - matrix[0, 1],
        ]
    )
    size = math.sqrt(sines[0] ** 2 + sines[1] ** 2 + sines[2] ** 2)
    angle = math.atan2(size, matrix[0, 0] + matrix[1, 1] + matrix[2, 2] - 1.0)
    if size < 1e-9:
        return 0.5 * sines
    return sines * (angle / size)


# In loops: numba takes seconds to compile products, solutions and assignments of arrays.
@compiled
def _multiply(one: np.ndarray, other: np.ndarray, product: np.ndarray) -> None:
    """Fill the product of two matrices, shape (3, 3)."""
    for x in range(3):
        for y in range(3):
            total = 0.0
            for z in range(3):
                total += one[x, z] * other[z, y]
            product[x, y] = total


@compiled(forceinline=True, fastmath=SUM)
def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution of positive definite equations, by the factors of Cholesky in place."""
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
