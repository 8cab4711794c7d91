"""A parametric body model in SMPL's layout: linear shape space and linear blend skinning."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy.typing import DTypeLike

from riemhuman.bodies.fitting import ModelFit, fit_model
from riemhuman.bodies.model_files import read_model_fields, write_model_fields
from riemhuman.bodies.skinning import joint_motions, joint_parents, parents_first, skin_surface
from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.io.mesh_arrays import read_only
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.surfaces.template import Template

# Weights in single precision, or rounded for storage, sum to one within this tolerance.
_SUM_TOLERANCE = 1e-3


class BodyModel:
    """A parametric body: a surface from shape coefficients, joint rotations and a translation.

    The model of Loper, Mahmood, Romero, Pons-Moll and Black, "SMPL: A Skinned Multi-Person
    Linear Model", ACM Trans. Graphics 34(6), 2015, equations 2 to 10: the shaped surface is
    v_template + shapedirs β, the joints are J(β) = J_regressor (v_template + shapedirs β),
    and every vertex moves with the weighted mean of the rigid motions of the joints.

    The rotation of a joint is an axis-angle vector in the axes of the model's rest pose, which the
    parent joint rotates. In the open model, x points to the body's left, y up and z forward. So at
    rest, a positive rotation about x bends the trunk forward and swings a hanging limb backward,
    one about y turns the front to the body's left, and one about z raises the left arm sideways
    and lowers the right arm.

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
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> pose = np.zeros((model.n_joints, 3))
    >>> pose[model.joint_names.index("left_elbow")] = [0.0, 0.0, 0.5]
    >>> model(np.zeros(model.n_betas), pose).shape
    (1202, 3)
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
        self._dtype = _precision(dtype)
        v_template = real_array(v_template, "v_template", ("V", 3), batched=False)
        n_vertices = len(v_template)
        self._template = Template(v_template, faces)
        self._shapedirs = _copy(shapedirs, "shapedirs", (n_vertices, 3, "B"))
        self._joint_regressor = _copy(joint_regressor, "J_regressor", ("J", n_vertices))
        n_joints = len(self._joint_regressor)
        self._weights = _copy(weights, "weights", (n_vertices, n_joints))
        self._parents = read_only(joint_parents(kintree_table, n_joints))
        self._order = parents_first(self._parents)
        self._posedirs = None
        if posedirs is not None:
            n_entries = 9 * (n_joints - 1)
            self._posedirs = _copy(posedirs, "posedirs", (n_vertices, 3, n_entries))
        self._joint_names = _checked_names(joint_names, n_joints)
        self._rest, self._regressor, self._blend = (
            array.astype(self._dtype, copy=False)
            for array in (self._template.vertices, self._joint_regressor, self._weights)
        )
        _check_sums(self._joint_regressor, "J_regressor")
        _check_sums(self._weights, "weights")
        if self._weights.min() < 0:
            vertex, joint = (int(i) for i in onp.argwhere(self._weights < 0)[0])
            raise ArgumentError(
                f"weights must not be negative; found {self._weights[vertex, joint]:g} "
                f"at vertex {vertex}, joint {joint}"
            )

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        n_betas: int | None = None,
        dtype: DTypeLike = onp.float64,
    ) -> BodyModel:
        """Read a model from a file in SMPL's layout: an .npz archive, or a .pkl file.

        Files of SMPL, SMPL-H, SMPL-X, STAR and SMAL are read as published, with posedirs in three
        axes, flattened or transposed, and with a dense or sparse J_regressor; `model_contents`
        returns the parts of a file that are used and those that are left out. A .pkl file is read
        as data: its code is not run, and chumpy is not needed.

        Parameters
        ----------
        path : path_like
            File with v_template, f, shapedirs, J_regressor, weights and kintree_table, and
            optionally posedirs and joint_names. Other fields are ignored.
        n_betas : int, optional
            Number of shape coefficients to keep, the first ones; by default all, but 10 of a
            file that has 300 or more.
        dtype : data type
            Precision of surfaces and joints, as for `BodyModel`.

        Returns
        -------
        model : BodyModel

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If the file is damaged, lacks a field, has a malformed field, or is a .pkl file with
            objects other than arrays.
        """
        dtype = _precision(dtype)
        fields = read_model_fields(path, n_betas)
        try:
            return cls(**fields, dtype=dtype)
        except (ArgumentError, ArgumentTypeError) as error:
            raise FileFormatError(f"{path}: {error}") from error

    def save(self, path: str | os.PathLike[str], *, single_precision: bool = False) -> None:
        """Write the model as a compressed .npz file in SMPL's layout.

        An interrupted call leaves no incomplete file.

        Parameters
        ----------
        path : path_like
            File to write, with its suffix; an existing file is replaced.
        single_precision : bool
            Whether real numbers are rounded to single precision, which halves the size.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        real = onp.float32 if single_precision else onp.float64
        kintree_table = onp.stack([self._parents, onp.arange(self.n_joints)])
        fields: dict[str, Any] = {
            "v_template": self._template.vertices.astype(real),
            "faces": self.faces.astype(onp.int32),
            "shapedirs": self._shapedirs.astype(real),
            "joint_regressor": self._joint_regressor.astype(real),
            "weights": self._weights.astype(real),
            "kintree_table": kintree_table.astype(onp.int32),
            "joint_names": onp.array(self._joint_names),
        }
        if self._posedirs is not None:
            fields["posedirs"] = self._posedirs.astype(real)
        write_model_fields(path, fields)

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
    def joint_order(self) -> tuple[int, ...]:
        """All joints, parents before children."""
        return self._order

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
        """
        surface = self._shaped(betas)
        joints = np.matmul(self._regressor, surface)
        if pose is not None:
            rotations = self._rotations(pose)
            if self._posedirs is not None:
                surface = surface + self._pose_offsets(rotations)
            motions = joint_motions(joints, rotations, self._parents, self._order)
            surface = skin_surface(surface, self._blend, joints, *motions)
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
        """
        joints = np.matmul(self._regressor, self._shaped(betas))
        if pose is not None:
            rotations = self._rotations(pose)
            _, joints = joint_motions(joints, rotations, self._parents, self._order)
        return self._translated(joints, trans)

    def fit(self, points: Any, **options: Any) -> ModelFit:
        """Fit shapes, poses and translations to surfaces.

        See `riemhuman.bodies.fit_model` for the method, the options and the errors.

        Parameters
        ----------
        points : array_like, shape (..., n_points, 3)
            Registered surfaces, metres: one point for each vertex, unless the option
            `correspondence` is given.
        **options
            Further arguments of `fit_model`: correspondence, weights, loss, loss_scale,
            betas_prior, pose_prior, tolerance, max_iter.

        Returns
        -------
        fit : ModelFit
            Betas, pose and trans, and the remaining distances.
        """
        return fit_model(self, points, **options)

    def _shaped(self, betas: Any) -> Any:
        if betas is None:
            return self._rest
        betas = self._rounded(real_array(betas, "betas", (self.n_betas,)))
        offsets = np.dot(betas, self._shape_matrix)
        return self._rest + np.reshape(offsets, (*np.shape(betas)[:-1], *self._rest.shape))

    def _rounded(self, array: Any) -> Any:
        return array.astype(self._dtype, copy=False)

    def _rotations(self, pose: Any) -> Any:
        pose = real_array(pose, "pose")
        shape = np.shape(pose)
        if shape[-1:] == (3 * self.n_joints,):
            pose = np.reshape(pose, (*shape[:-1], self.n_joints, 3))
        elif shape[-2:] != (self.n_joints, 3):
            raise ArgumentError(
                f"pose must have shape (..., {self.n_joints}, 3) or (..., {3 * self.n_joints}); "
                f"found {shape}"
            )
        return self._rounded(rotation_matrix(pose))

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
        assert self._posedirs is not None, "used only where there are posedirs"
        matrix = self._posedirs.reshape(3 * self.n_vertices, -1).T
        return onp.ascontiguousarray(matrix, dtype=self._dtype)


def convert_model(
    source: str | os.PathLike[str], target: str | os.PathLike[str], *, n_betas: int | None = None
) -> BodyModel:
    """Read a body model, check it, and write it as an .npz file in SMPL's layout.

    The new file holds only plain arrays: no pickled objects, no chumpy, no sparse matrices.

    Parameters
    ----------
    source : path_like
        A .pkl or .npz file, see `BodyModel.from_file`.
    target : path_like
        File to write, with its suffix; an existing file is replaced.
    n_betas : int, optional
        Number of shape coefficients to keep, as for `BodyModel.from_file`.

    Returns
    -------
    model : BodyModel
        The model in the new file.

    Raises
    ------
    FileError
        If a file is missing or cannot be read or written.
    FileFormatError
        If `source` does not hold a body model, or is a .pkl file with objects other than arrays.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> model.save("model.npz")
    >>> rh.bodies.convert_model("model.npz", "smaller.npz", n_betas=3).n_betas
    3
    """
    model = BodyModel.from_file(source, n_betas=n_betas)
    model.save(target)
    return model


def _copy(array: Any, name: str, shape: tuple[int | str, ...]) -> onp.ndarray:
    return read_only(onp.array(real_array(array, name, shape, batched=False)))


def _check_sums(rows: onp.ndarray, name: str) -> None:
    """Raise an error if a row of a matrix does not sum to one."""
    error = onp.abs(rows.sum(axis=1) - 1.0)
    if error.size and error.max() > _SUM_TOLERANCE:
        row = int(error.argmax())
        raise ArgumentError(
            f"every row of {name} must sum to one; row {row} sums to {rows[row].sum():g}"
        )


def _checked_names(names: Sequence[str] | None, n_joints: int) -> tuple[str, ...]:
    if names is None:
        return tuple(f"joint_{j}" for j in range(n_joints))
    if onp.ndim(names) != 1 or not len(names) == len({str(name) for name in names}) == n_joints:
        raise ArgumentError(f"joint_names must hold {n_joints} different names; found {names!r}")
    return tuple(str(name) for name in names)


def _precision(dtype: DTypeLike) -> onp.dtype[Any]:
    try:
        checked = onp.dtype(dtype)
    except TypeError:
        checked = onp.dtype(object)
    if checked not in (onp.float64, onp.float32):
        raise ArgumentError(f"dtype must be float64 or float32; found {dtype!r}")
    return checked
