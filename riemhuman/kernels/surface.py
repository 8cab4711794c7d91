r"""First fundamental forms and normals of triangulated surfaces, differentiable with autograd.

On template triangle t, with corners (0, 0), (u₂, 0), (u₃, v₃) in its own orthonormal frame, a
surface f with corners q₁, q₂, q₃ has

.. math:: f_u = (q_2 - q_1)/u_2, \qquad
          f_v = (q_3 - q_1)/v_3 - \frac{u_3}{v_3 u_2}(q_2 - q_1)

(supplement of the paper; its tan θ is corrected to u₃/v₃ = cot θ).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import autograd.numpy as np
import numpy as onp
from autograd.core import make_vjp
from autograd.extend import defjvp, defvjp, primitive
from autograd.numpy.numpy_vjps import unbroadcast_f
from scipy.sparse import csr_array, csr_matrix

from riemhuman.arrays import Array, Booleans, Points, TangentVectors, Triangles
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import of_one_kind

DEGENERATE = 8 * np.finfo(float).eps
"""Triangles count as degenerate below this squared sine of the angle between f_u and f_v."""

NEARLY_DEGENERATE = 2 * DEGENERATE
"""Below this squared sine, another order of summation may make a triangle degenerate."""


class Derivatives(NamedTuple):
    """First derivatives of surfaces on every triangle, and quantities derived from them.

    `rh.terms.Term.fields` and `rh.terms.FlatTerm.field` receive this object.

    Attributes
    ----------
    f_u, f_v : array, shape (..., F, 3)
        Derivatives in the orthonormal frame of the template's triangles.
    area_vectors : array, shape (..., F, 3)
        f_u × f_v, the unit normal times the area ratio.
    areas : array, shape (..., F)
        Areas in units of the template's; 1 on degenerate triangles.
    e, m : array, shape (..., F)
        Entries of the first fundamental form, ‖f_u‖², 1 on degenerate triangles, and f_u · f_v.
    degenerate : array of bool, shape (..., F)
        Which triangles have no area, to working precision.

    Examples
    --------
    >>> class Normals(rh.terms.FlatTerm):
    ...     needs_area = True
    ...
    ...     def field(self, first: rh.terms.Derivatives):
    ...         return first.area_vectors / first.areas[..., None]
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [Normals()])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    f_u: Array
    f_v: Array
    area_vectors: Array
    areas: Array
    e: Array
    m: Array
    degenerate: Booleans


def derivatives(points: Points, operator: csr_matrix) -> Derivatives:
    """Return the first derivatives of surfaces with the quantities computed from them."""
    # det g = ‖f_u × f_v‖² comes with relative errors of ε times the aspect ratio of a triangle;
    # from rounded entries of g, the square of that ratio would count.
    return follow_up(*partial_derivatives(points, operator))


def follow_up(f_u: Array, f_v: Array) -> Derivatives:
    """Return first derivatives with the quantities computed from them."""
    area_vectors = np.cross(f_u, f_v)
    squared, e = dot(area_vectors, area_vectors), dot(f_u, f_u)
    degenerate = squared <= DEGENERATE * e * dot(f_v, f_v)
    areas = np.sqrt(np.where(degenerate, 1.0, squared))
    e = np.where(degenerate, 1.0, e)
    return Derivatives(f_u, f_v, area_vectors, areas, e, dot(f_u, f_v), degenerate)


def frame_components(first: Derivatives, h_u: Array, h_v: Array) -> Array:
    r"""Return the derivatives of deformations along and across each triangle.

    In the orthonormal frame e₁ ∥ f_u, e₂, n of a triangle of the surface, a deformation h has the
    components e_i·∂_j h and n·∂_j h, with ε_ij = ½(e_i·∂_j h + e_j·∂_i h) and

    .. math:: \operatorname{tr}((g^{-1}\delta g_0)^2) = 2(\varepsilon_{11} - \varepsilon_{22})^2
              + 8\varepsilon_{12}^2, \quad \operatorname{tr}(g^{-1}\delta g)
              = 2(\varepsilon_{11} + \varepsilon_{22}), \quad
              \delta n = -(n\cdot\partial_1 h)\, e_1 - (n\cdot\partial_2 h)\, e_2 .

    Taken from g and n and their changes, slivers would lose the digits of their aspect ratio.
    """
    # The corners of the triangle f_u, f_v in its own frame: (p, 0) and (x p, y p).
    p = np.sqrt(first.e)[..., None]
    x = (first.m / first.e)[..., None]
    y = first.areas[..., None] / p**2
    e1, e2 = first.f_u / p, (first.f_v - x * first.f_u) / (y * p)
    normal = first.area_vectors / first.areas[..., None]
    along, across = h_u / p, (h_v - x * h_u) / (y * p)
    components = [
        dot(e1, along),
        dot(e1, across),
        dot(e2, along),
        dot(e2, across),
        dot(normal, along),
        dot(normal, across),
    ]
    return np.stack(components, axis=-1)


Forms = Sequence[tuple[Array, Array]]
"""Quadratic forms, shape (6, 6) or (..., F, 6, 6), each with a scale for every triangle."""


def product_by_forms(
    h: TangentVectors, k: TangentVectors, first: Derivatives, operator: csr_matrix, forms: Forms
) -> Array:
    """Return the sums over triangles of quadratic forms of `frame_components` of h and k."""
    along_h = frame_components(first, *partial_derivatives(h, operator))
    along_k = along_h
    if k is not h:
        along_k = frame_components(first, *partial_derivatives(k, operator))
    total = np.zeros(())
    for form, scale in forms:
        if form.ndim == 2:
            values = dot(np.matmul(along_h, form), along_k)
        else:
            values = np.einsum("...i,...ij,...j->...", along_h, form, along_k)
        total = total + np.sum(scale * values, axis=-1)
    return total


def add_blocks(blocks: Array, f: Points, faces: Triangles, forms: Forms) -> None:
    """Add quadratic forms of `frame_components` as forms of the nine numbers of corners."""
    surface = of_one_kind(f)
    for form, scale in forms:
        stacked = form.reshape(-1, 6, 6)  # one for all triangles, or one for each
        _add_blocks(blocks, surface, faces, of_one_kind(stacked), of_one_kind(scale))


@compiled
def _add_blocks(blocks: Array, f: Points, faces: Triangles, forms: Array, scales: Array) -> None:
    """Add one form to the blocks, or each triangle's own."""
    axes, edges = onp.empty((3, 3)), onp.empty((2, 3))
    # How ∂₁h and ∂₂h depend on the corners.
    along = onp.zeros((2, 3))
    # The form with one side, then both, in space: rows and columns are pairs (axis, derivative).
    turned, in_space = onp.empty((6, 6)), onp.empty((6, 6))
    for t in range(len(faces)):
        for d in range(3):
            edges[0, d] = f[faces[t, 1], d] - f[faces[t, 0], d]
            edges[1, d] = f[faces[t, 2], d] - f[faces[t, 0], d]
        x, y = edges[0], edges[1]
        n0, n1, n2 = _cross(x[0], x[1], x[2], y[0], y[1], y[2])
        squared, xx = n0 * n0 + n1 * n1 + n2 * n2, x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        yy = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
        degenerate = squared <= DEGENERATE * xx * yy
        p = 1.0 if degenerate else math.sqrt(xx)
        over_r = 0.0 if degenerate else p / math.sqrt(squared)
        for d in range(3):
            axes[0, d] = x[d] / p
        axes[2, 0], axes[2, 1], axes[2, 2] = n0 * over_r / p, n1 * over_r / p, n2 * over_r / p
        e1, e3 = axes[0], axes[2]
        axes[1, 0], axes[1, 1], axes[1, 2] = _cross(e3[0], e3[1], e3[2], e1[0], e1[1], e1[2])
        skew = y[0] * e1[0] + y[1] * e1[1] + y[2] * e1[2]
        along[0, 1], along[1, 1], along[1, 2] = 1.0 / p, -skew * over_r / p, over_r
        along[0, 0], along[1, 0] = -along[0, 1], -along[1, 1] - along[1, 2]
        form, scale = forms[t if len(forms) > 1 else 0], scales[t]
        for row in range(6):
            for d in range(3):
                for j in range(2):
                    turned[row, 2 * d + j] = (
                        form[row, j] * axes[0, d]
                        + form[row, 2 + j] * axes[1, d]
                        + form[row, 4 + j] * axes[2, d]
                    )
        for column in range(6):
            for d in range(3):
                for j in range(2):
                    in_space[2 * d + j, column] = scale * (
                        turned[j, column] * axes[0, d]
                        + turned[2 + j, column] * axes[1, d]
                        + turned[4 + j, column] * axes[2, d]
                    )
        block = blocks[t]
        for a in range(3):
            for b in range(3):
                aa, ab = along[0, a] * along[0, b], along[0, a] * along[1, b]
                ba, bb = along[1, a] * along[0, b], along[1, a] * along[1, b]
                for d in range(3):
                    for e in range(3):
                        block[3 * a + d, 3 * b + e] += (
                            aa * in_space[2 * d, 2 * e]
                            + ab * in_space[2 * d, 2 * e + 1]
                            + ba * in_space[2 * d + 1, 2 * e]
                            + bb * in_space[2 * d + 1, 2 * e + 1]
                        )


def triangle_corners(points: Points, faces: Triangles) -> tuple[Array, Array, Array]:
    """Return the first, the second and the third corners of all triangles, shape (..., F, 3)."""
    return points[..., faces[:, 0], :], points[..., faces[:, 1], :], points[..., faces[:, 2], :]


def doubled_area_vectors(points: Points, faces: Triangles) -> Array:
    """Return normals of triangles, twice as long as their areas, shape (..., F, 3)."""
    corner_1, corner_2, corner_3 = triangle_corners(points, faces)
    vectors: Array = onp.cross(corner_2 - corner_1, corner_3 - corner_1)
    return vectors


def partial_derivatives(points: Points, operator: csr_matrix) -> tuple[Array, Array]:
    """Return f_u and f_v of every triangle."""
    f_u, f_v = np.split(apply_operator(operator, points), 2, axis=-2)
    return f_u, f_v


def differential(
    map: Callable[[Array], Array], tangent_vec: TangentVectors, base_point: Points
) -> Array:
    r"""Apply the differential of a map to tangent vectors, :math:`d_x\varphi(v)`.

    The transposed differential :math:`w \mapsto d_x\varphi^T w` that reverse-mode automatic
    differentiation gives is linear in w, so its own gradient along v is :math:`d_x\varphi(v)`. This
    needs only reverse-mode rules, which every autograd function has.
    """
    pull_back, image = make_vjp(map, base_point)
    transposed, _ = make_vjp(pull_back, np.zeros_like(image))
    return transposed(tangent_vec)


@primitive
def square_root(x: Array) -> Array:
    """Return the square root, with subgradient 0 at 0 (rounding below 0 counts as 0)."""
    return np.sqrt(np.maximum(x, 0.0))


def _square_root_slope(answer: Array) -> Array:
    return np.where(answer > 0, 0.5 / np.where(answer > 0, answer, 1.0), 0.0)


defvjp(
    square_root,
    lambda answer, x: lambda upstream: upstream * _square_root_slope(square_root(x)),
)


@primitive
def apply_operator(operator: csr_matrix, values: Array) -> Array:
    """Apply a sparse operator along the second to last axis."""
    # By autograd, the transpose of gathering vertices by index is far slower than its forward pass.
    if values.ndim == 2:
        applied: Array = operator @ values
        return applied
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
def dot(a: Array, b: Array) -> Array:
    """Return the inner products of vectors along the last axis; sums of products take longer."""
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


def joined_axes(array: Array, n_axes: int) -> Array:
    """Return an array, or an empty stack of arrays, with the last axes joined to one."""
    shape = np.shape(array)
    n_leading = len(shape) - n_axes
    return np.reshape(array, (*shape[:n_leading], math.prod(shape[n_leading:])))


def symmetric_matrices(e: Array, m: Array, g: Array) -> Array:
    """Return the matrices [[e, m], [m, g]]."""
    return np.reshape(np.stack([e, m, m, g], axis=-1), (*np.shape(e), 2, 2))


def first_fundamental_form(f_u: Array, f_v: Array) -> Array:
    """Return g = [[f_u·f_u, f_u·f_v], [f_u·f_v, f_v·f_v]]."""
    return symmetric_matrices(dot(f_u, f_u), dot(f_u, f_v), dot(f_v, f_v))


def unit_normals(f_u: Array, f_v: Array) -> Array:
    """Return n = f_u × f_v / ‖f_u × f_v‖; not defined on triangles without area."""
    area_vectors = np.cross(f_u, f_v)
    return area_vectors / np.sqrt(dot(area_vectors, area_vectors))[..., None]


def is_degenerate(f_u: Array, f_v: Array) -> Booleans:
    """Return on which triangles g is singular to working precision, see `Derivatives`."""
    return follow_up(f_u, f_v).degenerate


def refuse_degenerate(degenerate: Booleans, name: str = "the surface") -> None:
    """Refuse surfaces with triangles without area."""
    refuse_triangles(
        degenerate,
        f"every triangle of {name} must have an area, for its normal to exist and g to be "
        "invertible",
        DegenerateSurfaceError,
    )


def refuse_triangles(
    bad: Booleans,
    message: str,
    error: type[Exception],
    names: tuple[str, str] = ("triangle", "triangles"),
) -> None:
    """Raise an error naming the first bad triangle, its surface if there are several, the count."""
    if not bad.any():
        return
    *leading, first = (int(i) for i in np.argwhere(bad)[0])
    where = f" of item {tuple(leading)}" if leading else ""
    count = int(bad.sum())
    total = "" if count == 1 else f", the first of {count} such {names[1]}"
    raise error(f"{message}; found otherwise at {names[0]} {first}{where}{total}")


def triangle_frames(points: Points, operator: csr_matrix) -> Array:
    """Return the matrices with columns f_u, f_v and n."""
    f_u, f_v = partial_derivatives(points, operator)
    return np.stack([f_u, f_v, unit_normals(f_u, f_v)], axis=-1)


def polar_frames(f_u: Array, f_v: Array) -> Array:
    r"""Return the orthonormal frames of polar decompositions, and the normal as third column.

    The differential of a surface is df = Q √g with Q isometric. In the plane of the triangle, Q is
    df plus its cofactors, divided by :math:`\mathrm{tr}\sqrt g`:

    .. math:: Q = (f_u + f_v \times n, \; f_v + n \times f_u) / \mathrm{tr}\sqrt g
    """
    n = unit_normals(f_u, f_v)
    q_u, q_v = f_u + np.cross(f_v, n), f_v + np.cross(n, f_u)
    trace = np.sqrt(dot(q_u, q_u))[..., None]
    return np.stack([q_u / trace, q_v / trace, n], axis=-1)


@compiled
def fill_rotations(f_u: Array, f_v: Array, axes: Array, rotations: Array) -> bool:
    """Fill `polar_frames` times axes transposed; return whether every triangle has an area."""
    for t in range(len(f_u)):
        u0, u1, u2 = f_u[t, 0], f_u[t, 1], f_u[t, 2]
        v0, v1, v2 = f_v[t, 0], f_v[t, 1], f_v[t, 2]
        n0, n1, n2 = _cross(u0, u1, u2, v0, v1, v2)
        squared = n0 * n0 + n1 * n1 + n2 * n2
        e, g = u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2
        if squared <= DEGENERATE * e * g:
            return False
        length = math.sqrt(squared)
        n0, n1, n2 = n0 / length, n1 / length, n2 / length
        a0, a1, a2 = _cross(v0, v1, v2, n0, n1, n2)
        b0, b1, b2 = _cross(n0, n1, n2, u0, u1, u2)
        a0, a1, a2, b0, b1, b2 = a0 + u0, a1 + u1, a2 + u2, b0 + v0, b1 + v1, b2 + v2
        trace = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        for j in range(3):
            x, y, z = axes[t, j, 0] / trace, axes[t, j, 1] / trace, axes[t, j, 2]
            rotations[t, 0, j] = a0 * x + b0 * y + n0 * z
            rotations[t, 1, j] = a1 * x + b1 * y + n1 * z
            rotations[t, 2, j] = a2 * x + b2 * y + n2 * z
    return True


@compiled(forceinline=True)
def _cross(
    x0: float, x1: float, x2: float, y0: float, y1: float, y2: float
) -> tuple[float, float, float]:
    return x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0


def deformation_gradients(before: Array, after: Array) -> Array:
    """Return the matrices that take one surface's triangles and normals to another's."""
    return after @ np.linalg.inv(before)


def stacked_derivatives(frames: Array) -> Array:
    """Return f_u of all triangles, then f_v, as the template's operator does."""
    return np.concatenate([frames[..., 0], frames[..., 1]], axis=-2)


def cotangent_laplacian(f: Points, faces: Triangles) -> csr_array:
    r"""Return the matrix L of the Dirichlet energy hᵀL h of functions linear on every triangle.

    :math:`h^T L h = \sum_t w_t (h_u^2 + h_v^2)` with the areas w of the triangles; open and
    non-manifold meshes have it as well.
    """
    corners = f[faces]
    # Half the cotangents of the angles are inner products of the edges opposite them, over 4 areas.
    edges = onp.roll(corners, -1, axis=1) - onp.roll(corners, 1, axis=1)
    double_areas = onp.linalg.norm(onp.cross(edges[:, 0], edges[:, 1]), axis=1)
    entries = edges @ onp.swapaxes(edges, 1, 2) / (2.0 * double_areas)[:, None, None]
    places = onp.repeat(faces, 3, axis=1).ravel(), onp.tile(faces, 3).ravel()
    return csr_array((entries.ravel(), places), shape=(len(f), len(f)))


def vertex_normals(points: Points, faces: Triangles) -> Array:
    """Return unit normals of the vertices, averaged over their triangles with areas as weights."""
    area_vectors = onp.repeat(doubled_area_vectors(points, faces), 3, axis=0)
    sums = [onp.bincount(faces.ravel(), column, len(points)) for column in area_vectors.T]
    return unit_vectors(onp.stack(sums, axis=1))


def unit_vectors(vectors: TangentVectors) -> Array:
    """Return vectors at unit length; zero vectors stay zero."""
    lengths = onp.linalg.norm(vectors, axis=-1, keepdims=True)
    scaled: Array = onp.divide(vectors, lengths, out=onp.zeros_like(vectors), where=lengths > 0)
    return scaled
