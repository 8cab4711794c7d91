"""A parametric body model in SMPL's layout: linear shape space and linear blend skinning."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies.fitting import fit_model
from riemhuman.bodies.model_files import read_model_fields
from riemhuman.bodies.skinning import (
    SkinningWeights,
    joint_parents,
    motions_of_joints,
    parents_first,
    skin_by,
)
from riemhuman.checks import checked, flag, joint_shape, one_of, real_array, values_of, whole
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentError
from riemhuman.io.arrays import save_arrays
from riemhuman.io.files import file_path, format_errors
from riemhuman.io.kinds_of_files import BY_DEFINITIONS, YES, FileKind, reads
from riemhuman.io.mesh_arrays import read_only
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.representation import Unchanging, join_names
from riemhuman.surfaces.template import Template

# Weights in single precision, or rounded for storage, sum to one within this tolerance.
_SUM_TOLERANCE = 1e-3


class BodyModel(Unchanging):
    """A parametric body: a surface from shape coefficients, joint rotations and a translation.

    The model of Loper, Mahmood, Romero, Pons-Moll and Black, "SMPL: A Skinned Multi-Person
    Linear Model", ACM Trans. Graphics 34(6), 2015, equations 2 to 10: the shaped surface is
    v_template + shapedirs β, the joints are J(β) = J_regressor (v_template + shapedirs β),
    and every vertex moves with the weighted mean of the rigid motions of the joints. Hand poses,
    which the open model has, are added to the surface before skinning.

    The rotation of a joint is an axis-angle vector in the axes of the model's rest pose, which the
    parent joint rotates. In the open model, x points to the body's left, y up and z forward.

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
    hand_directions : array_like, shape (V, 3, 2 K), optional
        Displacement of each vertex from the relaxed hands for K poses of the left hand, then of the
        right.
    hand_poses : sequence of str
        Names of the K hand poses.

    Attributes
    ----------
    template : Template
        The mean body in the rest pose.
    faces, shapedirs, joint_regressor, weights, posedirs, hand_directions, joint_names, hand_poses
        As given; arrays are read-only.
    parents : array of int, shape (J,)
        Number of each joint's parent, -1 for the root.
    joint_order : tuple of int
        All joints, parents before children.
    n_vertices, n_joints, n_betas : int

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> pose = np.zeros((model.n_joints, 3))
    >>> model(np.zeros(model.n_betas), pose, hands=model.hand_pose("fist")).shape
    (1202, 3)
    """

    # More than eight arguments: the arrays of SMPL's files, under their own names.
    def __init__(
        self,
        v_template: ArrayLike,
        faces: ArrayLike,
        shapedirs: ArrayLike,
        joint_regressor: ArrayLike,
        weights: ArrayLike,
        kintree_table: ArrayLike,
        *,
        posedirs: ArrayLike | None = None,
        joint_names: Sequence[str] | Array | None = None,
        hand_directions: ArrayLike | None = None,
        hand_poses: Sequence[str] | Array = (),
    ) -> None:
        v_template = real_array(v_template, "v_template", ("V", 3), batched=False)
        n_vertices = len(v_template)
        self.template = Template(v_template, faces)
        self.faces = self.template.faces
        self.shapedirs = _copy(shapedirs, "shapedirs", (n_vertices, 3, "B"))
        self.joint_regressor = _copy(joint_regressor, "J_regressor", ("J", n_vertices))
        n_joints = len(self.joint_regressor)
        self.weights = _copy(weights, "weights", (n_vertices, n_joints))
        self.parents = read_only(joint_parents(kintree_table, n_joints))
        self.joint_order = parents_first(self.parents)
        self.posedirs: Array | None = None
        if posedirs is not None:
            n_entries = 9 * (n_joints - 1)
            self.posedirs = _copy(posedirs, "posedirs", (n_vertices, 3, n_entries))
        self.joint_names = _checked_names(joint_names, n_joints)
        self.hand_poses = _texts(hand_poses, "hand_poses")
        shape = (n_vertices, 3, 2 * len(self.hand_poses))
        if hand_directions is None:
            hand_directions = onp.zeros((n_vertices, 3, 0))
        self.hand_directions = _copy(hand_directions, "hand_directions", shape)
        self.n_vertices, self.n_joints = n_vertices, n_joints
        self.n_betas = self.shapedirs.shape[-1]
        self._weights = SkinningWeights.of_table(self.weights)
        _check_sums(self.joint_regressor, "J_regressor")
        _check_sums(self.weights, "weights")
        if self.weights.min() < 0:
            raise ArgumentError(f"weights must not be negative; found {self.weights.min():g}")

    @classmethod
    @checked(n_betas=whole(minimum=0))
    def from_file(cls, path: str | os.PathLike[str], *, n_betas: int | None = None) -> BodyModel:
        """Read a model from a file in SMPL's layout: an .npz archive, or a .pkl file.

        Files of SMPL, SMPL-H, SMPL-X, STAR and SMAL are read as published, see `model_contents`. A
        .pkl file is read as data: its code is not run, and chumpy is not needed.

        Parameters
        ----------
        path : path_like
            File with v_template, f, shapedirs, J_regressor, weights and kintree_table, and
            optionally posedirs and joint_names. Other fields are ignored.
        n_betas : int, optional
            Number of shape coefficients to keep, starting from the first; by default all of them,
            or 10 if the file has 300 or more.
        """
        fields = read_model_fields(path, n_betas)
        with format_errors(file_path(path), "a body model"):
            return cls(**fields)

    @checked(single_precision=flag)
    def save(self, path: str | os.PathLike[str], *, single_precision: bool = False) -> None:
        """Write the model as a compressed .npz file in SMPL's layout.

        Parameters
        ----------
        path : path_like
            File to write, with its suffix; an existing file is replaced.
        single_precision : bool
            Whether real numbers are rounded to single precision, which halves the size.
        """
        real = onp.float32 if single_precision else onp.float64
        kintree_table = onp.stack([self.parents, onp.arange(self.n_joints)])
        fields: dict[str, object] = {
            "v_template": self.template.vertices.astype(real),
            "f": self.faces.astype(onp.int32),
            "shapedirs": self.shapedirs.astype(real),
            "J_regressor": self.joint_regressor.astype(real),
            "weights": self.weights.astype(real),
            "kintree_table": kintree_table.astype(onp.int32),
            "joint_names": onp.array(self.joint_names),
        }
        if self.posedirs is not None:
            fields["posedirs"] = self.posedirs.astype(real)
        if self.hand_poses:
            fields["hand_directions"] = self.hand_directions.astype(real)
            fields["hand_poses"] = onp.array(self.hand_poses)
        save_arrays(path, fields, compressed=True)

    def _is_fixed(self, name: str) -> bool:
        # All that is known of a body: the open model is shared by all its users.
        return name in vars(self)

    def __repr__(self) -> str:
        return (
            f"<{type(self).__name__}: {self.n_joints} joints, {self.n_betas} shape coefficients, "
            f"{self.n_vertices:,} vertices>"
        )

    def __call__(
        self,
        betas: ArrayLike | None = None,
        pose: ArrayLike | None = None,
        trans: ArrayLike | None = None,
        hands: ArrayLike | None = None,
    ) -> Array:
        """Return the surfaces with these shapes, poses, translations and hand poses.

        Leading axes of the arguments broadcast, and autograd can differentiate with respect to all
        four. See Loper et al. 2015, equations 2 to 10; hands are relaxed by default.
        """
        self._check_batches(betas, pose, trans, hands)
        surface = self._shaped(betas)
        if hands is not None:
            surface = surface + self._hand_offsets(hands)
        if pose is not None:
            rotations = self._rotations(pose)
            if self.posedirs is not None:
                surface = surface + self._pose_offsets(rotations)
            joints = self._shaped_joints(betas)
            motions = motions_of_joints(joints, rotations, self.parents, self.joint_order)
            surface = skin_by(self._weights, surface, joints, *motions)
        return self._translated(surface, trans)

    def joints(
        self,
        betas: ArrayLike | None = None,
        pose: ArrayLike | None = None,
        trans: ArrayLike | None = None,
    ) -> Array:
        """Return the joints with these parameters, (..., J, 3), metres (Loper et al., equation 10).

        Parameters
        ----------
        betas : array_like, shape (..., B), optional
            Shape coefficients.
        pose : array_like, shape (..., J, 3) or (..., 3 J), optional
            Axis-angle rotation of each joint, radians.
        trans : array_like, shape (..., 3), optional
            Translation, metres.
        """
        self._check_batches(betas, pose, trans)
        joints = self._shaped_joints(betas)
        if pose is not None:
            rotations = self._rotations(pose)
            _, joints = motions_of_joints(joints, rotations, self.parents, self.joint_order)
        return self._translated(joints, trans)

    def hand_pose(self, left: str, right: str | None = None) -> Array:
        """Return the coefficients of named hand poses, shape (2 K,).

        Parameters
        ----------
        left, right : str
            "relaxed" or one of `hand_poses`, for each hand; by default the same for both.

        Examples
        --------
        >>> model = rh.datasets.load_open_model("coarse")
        >>> model.hand_pose("relaxed", "fist").tolist()
        [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        """
        self._check_hands()
        of_left = self._coefficients_of_hand(left)
        of_right = of_left if right is None else self._coefficients_of_hand(right)
        return onp.concatenate([of_left, of_right])

    def _coefficients_of_hand(self, pose: str) -> Array:
        """Return 1 for a named pose and 0 for the others; all are 0 for the relaxed hand."""
        one_of(pose, "pose", ("relaxed", *self.hand_poses))
        return onp.array([float(name == pose) for name in self.hand_poses])

    fit = fit_model

    def _shaped(self, betas: ArrayLike | None) -> Array:
        if betas is None:
            return self.template.vertices
        betas = real_array(betas, "betas", (self.n_betas,))
        return self.template.vertices + self._offsets(betas, self._shape_rows)

    def _shaped_joints(self, betas: ArrayLike | None) -> Array:
        """Return the joints in the rest pose, linear in the betas like the vertices."""
        rest, shapes = self._joint_shapes
        if betas is None:
            return rest
        betas = real_array(betas, "betas", (self.n_betas,))
        offsets = np.dot(betas, shapes)
        return rest + np.reshape(offsets, (*np.shape(offsets)[:-1], self.n_joints, 3))

    def _hand_offsets(self, hands: ArrayLike) -> Array:
        self._check_hands()
        hands = real_array(hands, "hands", self.hand_directions.shape[-1:])
        return self._offsets(hands, self._hand_rows)

    def _check_hands(self) -> None:
        if not self.hand_poses:
            raise ArgumentError("hands must be relaxed: the model has no hand poses")

    def _check_batches(
        self,
        betas: ArrayLike | None,
        pose: ArrayLike | None,
        trans: ArrayLike | None,
        hands: ArrayLike | None = None,
    ) -> None:
        """Raise an error if leading axes do not fit together."""
        # Arrays of the leading shapes, which take no memory.
        batches = {}
        for name, array in {"betas": betas, "pose": pose, "trans": trans, "hands": hands}.items():
            if array is None:
                continue
            shape = np.shape(values_of(array, name))
            is_table = name == "pose" and shape[-2:] == (self.n_joints, 3)
            leading = shape[:-2] if is_table else shape[:-1]
            batches[name] = onp.broadcast_to(0.0, leading)
        joint_shape(**batches)

    def _rotations(self, pose: ArrayLike) -> Array:
        pose = real_array(pose, "pose")
        shape = np.shape(pose)
        if shape[-1:] == (3 * self.n_joints,):
            pose = np.reshape(pose, (*shape[:-1], self.n_joints, 3))
        elif shape[-2:] != (self.n_joints, 3):
            raise ArgumentError(
                f"pose must have shape (..., {self.n_joints}, 3) or (..., {3 * self.n_joints}); "
                f"found {shape}"
            )
        return rotation_matrix(pose)

    def _pose_offsets(self, rotations: Array) -> Array:
        limbs = onp.flatnonzero(self.parents >= 0)
        feature = rotations[..., limbs, :, :] - np.eye(3)
        feature = np.reshape(feature, (*np.shape(feature)[:-3], 9 * len(limbs)))
        return self._offsets(feature, self._pose_rows)

    def _offsets(self, coefficients: Array, rows: Array) -> Array:
        """Return sums of the directions that are rows of a matrix."""
        shape = (*np.shape(coefficients)[:-1], self.n_vertices, 3)
        return np.reshape(np.dot(coefficients, rows), shape)

    def _rows(self, directions: Array) -> Array:
        rows = directions.reshape(-1, directions.shape[-1]).T
        return onp.ascontiguousarray(rows)

    @cached_property
    def _shape_rows(self) -> Array:
        return self._rows(self.shapedirs)

    @cached_property
    def _hand_rows(self) -> Array:
        return self._rows(self.hand_directions)

    @cached_property
    def _pose_rows(self) -> Array:
        return self._rows(onp.asarray(self.posedirs))  # of models that have them

    def _translated(self, points: Array, trans: ArrayLike | None) -> Array:
        if trans is None:
            return points
        return points + real_array(trans, "trans", (3,))[..., None, :]

    @cached_property
    def _joint_shapes(self) -> tuple[Array, Array]:
        """The joints at rest, and how they move with each of the betas, shape (B, 3 J)."""
        rest = self.joint_regressor @ self.template.vertices
        shapes = onp.tensordot(self.shapedirs, self.joint_regressor, axes=(0, 1))
        rows = shapes.transpose(1, 2, 0).reshape(self.n_betas, -1)
        return rest, rows


reads(
    FileKind(
        "models: SMPL, SMPL-H, SMPL-X, STAR, SMAL",
        "BodyModel.from_file",
        (".npz", ".pkl", ".pickle"),
        registered=YES,
        measured=BY_DEFINITIONS,
        written=(".npz",),
    )
)(BodyModel.from_file)


def convert_model(
    source: str | os.PathLike[str], target: str | os.PathLike[str], *, n_betas: int | None = None
) -> BodyModel:
    """Read a body model, check it, and write it as an .npz file of plain arrays, in SMPL's layout.

    Parameters
    ----------
    source : path_like
        A .pkl or .npz file, see `BodyModel.from_file`.
    target : path_like
        File to write, with its suffix; an existing file is replaced.
    n_betas : int, optional
        Number of shape coefficients to keep, as for `BodyModel.from_file`.

    Examples
    --------
    >>> rh.datasets.load_open_model("coarse").save("model.npz")
    >>> rh.bodies.convert_model("model.npz", "smaller.npz", n_betas=3).n_betas
    3
    """
    model = BodyModel.from_file(source, n_betas=n_betas)
    model.save(target)
    return model


def _checked_names(names: Sequence[str] | Array | None, n_joints: int) -> tuple[str, ...]:
    """Return names of the joints, by default their numbers."""
    if names is None:
        return tuple(f"joint_{joint}" for joint in range(n_joints))
    texts = _texts(names, "joint_names")
    if len(texts) != n_joints or len(set(texts)) != n_joints:
        raise ArgumentError(
            f"joint_names must hold {n_joints} different names; found {join_names(texts)}"
        )
    return texts


def _texts(names: Sequence[str] | Array, name: str) -> tuple[str, ...]:
    """Return names, of a list or an array; the field of a file may be a single text."""
    array = onp.atleast_1d(values_of(names, name))
    if array.dtype.kind in "Siu":
        array = array.astype(str)
    return texts_of(array.tolist(), name) if array.size else ()


def _copy(array: ArrayLike, name: str, shape: tuple[int | str, ...]) -> Array:
    return read_only(onp.array(real_array(array, name, shape, batched=False)))


def _check_sums(rows: Array, name: str) -> None:
    """Raise an error if a row of a matrix does not sum to one."""
    error = onp.abs(rows.sum(axis=1) - 1.0)
    if error.size and error.max() > _SUM_TOLERANCE:
        row = int(error.argmax())
        raise ArgumentError(
            f"every row of {name} must sum to one; row {row} sums to {rows[row].sum():g}"
        )
