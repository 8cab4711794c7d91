"""The surfaces and joints of a body model with a linear shape space and blend skinning."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy.typing import DTypeLike

from riemhuman.bodies.joint_tree import joint_parents, root_first
from riemhuman.bodies.model_checks import check_sums, check_weights, names_of_joints, precision
from riemhuman.bodies.skinning import chained_motions, skinned
from riemhuman.checks import real_array
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import read_only
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.surfaces.template import Template


class SkinnedModel(InheritsDocstrings):
    """The arrays of a body model, and its surfaces and joints.

    `BodyModel` describes the model and adds files and fits.

    Parameters
    ----------
    v_template : array_like, shape (V, 3)
        Mean body in the rest pose, metres.
    faces : array_like of int, shape (F, 3)
        Triangles.
    shapedirs : array_like, shape (V, 3, B)
        Displacement of each vertex for one unit of each shape coefficient.
    joint_regressor : array_like, shape (J, V)
        Joints as combinations of vertices.
    weights : array_like, shape (V, J)
        Skinning weights: not negative, each row sums to one.
    kintree_table : array_like of int, shape (2, J)
        Row 1 holds the number of each joint, row 0 that of its parent; the root's parent is -1 or
        2**32 - 1.
    posedirs : array_like, shape (V, 3, 9 (J - 1)), optional
        Displacement for each entry of R - I of the joints other than the root.
    joint_names : sequence of str, optional
        Names of the joints; by default "joint_0", "joint_1", and so on.
    dtype : data type
        Precision of surfaces and joints, float64 or float32, which halves their memory. The model
        itself is kept in double precision.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> model.joints().shape
    (23, 3)
    """

    def __init__(
        self,
        v_template: Any,
        faces: Any,
        shapedirs: Any,
        joint_regressor: Any,
        weights: Any,
        kintree_table: Any,
        *,
        posedirs: Any = None,
        joint_names: Sequence[str] | None = None,
        dtype: DTypeLike = onp.float64,
    ) -> None:
        self._dtype = precision(dtype)
        v_template = real_array(v_template, "v_template", ("V", 3), batched=False)
        n_vertices = len(v_template)
        self._template = Template(v_template, faces)
        self._shapedirs = _copied(shapedirs, "shapedirs", (n_vertices, 3, "B"))
        self._joint_regressor = _copied(joint_regressor, "J_regressor", ("J", n_vertices))
        n_joints = len(self._joint_regressor)
        self._weights = _copied(weights, "weights", (n_vertices, n_joints))
        self._parents = read_only(joint_parents(kintree_table, n_joints))
        self._order = root_first(self._parents)
        self._posedirs = None
        if posedirs is not None:
            n_entries = 9 * (n_joints - 1)
            self._posedirs = _copied(posedirs, "posedirs", (n_vertices, 3, n_entries))
        self._joint_names = names_of_joints(joint_names, n_joints)
        self._rest, self._regressor, self._blend = (
            array.astype(self._dtype, copy=False)
            for array in (self._template.vertices, self._joint_regressor, self._weights)
        )
        check_sums(self._joint_regressor, "J_regressor")
        check_weights(self._weights)

    @property
    def template(self) -> Template:
        """The mean body in the rest pose, a `Template`."""
        return self._template

    @property
    def faces(self) -> onp.ndarray:
        """Triangles, shape (F, 3)."""
        return self._template.faces

    @property
    def shapedirs(self) -> onp.ndarray:
        """Displacements for each shape coefficient, shape (V, 3, B)."""
        return self._shapedirs

    @property
    def joint_regressor(self) -> onp.ndarray:
        """Joints as combinations of vertices, shape (J, V)."""
        return self._joint_regressor

    @property
    def weights(self) -> onp.ndarray:
        """Skinning weights, shape (V, J)."""
        return self._weights

    @property
    def parents(self) -> onp.ndarray:
        """Number of each joint's parent, -1 for the root; shape (J,)."""
        return self._parents

    @property
    def posedirs(self) -> onp.ndarray | None:
        """Pose-dependent displacements, shape (V, 3, 9 (J - 1)), or None."""
        return self._posedirs

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self._joint_names

    @property
    def dtype(self) -> onp.dtype[Any]:
        """Precision of surfaces and joints."""
        return self._dtype

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return self._template.n_vertices

    @property
    def n_joints(self) -> int:
        """Number of joints J."""
        return len(self._parents)

    @property
    def n_betas(self) -> int:
        """Number of shape coefficients B."""
        return self._shapedirs.shape[-1]

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__}: {self.n_joints} joints, {self.n_betas} shape coefficients, "
            f"{self.n_vertices:,} vertices>"
        )

    def __call__(self, betas: Any = None, pose: Any = None, trans: Any = None) -> Any:
        """Return the surfaces with these shapes, poses and translations.

        Leading axes of the arguments broadcast, and autograd can differentiate with respect to all
        three. See Loper et al. 2015, equations 2 to 10.

        Parameters
        ----------
        betas : array_like, shape (..., B), optional
            Shape coefficients; zero by default.
        pose : array_like, shape (..., J, 3) or (..., 3 J), optional
            Axis-angle rotation of each joint, radians; zero by default.
        trans : array_like, shape (..., 3), optional
            Translation in metres; zero by default.

        Returns
        -------
        points : array, shape (..., V, 3)
            Surfaces, metres.

        Raises
        ------
        ArgumentError
            If an argument has the wrong shape or is not finite.
        """
        surface = self._shaped(betas)
        joints = self._joints_of(surface)
        if pose is not None:
            rotations = self._rotations(pose)
            if self._posedirs is not None:
                surface = surface + self._pose_offsets(rotations)
            turns, places = chained_motions(joints, rotations, self._parents, self._order)
            surface = skinned(surface, self._blend, joints, turns, places)
        return self._translated(surface, trans)

    def joints(self, betas: Any = None, pose: Any = None, trans: Any = None) -> Any:
        """Return the joints with these shapes, poses and translations.

        Without a pose, these are the joints J(β) in the rest pose (Loper et al. 2015, equation 10).

        Parameters
        ----------
        betas : array_like, shape (..., B), optional
            Shape coefficients; zero by default.
        pose : array_like, shape (..., J, 3) or (..., 3 J), optional
            Axis-angle rotation of each joint, radians; zero by default.
        trans : array_like, shape (..., 3), optional
            Translation in metres; zero by default.

        Returns
        -------
        joints : array, shape (..., J, 3)
            Joint positions, metres.

        Raises
        ------
        ArgumentError
            If an argument has the wrong shape or is not finite.
        """
        joints = self._joints_of(self._shaped(betas))
        if pose is not None:
            rotations = self._rotations(pose)
            _, joints = chained_motions(joints, rotations, self._parents, self._order)
        return self._translated(joints, trans)

    def _shaped(self, betas: Any) -> Any:
        if betas is None:
            return self._rest
        betas = self._rounded(real_array(betas, "betas", (self.n_betas,)))
        offsets = np.dot(betas, self._shape_matrix)
        return self._rest + np.reshape(offsets, (*np.shape(betas)[:-1], *self._rest.shape))

    def _joints_of(self, surface: Any) -> Any:
        return np.matmul(self._regressor, surface)

    def _rounded(self, array: Any) -> Any:
        return array.astype(self._dtype, copy=False)

    def _rotations(self, pose: Any) -> Any:
        return self._rounded(rotation_matrix(self._joint_vectors(pose)))

    def _joint_vectors(self, pose: Any) -> Any:
        pose = real_array(pose, "pose")
        shape = np.shape(pose)
        if shape[-2:] == (self.n_joints, 3):
            return pose
        if shape[-1:] == (3 * self.n_joints,):
            return np.reshape(pose, (*shape[:-1], self.n_joints, 3))
        raise ArgumentError(
            f"pose must have shape (..., {self.n_joints}, 3) or (..., {3 * self.n_joints}); "
            f"found {shape}"
        )

    def _pose_offsets(self, rotations: Any) -> Any:
        limbs = onp.flatnonzero(self._parents >= 0)
        feature = rotations[..., limbs, :, :] - np.eye(3, dtype=self._dtype)
        feature = np.reshape(feature, (*np.shape(feature)[:-3], 9 * len(limbs)))
        offsets = np.dot(feature, self._pose_matrix)
        return np.reshape(offsets, (*np.shape(feature)[:-1], self.n_vertices, 3))

    def _translated(self, points: Any, trans: Any) -> Any:
        if trans is None:
            return points
        return points + self._rounded(real_array(trans, "trans", (3,)))[..., None, :]

    @cached_property
    def _shape_matrix(self) -> onp.ndarray:
        matrix = self._shapedirs.reshape(-1, self.n_betas).T
        return onp.ascontiguousarray(matrix, dtype=self._dtype)

    @cached_property
    def _pose_matrix(self) -> onp.ndarray:
        assert self._posedirs is not None, "asked for where there are posedirs only"
        matrix = self._posedirs.reshape(3 * self.n_vertices, -1).T
        return onp.ascontiguousarray(matrix, dtype=self._dtype)


def _copied(array: Any, name: str, shape: tuple[int | str, ...]) -> onp.ndarray:
    return read_only(onp.array(real_array(array, name, shape, batched=False)))
