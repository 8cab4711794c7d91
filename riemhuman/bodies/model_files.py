"""Files of body models in SMPL's layout: .npz archives and pickles."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from riemhuman.bodies.model_families import (
    HANDS,
    LANDMARKS,
    ModelContents,
    contents_of,
    last_length,
)
from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.pickles import load_pickled_arrays

# Fields of the file, in SMPL's spelling, and the arguments of `BodyModel` they fill.
_FIELDS = {
    "v_template": "v_template",
    "f": "faces",
    "shapedirs": "shapedirs",
    "J_regressor": "joint_regressor",
    "weights": "weights",
    "kintree_table": "kintree_table",
}
_OPTIONAL_FIELDS = {"posedirs": "posedirs", "joint_names": "joint_names"}
_PICKLES = (".pkl", ".pickle")
# SMPL's files have 10 shape coefficients or 300, of which 10 are commonly used.
_MANY_BETAS = 300
_USUAL_BETAS = 10


def read_model_fields(path: str | os.PathLike[str], n_betas: int | None = None) -> dict[str, Any]:
    """Read the arrays of a body model in any of the published layouts.

    Parameters
    ----------
    path : path_like
        An .npz file, or a .pkl file of Python 2 or 3, which is read as data.
    n_betas : int, optional
        Number of shape coefficients to keep, as for `BodyModel.from_file`.

    Returns
    -------
    fields : dict of str to array
        The arguments of `BodyModel` by name.

    Raises
    ------
    ArgumentTypeError, ArgumentError, FileError, FileFormatError
        As for `BodyModel.from_file`.
    """
    if n_betas is not None:
        whole_number(n_betas, "n_betas", minimum=0)
    found = _arrays_of(path)
    contents = _contents(found, n_betas)
    found = {name: array for name, array in found.items() if name not in (*HANDS, *LANDMARKS)}
    if contents.family == "STAR":
        del found["posedirs"]
    names = _FIELDS | _OPTIONAL_FIELDS
    fields = {names[name]: array for name, array in found.items()}
    for name, array in fields.items():
        if sparse.issparse(array) and name != "joint_regressor":
            raise FileFormatError(f"{path}: {name} must not be a sparse matrix")
    try:
        fields["joint_regressor"] = _dense(fields["joint_regressor"], fields["weights"].shape)
    except ArgumentError as error:
        raise FileFormatError(f"{path}: {error}") from error
    if "posedirs" in fields:
        n_entries = 9 * (len(fields["joint_regressor"]) - 1)
        n_vertices = len(np.atleast_1d(fields["v_template"]))
        fields["posedirs"] = _posedirs(fields["posedirs"], n_vertices, n_entries)
    if fields["shapedirs"].ndim == 3:
        shapes = fields["shapedirs"][..., : contents.n_shapes]
        fields["shapedirs"] = _first_betas(shapes, n_betas, path)
    return fields


def model_contents(path: str | os.PathLike[str], n_betas: int | None = None) -> ModelContents:
    """Return the contents of a file in SMPL's layout: which parts are used and which left out.

    From files of SMPL-X, expressions, hand components and facial landmarks are left out; from files
    of STAR, the pose correctives, which are functions of quaternions.

    Parameters
    ----------
    path : path_like
        An .npz or .pkl file of SMPL, SMPL-H, SMPL-X, STAR, SMAL or a model in their layout.
    n_betas : int, optional
        Number of shape coefficients to keep, as for `BodyModel.from_file`.

    Returns
    -------
    contents : ModelContents
        The family, the used parts and those left out; as text, one sentence.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path or `n_betas` not a whole number.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If the file is damaged, lacks a field, or is a .pkl file with objects other than arrays.

    Examples
    --------
    >>> import riemhuman as rh
    >>> rh.datasets.load_open_model("coarse").save("model.npz")
    >>> print(rh.bodies.model_contents("model.npz"))
    SMPL's layout: used are 23 joints, 16 shape coefficients
    """
    if n_betas is not None:
        whole_number(n_betas, "n_betas", minimum=0)
    return _contents(_arrays_of(path), n_betas)


def _arrays_of(path: str | os.PathLike[str]) -> dict[str, Any]:
    is_pickle = isinstance(path, (str, os.PathLike)) and Path(path).suffix.lower() in _PICKLES
    load = load_pickled_arrays if is_pickle else load_arrays
    return load(path, tuple(_FIELDS), (*_OPTIONAL_FIELDS, *HANDS, *LANDMARKS))


def _contents(found: Mapping[str, Any], n_betas: int | None) -> ModelContents:
    every = last_length(found["shapedirs"])
    usual = _USUAL_BETAS if every >= _MANY_BETAS else every
    return contents_of(found, usual if n_betas is None else n_betas)


def write_model_fields(path: str | os.PathLike[str], fields: Mapping[str, Any]) -> None:
    """Write the arrays of a body model as a compressed .npz file in SMPL's layout.

    Parameters
    ----------
    path : path_like
        File to write, with its suffix.
    fields : mapping of str to array
        The arguments of `BodyModel` by name.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file cannot be written.
    """
    names = {argument: name for name, argument in (_FIELDS | _OPTIONAL_FIELDS).items()}
    arrays = {names[argument]: array for argument, array in fields.items()}
    save_arrays(path, arrays, compressed=True)


def _dense(regressor: Any, shape_of_weights: tuple[int, ...]) -> np.ndarray:
    """Return the joint regressor as an array, after a check of the shape of a sparse one."""
    if not sparse.issparse(regressor):
        return np.atleast_1d(regressor)
    if regressor.shape[::-1] != shape_of_weights:
        raise ArgumentError(
            f"J_regressor must have the shape of weights, {shape_of_weights}, transposed; found "
            f"{regressor.shape}"
        )
    return regressor.toarray()


def _posedirs(posedirs: np.ndarray, n_vertices: int, n_entries: int) -> np.ndarray:
    """Return pose-dependent displacements as (V, 3, entries), from any published layout."""
    whole, rows = (n_vertices, 3, n_entries), (3 * n_vertices, n_entries)
    if posedirs.shape == rows:
        return posedirs.reshape(whole)
    if posedirs.shape in ((n_entries, n_vertices, 3), rows[::-1]):
        return np.moveaxis(posedirs.reshape(n_entries, n_vertices, 3), 0, -1)
    return posedirs


def _first_betas(
    shapedirs: np.ndarray, n_betas: int | None, path: str | os.PathLike[str]
) -> np.ndarray:
    found = shapedirs.shape[-1]
    if n_betas is None:
        n_betas = _USUAL_BETAS if found >= _MANY_BETAS else found
    if n_betas > found:
        raise ArgumentError(f"n_betas is {n_betas}; {path} has {found} shape coefficients")
    return shapedirs[..., :n_betas]
