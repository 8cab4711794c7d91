"""A body model in SMPL's layout: linear shape space and linear blend skinning."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import autograd.numpy as np
import numpy as onp

from riemhuman.bodies.rotations import rotation_matrix
from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.surfaces.array_files import load_arrays, save_arrays
from riemhuman.surfaces.template import Template

# Fields of the file, in SMPL's spelling, and the constructor arguments they fill.
_FIELDS = {
    "v_template": "v_template",
    "f": "faces",
    "shapedirs": "shapedirs",
    "J_regressor": "joint_regressor",
    "weights": "weights",
    "kintree_table": "kintree_table",
}
_OPTIONAL_FIELDS = {"posedirs": "posedirs", "joint_names": "joint_names"}
_UNSIGNED_ROOT = 2**32 - 1
# Weights stored in single precision, or rounded for storage, sum to one within this.
_SUM_TOLERANCE = 1e-3


class BodyModel:
    """Parametric body: shape coefficients, joint rotations and a translation give a surface.

    The model of Loper, Mahmood, Romero, Pons-Moll and Black, "SMPL: A Skinned Multi-Person
    Linear Model", ACM Trans. Graphics 34(6), 2015, equations 2 to 10: the shaped surface is
    v_template + shapedirs β, the joints are J(β) = J_regressor (v_template + shapedirs β),
    and every vertex moves with the mean, by its weights, of the rigid motions of the joints.

    A joint's rotation is an axis-angle vector in the axes of the model's rest pose, carried
    along by its parent joint. In the open model, x points to the body's left, y up and z
    forward; so at rest a positive turn about x bends the trunk forward and swings a hanging
    limb backward, one about y turns the front to the body's left, and one about z raises the
    left arm sideways and lowers the right one.

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
        Row 1 numbers the joints, row 0 holds the number of each joint's parent; the root's
        parent is -1 or 2**32 - 1.
    posedirs : array_like, shape (V, 3, 9 (J - 1)), optional
        Displacement for each entry of R - I of the joints other than the root.
    joint_names : sequence of str, optional
        Names of the joints; by default "joint_0", "joint_1", and so on.

    Raises
    ------
    ArgumentError
        If shapes disagree, entries are not finite, weights do not sum to one, or the joints
        do not form one tree.
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
    ) -> None:
        v_template = real_array(v_template, "v_template", ("V", 3), batched=False)
        n_vertices = len(v_template)
        self._template = Template(v_template, faces)
        self._shapedirs = _frozen(
            real_array(shapedirs, "shapedirs", (n_vertices, 3, "B"), batched=False)
        )
        self._joint_regressor = _frozen(
            real_array(joint_regressor, "J_regressor", ("J", n_vertices), batched=False)
        )
        n_joints = len(self._joint_regressor)
        self._weights = _frozen(
            real_array(weights, "weights", (n_vertices, n_joints), batched=False)
        )
        self._parents = _frozen(_parents(kintree_table, n_joints))
        self._order = _root_first(self._parents)
        self._posedirs = None
        if posedirs is not None:
            shape = (n_vertices, 3, 9 * (n_joints - 1))
            self._posedirs = _frozen(real_array(posedirs, "posedirs", shape, batched=False))
        self._joint_names = _names(joint_names, n_joints)
        _check_sums(self._joint_regressor, "J_regressor")
        _check_sums(self._weights, "weights")
        if self._weights.min() < 0:
            vertex, joint = (int(i) for i in onp.argwhere(self._weights < 0)[0])
            raise ArgumentError(
                f"weights must not be negative; found {self._weights[vertex, joint]:g} "
                f"at vertex {vertex}, joint {joint}"
            )

    @classmethod
    def from_file(cls, path: str | os.PathLike[str]) -> BodyModel:
        """Read a model from an .npz file in SMPL's layout.

        Parameters
        ----------
        path : path-like
            File with v_template, f, shapedirs, J_regressor, weights and kintree_table, and
            perhaps posedirs and joint_names. Pickled objects there are refused; other fields
            are left unread.

        Returns
        -------
        model : BodyModel
            The model.

        Raises
        ------
        ArgumentTypeError
            If `path` is not a path.
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it is not an .npz archive, lacks a field, or a field is malformed.
        """
        fields = load_arrays(path, tuple(_FIELDS), tuple(_OPTIONAL_FIELDS))
        arguments = _FIELDS | _OPTIONAL_FIELDS
        arrays: dict[str, Any] = {arguments[name]: fields[name] for name in fields}
        try:
            return cls(**arrays)
        except (ArgumentError, ArgumentTypeError) as error:
            raise FileFormatError(f"{path}: {error}") from error

    def save(self, path: str | os.PathLike[str], *, single_precision: bool = False) -> None:
        """Write the model as a compressed .npz file in SMPL's layout.

        The file appears whole or not at all: it is written beside `path` and then renamed.

        Parameters
        ----------
        path : path-like
            File to write, with its suffix; an existing file is replaced.
        single_precision : bool
            Whether real numbers are rounded to single precision, half the size.

        Raises
        ------
        ArgumentTypeError
            If `path` is not a path.
        FileError
            If the file cannot be written.
        """
        real = onp.float32 if single_precision else onp.float64
        kintree_table = onp.stack([self._parents, onp.arange(self.n_joints)])
        fields: dict[str, Any] = {
            "v_template": self._template.vertices.astype(real),
            "f": self.faces.astype(onp.int32),
            "shapedirs": self._shapedirs.astype(real),
            "J_regressor": self._joint_regressor.astype(real),
            "weights": self._weights.astype(real),
            "kintree_table": kintree_table.astype(onp.int32),
            "joint_names": onp.array(self._joint_names),
        }
        if self._posedirs is not None:
            fields["posedirs"] = self._posedirs.astype(real)
        save_arrays(path, fields, compressed=True)

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

    def __call__(self, betas: Any = None, pose: Any = None, trans: Any = None) -> Any:
        """Return the surfaces with these shapes, poses and translations.

        Leading axes of the arguments broadcast; differentiable with autograd in all three.
        Loper et al. 2015, equations 2 to 10.

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
            rotations = rotation_matrix(self._joint_vectors(pose))
            if self._posedirs is not None:
                surface = surface + self._pose_offsets(rotations)
            surface = self._skin(surface, joints, rotations)
        return self._translated(surface, trans)

    def joints(self, betas: Any = None, pose: Any = None, trans: Any = None) -> Any:
        """Return the joints with these shapes, poses and translations.

        Arguments as for the model itself; without a pose, the joints in the rest pose:
        J(β) of Loper et al. 2015, equation 10.

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
            _, joints = self._chained(joints, rotation_matrix(self._joint_vectors(pose)))
        return self._translated(joints, trans)

    def _shaped(self, betas: Any) -> Any:
        vertices = self._template.vertices
        if betas is None:
            return vertices
        betas = real_array(betas, "betas", (self.n_betas,))
        offsets = np.dot(betas, self._shape_matrix)
        return vertices + np.reshape(offsets, (*np.shape(betas)[:-1], *vertices.shape))

    def _joints_of(self, surface: Any) -> Any:
        return np.matmul(self._joint_regressor, surface)

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
        feature = rotations[..., limbs, :, :] - np.eye(3)
        feature = np.reshape(feature, (*np.shape(feature)[:-3], 9 * len(limbs)))
        offsets = np.dot(feature, self._pose_matrix)
        return np.reshape(offsets, (*np.shape(feature)[:-1], self.n_vertices, 3))

    def _translated(self, points: Any, trans: Any) -> Any:
        if trans is None:
            return points
        return points + real_array(trans, "trans", (3,))[..., None, :]

    def _chained(self, joints: Any, rotations: Any) -> tuple[Any, Any]:
        """Return every joint's global rotation and place, along the tree (equations 3 and 4)."""
        shape = np.broadcast_shapes(np.shape(joints)[:-2], np.shape(rotations)[:-3])
        joints = joints + np.zeros((*shape, 1, 1))
        rotations = rotations + np.zeros((*shape, 1, 1, 1))
        turns: list[Any] = [None] * self.n_joints
        places: list[Any] = [None] * self.n_joints
        for joint in self._order:
            parent = self._parents[joint]
            turns[joint], places[joint] = rotations[..., joint, :, :], joints[..., joint, :]
            if parent >= 0:
                bone = places[joint] - joints[..., parent, :]
                places[joint] = places[parent] + _apply(turns[parent], bone)
                turns[joint] = np.matmul(turns[parent], turns[joint])
        return np.stack(turns, axis=-3), np.stack(places, axis=-2)

    def _skin(self, surface: Any, joints: Any, rotations: Any) -> Any:
        """Move every vertex with the mean of its joints' rigid motions (equation 2)."""
        turns, places = self._chained(joints, rotations)
        # Joint j moves x to R_j (x - J_j) + place_j.
        shifts = places - _apply(turns, joints)
        motions = np.concatenate([turns, shifts[..., None]], axis=-1)
        lead = np.shape(motions)[:-3]
        blended = np.matmul(self._weights, np.reshape(motions, (*lead, self.n_joints, 12)))
        blended = np.reshape(blended, (*lead, self.n_vertices, 3, 4))
        return (
            blended[..., 0] * surface[..., 0:1]
            + blended[..., 1] * surface[..., 1:2]
            + blended[..., 2] * surface[..., 2:3]
            + blended[..., 3]
        )

    @cached_property
    def _shape_matrix(self) -> onp.ndarray:
        return onp.ascontiguousarray(self._shapedirs.reshape(-1, self.n_betas).T)

    @cached_property
    def _pose_matrix(self) -> onp.ndarray:
        assert self._posedirs is not None, "asked for where there are posedirs only"
        return onp.ascontiguousarray(self._posedirs.reshape(3 * self.n_vertices, -1).T)


def _apply(matrices: Any, vectors: Any) -> Any:
    return np.matmul(matrices, vectors[..., None])[..., 0]


def _frozen(array: onp.ndarray) -> onp.ndarray:
    array = onp.array(array)
    array.flags.writeable = False
    return array


def _names(names: Sequence[str] | None, n_joints: int) -> tuple[str, ...]:
    if names is None:
        return tuple(f"joint_{j}" for j in range(n_joints))
    if onp.ndim(names) != 1 or not len(names) == len({str(name) for name in names}) == n_joints:
        raise ArgumentError(f"joint_names must hold {n_joints} different names; found {names!r}")
    return tuple(str(name) for name in names)


def _check_sums(rows: onp.ndarray, name: str) -> None:
    error = onp.abs(rows.sum(axis=1) - 1.0)
    if error.size and error.max() > _SUM_TOLERANCE:
        row = int(error.argmax())
        raise ArgumentError(
            f"every row of {name} must sum to one; row {row} sums to {rows[row].sum():g}"
        )


def _parents(kintree_table: Any, n_joints: int) -> onp.ndarray:
    """Return the index of each joint's parent, -1 for the root, checked to form one tree."""
    table = integer_array(kintree_table, "kintree_table", (2, n_joints))
    index = {int(number): j for j, number in enumerate(table[1])}
    if len(index) != n_joints:
        raise ArgumentError("kintree_table numbers a joint twice in its second row")
    parents = onp.empty(n_joints, dtype=onp.int64)
    for joint, number in enumerate(table[0].tolist()):
        if number in (-1, _UNSIGNED_ROOT):
            parents[joint] = -1
        elif number in index:
            parents[joint] = index[number]
        else:
            raise ArgumentError(
                f"kintree_table names {number} as the parent of joint {joint}; no joint has "
                "that number"
            )
    roots = onp.flatnonzero(parents < 0).tolist()
    if len(roots) != 1:
        raise ArgumentError(f"kintree_table must have one root; found roots {roots}")
    return parents


def _root_first(parents: onp.ndarray) -> tuple[int, ...]:
    """Return the joints ordered so that parents precede children; refuse a cycle."""
    order = onp.flatnonzero(parents < 0).tolist()
    for joint in order:
        order.extend(onp.flatnonzero(parents == joint).tolist())
    if len(order) != len(parents):
        cycle = sorted(set(range(len(parents))) - set(order))
        raise ArgumentError(f"kintree_table has a cycle: joints {cycle} never reach the root")
    return tuple(order)
