"""The check of precomputed distances."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError

# Largest difference of d(i, j) and d(j, i) due to rounding, relative to the largest distance.
_SYMMETRY = 1e-6

# Sums of squares of larger distances overflow.
_LARGEST = 1e150


def distance_matrix(distances: ArrayLike, name: str = "distances") -> ndarray:
    """Return distances, shape (n, n), made exactly symmetric with zero diagonal, or raise."""
    matrix = real_array(distances, name, ("n", "n"), batched=False).copy()
    if matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise ArgumentError(f"{name} must be a square matrix; found shape {matrix.shape}")
    np.fill_diagonal(matrix, 0.0)
    if matrix.min() < 0:
        raise ArgumentError(f"{name} must not be negative; the smallest is {matrix.min():g}")
    if matrix.max() > _LARGEST:
        raise ArgumentError(
            f"{name} must be at most {_LARGEST:g}, so that sums do not overflow; the largest is "
            f"{matrix.max():g}"
        )
    gap = np.abs(matrix - matrix.T).max()
    if gap > _SYMMETRY * matrix.max():
        raise ArgumentError(f"{name} must be symmetric; it differs from its transpose by {gap:.3g}")
    return 0.5 * (matrix + matrix.T)
