"""The cotangent Laplacian of triangulated surfaces.

Pinkall and Polthier, "Computing Discrete Minimal Surfaces and Their Conjugates", Experimental
Mathematics 2(1), 1993.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_array


def cotangent_laplacian(f: ndarray, faces: ndarray) -> csr_array:
    r"""Return the matrix L of the Dirichlet energy hᵀL h of functions linear on every triangle.

    :math:`h^T L h = \sum_t w_t (h_u^2 + h_v^2)`; open and non-manifold meshes have it as well.

    Parameters
    ----------
    f : array, shape (V, 3)
        Surface whose triangles have an area.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    csr_array, shape (V, V)
    """
    corners = f[faces]
    rows, columns, entries = [], [], []
    for corner in range(3):
        # The angle at a corner weighs the edge between the two others.
        left, right = faces[:, (corner + 1) % 3], faces[:, (corner + 2) % 3]
        one = corners[:, (corner + 1) % 3] - corners[:, corner]
        other = corners[:, (corner + 2) % 3] - corners[:, corner]
        sine = np.linalg.norm(np.cross(one, other), axis=1)
        half_cotangent = 0.5 * np.sum(one * other, axis=1) / sine
        rows += [left, right, left, right]
        columns += [left, right, right, left]
        entries += [half_cotangent, half_cotangent, -half_cotangent, -half_cotangent]
    places = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(entries), places), shape=(len(f), len(f)))
