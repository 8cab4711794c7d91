"""The rigid motions of a body model's joints, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from riemhuman.bodies.joint_tree import root_first
from riemhuman.bodies.skinned_model import SkinnedModel
from riemhuman.kernels.rotations import rotation_derivative, rotation_matrix

# _CROSS_WITH_AXES[c] @ x is the cross product of the axis c with x.
_CROSS_WITH_AXES = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)


@dataclass(frozen=True)
class Posture:
    """Parameters of one body.

    Parameters
    ----------
    betas : array, shape (B,)
        Shape coefficients.
    pose : array, shape (J, 3)
        Axis-angle rotation of each joint, radians.
    trans : array, shape (3,)
        Translation, metres.
    """

    betas: np.ndarray
    pose: np.ndarray
    trans: np.ndarray

    def moved(self, step: np.ndarray) -> Posture:
        """Return the parameters after a step.

        Parameters
        ----------
        step : array, shape (3 J + B + 3,)
            Change of pose, betas and trans.
        """
        turned = self.pose.size
        return replace(
            self,
            pose=self.pose + step[:turned].reshape(-1, 3),
            betas=self.betas + step[turned:-3],
            trans=self.trans + step[-3:],
        )


class Skeleton:
    """The joints of a body model: their tree, and their places as functions of the betas.

    Parameters
    ----------
    model : BodyModel
        The model.
    """

    def __init__(self, model: SkinnedModel) -> None:
        self.parents = model.parents
        self.order = root_first(model.parents)
        self.rest_joints = model.joint_regressor @ model.template.vertices
        self.joint_shapes = np.einsum("jv,vxb->jxb", model.joint_regressor, model.shapedirs)
        # below[j, k]: whether joint k moves with joint j.
        self.below = np.eye(len(model.parents))
        for joint in reversed(self.order):
            if self.parents[joint] >= 0:
                self.below[self.parents[joint]] += self.below[joint]

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.parents)

    @property
    def n_betas(self) -> int:
        """Number of shape coefficients."""
        return self.joint_shapes.shape[-1]


class JointMotions:
    """The rigid motions of the joints for some parameters, and their derivatives.

    Parameters
    ----------
    skeleton : Skeleton
        The joints.
    posture : Posture
        Parameters.
    """

    def __init__(self, skeleton: Skeleton, posture: Posture) -> None:
        self._skeleton = skeleton
        self.posture = posture
        joints = skeleton.rest_joints + skeleton.joint_shapes @ posture.betas
        self.local = rotation_matrix(posture.pose)
        self.turns = np.empty_like(self.local)
        self.places = np.empty_like(joints)
        # The axes of a joint's own rotation are those of its parent.
        self.axes = np.tile(np.eye(3), (skeleton.n_joints, 1, 1))
        # Derivatives of the places with respect to the betas.
        self._place_shapes = np.empty_like(skeleton.joint_shapes)
        for joint in skeleton.order:
            parent = skeleton.parents[joint]
            place, shapes = joints[joint], skeleton.joint_shapes[joint]
            if parent >= 0:
                self.axes[joint] = turn = self.turns[parent]
                place = self.places[parent] + turn @ (place - joints[parent])
                shapes = self._place_shapes[parent] + turn @ (
                    shapes - skeleton.joint_shapes[parent]
                )
            self.turns[joint] = self.axes[joint] @ self.local[joint]
            self.places[joint], self._place_shapes[joint] = place, shapes
        self.shifts = self.places - np.einsum("jxy,jy->jx", self.turns, joints)

    @cached_property
    def shift_shapes(self) -> np.ndarray:
        """Derivatives of the shifts with respect to the betas, shape (J, 3, B)."""
        return self._place_shapes - self.turns @ self._skeleton.joint_shapes

    @cached_property
    def limbs(self) -> np.ndarray:
        """Numbers of the joints other than the root, shape (J - 1,)."""
        return np.flatnonzero(self._skeleton.parents >= 0)

    @cached_property
    def pose_feature(self) -> np.ndarray:
        """The entries of R - I, by which pose-dependent displacements are multiplied."""
        return (self.local[self.limbs] - np.eye(3)).ravel()

    @cached_property
    def pose_feature_turns(self) -> np.ndarray:
        """Derivatives of the entries of R by small turns in space, shape (J - 1, 9, 3)."""
        axes, turns = self.axes[self.limbs], self.turns[self.limbs]
        products = np.einsum("jyx,cyz,jzw->jxwc", axes, _CROSS_WITH_AXES, turns)
        return products.reshape(len(self.limbs), 9, 3)

    @cached_property
    def turns_of_pose(self) -> np.ndarray:
        """Matrices from changes of axis-angle vectors to turns in space, shape (J, 3, 3)."""
        return self.axes @ rotation_derivative(self.posture.pose)
