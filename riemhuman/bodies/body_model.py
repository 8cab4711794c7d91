"""A body model in SMPL's layout, with its files and fits."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from riemhuman.bodies.fitting import fit_model
from riemhuman.bodies.model_checks import precision
from riemhuman.bodies.model_files import read_model_fields, write_model_fields
from riemhuman.bodies.model_fit import ModelFit
from riemhuman.bodies.skinned_model import SkinnedModel
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError


class BodyModel(SkinnedModel):
    """A parametric body: a surface from shape coefficients, joint rotations and a translation.

    The model of Loper, Mahmood, Romero, Pons-Moll and Black, "SMPL: A Skinned Multi-Person
    Linear Model", ACM Trans. Graphics 34(6), 2015, equations 2 to 10: the shaped surface is
    v_template + shapedirs β, the joints are J(β) = J_regressor (v_template + shapedirs β),
    and every vertex moves with the weighted mean of the rigid motions of the joints.

    The rotation of a joint is an axis-angle vector in the axes of the model's rest pose, which the
    parent joint turns. In the open model, x points to the body's left, y up and z forward. So at
    rest, a positive turn about x bends the trunk forward and swings a hanging limb backward, one
    about y turns the front to the body's left, and one about z raises the left arm sideways and
    lowers the right arm.

    Raises
    ------
    ArgumentError
        If shapes disagree, entries are not finite, weights do not sum to one, the joints do not
        form one tree, or `dtype` is neither float64 nor float32.

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

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        *,
        n_betas: int | None = None,
        dtype: DTypeLike = np.float64,
    ) -> BodyModel:
        """Read a model from a file in SMPL's layout: an .npz archive, or a .pkl file.

        Files of SMPL, SMPL-H, SMPL-X, STAR and SMAL are read as published, with posedirs in three
        axes, flattened or transposed, and with a dense or sparse J_regressor; `model_contents`
        tells what is used of a file and what is left out. A .pkl file is read as data: its code is
        not run, and chumpy is not needed.

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
        ArgumentTypeError
            If `path` is not a path or `n_betas` not a whole number.
        ArgumentError
            If `n_betas` is negative or more than the file has, or `dtype` is neither float64 nor
            float32.
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If the file is damaged, lacks a field, has a malformed field, or is a .pkl file with
            objects other than arrays.
        """
        dtype = precision(dtype)
        fields = read_model_fields(path, n_betas)
        try:
            return cls(**fields, dtype=dtype)
        except (ArgumentError, ArgumentTypeError) as error:
            raise FileFormatError(f"{path}: {error}") from error

    def save(self, path: str | os.PathLike[str], *, single_precision: bool = False) -> None:
        """Write the model as a compressed .npz file in SMPL's layout.

        The file appears whole or not at all.

        Parameters
        ----------
        path : path_like
            File to write, with its suffix; an existing file is replaced.
        single_precision : bool
            Whether real numbers are rounded to single precision, which halves the size.

        Raises
        ------
        ArgumentTypeError
            If `path` is not a path.
        FileError
            If the file cannot be written.
        """
        real = np.float32 if single_precision else np.float64
        kintree_table = np.stack([self._parents, np.arange(self.n_joints)])
        fields: dict[str, Any] = {
            "v_template": self._template.vertices.astype(real),
            "faces": self.faces.astype(np.int32),
            "shapedirs": self._shapedirs.astype(real),
            "joint_regressor": self._joint_regressor.astype(real),
            "weights": self._weights.astype(real),
            "kintree_table": kintree_table.astype(np.int32),
            "joint_names": np.array(self._joint_names),
        }
        if self._posedirs is not None:
            fields["posedirs"] = self._posedirs.astype(real)
        write_model_fields(path, fields)

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
