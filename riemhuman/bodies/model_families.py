"""Families of body models in SMPL's layout, and the parts of their files that are used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

HANDS = ("hands_componentsl", "hands_componentsr", "hands_meanl", "hands_meanr")
LANDMARKS = ("lmk_faces_idx", "dynamic_lmk_faces_idx")
"""Fields of SMPL-H and SMPL-X beside the model itself: hand poses, landmarks of the face."""

_SMPLX_JOINTS, _SMPLH_JOINTS, _SMAL_JOINTS = 55, 52, (33, 35)
# Shape coefficients of SMPL-X, by the number of all its coefficients; expressions come after them.
_SHAPES_OF_SMPLX = {400: 300, 20: 10}


@dataclass(frozen=True)
class ModelContents:
    """The contents of a file of a body model.

    Attributes
    ----------
    family : str
        "SMPL", "SMPL-H", "SMPL-X", "STAR", "SMAL", or "SMPL's layout".
    n_shapes : int
        Number of shape coefficients in the file, without expressions.
    used : tuple of str
        Parts that are used.
    left_out : tuple of str
        Parts that are left out.

    Examples
    --------
    >>> import riemhuman as rh
    >>> rh.datasets.load_open_model("coarse").save("model.npz")
    >>> rh.bodies.model_contents("model.npz").family
    "SMPL's layout"
    """

    family: str
    n_shapes: int
    used: tuple[str, ...]
    left_out: tuple[str, ...]

    def __str__(self) -> str:
        said = f"{self.family}: used are {', '.join(self.used)}"
        return said + (f"; left out are {', '.join(self.left_out)}" if self.left_out else "")


def contents_of(fields: Mapping[str, Any], n_betas: int) -> ModelContents:
    """Return the contents of a file.

    Parameters
    ----------
    fields : mapping of str to array
        Arrays of the file by SMPL's names.
    n_betas : int
        Number of shape coefficients to keep.
    """
    n_joints = last_length(fields["weights"])
    n_entries = np.size(fields.get("posedirs", ())) // max(1, np.size(fields["v_template"]))
    n_coefficients = last_length(fields["shapedirs"])
    by_quaternions = n_entries == 4 * (n_joints - 1) + 1
    has_face = any(name in fields for name in LANDMARKS)
    n_shapes = n_coefficients
    if by_quaternions:
        family = "STAR"
    elif n_joints == _SMPLX_JOINTS and (has_face or n_coefficients in _SHAPES_OF_SMPLX):
        family = "SMPL-X"
        n_shapes = _SHAPES_OF_SMPLX.get(n_coefficients, n_coefficients)
    elif n_joints == _SMPLH_JOINTS:
        family = "SMPL-H"
    elif n_joints in _SMAL_JOINTS:
        family = "SMAL"
    else:
        family = "SMPL" if n_joints == 24 else "SMPL's layout"

    kept = min(n_betas, n_shapes)
    used = [f"{n_joints} joints", f"{kept} shape coefficients"]
    left_out = []
    if by_quaternions:
        left_out.append(f"posedirs ({n_entries} entries, of quaternions and a shape coefficient)")
    elif n_entries:
        used.append(f"posedirs ({n_entries} entries)")
    if kept < n_shapes:
        left_out.append(f"{n_shapes - kept} further shape coefficients")
    if n_shapes < n_coefficients:
        left_out.append(f"{n_coefficients - n_shapes} expression coefficients")
    if any(name in fields for name in HANDS):
        left_out.append("mean poses and components of the hands (fingers are joints like others)")
    if has_face:
        left_out.append("landmarks of the face")
    return ModelContents(family, n_shapes, tuple(used), tuple(left_out))


def last_length(array: Any) -> int:
    """Return the length of the last axis of an array, or 0 for a number.

    Parameters
    ----------
    array : array_like
        A field of a file.
    """
    return (0, *np.shape(array))[-1]
