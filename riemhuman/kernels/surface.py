r"""First fundamental forms and normals of triangulated surfaces over a template.

On template triangle t, with corners (0, 0), (u₂, 0), (u₃, v₃) in its own orthonormal frame, a
surface f with corners q₁, q₂, q₃ has

.. math:: f_u = (q_2 - q_1)/u_2, \qquad
          f_v = (q_3 - q_1)/v_3 - \frac{u_3}{v_3 u_2}(q_2 - q_1)

(supplement of the paper; its tan θ is corrected to u₃/v₃ = cot θ).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import autograd.numpy as np
from autograd.extend import defjvp, defvjp, primitive
from autograd.numpy.numpy_vjps import unbroadcast_f
from numpy import ndarray
from scipy.sparse import csr_matrix

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.kernels.linear import entry

DEGENERATE = 8 * np.finfo(float).eps
"""Below this squared sine of the angle between f_u and f_v, det g is rounding error alone."""

NEARLY_DEGENERATE = 2 * DEGENERATE
"""Below this one, whoever rounds in another order may find that det g is rounding error alone."""


class Derivatives(NamedTuple):
    """What terms know of surfaces: first derivatives, and what follows from them.

    Attributes
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.
    area_vectors : array, shape (..., F, 3)
        f_u × f_v.
    areas : array, shape (..., F)
        A = ‖f_u × f_v‖, the ratio of the triangle's area to the template's; 1 where degenerate.
    e, m : array, shape (..., F)
        f_u·f_u, 1 where degenerate, and f_u·f_v.
    degenerate : array of bool, shape (..., F)
        Triangles without area: g is singular to working precision.
    """

    f_u: ndarray
    f_v: ndarray
    area_vectors: ndarray
    areas: ndarray
    e: ndarray
    m: ndarray
    degenerate: ndarray


def derivatives(points: ndarray, operator: csr_matrix) -> Derivatives:
    """Return the first derivatives of surfaces, and what follows from them.

    det g = ‖f_u × f_v‖² comes with relative errors of ε times the aspect ratio of a triangle; from
    rounded entries of g, the square of that ratio would count.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces.
    operator : csr_matrix, shape (2F, V)
        The template's differential operator: rows of f_u, then rows of f_v.

    Returns
    -------
    Derivatives
    """
    return follow_up(*partial_derivatives(points, operator))


def follow_up(f_u: ndarray, f_v: ndarray, bound: float = DEGENERATE) -> Derivatives:
    """Return first derivatives with what follows from them.

    Parameters
    ----------
    f_u, f_v : array, shape (..., 3)
        Partial derivatives.
    bound : float
        Squared sine of their angle up to which a triangle is degenerate.

    Returns
    -------
    Derivatives
    """
    area_vectors = np.cross(f_u, f_v)
    squared, e = dot(area_vectors, area_vectors), dot(f_u, f_u)
    degenerate = squared <= bound * e * dot(f_v, f_v)
    areas = np.sqrt(np.where(degenerate, 1.0, squared))
    e = np.where(degenerate, 1.0, e)
    return Derivatives(f_u, f_v, area_vectors, areas, e, dot(f_u, f_v), degenerate)


def frame_components(first: Derivatives, h_u: ndarray, h_v: ndarray) -> ndarray:
    r"""Return the derivatives of deformations along and across each triangle.

    In the orthonormal frame e₁ ∥ f_u, e₂, n of a triangle of the surface, a deformation h has the
    components e_i·∂_j h and n·∂_j h, with ε_ij = ½(e_i·∂_j h + e_j·∂_i h) and

    .. math:: \operatorname{tr}((g^{-1}\delta g_0)^2) = 2(\varepsilon_{11} - \varepsilon_{22})^2
              + 8\varepsilon_{12}^2, \quad \operatorname{tr}(g^{-1}\delta g)
              = 2(\varepsilon_{11} + \varepsilon_{22}), \quad
              \delta n = -(n\cdot\partial_1 h)\, e_1 - (n\cdot\partial_2 h)\, e_2 .

    Taken from g and n and their changes, slivers would lose the digits of their aspect ratio.

    Parameters
    ----------
    first : Derivatives
        Those of the surface, whose triangles have an area.
    h_u, h_v : array, shape (..., F, 3)
        Partial derivatives of the deformation.

    Returns
    -------
    array, shape (..., F, 6)
        e₁·∂₁h, e₁·∂₂h, e₂·∂₁h, e₂·∂₂h, n·∂₁h, n·∂₂h.
    """
    p, x, y = (value[..., None] for value in (np.sqrt(first.e), first.m / first.e, first.areas))
    y = y / p**2
    e1, e2 = first.f_u / p, (first.f_v - x * first.f_u) / (y * p)
    along, across = h_u / p, (h_v - x * h_u) / (y * p)
    axes = (e1, e2, first.area_vectors / first.areas[..., None])
    return np.stack([dot(axis, h) for axis in axes for h in (along, across)], axis=-1)


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
    f_u, f_v = np.split(apply_operator(operator, points), 2, axis=-2)
    return f_u, f_v


@primitive
def apply_operator(operator: csr_matrix, values: ndarray) -> ndarray:
    """Apply a sparse operator along the second to last axis.

    Registered as an autograd primitive whose transpose is the transposed operator: gathering
    vertices by index has a transpose far slower than its forward pass.

    Parameters
    ----------
    operator : csr_matrix, shape (m, V)
        The linear operator.
    values : array, shape (..., V, d)
        Values at the vertices.

    Returns
    -------
    array, shape (..., m, d)
    """
    if values.ndim == 2:
        return operator @ values
    *leading, length, width = values.shape
    columns = np.moveaxis(values, -2, 0).reshape(length, math.prod(leading) * width)
    images = (operator @ columns).reshape(operator.shape[0], *leading, width)
    return np.moveaxis(images, 0, -2)


defvjp(
    apply_operator,
    lambda answer, operator, values: lambda upstream: apply_operator(operator.T, upstream),
    argnums=(1,),
)
defjvp(
    apply_operator,
    lambda tangent, answer, operator, values: apply_operator(operator, tangent),
    argnums=(1,),
)


@primitive
def dot(a: ndarray, b: ndarray) -> ndarray:
    """Return the inner products of vectors along the last axis.

    Registered as an autograd primitive: a sum of products takes four times as long.

    Parameters
    ----------
    a, b : array, shape (..., n)
        Vectors.

    Returns
    -------
    array, shape (...)
    """
    return np.einsum("...i,...i->...", a, b)


defvjp(
    dot,
    lambda answer, a, b: unbroadcast_f(a, lambda upstream: np.expand_dims(upstream, -1) * b),
    lambda answer, a, b: unbroadcast_f(b, lambda upstream: np.expand_dims(upstream, -1) * a),
)
defjvp(
    dot,
    lambda tangent, answer, a, b: dot(tangent, b),
    lambda tangent, answer, a, b: dot(a, tangent),
)


@primitive
def symmetric_matrices(e: ndarray, m: ndarray, g: ndarray) -> ndarray:
    """Return the matrices [[e, m], [m, g]].

    Registered as an autograd primitive: the transpose of stacking adds up entry by entry.

    Parameters
    ----------
    e, m, g : array, shape (...)
        Entries, all of one shape.

    Returns
    -------
    array, shape (..., 2, 2)

    Raises
    ------
    ArgumentError
        If the shapes differ.
    """
    shapes = np.shape(e), np.shape(m), np.shape(g)
    if len(set(shapes)) > 1:
        raise ArgumentError(f"entries of matrices must be of one shape; found {shapes}")
    matrices = np.empty((*shapes[0], 2, 2))
    matrices[..., 0, 0], matrices[..., 1, 1] = e, g
    matrices[..., 0, 1] = matrices[..., 1, 0] = m
    return matrices


defvjp(
    symmetric_matrices,
    lambda answer, e, m, g: lambda upstream: entry(upstream, 0, 0),
    lambda answer, e, m, g: lambda upstream: entry(upstream, 0, 1) + entry(upstream, 1, 0),
    lambda answer, e, m, g: lambda upstream: entry(upstream, 1, 1),
)
defjvp(
    symmetric_matrices,
    lambda tangent, answer, e, m, g: symmetric_matrices(tangent, 0.0 * m, 0.0 * g),
    lambda tangent, answer, e, m, g: symmetric_matrices(0.0 * e, tangent, 0.0 * g),
    lambda tangent, answer, e, m, g: symmetric_matrices(0.0 * e, 0.0 * m, tangent),
)


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
    area_vectors = np.cross(f_u, f_v)
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
    area_vectors = np.cross(f_u, f_v)
    areas = np.sqrt(dot(area_vectors, area_vectors))[..., None]
    normals = area_vectors / areas
    change = (np.cross(h_u, f_v) + np.cross(f_u, h_v)) / areas
    return change - dot(normals, change)[..., None] * normals


def is_degenerate(f_u: ndarray, f_v: ndarray, bound: float = DEGENERATE) -> ndarray:
    """Tell the triangles on which g is singular to working precision, see `Derivatives`.

    Parameters
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Partial derivatives.
    bound : float
        See `follow_up`.

    Returns
    -------
    array of bool, shape (..., F)
    """
    return follow_up(f_u, f_v, bound).degenerate


def refuse_degenerate(degenerate: ndarray, name: str = "the surface") -> None:
    """Refuse surfaces with triangles without area.

    Parameters
    ----------
    degenerate : array of bool, shape (..., F)
        Which triangles of the surfaces have no area.
    name : str
        Name of the argument, for messages.

    Raises
    ------
    DegenerateSurfaceError
        If there is one.
    """
    refuse_triangles(
        degenerate,
        f"every triangle of {name} must have an area, for its normal to exist and g to be "
        "invertible",
        DegenerateSurfaceError,
    )


def refuse_triangles(bad: ndarray, message: str, error: type[Exception]) -> None:
    """Raise an error naming the first bad triangle, its surface if there are several, the count.

    Parameters
    ----------
    bad : array of bool, shape (..., F)
        Triangles to refuse.
    message : str
        What was expected.
    error : type
        Class of the error.
    """
    if not bad.any():
        return
    *leading, triangle = (int(i) for i in np.argwhere(bad)[0])
    where = f" of item {tuple(leading)}" if leading else ""
    count = int(bad.sum())
    others = "" if count == 1 else f", the first of {count} such triangles"
    raise error(f"{message}; found otherwise at triangle {triangle}{where}{others}")
