"""Files of body models in SMPL's layout: .npz archives and pickles, of all published families."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array, Values
from riemhuman.checks import checked, is_human_size, likely_units, whole
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_arrays
from riemhuman.io.pickles import load_pickled_arrays

Stored: TypeAlias = Array | sparse.coo_array
"""An array, also of text, or, of SMPL's joint regressor, a sparse matrix."""

# Fields of a file, in SMPL's spelling, and the arguments of `BodyModel` they fill.
_REQUIRED = ("v_template", "f", "shapedirs", "J_regressor", "weights", "kintree_table")
_OPTIONAL = ("posedirs", "joint_names", "hand_directions", "hand_poses")
_ARGUMENTS = {name: name for name in (*_REQUIRED, *_OPTIONAL)}
_ARGUMENTS |= {"f": "faces", "J_regressor": "joint_regressor"}
_PICKLES = (".pkl", ".pickle")
# SMPL's files have 10 shape coefficients or 300, of which 10 are commonly used.
_MANY_BETAS = 300
_USUAL_BETAS = 10

# Fields of SMPL-H and SMPL-X beside the model itself: hand poses, landmarks of the face.
_HANDS = ("hands_componentsl", "hands_componentsr", "hands_meanl", "hands_meanr")
_LANDMARKS = ("lmk_faces_idx", "dynamic_lmk_faces_idx")

# By the number of joints.
_FAMILIES = {24: "SMPL", 52: "SMPL-H", 55: "SMPL-X", 33: "SMAL", 35: "SMAL"}
_OTHER_FAMILY = "SMPL's layout"
# Shape coefficients of SMPL-X, by the number of all its coefficients; expressions come after them.
_SHAPES_OF_SMPLX = {400: 300, 20: 10}


@dataclass(frozen=True)
class ModelContents:
    """The contents of a file of a body model.

    Attributes
    ----------
    family : str
        "SMPL", "SMPL-H", "SMPL-X", "STAR", "SMAL", or "SMPL's layout".
    n_shapes, n_used : int
        Number of shape coefficients in the file, without expressions, and of those that are used.
    used, left_out : tuple of str
        Parts that are used, and parts that are ignored.

    Examples
    --------
    >>> rh.datasets.load_open_model("coarse").save("model.npz")
    >>> rh.bodies.model_contents("model.npz").family
    "SMPL's layout"
    """

    family: str
    n_shapes: int
    n_used: int
    used: tuple[str, ...]
    left_out: tuple[str, ...]

    def __str__(self) -> str:
        sentence = f"{self.family}: used: {', '.join(self.used)}"
        return sentence + (f"; ignored: {', '.join(self.left_out)}" if self.left_out else "")


@checked(n_betas=whole(minimum=0))
def model_contents(path: str | os.PathLike[str], n_betas: int | None = None) -> ModelContents:
    """Return the contents of a file in SMPL's layout: which parts are used and which are ignored.

    In files of SMPL-X, expressions, hand components and facial landmarks are ignored; in files of
    STAR, the pose correctives, which are functions of quaternions.

    Parameters
    ----------
    path : path_like
        An .npz or .pkl file, as for `BodyModel.from_file`.
    n_betas : int, optional
        Number of shape coefficients to keep.

    Examples
    --------
    >>> rh.datasets.load_open_model("coarse").save("model.npz")
    >>> print(rh.bodies.model_contents("model.npz"))
    SMPL's layout: used: 23 joints, 32 shape coefficients, 4 poses of each hand
    """
    return _contents(_load_arrays(path), n_betas)


def read_model_fields(
    path: str | os.PathLike[str], n_betas: int | None = None
) -> dict[str, Stored]:
    """Return the arguments of `BodyModel` by name, from a file in any of the published layouts."""
    arrays = _load_arrays(path)
    contents = _contents(arrays, n_betas)
    if contents.family == "STAR":
        del arrays["posedirs"]
    fields = {argument: arrays[name] for name, argument in _ARGUMENTS.items() if name in arrays}
    for name, array in fields.items():
        if sparse.issparse(array) and name != "joint_regressor":
            raise FileFormatError(f"{path}: {name} must not be a sparse matrix")
    _check_unit(np.asarray(fields["v_template"]), path)
    regressor, shape = fields["joint_regressor"], fields["weights"].shape
    if not isinstance(regressor, np.ndarray):
        if regressor.shape[::-1] != shape:  # which may be vast
            raise FileFormatError(
                f"{path}: J_regressor must have the shape of weights, {shape}, transposed; "
                f"found {regressor.shape}"
            )
        fields["joint_regressor"] = regressor.toarray()
    if "posedirs" in fields:
        n_entries = 9 * (len(np.atleast_1d(fields["joint_regressor"])) - 1)
        n_vertices = len(np.atleast_1d(fields["v_template"]))
        fields["posedirs"] = _posedirs(fields["posedirs"], n_vertices, n_entries)
    if fields["shapedirs"].ndim == 3:
        if n_betas is not None and n_betas > contents.n_shapes:
            raise ArgumentError(
                f"n_betas is {n_betas}; {path} has {contents.n_shapes} shape coefficients"
            )
        fields["shapedirs"] = fields["shapedirs"][..., : contents.n_used]
    return fields


def _check_unit(vertices: Values, path: str | os.PathLike[str]) -> None:
    """Raise an error if a template has the size of a human body in another unit than metres."""
    if vertices.ndim != 2 or vertices.dtype.kind not in "fiu" or not len(vertices):
        return  # refused later
    extent = float(np.ptp(vertices, axis=0).max())
    if not is_human_size(extent) and likely_units(extent):
        raise FileFormatError(
            f"{path}: its template is {extent:.4g} long, as a body in "
            f"{' or '.join(likely_units(extent))} is; body models must be in metres"
        )


def _load_arrays(path: str | os.PathLike[str]) -> dict[str, Stored]:
    is_pickle = isinstance(path, (str, os.PathLike)) and Path(path).suffix.lower() in _PICKLES
    load = load_pickled_arrays if is_pickle else load_arrays
    return load(path, _REQUIRED, (*_OPTIONAL, *_HANDS, *_LANDMARKS))


def _contents(fields: Mapping[str, Stored], n_betas: int | None) -> ModelContents:
    """Return the family of a model, and which parts of its file are used."""
    n_joints = _last_length(fields["weights"])
    n_entries = np.size(fields.get("posedirs", ())) // max(1, np.size(fields["v_template"]))
    n_coefficients = _last_length(fields["shapedirs"])
    by_quaternions = n_entries == 4 * (n_joints - 1) + 1
    has_face = any(name in fields for name in _LANDMARKS)
    family = "STAR" if by_quaternions else _FAMILIES.get(n_joints, _OTHER_FAMILY)
    if family == "SMPL-X" and not has_face and n_coefficients not in _SHAPES_OF_SMPLX:
        family = _OTHER_FAMILY
    n_shapes = n_coefficients
    if family == "SMPL-X":
        n_shapes = _SHAPES_OF_SMPLX.get(n_coefficients, n_coefficients)
    usual = _USUAL_BETAS if n_coefficients >= _MANY_BETAS else n_coefficients
    wanted = usual if n_betas is None else n_betas
    n_used = min(wanted, n_shapes)
    used = [f"{n_joints} joints", f"{n_used} shape coefficients"]
    left_out = []
    if by_quaternions:
        left_out.append(f"posedirs ({n_entries} entries, of quaternions and a shape coefficient)")
    elif n_entries:
        used.append(f"posedirs ({n_entries} entries)")
    if "hand_poses" in fields:
        used.append(f"{np.size(fields['hand_poses'])} poses of each hand")
    if n_used < n_shapes:
        left_out.append(f"{n_shapes - n_used} further shape coefficients")
    if n_shapes < n_coefficients:
        left_out.append(f"{n_coefficients - n_shapes} expression coefficients")
    if any(name in fields for name in _HANDS):
        left_out.append("mean poses and components of the hands (fingers are ordinary joints)")
    if has_face:
        left_out.append("landmarks of the face")
    return ModelContents(family, n_shapes, n_used, tuple(used), tuple(left_out))


def _last_length(array: Stored) -> int:
    """Return the length of the last axis of an array, or 0 for a number."""
    shape = np.shape(array)
    return int(shape[-1]) if shape else 0


def _posedirs(posedirs: Array, n_vertices: int, n_entries: int) -> Array:
    """Return pose-dependent displacements as (V, 3, entries), from any published layout."""
    if posedirs.shape == (3 * n_vertices, n_entries):
        return posedirs.reshape(n_vertices, 3, n_entries)
    if posedirs.shape in ((n_entries, n_vertices, 3), (n_entries, 3 * n_vertices)):
        return np.moveaxis(posedirs.reshape(n_entries, n_vertices, 3), 0, -1)
    return posedirs
