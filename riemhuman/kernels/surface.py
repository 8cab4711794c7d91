r"""First fundamental forms and normals of triangulated surfaces over a template.

On template triangle t, with corners (0, 0), (u₂, 0), (u₃, v₃) in its own orthonormal frame, a
surface f with corners q₁, q₂, q₃ has

.. math:: f_u = (q_2 - q_1)/u_2, \qquad
          f_v = (q_3 - q_1)/v_3 - \frac{u_3}{v_3 u_2}(q_2 - q_1)

(supplement of the paper; its tan θ is corrected to u₃/v₃ = cot θ).
"""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix

from riemhuman.kernels.linear import apply_operator
from riemhuman.kernels.scalars import square_root


def partial_derivatives(points: ndarray, operator: csr_matrix) -> tuple[ndarray, ndarray]:
    """Return f_u and f_v of every triangle.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces.
    operator : csr_matrix, shape (2F, V)
        The template's differential operator: rows of f_u, then rows of f_v.

    Returns
    -------
    f_u, f_v : array, shape (..., F, 3)
    """
    derivatives = apply_operator(operator, points)
    n_faces = operator.shape[0] // 2
    return derivatives[..., :n_faces, :], derivatives[..., n_faces:, :]


def dot(a: ndarray, b: ndarray) -> ndarray:
    """Return the inner products of vectors along the last axis.

    Parameters
    ----------
    a, b : array, shape (..., n)
        Vectors.

    Returns
    -------
    array, shape (...)
    """
    return np.sum(a * b, axis=-1)


def cross(a: ndarray, b: ndarray) -> ndarray:
    """Return the cross products of vectors of R³ along the last axis.

    Parameters
    ----------
    a, b : array, shape (..., 3)
        Vectors.

    Returns
    -------
    array, shape (..., 3)
    """
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def symmetric_matrices(e: ndarray, m: ndarray, g: ndarray) -> ndarray:
    """Return the matrices [[e, m], [m, g]].

    Parameters
    ----------
    e, m, g : array, shape (...)
        Entries, all of one shape.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    return np.stack([np.stack([e, m], axis=-1), np.stack([m, g], axis=-1)], axis=-2)


def first_fundamental_form(f_u: ndarray, f_v: ndarray) -> ndarray:
    """Return g = [[f_u·f_u, f_u·f_v], [f_u·f_v, f_v·f_v]].

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.

    Returns
    -------
    array, shape (..., F, 2, 2)
    """
    return symmetric_matrices(dot(f_u, f_u), dot(f_u, f_v), dot(f_v, f_v))


def first_fundamental_form_differential(
    f_u: ndarray, f_v: ndarray, h_u: ndarray, h_v: ndarray
) -> ndarray:
    """Return the derivative of g along a deformation h.

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives of the surface.
    h_u, h_v : array, shape (..., F, 3)
        Partial derivatives of the deformation.

    Returns
    -------
    array, shape (..., F, 2, 2)
    """
    return symmetric_matrices(2 * dot(f_u, h_u), dot(f_u, h_v) + dot(h_u, f_v), 2 * dot(f_v, h_v))


def unit_normals(f_u: ndarray, f_v: ndarray) -> ndarray:
    """Return n = f_u × f_v / ‖f_u × f_v‖; not defined on triangles without area.

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.

    Returns
    -------
    array, shape (..., F, 3)
    """
    area_vectors = cross(f_u, f_v)
    return area_vectors / np.sqrt(dot(area_vectors, area_vectors))[..., None]


def unit_normals_differential(f_u: ndarray, f_v: ndarray, h_u: ndarray, h_v: ndarray) -> ndarray:
    """Return the derivative of n along a deformation h.

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives of the surface.
    h_u, h_v : array, shape (..., F, 3)
        Partial derivatives of the deformation.

    Returns
    -------
    array, shape (..., F, 3)
    """
    area_vectors = cross(f_u, f_v)
    areas = np.sqrt(dot(area_vectors, area_vectors))[..., None]
    normals = area_vectors / areas
    change = (cross(h_u, f_v) + cross(f_u, h_v)) / areas
    return change - dot(normals, change)[..., None] * normals


def square_root_normals(f_u: ndarray, f_v: ndarray) -> ndarray:
    r"""Return the square root normal field :math:`q = \sqrt{A}\, n`, A = ‖f_u × f_v‖.

    q and its gradient are 0 on a degenerate triangle (section 5.2 of the paper).

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.

    Returns
    -------
    array, shape (..., F, 3)
    """
    area_vectors = cross(f_u, f_v)
    degenerate = is_degenerate(f_u, f_v)[..., None]
    roots = square_root(square_root(dot(area_vectors, area_vectors)))[..., None]
    return np.where(degenerate, 0.0, area_vectors / np.where(degenerate, 1.0, roots))


def is_degenerate(f_u: ndarray, f_v: ndarray) -> ndarray:
    """Tell the triangles on which g is singular to working precision, see `ebin.is_degenerate`.

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.

    Returns
    -------
    array of bool, shape (..., F)
    """
    area_vectors = cross(f_u, f_v)
    scale = dot(f_u, f_u) * dot(f_v, f_v)
    return dot(area_vectors, area_vectors) <= DEGENERATE * scale


DEGENERATE = 8 * np.finfo(float).eps
"""Below this squared sine of the angle between f_u and f_v, det g is rounding error alone."""
