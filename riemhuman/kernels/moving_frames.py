r"""Orthonormal frames of the triangles of many surfaces, shared by compiled loops.

At corners q₁, q₂, q₃ of a triangle, e₁ runs along q₂ − q₁, e₂ across it within the plane and e₃ is
the normal; q₂ − q₁ = p e₁ and q₃ − q₁ = q e₁ + r e₂. Surfaces are stored vertex by vertex, with all
times side by side, so that what one triangle reads lies close together.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compiled import compiled
from riemhuman.kernels.surface import DEGENERATE

# Below this many triangles times surfaces, threads cost more than they bring.
_WORTH_THREADS = 20_000


@compiled(inline="always")
def frame_of(surfaces: ndarray, face: ndarray, i: int) -> tuple[float, ...]:
    """Return the frame of a triangle at time i.

    Parameters
    ----------
    surfaces : array, shape (V, n, 3)
        Surfaces, vertex by vertex.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.

    Returns
    -------
    tuple of 13 floats
        The area, 0 where the corners are collinear to working precision; 1/p, 1/r and q/(p r);
        e₁, e₂, e₃.
    """
    one, two, three = face[0], face[1], face[2]
    x0 = surfaces[two, i, 0] - surfaces[one, i, 0]
    x1 = surfaces[two, i, 1] - surfaces[one, i, 1]
    x2 = surfaces[two, i, 2] - surfaces[one, i, 2]
    y0 = surfaces[three, i, 0] - surfaces[one, i, 0]
    y1 = surfaces[three, i, 1] - surfaces[one, i, 1]
    y2 = surfaces[three, i, 2] - surfaces[one, i, 2]
    n0, n1, n2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    xx = x0 * x0 + x1 * x1 + x2 * x2
    if squared <= DEGENERATE * xx * (y0 * y0 + y1 * y1 + y2 * y2):
        squared, xx = 0.0, 1.0
    double_area, p = math.sqrt(squared), math.sqrt(xx)
    over_p = 1.0 / p
    over_r = p / double_area if squared > 0.0 else 0.0
    flat = over_p * over_r
    x0, x1, x2 = x0 * over_p, x1 * over_p, x2 * over_p
    n0, n1, n2 = n0 * flat, n1 * flat, n2 * flat
    skew = (y0 * x0 + y1 * x1 + y2 * x2) * flat
    z0, z1, z2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
    area = 0.5 * double_area
    return area, over_p, over_r, skew, x0, x1, x2, z0, z1, z2, n0, n1, n2


@compiled(inline="always")
def fill_axes(
    surfaces: ndarray, face: ndarray, i: int, axes: ndarray
) -> tuple[float, float, float, float]:
    """Fill e₁, e₂, e₃ of a triangle at time i as rows, and return what else `frame_of` does.

    Parameters
    ----------
    surfaces : array, shape (V, n, 3)
        Surfaces, vertex by vertex.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.
    axes : array, shape (3, 3)
        Filled.

    Returns
    -------
    tuple of 4 floats
        The area; 1/p, 1/r and q/(p r).
    """
    area, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame_of(surfaces, face, i)
    axes[0, 0], axes[0, 1], axes[0, 2] = a0, a1, a2
    axes[1, 0], axes[1, 1], axes[1, 2] = b0, b1, b2
    axes[2, 0], axes[2, 1], axes[2, 2] = c0, c1, c2
    return area, over_p, over_r, skew


@compiled(inline="always")
def derivatives_in_frame(
    vectors: ndarray, face: ndarray, i: int, frame: tuple[float, ...]
) -> tuple[float, ...]:
    """Return M_kj = e_k·∂_j h, the derivatives of a deformation h along e₁ and e₂.

    Parameters
    ----------
    vectors : array, shape (V, n, 3)
        Deformations, vertex by vertex.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.
    frame : tuple of 13 floats
        See `frame_of`.

    Returns
    -------
    tuple of 6 floats
        M₁₁, M₁₂, M₂₁, M₂₂, M₃₁, M₃₂.
    """
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    one, two, three = face[0], face[1], face[2]
    x0 = vectors[two, i, 0] - vectors[one, i, 0]
    x1 = vectors[two, i, 1] - vectors[one, i, 1]
    x2 = vectors[two, i, 2] - vectors[one, i, 2]
    y0 = over_r * (vectors[three, i, 0] - vectors[one, i, 0]) - skew * x0
    y1 = over_r * (vectors[three, i, 1] - vectors[one, i, 1]) - skew * x1
    y2 = over_r * (vectors[three, i, 2] - vectors[one, i, 2]) - skew * x2
    x0, x1, x2 = over_p * x0, over_p * x1, over_p * x2
    return (
        a0 * x0 + a1 * x1 + a2 * x2,
        a0 * y0 + a1 * y1 + a2 * y2,
        b0 * x0 + b1 * x1 + b2 * x2,
        b0 * y0 + b1 * y1 + b2 * y2,
        c0 * x0 + c1 * x1 + c2 * x2,
        c0 * y0 + c1 * y1 + c2 * y2,
    )


@compiled(inline="always")
def add_to_corners(
    slopes: ndarray, face: ndarray, i: int, frame: tuple[float, ...], entries: tuple[float, ...]
) -> None:
    """Add the slopes at the corners of a function with slopes Γ_kj in e_k·∂_j h.

    The transpose of `derivatives_in_frame`.

    Parameters
    ----------
    slopes : array, shape (V, n, 3)
        Added to.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.
    frame : tuple of 13 floats
        See `frame_of`.
    entries : tuple of 6 floats
        Γ₁₁, Γ₁₂, Γ₂₁, Γ₂₂, Γ₃₁, Γ₃₂.
    """
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    k11, k12, k21, k22, k31, k32 = entries
    k11, k21, k31 = (
        over_p * k11 - skew * k12,
        over_p * k21 - skew * k22,
        over_p * k31 - skew * k32,
    )
    k12, k22, k32 = over_r * k12, over_r * k22, over_r * k32
    one, two, three = face[0], face[1], face[2]
    x0, y0 = k11 * a0 + k21 * b0 + k31 * c0, k12 * a0 + k22 * b0 + k32 * c0
    x1, y1 = k11 * a1 + k21 * b1 + k31 * c1, k12 * a1 + k22 * b1 + k32 * c1
    x2, y2 = k11 * a2 + k21 * b2 + k31 * c2, k12 * a2 + k22 * b2 + k32 * c2
    slopes[one, i, 0] -= x0 + y0
    slopes[one, i, 1] -= x1 + y1
    slopes[one, i, 2] -= x2 + y2
    slopes[two, i, 0] += x0
    slopes[two, i, 1] += x1
    slopes[two, i, 2] += x2
    slopes[three, i, 0] += y0
    slopes[three, i, 1] += y1
    slopes[three, i, 2] += y2


@compiled(inline="always")
def fill_edges(surfaces: ndarray, face: ndarray, i: int, edges: ndarray) -> float:
    """Fill the edges q₂ − q₁ and q₃ − q₁ of a triangle at time i; return its area.

    Parameters
    ----------
    surfaces : array, shape (V, n, 3)
        Surfaces, vertex by vertex.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.
    edges : array, shape (2, 3)
        Filled.

    Returns
    -------
    float
        0 where the corners are collinear to working precision.
    """
    one, two, three = face[0], face[1], face[2]
    xx = yy = 0.0
    for d in range(3):
        edges[0, d] = surfaces[two, i, d] - surfaces[one, i, d]
        edges[1, d] = surfaces[three, i, d] - surfaces[one, i, d]
        xx += edges[0, d] * edges[0, d]
        yy += edges[1, d] * edges[1, d]
    n0 = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
    n1 = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
    n2 = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    squared = n0 * n0 + n1 * n1 + n2 * n2
    return 0.5 * math.sqrt(squared) if squared > DEGENERATE * xx * yy else 0.0


@compiled(inline="always")
def add_area_slope(
    slopes: ndarray, face: ndarray, i: int, edges: ndarray, area: float, factor: float
) -> None:
    """Add the slope of a triangle's area at its corners, times a factor.

    Parameters
    ----------
    slopes : array, shape (V, n, 3)
        Added to.
    face : array of int, shape (3,)
        Corners.
    i : int
        Time.
    edges : array, shape (2, 3)
        Edges, see `fill_edges`.
    area : float
        Area.
    factor : float
        Factor of the slope.
    """
    xx = edges[0, 0] ** 2 + edges[0, 1] ** 2 + edges[0, 2] ** 2
    xy = edges[0, 0] * edges[1, 0] + edges[0, 1] * edges[1, 1] + edges[0, 2] * edges[1, 2]
    yy = edges[1, 0] ** 2 + edges[1, 1] ** 2 + edges[1, 2] ** 2
    factor /= 4.0 * area
    for d in range(3):
        at_two = factor * (yy * edges[0, d] - xy * edges[1, d])
        at_three = factor * (xx * edges[1, d] - xy * edges[0, d])
        slopes[face[1], i, d] += at_two
        slopes[face[2], i, d] += at_three
        slopes[face[0], i, d] -= at_two + at_three


def by_vertex(surfaces: ndarray) -> ndarray:
    """Return surfaces vertex by vertex, or back.

    Parameters
    ----------
    surfaces : array, shape (n, V, 3)
        Surfaces.

    Returns
    -------
    array, shape (V, n, 3)
        C-contiguous.
    """
    return np.ascontiguousarray(np.swapaxes(surfaces, 0, 1))


def is_worth_threads(surfaces: ndarray, faces: ndarray) -> bool:
    """Tell whether loops over the triangles of surfaces gain from threads.

    Parameters
    ----------
    surfaces : array, shape (V, n, 3)
        Surfaces.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    bool
    """
    return len(faces) * surfaces.shape[1] > _WORTH_THREADS
