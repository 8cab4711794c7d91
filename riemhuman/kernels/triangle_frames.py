"""Deformation gradients, the maps of triangles and their normals to others."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.surface import dot, partial_derivatives, unit_normals


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


def polar_frames(f_u: ndarray, f_v: ndarray) -> ndarray:
    r"""Return the orthonormal frames of polar decompositions, and the normal as third column.

    The differential of a surface is df = Q √g with Q isometric. In the plane of the triangle, Q is
    df plus its cofactors, divided by :math:`\mathrm{tr}\sqrt g`:

    .. math:: Q = (f_u + f_v \times n, \; f_v + n \times f_u) / \mathrm{tr}\sqrt g

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives of surfaces whose triangles have an area.

    Returns
    -------
    array, shape (..., F, 3, 3)
        Rotations of the axes to the frames.
    """
    n = unit_normals(f_u, f_v)
    q_u, q_v = f_u + np.cross(f_v, n), f_v + np.cross(n, f_u)
    trace = np.sqrt(dot(q_u, q_u))[..., None]
    return np.stack([q_u / trace, q_v / trace, n], axis=-1)


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
