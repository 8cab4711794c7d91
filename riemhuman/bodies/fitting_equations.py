"""The least-squares equations of a body model's fit: points, exact derivatives, normal equations.

A vertex v of the shaped surface moves to x = Σ_k w_k (G_k v + t_k), with the joints' motions G, t.
A turn of joint j by a small δ, in the axes of the posed body, moves x by δ × a, where

    a = Σ_k w_k (G_k v + t_k − p_j)   over the joints k below j (j included),

and p_j is the place of the joint. So all derivatives with respect to rotations are cross products,
and one 3 × 3 matrix per joint converts them to derivatives with respect to the axis-angle vector,
after the sums over vertices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import linalg, sparse

from riemhuman.bodies.joint_motions import JointMotions, Posture, Skeleton
from riemhuman.bodies.skinned_model import SkinnedModel

# Number of points in a patch: their derivatives fit in the processor's cache, and most patches
# depend on few joints, so that most columns are left out.
_PATCH = 512
# Weight of the parent's rotation as a share of a joint's spread: enough to determine what the
# points leave open, too little to matter elsewhere.
_PULL = 1e-3

Loss = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Maps squared distances to their loss and its derivative."""


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
        """Return the shaped vertices, their blended turns and the moved vertices."""
        shaped = self.rest + self.shapedirs @ motions.posture.betas
        if self.posedirs is not None:
            shaped = shaped + self.posedirs @ motions.pose_feature
        blended = self.weights @ motions.turns[self.bones].reshape(-1, 9)
        turns = blended.reshape(-1, 3, 3)
        moved = np.matmul(turns, shaped[..., np.newaxis])[..., 0]
        return shaped, turns, moved + self.weights @ motions.shifts[self.bones]

    def derivatives(
        self, motions: JointMotions, shaped: np.ndarray, turns: np.ndarray
    ) -> np.ndarray:
        """Return derivatives (n, 3, c) of the points by turns in space, betas and trans."""
        n_vertices, n_betas = len(shaped), self.shapedirs.shape[-1]
        n_turns = 3 * len(self.active)
        rows = np.zeros((n_vertices, 3, n_turns + n_betas + 3))

        matrices = motions.turns[self.bones].transpose(2, 1, 0)  # (from, to, bone)
        carried = (shaped @ matrices.reshape(3, -1)).reshape(n_vertices, 3, -1)
        carried = (carried + motions.shifts[self.bones].T) * self.weights[:, np.newaxis]
        arms = carried @ self.below
        shares = self.weights @ self.below
        arms -= motions.places[self.active].T * shares[:, np.newaxis]
        x, y, z = arms[:, 0], arms[:, 1], arms[:, 2]
        of_turns = rows[..., :n_turns].reshape(n_vertices, 3, -1, 3)
        of_turns[:, 0, :, 1], of_turns[:, 0, :, 2] = z, -y
        of_turns[:, 1, :, 0], of_turns[:, 1, :, 2] = -z, x
        of_turns[:, 2, :, 0], of_turns[:, 2, :, 1] = y, -x
        rows[..., :n_turns] = of_turns.reshape(n_vertices, 3, -1)
        if self.posedirs is not None:
            of_features = self.posedirs.reshape(n_vertices * 3, -1, 9)
            offsets = np.einsum("rjk,jkc->rjc", of_features, motions.pose_feature_turns)
            # With pose offsets, all joints are active, in the order of the tree's table.
            limbs = (3 * motions.limbs[:, np.newaxis] + np.arange(3)).ravel()
            rows[..., limbs] += np.matmul(turns, offsets.reshape(n_vertices, 3, -1))

        shifts = self.weights @ motions.shift_shapes[self.bones].reshape(len(self.bones), -1)
        rows[..., n_turns:-3] = np.matmul(turns, self.shapedirs) + shifts.reshape(-1, 3, n_betas)
        rows[..., -3:] = np.eye(3)
        return self.combined(rows)


class Equations:
    """Least-squares equations for chosen points of a model's surface.

    Parameters
    ----------
    model : BodyModel
        The model.
    skeleton : Skeleton
        Its joints.
    combine : scipy.sparse.csr_array, shape (n_points, V)
        The points as combinations of the model's vertices.
    shares : array, shape (n_points,)
        Weights of the points, which sum to one.
    numbers : array of int, shape (n,)
        Numbers of the points in use.
    """

    def __init__(
        self,
        model: SkinnedModel,
        skeleton: Skeleton,
        combine: sparse.csr_array,
        shares: np.ndarray,
        numbers: np.ndarray,
    ) -> None:
        self._skeleton = skeleton
        self._shares = shares / shares[numbers].sum()
        self._patches = [
            _patch(model, skeleton, combine, numbers[first : first + _PATCH])
            for first in range(0, len(numbers), _PATCH)
        ]
        self._numbers = numbers
        self._weights = (combine @ model.weights)[numbers]

    def points(self, posture: Posture) -> np.ndarray:
        """Return the points in use for some parameters.

        Parameters
        ----------
        posture : Posture
            Parameters.

        Returns
        -------
        points : array, shape (n, 3)
        """
        motions = JointMotions(self._skeleton, posture)
        parts = [patch.combined(patch.surface(motions)[2]) for patch in self._patches]
        return np.concatenate(parts) + posture.trans

    def cost(self, posture: Posture, target: np.ndarray, loss: Loss) -> float:
        """Return the mean loss of the distances from the points to their targets.

        Parameters
        ----------
        posture : Posture
            Parameters.
        target : array, shape (n_points, 3)
            Targets of the points.
        loss : callable
            Maps squared distances to their loss and its derivative.

        Returns
        -------
        cost : float
            Square metres.
        """
        gaps = target[self._numbers] - self.points(posture)
        return float(self._shares[self._numbers] @ loss(np.sum(gaps**2, axis=-1))[0])

    def normal(
        self, posture: Posture, target: np.ndarray, loss: Loss
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrix and the right-hand side of the normal equations.

        Parameters
        ----------
        posture, target, loss
            As for `cost`.

        Returns
        -------
        matrix : array, shape (P, P)
            For changes of pose, betas and trans: P = 3 J + B + 3.
        right : array, shape (P,)
            Half the negative gradient of the cost.
        """
        motions = JointMotions(self._skeleton, posture)
        n_turns, n_betas = 3 * self._skeleton.n_joints, self._skeleton.n_betas
        n_columns = n_turns + n_betas + 3
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        for patch in self._patches:
            shaped, turns, moved = patch.surface(motions)
            gaps = target[patch.points] - patch.combined(moved) - posture.trans
            factors = np.sqrt(self._shares[patch.points] * loss(np.sum(gaps**2, axis=-1))[1])
            rows = patch.derivatives(motions, shaped, turns)
            rows *= factors[:, np.newaxis, np.newaxis]
            rows = rows.reshape(-1, rows.shape[-1])
            matrix[np.ix_(patch.columns, patch.columns)] += rows.T @ rows
            right[patch.columns] += rows.T @ (factors[:, np.newaxis] * gaps).ravel()
        change = linalg.block_diag(*motions.turns_of_pose, np.eye(n_betas + 3))
        return change.T @ matrix @ change, change.T @ right

    def closed_form_turns(self, target: np.ndarray, betas: np.ndarray) -> np.ndarray:
        """Return the turns of the joints that bring their points nearest to their targets.

        For each joint separately, this is the rotation of Kabsch's solution with the skinning
        weights, or the rotation of the parent where the points do not determine it.

        Parameters
        ----------
        target : array, shape (n_points, 3)
            Targets of the points.
        betas : array, shape (B,)
            Shape coefficients.

        Returns
        -------
        turns : array, shape (J, 3, 3)
            In space, not relative to the parent.
        """
        shaped = [patch.combined(patch.rest + patch.shapedirs @ betas) for patch in self._patches]
        points, goal = np.concatenate(shaped), target[self._numbers]
        weights = self._weights * self._shares[self._numbers, np.newaxis]
        mass = np.maximum(weights.sum(axis=0), np.finfo(float).tiny)[:, np.newaxis]
        products = (goal[:, :, np.newaxis] * points[:, np.newaxis]).reshape(-1, 9)
        centres, goals = weights.T @ points / mass, weights.T @ goal / mass
        spread = (weights.T @ products / mass).reshape(-1, 3, 3)
        spread -= goals[:, :, np.newaxis] * centres[:, np.newaxis]
        size = weights.T @ np.sum(points**2, axis=-1) / mass[:, 0] - np.sum(centres**2, axis=-1)
        turns = np.empty_like(spread)
        for joint in self._skeleton.order:
            parent = self._skeleton.parents[joint]
            known = turns[parent] if parent >= 0 else np.eye(3)
            pull = _PULL * max(size[joint], 0.0) + np.finfo(float).eps
            left, _, right = np.linalg.svd(spread[joint] + pull * known)
            left[:, 2] *= np.linalg.det(left @ right)
            turns[joint] = left @ right
        return turns


def by_main_joint(skeleton: Skeleton, weights: np.ndarray) -> list[np.ndarray]:
    """Return the numbers of the points that each joint moves most, in depth-first order of joints.

    Parameters
    ----------
    skeleton : Skeleton
        The joints.
    weights : array, shape (n_points, J)
        Skinning weights.

    Returns
    -------
    numbers : list of array of int
        One array per joint, possibly empty.
    """
    main = weights.argmax(axis=1)
    depth_first: list[int] = []
    waiting = list(skeleton.order[:1])
    while waiting:
        joint = waiting.pop()
        depth_first.append(joint)
        waiting.extend(np.flatnonzero(skeleton.parents == joint).tolist())
    return [np.flatnonzero(main == joint) for joint in depth_first]


def _patch(
    model: SkinnedModel, skeleton: Skeleton, combine: sparse.csr_array, numbers: np.ndarray
) -> _Patch:
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
    n_turns = 3 * skeleton.n_joints
    turns = 3 * active[:, np.newaxis] + np.arange(3)
    rest = np.arange(n_turns, n_turns + skeleton.n_betas + 3)
    return _Patch(
        points=numbers,
        combine=None if is_choice else local,
        rest=model.template.vertices[vertices],
        shapedirs=model.shapedirs[vertices],
        posedirs=posedirs,
        bones=bones,
        weights=weights[:, bones],
        active=active,
        below=below[:, active],
        columns=np.concatenate([turns.ravel(), rest]),
    )


def least_squares_step(matrix: np.ndarray, right: np.ndarray, damping: float) -> np.ndarray:
    """Return the step that solves damped normal equations.

    Parameters
    ----------
    matrix : array, shape (P, P)
        Symmetric and positive semidefinite.
    right : array, shape (P,)
        Right-hand side.
    damping : float
        Levenberg–Marquardt damping, as a fraction of the diagonal.

    Returns
    -------
    step : array, shape (P,)
    """
    scale = np.sqrt(np.diag(matrix))
    # A parameter without effect on the points does not change.
    scale[scale <= np.finfo(float).eps * scale.max(initial=0.0)] = np.inf
    system = matrix / np.outer(scale, scale) + np.diag(np.full(len(right), damping))
    system[np.isinf(scale), np.isinf(scale)] = 1.0
    step: Any = linalg.solve(system, right / scale, assume_a="pos")
    return step / scale
