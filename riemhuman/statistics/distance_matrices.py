"""The check of precomputed distances."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError

_SYMMETRY = 1e-6


def distance_matrix(distances: ArrayLike, name: str = "distances") -> ndarray:
    """Return symmetric distances with zero diagonal after checking them.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distances; the diagonal may hold rounding errors.
    name : str
        Name of the argument, for messages.

    Returns
    -------
    array, shape (n, n)

    Raises
    ------
    ArgumentError
        If the matrix is not square and symmetric, or an entry is negative or not finite.
    """
    matrix = real_array(distances, name, ("n", "n"), batched=False).copy()
    if matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise ArgumentError(f"{name} must be a square matrix; found shape {matrix.shape}")
    np.fill_diagonal(matrix, 0.0)
    if matrix.min() < 0:
        raise ArgumentError(f"{name} must not be negative; the smallest is {matrix.min():g}")
    gap = np.abs(matrix - matrix.T).max()
    if gap > _SYMMETRY * matrix.max():
        raise ArgumentError(f"{name} must be symmetric; it differs from its transpose by {gap:.3g}")
    return 0.5 * (matrix + matrix.T)
