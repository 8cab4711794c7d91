"""The least-squares equations of a body model's fit: points, exact derivatives, normal equations.

A vertex v of the shaped surface moves to x = Σ_k w_k (G_k v + t_k), with the joints' motions G, t.
A rotation of joint j by a small δ, in the axes of the posed body, moves x by δ × a, where

    a = Σ_k w_k (G_k v + t_k − p_j)   over the joints k below j (j included),

and p_j is the position of the joint. So all derivatives with respect to rotations are cross
products, and one 3 × 3 matrix per joint converts them to derivatives with respect to the
axis-angle vector, after the sums over vertices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import linalg, sparse

from riemhuman.kernels.rotations import rotation_derivative, rotation_matrix

# Number of points in a patch: their derivatives fit in the processor's cache, and most patches
# depend on few joints, so that most columns are left out.
_PATCH = 512
# Weight of the parent's rotation as a share of a joint's spread: enough to determine what the
# points leave open, too little to matter elsewhere.
_PULL = 1e-3

Loss = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Maps squared distances to their loss and its derivative."""

# _CROSS_WITH_AXES[c] @ x is the cross product of the axis c with x.
_CROSS_WITH_AXES = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)


@dataclass(frozen=True)
class Parameters:
    """Parameters of one body."""

    betas: np.ndarray
    pose: np.ndarray
    trans: np.ndarray

    @property
    def vector(self) -> np.ndarray:
        """The numbers in the order of the equations."""
        return np.concatenate([self.pose.ravel(), self.betas, self.trans])

    def moved(self, step: np.ndarray) -> Parameters:
        """Return the parameters after a step."""
        n_angles = self.pose.size
        return replace(
            self,
            pose=self.pose + step[:n_angles].reshape(-1, 3),
            betas=self.betas + step[n_angles:-3],
            trans=self.trans + step[-3:],
        )


class Skeleton:
    """The joints of a body model; coefficients of hand poses are betas that move no joint."""

    def __init__(self, model: Any, with_hands: bool = False) -> None:
        self.model, self.parents, self.order = model, model.parents, model.joint_order
        self.limbs = np.flatnonzero(model.parents >= 0)  # joints other than the root
        self.rest_joints = model.joint_regressor @ model.template.vertices
        self.directions = model.shapedirs
        self.joint_shapes = np.einsum("jv,vxb->jxb", model.joint_regressor, model.shapedirs)
        if with_hands:
            self.directions = np.concatenate([model.shapedirs, model.hand_directions], axis=-1)
            n_hands = model.hand_directions.shape[-1]
            self.joint_shapes = np.pad(self.joint_shapes, ((0, 0), (0, 0), (0, n_hands)))
        self.n_joints, self.n_betas = model.n_joints, self.directions.shape[-1]
        # below[j, k]: whether joint k moves with joint j.
        self.below = np.eye(len(model.parents))
        for joint in reversed(self.order):
            if self.parents[joint] >= 0:
                self.below[self.parents[joint]] += self.below[joint]


class JointMotions:
    """The rigid motions of the joints for some parameters, and their derivatives."""

    def __init__(self, skeleton: Skeleton, parameters: Parameters) -> None:
        self.skeleton = skeleton
        self.parameters = parameters
        joints = skeleton.rest_joints + skeleton.joint_shapes @ parameters.betas
        self.local = rotation_matrix(parameters.pose)
        self.rotations = np.empty_like(self.local)
        self.positions = np.empty_like(joints)
        # The axes of a joint's own rotation are those of its parent.
        self.axes = np.tile(np.eye(3), (skeleton.n_joints, 1, 1))
        # Derivatives of the positions with respect to the betas.
        self._position_shapes = np.empty_like(skeleton.joint_shapes)
        for joint in skeleton.order:
            parent = skeleton.parents[joint]
            position, shapes = joints[joint], skeleton.joint_shapes[joint]
            if parent >= 0:
                self.axes[joint] = rotation = self.rotations[parent]
                position = self.positions[parent] + rotation @ (position - joints[parent])
                shapes = self._position_shapes[parent] + rotation @ (
                    shapes - skeleton.joint_shapes[parent]
                )
            self.rotations[joint] = self.axes[joint] @ self.local[joint]
            self.positions[joint], self._position_shapes[joint] = position, shapes
        self.shifts = self.positions - np.einsum("jxy,jy->jx", self.rotations, joints)

    @cached_property
    def shift_shapes(self) -> np.ndarray:
        """Derivatives of the shifts with respect to the betas, shape (J, 3, B)."""
        return self._position_shapes - self.rotations @ self.skeleton.joint_shapes

    @cached_property
    def pose_feature(self) -> np.ndarray:
        """The entries of R - I, by which pose-dependent displacements are multiplied."""
        return (self.local[self.skeleton.limbs] - np.eye(3)).ravel()

    @cached_property
    def pose_feature_rotations(self) -> np.ndarray:
        """Derivatives of the entries of R by small rotations in space, shape (J - 1, 9, 3)."""
        limbs = self.skeleton.limbs
        axes, rotations = self.axes[limbs], self.rotations[limbs]
        products = np.einsum("jyx,cyz,jzw->jxwc", axes, _CROSS_WITH_AXES, rotations)
        return products.reshape(len(limbs), 9, 3)


@dataclass(frozen=True)
class _Patch:
    """Some points, the vertices that they combine, and the joints on which these depend."""

    points: np.ndarray
    combine: sparse.csr_array | None
    rest: np.ndarray
    shapedirs: np.ndarray
    posedirs: np.ndarray | None
    bones: np.ndarray  # joints with weight here
    weights: np.ndarray
    active: np.ndarray  # joints that move something here
    below: np.ndarray  # (bones, active): whether the bone moves with the joint
    columns: np.ndarray

    def combined(self, values: np.ndarray) -> np.ndarray:
        """Map values at vertices, (n_vertices, ...), to values at points."""
        if self.combine is None:
            return values
        flat = self.combine @ values.reshape(len(values), -1)
        return flat.reshape(-1, *values.shape[1:])

    def surface(self, motions: JointMotions) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the shaped vertices, their blended rotations and the moved vertices."""
        shaped = self.rest + self.shapedirs @ motions.parameters.betas
        if self.posedirs is not None:
            shaped = shaped + self.posedirs @ motions.pose_feature
        blended = self.weights @ motions.rotations[self.bones].reshape(-1, 9)
        rotations = blended.reshape(-1, 3, 3)
        moved = np.matmul(rotations, shaped[..., np.newaxis])[..., 0]
        return shaped, rotations, moved + self.weights @ motions.shifts[self.bones]

    def derivatives(
        self, motions: JointMotions, shaped: np.ndarray, rotations: np.ndarray
    ) -> np.ndarray:
        """Return derivatives (n, 3, c) of the points by rotations in space, betas and trans."""
        n_vertices, n_betas = len(shaped), self.shapedirs.shape[-1]
        n_angles = 3 * len(self.active)
        rows = np.zeros((n_vertices, 3, n_angles + n_betas + 3))

        matrices = motions.rotations[self.bones].transpose(2, 1, 0)  # (from, to, bone)
        moved_by_bone = (shaped @ matrices.reshape(3, -1)).reshape(n_vertices, 3, -1)
        moved_by_bone = (moved_by_bone + motions.shifts[self.bones].T) * self.weights[:, np.newaxis]
        levers = moved_by_bone @ self.below
        shares = self.weights @ self.below
        levers -= motions.positions[self.active].T * shares[:, np.newaxis]
        x, y, z = levers[:, 0], levers[:, 1], levers[:, 2]
        of_rotations = rows[..., :n_angles].reshape(n_vertices, 3, -1, 3)
        of_rotations[:, 0, :, 1], of_rotations[:, 0, :, 2] = z, -y
        of_rotations[:, 1, :, 0], of_rotations[:, 1, :, 2] = -z, x
        of_rotations[:, 2, :, 0], of_rotations[:, 2, :, 1] = y, -x
        rows[..., :n_angles] = of_rotations.reshape(n_vertices, 3, -1)
        if self.posedirs is not None:
            of_features = self.posedirs.reshape(n_vertices * 3, -1, 9)
            offsets = np.einsum("rjk,jkc->rjc", of_features, motions.pose_feature_rotations)
            # With pose offsets, all joints are active, in the order of the tree's table.
            limbs = (3 * motions.skeleton.limbs[:, np.newaxis] + np.arange(3)).ravel()
            rows[..., limbs] += np.matmul(rotations, offsets.reshape(n_vertices, 3, -1))

        shifts = self.weights @ motions.shift_shapes[self.bones].reshape(len(self.bones), -1)
        rows[..., n_angles:-3] = np.matmul(rotations, self.shapedirs) + shifts.reshape(
            -1, 3, n_betas
        )
        rows[..., -3:] = np.eye(3)
        return self.combined(rows)


class Equations:
    """Least-squares equations for the points `combine[numbers]` of a model's surface."""

    def __init__(
        self,
        skeleton: Skeleton,
        combine: sparse.csr_array,
        shares: np.ndarray,
        numbers: np.ndarray,
        loss: Loss,
        prior: np.ndarray,
    ) -> None:
        self._skeleton, self._loss, self._prior = skeleton, loss, prior
        self._shares = shares / shares[numbers].sum()
        self._patches = [
            _patch(skeleton, combine, numbers[first : first + _PATCH])
            for first in range(0, len(numbers), _PATCH)
        ]
        self._numbers = numbers
        self._weights = (combine @ skeleton.model.weights)[numbers]

    def cost(self, parameters: Parameters, target: np.ndarray) -> float:
        """Return the mean loss of the distances from the points to their targets, and the prior."""
        motions = JointMotions(self._skeleton, parameters)
        parts = [patch.combined(patch.surface(motions)[2]) for patch in self._patches]
        gaps = target[self._numbers] - np.concatenate(parts) - parameters.trans
        losses, _ = self._loss(np.sum(gaps**2, axis=-1))
        return float(self._shares[self._numbers] @ losses + self._prior @ parameters.vector**2)

    def normal(self, parameters: Parameters, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal equations: the matrix, and half the negative gradient of the cost."""
        motions = JointMotions(self._skeleton, parameters)
        n_angles, n_betas = 3 * self._skeleton.n_joints, self._skeleton.n_betas
        n_columns = n_angles + n_betas + 3
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        for patch in self._patches:
            shaped, rotations, moved = patch.surface(motions)
            gaps = target[patch.points] - patch.combined(moved) - parameters.trans
            factors = np.sqrt(self._shares[patch.points] * self._loss(np.sum(gaps**2, axis=-1))[1])
            rows = patch.derivatives(motions, shaped, rotations)
            rows *= factors[:, np.newaxis, np.newaxis]
            rows = rows.reshape(-1, rows.shape[-1])
            matrix[np.ix_(patch.columns, patch.columns)] += rows.T @ rows
            right[patch.columns] += rows.T @ (factors[:, np.newaxis] * gaps).ravel()
        # From changes of axis-angle vectors to rotations in space.
        of_pose = motions.axes @ rotation_derivative(parameters.pose)
        change = linalg.block_diag(*of_pose, np.eye(n_betas + 3))
        matrix, right = change.T @ matrix @ change, change.T @ right
        return matrix + np.diag(self._prior), right - self._prior * parameters.vector

    def closed_form_rotations(self, target: np.ndarray, betas: np.ndarray) -> np.ndarray:
        """Return each joint's rotation in space by Kabsch's solution with the skinning weights."""
        shaped = [patch.combined(patch.rest + patch.shapedirs @ betas) for patch in self._patches]
        points, goal = np.concatenate(shaped), target[self._numbers]
        weights = self._weights * self._shares[self._numbers, np.newaxis]
        mass = np.maximum(weights.sum(axis=0), np.finfo(float).tiny)[:, np.newaxis]
        products = (goal[:, :, np.newaxis] * points[:, np.newaxis]).reshape(-1, 9)
        centres, goals = weights.T @ points / mass, weights.T @ goal / mass
        spread = (weights.T @ products / mass).reshape(-1, 3, 3)
        spread -= goals[:, :, np.newaxis] * centres[:, np.newaxis]
        size = weights.T @ np.sum(points**2, axis=-1) / mass[:, 0] - np.sum(centres**2, axis=-1)
        rotations = np.empty_like(spread)
        for joint in self._skeleton.order:
            parent = self._skeleton.parents[joint]
            # The rotation of the parent, where the points do not determine the joint's own.
            known = rotations[parent] if parent >= 0 else np.eye(3)
            pull = _PULL * max(size[joint], 0.0) + np.finfo(float).eps
            left, _, right = np.linalg.svd(spread[joint] + pull * known)
            left[:, 2] *= np.linalg.det(left @ right)
            rotations[joint] = left @ right
        return rotations


def _patch(skeleton: Skeleton, combine: sparse.csr_array, numbers: np.ndarray) -> _Patch:
    model = skeleton.model
    rows = combine[numbers]
    vertices = np.unique(rows.indices)
    local = rows[:, vertices]
    is_choice = local.nnz == len(numbers) and np.all(local.data == 1.0)
    if is_choice:
        vertices = rows.indices
    weights = model.weights[vertices]
    bones = np.flatnonzero(weights.any(axis=0))
    below = skeleton.below.T[bones]
    posedirs = None if model.posedirs is None else model.posedirs[vertices]
    active = np.flatnonzero(below.any(axis=0))
    if posedirs is not None:
        active = np.arange(skeleton.n_joints)
    n_angles = 3 * skeleton.n_joints
    rotations = 3 * active[:, np.newaxis] + np.arange(3)
    rest = np.arange(n_angles, n_angles + skeleton.n_betas + 3)
    return _Patch(
        points=numbers,
        combine=None if is_choice else local,
        rest=model.template.vertices[vertices],
        shapedirs=skeleton.directions[vertices],
        posedirs=posedirs,
        bones=bones,
        weights=weights[:, bones],
        active=active,
        below=below[:, active],
        columns=np.concatenate([rotations.ravel(), rest]),
    )


def least_squares_step(matrix: np.ndarray, right: np.ndarray, damping: float) -> np.ndarray:
    """Return the step that solves damped normal equations."""
    scale = np.sqrt(np.diag(matrix))
    # A parameter without effect on the points does not change.
    scale[scale <= np.finfo(float).eps * scale.max(initial=0.0)] = np.inf
    system = matrix / np.outer(scale, scale) + np.diag(np.full(len(right), damping))
    system[np.isinf(scale), np.isinf(scale)] = 1.0
    step: Any = linalg.solve(system, right / scale, assume_a="pos")
    return step / scale
