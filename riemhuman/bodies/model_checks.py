"""Checks on the fields of a body model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from riemhuman.errors import ArgumentError

# Weights in single precision, or rounded for storage, sum to one within this tolerance.
_SUM_TOLERANCE = 1e-3


def check_sums(rows: np.ndarray, name: str) -> None:
    """Refuse a matrix with a row that does not sum to one.

    Parameters
    ----------
    rows : array, shape (n, m)
        The matrix.
    name : str
        Its name, for messages.
    """
    error = np.abs(rows.sum(axis=1) - 1.0)
    if error.size and error.max() > _SUM_TOLERANCE:
        row = int(error.argmax())
        raise ArgumentError(
            f"every row of {name} must sum to one; row {row} sums to {rows[row].sum():g}"
        )


def check_weights(weights: np.ndarray) -> None:
    """Refuse skinning weights that are negative or do not sum to one.

    Parameters
    ----------
    weights : array, shape (V, J)
        Skinning weights.
    """
    check_sums(weights, "weights")
    if weights.min() < 0:
        vertex, joint = (int(i) for i in np.argwhere(weights < 0)[0])
        raise ArgumentError(
            f"weights must not be negative; found {weights[vertex, joint]:g} "
            f"at vertex {vertex}, joint {joint}"
        )


def names_of_joints(names: Sequence[str] | None, n_joints: int) -> tuple[str, ...]:
    """Return the names of the joints, by default "joint_0", "joint_1", and so on.

    Parameters
    ----------
    names : sequence of str, optional
        Names.
    n_joints : int
        Number of joints.

    Raises
    ------
    ArgumentError
        If the names are repeated or not one per joint.
    """
    if names is None:
        return tuple(f"joint_{j}" for j in range(n_joints))
    if np.ndim(names) != 1 or not len(names) == len({str(name) for name in names}) == n_joints:
        raise ArgumentError(f"joint_names must hold {n_joints} different names; found {names!r}")
    return tuple(str(name) for name in names)


def precision(dtype: DTypeLike) -> np.dtype[Any]:
    """Return the data type of surfaces after checking it.

    Parameters
    ----------
    dtype : data type
        The argument.

    Raises
    ------
    ArgumentError
        If it is neither float64 nor float32.
    """
    try:
        found = np.dtype(dtype)
    except TypeError:
        found = np.dtype(object)
    if found not in (np.float64, np.float32):
        raise ArgumentError(f"dtype must be float64 or float32; found {dtype!r}")
    return found
