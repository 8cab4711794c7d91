r"""The L² term of deformations on the moving surface, :math:`\int \langle h, k\rangle\, dA`.

Masses are lumped: every vertex carries a third of the area of the triangles around it.
"""

from __future__ import annotations

import math
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array, diags_array, eye_array, kron

from riemhuman.kernels import surface
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import apply_operator
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.kernels.triangles import (
    add_area_slope,
    fill_edges,
    is_worth_threads,
)
from riemhuman.terms.quadratic import QuadraticTerm, Slopes


def corner_averages(faces: ndarray, n_vertices: int) -> csr_array:
    """Return the matrix that takes values at vertices to their means over triangles."""
    ends = np.arange(0, faces.size + 1, 3)
    return csr_array(
        (np.full(faces.size, 1.0 / 3.0), faces.ravel(), ends), shape=(len(faces), n_vertices)
    )


def vertex_areas(f: ndarray, template: Any, averages: csr_array) -> ndarray:
    """Return a third of the area of the triangles around each vertex, differentiably."""
    first = surface.derivatives(f, template.differential_operator)
    return apply_operator(averages.T, (template.face_areas * first.areas)[..., None])[..., 0]


class ZerothOrderTerm(QuadraticTerm):
    """w Σ_v A_v ⟨h_v, k_v⟩ with the vertex areas A of the surface."""

    is_translation_invariant = False

    def __init__(self, template: Any, weight: float) -> None:
        self.template, self.weight = template, weight
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        masses = vertex_areas(f, self.template, self._averages)
        return self.weight * np.sum(masses * surface.dot(h, k), axis=-1)

    def matrix(self, f: ndarray) -> csr_array:
        masses = vertex_areas(f, self.template, self._averages)
        return csr_array(kron(diags_array(self.weight * masses), eye_array(3)))

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        faces = self.template.faces

        def run(first: int, last: int) -> tuple[float, ndarray, ndarray]:
            slopes = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)
            value = _squared_norms(vectors, surfaces, faces, self.weight, first, last, *slopes)
            return value, *slopes

        return sums_in_chunks(run, len(faces), threaded=is_worth_threads(surfaces, faces))


@compiled
def _squared_norms(
    vectors: ndarray,
    surfaces: ndarray,
    faces: ndarray,
    weight: float,
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
            factor, squared = 2.0 / 3.0 * weight * area, 0.0
            for corner in faces[t]:
                for d in range(3):
                    squared += vectors[corner, i, d] ** 2
                    vector_slopes[corner, i, d] += factor * vectors[corner, i, d]
            total += 0.5 * factor * squared
            add_area_slope(surface_slopes, faces[t], i, edges, area, weight * squared / 3.0)
    return total
