r"""The L² term of deformations on the moving surface, :math:`\int \langle h, k\rangle\, dA`.

Masses are lumped: every vertex carries a third of the area of the triangles around it.
"""

from __future__ import annotations

import math

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array, diags_array, eye_array, kron

from riemhuman.kernels import surface
from riemhuman.kernels.compilation import njit
from riemhuman.kernels.linear import apply_operator
from riemhuman.kernels.moving_frames import (
    add_area_slope,
    fill_edges,
    is_worth_threads,
    sums_in_chunks,
)


def corner_averages(faces: ndarray, n_vertices: int) -> csr_array:
    """Return the matrix that takes values at vertices to their means over triangles.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    n_vertices : int
        Number of vertices V.

    Returns
    -------
    csr_array, shape (F, V)
    """
    ends = np.arange(0, faces.size + 1, 3)
    return csr_array(
        (np.full(faces.size, 1.0 / 3.0), faces.ravel(), ends), shape=(len(faces), n_vertices)
    )


def vertex_areas(f: ndarray, operator: csr_array, areas: ndarray, averages: csr_array) -> ndarray:
    """Return a third of the area of the triangles around each vertex, differentiably.

    Parameters
    ----------
    f : array, shape (..., V, 3)
        Surfaces whose triangles have an area.
    operator : csr_array, shape (2F, V)
        The template's differential operator.
    areas : array, shape (F,)
        Template areas w_t.
    averages : csr_array, shape (F, V)
        See `corner_averages`.

    Returns
    -------
    array, shape (..., V)
    """
    area_vectors = surface.cross(*surface.partial_derivatives(f, operator))
    own = areas * np.sqrt(surface.dot(area_vectors, area_vectors))
    return apply_operator(averages.T, own[..., None])[..., 0]


def inner_product(
    h: ndarray, k: ndarray, f: ndarray, operator: csr_array, areas: ndarray, averages: csr_array
) -> ndarray:
    """Return Σ_v A_v ⟨h_v, k_v⟩ with the vertex areas A of the surface: the definition.

    Parameters
    ----------
    h, k : array, shape (..., V, 3)
        Deformations.
    f : array, shape (..., V, 3)
        Surfaces whose triangles have an area.
    operator : csr_array, shape (2F, V)
        The template's differential operator.
    areas : array, shape (F,)
        Template areas w_t.
    averages : csr_array, shape (F, V)
        See `corner_averages`.

    Returns
    -------
    array, shape (...)
    """
    masses = vertex_areas(f, operator, areas, averages)
    return np.sum(masses * surface.dot(h, k), axis=-1)


def matrix(masses: ndarray) -> csr_array:
    """Return the diagonal matrix of `inner_product` at a surface.

    Parameters
    ----------
    masses : array, shape (V,)
        Vertex areas of the surface.

    Returns
    -------
    csr_array, shape (3V, 3V)
    """
    return csr_array(kron(diags_array(masses), eye_array(3)))


@njit(nogil=True, error_model="numpy")
def _squared_norms(
    vectors: ndarray,
    surfaces: ndarray,
    faces: ndarray,
    first: int,
    last: int,
    vector_slopes: ndarray,
    surface_slopes: ndarray,
) -> float:
    edges = onp.empty((2, 3))
    total = 0.0
    for t in range(first, last):
        for i in range(surfaces.shape[1]):
            area = fill_edges(surfaces, faces[t], i, edges)
            if area == 0.0:
                total = math.inf
                continue
            squared = 0.0
            for corner in faces[t]:
                for d in range(3):
                    squared += vectors[corner, i, d] ** 2
                    vector_slopes[corner, i, d] += 2.0 / 3.0 * area * vectors[corner, i, d]
            total += area * squared / 3.0
            add_area_slope(surface_slopes, faces[t], i, edges, area, squared / 3.0)
    return total


def squared_norms_and_slopes(
    vectors: ndarray, surfaces: ndarray, faces: ndarray
) -> tuple[float, ndarray, ndarray]:
    """Return the sum of the squared norms of deformations, each at its surface, and its slopes.

    Parameters
    ----------
    vectors, surfaces : array, shape (V, n, 3)
        Deformations and surfaces, vertex by vertex.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    value : float
        Infinite where a triangle has no area.
    vector_slopes, surface_slopes : array, shape (V, n, 3)
        Slopes in the deformations and in the surfaces.
    """

    def run(first: int, last: int) -> tuple[float, ndarray, ndarray]:
        slopes = np.zeros(surfaces.shape), np.zeros(surfaces.shape)
        value = _squared_norms(vectors, surfaces, faces, first, last, *slopes)
        return value, *slopes

    return sums_in_chunks(run, len(faces), threaded=is_worth_threads(surfaces, faces))
