"""Deformation gradients of triangles: what takes a triangle and its normal to another."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.kernels.surface import partial_derivatives, unit_normals


def triangle_frames(points: ndarray, operator: object) -> ndarray:
    """Return the matrices with columns f_u, f_v and n.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces whose triangles have an area.
    operator : csr_array, shape (2F, V)
        The template's differential operator.

    Returns
    -------
    array, shape (..., F, 3, 3)
    """
    f_u, f_v = partial_derivatives(points, operator)
    return np.stack([f_u, f_v, unit_normals(f_u, f_v)], axis=-1)


def deformation_gradients(before: ndarray, after: ndarray) -> ndarray:
    """Return the matrices that take one surface's triangles and normals to another's.

    Parameters
    ----------
    before, after : array, shape (..., F, 3, 3)
        Frames, see `triangle_frames`.

    Returns
    -------
    array, shape (..., F, 3, 3)
    """
    return after @ np.linalg.inv(before)


def nearest_rotations(matrices: ndarray) -> ndarray:
    """Return the rotations of polar decompositions, those nearest to the matrices.

    Parameters
    ----------
    matrices : array, shape (..., 3, 3)
        Matrices of positive determinant.

    Returns
    -------
    array, shape (..., 3, 3)
    """
    left, _, right = np.linalg.svd(matrices)
    return left @ right


def stacked_derivatives(frames: ndarray) -> ndarray:
    """Return f_u of all triangles, then f_v, as the template's operator does.

    Parameters
    ----------
    frames : array, shape (..., F, 3, 3)
        Matrices whose first two columns are f_u and f_v.

    Returns
    -------
    array, shape (..., 2F, 3)
    """
    return np.concatenate([frames[..., 0], frames[..., 1]], axis=-2)
