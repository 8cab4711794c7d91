"""The least-squares equations of a body model's fit, with exact derivatives."""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse

from riemhuman.arrays import Array, Integers, Points
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.kernels.rotations import nearest_rotations, rotation_derivative, rotation_matrix

# Number of points in a patch: their derivatives fit in the processor's cache, and most patches
# depend on few joints, so that most columns are left out.
_PATCH = 512
# Weight of the parent's rotation as a share of a joint's spread: enough to determine what the
# points leave open, too little to matter elsewhere.
_PULL = 1e-3

# _CROSS_WITH_AXES[c] @ x is the cross product of the axis c with x.
_CROSS_WITH_AXES = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)


class _Patch:
    """Some points, the vertices that they combine, and the joints on which these depend."""

    def __init__(self, skeleton: Skeleton, combine: sparse.csr_array, numbers: Integers) -> None:
        model, rows = skeleton.model, combine[numbers]
        vertices = np.unique(rows.indices)
        self.points, self.combine = numbers, rows[:, vertices]
        # Where the points are vertices, as they are by default, nothing is combined.
        if len(vertices) == rows.nnz == len(numbers) and np.all(rows.data == 1.0):
            vertices, self.combine = rows.indices, None
        self.rest = model.template.vertices[vertices]
        self.shapedirs = skeleton.directions[vertices]
        self.posedirs = None if model.posedirs is None else model.posedirs[vertices]
        weights = model.weights[vertices]
        self.bones = np.flatnonzero(weights.any(axis=0))  # joints with weight here
        self.weights = weights[:, self.bones]
        below = skeleton.below[self.bones]
        # Joints that move something here; with pose offsets, all do.
        moves = below.any(axis=0) | (self.posedirs is not None)
        self.active = np.flatnonzero(moves)
        # Whether the bone moves with the joint, shape (bones, active).
        self.below = below[:, self.active]
        # The parameters on which the points depend: angles of active joints, betas, translation.
        n_angles = 3 * skeleton.n_joints
        angles = 3 * self.active + np.arange(3)[:, np.newaxis]
        others = np.arange(n_angles, n_angles + skeleton.n_betas + 3)
        self.columns = np.concatenate([angles.ravel(), others])

    def combined(self, values: Array) -> Array:
        """Map values at vertices, (n_vertices, ...), to values at points."""
        if self.combine is None:
            return values
        flat: Array = self.combine @ values.reshape(len(values), -1)
        return flat.reshape(-1, *values.shape[1:])

    def surface(self, motions: JointMotions) -> tuple[Array, Array, Array]:
        """Return the shaped vertices, their blended rotations and the moved vertices."""
        return motions.skin(self.rest, self.shapedirs, self.posedirs, self.weights, self.bones)

    def derivatives(self, motions: JointMotions, shaped: Array, rotations: Array) -> Array:
        """Return derivatives (n, 3, c) of the points by rotations in space, betas and trans."""
        rows = skinning_derivatives(
            motions,
            shaped,
            rotations,
            self.weights,
            self.shapedirs,
            self.below,
            self.bones,
            self.active,
        )
        if self.posedirs is not None:
            limbs = motions.skeleton.limbs
            # Derivatives Aᵀ [c]× G of the entries of R = Aᵀ G by small rotations about the axes c,
            # for each joint j.
            products = np.einsum(
                "jyx,cyz,jzw->cjxw", motions.axes[limbs], _CROSS_WITH_AXES, motions.rotations[limbs]
            ).reshape(3, len(limbs), 9)
            of_features = self.posedirs.reshape(*shaped.shape, -1, 9)
            # Sums over the nine entries k, for each vertex n and coordinate x.
            offsets = np.einsum("nxjk,cjk->nxcj", of_features, products, optimize=True)
            offsets = np.matmul(rotations, offsets.reshape(*shaped.shape, -1))
            # With pose offsets, all joints are active, in the order of the tree's table.
            columns = motions.skeleton.n_joints * np.arange(3)[:, np.newaxis] + limbs
            rows[..., columns.ravel()] += offsets
        return self.combined(rows)


class Equations:
    """Least-squares equations for the points `combine[numbers]` of a model's surface."""

    def __init__(
        self,
        skeleton: Skeleton,
        combine: sparse.csr_array,
        shares: Array,
        numbers: Integers,
        prior: Array,
    ) -> None:
        self.skeleton, self._prior = skeleton, prior
        self._shares = shares / shares[numbers].sum()
        self._patches = [
            _Patch(skeleton, combine, numbers[first : first + _PATCH])
            for first in range(0, len(numbers), _PATCH)
        ]
        self._numbers = numbers
        self._weights = (combine @ skeleton.model.weights)[numbers]

    def _motions(self, parameters: Array) -> JointMotions:
        """Return the motions for parameters: axis-angle vectors of the joints, betas, trans."""
        pose, betas = np.split(parameters[:-3], [3 * self.skeleton.n_joints])
        return JointMotions(self.skeleton, rotation_matrix(pose.reshape(-1, 3)), betas)

    def cost(self, parameters: Array, target: Points) -> float:
        """Return the mean squared distance from the points to their targets, and the prior."""
        motions = self._motions(parameters)
        parts = [patch.combined(patch.surface(motions)[2]) for patch in self._patches]
        trans = parameters[-3:]
        gaps = target[self._numbers] - np.concatenate(parts) - trans
        squares = np.sum(gaps**2, axis=-1)
        return float(self._shares[self._numbers] @ squares + self._prior @ parameters**2)

    def normal(self, parameters: Array, target: Points) -> tuple[Array, Array]:
        """Return the normal equations: the matrix, and half the negative gradient of the cost."""
        motions = self._motions(parameters)
        n_angles, n_columns = 3 * self.skeleton.n_joints, len(parameters)
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        trans = parameters[-3:]
        for patch in self._patches:
            shaped, rotations, moved = patch.surface(motions)
            gaps = target[patch.points] - patch.combined(moved) - trans
            factors = np.sqrt(self._shares[patch.points])
            rows = patch.derivatives(motions, shaped, rotations)
            rows *= factors[:, np.newaxis, np.newaxis]
            rows = rows.reshape(-1, rows.shape[-1])
            matrix[np.ix_(patch.columns, patch.columns)] += rows.T @ rows
            right[patch.columns] += rows.T @ (factors[:, np.newaxis] * gaps).ravel()
        # From changes of axis-angle vectors to rotations in space.
        of_pose = motions.axes @ rotation_derivative(parameters[:n_angles].reshape(-1, 3))
        change, angles = np.eye(n_columns), np.arange(n_angles).reshape(-1, 3)
        change[angles[:, :, np.newaxis], angles[:, np.newaxis]] = of_pose
        matrix, right = change.T @ matrix @ change, change.T @ right
        return matrix + np.diag(self._prior), right - self._prior * parameters

    def closed_form_rotations(self, target: Points, betas: Array) -> Array:
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
        rotations: Array = np.empty_like(spread)
        for joint in self.skeleton.order:
            parent = self.skeleton.parents[joint]
            # The rotation of the parent, where the points do not determine the joint's own.
            known = rotations[parent] if parent >= 0 else np.eye(3)
            pull = _PULL * max(size[joint], 0.0) + np.finfo(float).eps
            rotations[joint] = nearest_rotations(spread[joint] + pull * known)
        return rotations


def least_squares_step(matrix: Array, right: Array, damping: float) -> Array:
    """Return the step that solves damped normal equations."""
    scale = np.sqrt(np.diag(matrix))
    # A parameter without effect on the points does not change.
    scale[scale <= np.finfo(float).eps * scale.max(initial=0.0)] = np.inf
    system = matrix / np.outer(scale, scale) + np.diag(np.full(len(right), damping))
    system[np.isinf(scale), np.isinf(scale)] = 1.0
    step: Array = linalg.solve(system, right / scale, assume_a="pos")
    return step / scale
