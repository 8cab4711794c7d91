r"""The projection of deformations to the normals of a surface, P = n nᵀ at every vertex.

Normals of vertices are those of the triangles around them, weighted by their areas. Vertices
outside all triangles have none and are projected to 0.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array

from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.kernels import surface
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import apply_operator
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.kernels.triangles import fill_edges, is_worth_threads
from riemhuman.terms.quadratic import QuadraticTerm, Slopes
from riemhuman.terms.zeroth_order import corner_averages

# Below this share of the areas around a vertex, the sum of the area vectors is rounding error.
_CANCELLED = 1e-12


def vertex_normals(f: ndarray, template: Any, averages: csr_array) -> ndarray:
    """Return unit normals at the vertices: the definition."""
    first = surface.derivatives(f, template.differential_operator)
    area_vectors = template.face_areas[:, None] * first.area_vectors
    sums = apply_operator(averages.T, area_vectors)
    plain = values_of(area_vectors)
    around = apply_operator(averages.T, onp.linalg.norm(plain, axis=-1, keepdims=True))[..., 0]
    cancelled = onp.linalg.norm(values_of(sums), axis=-1) <= _CANCELLED * around
    unused = around == 0.0
    if onp.any(cancelled & ~unused):
        vertex = int(onp.argwhere(cancelled & ~unused)[0][-1])
        raise DegenerateSurfaceError(
            f"the normals of the triangles around vertex {vertex} cancel, so that it has none; "
            "orient all triangles of the template consistently"
        )
    sums = np.where(unused[..., None], 1.0, sums)
    unit = sums / np.sqrt(surface.dot(sums, sums))[..., None]
    return np.where(unused[..., None], 0.0, unit)


def mixed_edges(faces: ndarray) -> ndarray:
    """Return the edges whose two triangles turn opposite sides up, as both pass them one way."""
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges, edge_of_side = onp.unique(onp.sort(sides, axis=1), axis=0, return_inverse=True)
    edge_of_side = edge_of_side.reshape(-1)
    n_ahead = onp.bincount(edge_of_side, weights=sides[:, 0] < sides[:, 1])
    return edges[(onp.bincount(edge_of_side) == 2) & (n_ahead != 1)]


def project(h: ndarray, f: ndarray, template: Any, averages: csr_array) -> ndarray:
    """Return P_f h = ⟨h, n⟩ n: the definition."""
    normals = vertex_normals(f, template, averages)
    return surface.dot(h, normals)[..., None] * normals


def matrix(normals: ndarray) -> csr_array:
    """Return the matrix P of the projection."""
    coordinates = onp.arange(normals.size).reshape(-1, 3)
    blocks = normals[:, :, None] * normals[:, None, :]
    columns = onp.broadcast_to(coordinates[:, None, :], blocks.shape)
    ends = onp.arange(0, blocks.size + 1, 3)
    return csr_array((blocks.ravel(), columns.ravel(), ends), shape=(normals.size,) * 2)


@compiled
def _add_area_vectors(
    surfaces: ndarray, faces: ndarray, first: int, last: int, sums: ndarray, around: ndarray
) -> None:
    edges = onp.empty((2, 3))
    for t in range(first, last):
        for i in range(surfaces.shape[1]):
            area = fill_edges(surfaces, faces[t], i, edges)
            for corner in faces[t]:
                around[corner, i] += 2.0 * area
            for d in range(3):
                e, g = (d + 1) % 3, (d + 2) % 3
                entry = edges[0, e] * edges[1, g] - edges[0, g] * edges[1, e]
                for corner in faces[t]:
                    sums[corner, i, d] += entry


@compiled
def _add_slopes(
    surfaces: ndarray,
    sum_slopes: ndarray,
    faces: ndarray,
    first: int,
    last: int,
    surface_slopes: ndarray,
) -> None:
    edges, slope = onp.empty((2, 3)), onp.empty(3)
    for t in range(first, last):
        one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
        for i in range(surfaces.shape[1]):
            fill_edges(surfaces, faces[t], i, edges)
            for d in range(3):
                slope[d] = sum_slopes[one, i, d] + sum_slopes[two, i, d] + sum_slopes[three, i, d]
            for d in range(3):
                e, g = (d + 1) % 3, (d + 2) % 3
                at_two = edges[1, e] * slope[g] - edges[1, g] * slope[e]
                at_three = slope[e] * edges[0, g] - slope[g] * edges[0, e]
                surface_slopes[two, i, d] += at_two
                surface_slopes[three, i, d] += at_three
                surface_slopes[one, i, d] -= at_two + at_three


class NormalProjections:
    """The projections at surfaces, and the way back for slopes, in compiled loops."""

    def __init__(self, surfaces: ndarray, faces: ndarray) -> None:
        self._surfaces, self._faces = surfaces, faces

        def run(first: int, last: int) -> tuple[ndarray, ndarray]:
            sums, around = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape[:2])
            _add_area_vectors(surfaces, faces, first, last, sums, around)
            return sums, around

        sums, around = self._in_chunks(run)
        lengths = onp.linalg.norm(sums, axis=-1, keepdims=True)
        self.exist = not onp.any((lengths[..., 0] <= _CANCELLED * around) & (around > 0.0))
        self._lengths = onp.where(lengths > 0.0, lengths, 1.0)
        self._normals = sums / self._lengths

    def project(self, vectors: ndarray) -> ndarray:
        """Return P h."""
        return self._along(vectors) * self._normals

    def slopes(self, vectors: ndarray, slopes: ndarray) -> tuple[ndarray, ndarray]:
        """Return slopes in h and in the surfaces from slopes in P h."""
        along = self._along(slopes)
        in_normals = self._along(vectors) * slopes + along * vectors
        tangential = in_normals - self._along(in_normals) * self._normals
        in_sums = tangential / self._lengths

        def run(first: int, last: int) -> tuple[ndarray]:
            surface_slopes = onp.zeros(slopes.shape)
            _add_slopes(self._surfaces, in_sums, self._faces, first, last, surface_slopes)
            return (surface_slopes,)

        (surface_slopes,) = self._in_chunks(run)
        return along * self._normals, surface_slopes

    def _along(self, vectors: ndarray) -> ndarray:
        return onp.einsum("vid,vid->vi", vectors, self._normals)[..., None]

    def _in_chunks(self, task: Callable[[int, int], tuple[ndarray, ...]]) -> tuple[Any, ...]:
        threaded = is_worth_threads(self._surfaces, self._faces)
        return sums_in_chunks(task, len(self._faces), threaded=threaded)


class NormalPartTerm(QuadraticTerm):
    """A term of the normal parts of deformations, ⟨P h, P k⟩."""

    is_translation_invariant = False
    is_reparametrization_invariant = True

    def __init__(self, template: Any, term: QuadraticTerm) -> None:
        mixed = mixed_edges(template.faces)
        if len(mixed):
            raise ArgumentError(
                f"the two triangles at the edge between the vertices {mixed[0, 0]} and "
                f"{mixed[0, 1]} of the template turn opposite sides up (and those at "
                f"{len(mixed) - 1} other edges), so that vertices have no normals; orient all "
                "triangles of the template consistently"
            )
        self.template, self.term = template, term
        self.is_stretch_invariant = term.is_stretch_invariant
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        normal_h = project(h, f, self.template, self._averages)
        normal_k = normal_h if k is h else project(k, f, self.template, self._averages)
        return self.term.inner_product(normal_h, normal_k, f)

    def matrix(self, f: ndarray) -> csr_array:
        projection = matrix(vertex_normals(f, self.template, self._averages))
        return projection @ self.term.matrix(f) @ projection

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        projections = NormalProjections(surfaces, self.template.faces)
        parts = projections.project(vectors)
        value, in_parts, in_surfaces = self.term.squared_norms_and_slopes(parts, surfaces)
        in_vectors, through_normals = projections.slopes(vectors, in_parts)
        return value if projections.exist else onp.inf, in_vectors, in_surfaces + through_normals
