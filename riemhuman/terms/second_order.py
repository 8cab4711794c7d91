r"""The second-order term of deformations, :math:`\int \langle\Delta h, \Delta k\rangle\, dA`.

Δ is the cotangent Laplacian of the moving surface with lumped masses, A Δh = −L h, where hᵀL h is
the Dirichlet energy and A holds a third of the area of the triangles around each vertex (Pinkall
and Polthier, "Computing Discrete Minimal Surfaces and Their Conjugates", Experimental Mathematics
2(1), 1993). The integral runs over interior vertices: at a border half of the cotangent formula is
missing, so that linear functions on a plane, whose Laplacian is 0, would have a cost there.
"""

from __future__ import annotations

import math
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array, diags_array, eye_array, kron

from riemhuman.errors import ArgumentError
from riemhuman.kernels import surface
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import apply_operator, cotangent_laplacian
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.kernels.triangles import (
    add_area_slope,
    fill_edges,
    is_worth_threads,
)
from riemhuman.terms.quadratic import QuadraticTerm, Slopes
from riemhuman.terms.zeroth_order import corner_averages, vertex_areas


def surrounded_vertices(faces: ndarray, n_vertices: int) -> ndarray:
    """Tell which vertices are interior, neither on a border nor outside all triangles."""
    sides = onp.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, counts = onp.unique(sides, axis=0, return_counts=True)
    if counts.max() > 2:
        worst = int(onp.argmax(counts))
        raise ArgumentError(
            f"{counts[worst]} triangles share the edge between the vertices {edges[worst, 0]} and "
            f"{edges[worst, 1]}; second derivatives (a2 > 0) need a manifold mesh, with at most two"
        )
    surrounded = onp.zeros(n_vertices, dtype=bool)
    surrounded[faces] = True
    surrounded[edges[counts == 1]] = False
    return surrounded


class SecondOrderTerm(QuadraticTerm):
    """w Σ_v ⟨(L h)_v, (L k)_v⟩/A_v over the vertices that triangles surround."""

    def __init__(self, template: Any, weight: float) -> None:
        self.template, self.weight = template, weight
        self.surrounded = surrounded_vertices(template.faces, template.n_vertices)
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        # √det g times the inverse of g, as an integrand over the template.
        squared_v = surface.dot(first.f_v, first.f_v)
        scale = self.template.face_areas / first.areas
        e, m, g = ((scale * value)[..., None] for value in (first.e, first.m, squared_v))

        def laplacian(values: ndarray) -> ndarray:
            v_u, v_v = surface.partial_derivatives(values, operator)
            fluxes = np.concatenate([g * v_u - m * v_v, e * v_v - m * v_u], axis=-2)
            return apply_operator(operator.T, fluxes)

        image_h = laplacian(h)
        image_k = image_h if k is h else laplacian(k)
        shares = self._shares(vertex_areas(f, self.template, self._averages))
        return np.sum(shares * surface.dot(image_h, image_k), axis=-1)

    def matrix(self, f: ndarray) -> csr_array:
        laplacian = cotangent_laplacian(f, self.template.faces)
        shares = self._shares(vertex_areas(f, self.template, self._averages))
        return csr_array(kron(laplacian @ diags_array(shares) @ laplacian, eye_array(3)))

    def squared_norms(self, vectors: ndarray, surfaces: ndarray) -> float:
        return self._laplacians(vectors, surfaces)[0]

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        faces = self.template.faces
        value, ratios = self._laplacians(vectors, surfaces)
        if value == math.inf:
            return value, onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)

        def slopes(first: int, last: int) -> tuple[ndarray, ndarray]:
            both = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)
            _add_slopes(vectors, surfaces, ratios, faces, self.weight, first, last, *both)
            return both

        threaded = is_worth_threads(surfaces, faces)
        return value, *sums_in_chunks(slopes, len(faces), threaded=threaded)

    def _laplacians(self, vectors: ndarray, surfaces: ndarray) -> tuple[float, ndarray]:
        """Return the sum of the squared norms, infinite without areas, and w/A L h."""
        faces = self.template.faces

        def apply(first: int, last: int) -> tuple[float, ndarray, ndarray]:
            images, masses = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape[:2])
            value = _add_laplacians(vectors, surfaces, faces, first, last, images, masses)
            return value, images, masses

        threaded = is_worth_threads(surfaces, faces)
        value, images, masses = sums_in_chunks(apply, len(faces), threaded=threaded)
        if value > 0.0:
            return math.inf, images
        ratios = self._shares(masses.T).T[..., None] * images
        return float(onp.sum(ratios * images)), ratios

    def _shares(self, masses: ndarray) -> ndarray:
        """Return w/A at the vertices surrounded, 0 at the others."""
        return self.weight * self.surrounded / np.where(self.surrounded, masses, 1.0)


@compiled(inline="always")
def _half_cotangents(edges: ndarray, area: float) -> tuple[float, float, float]:
    """Return half the cotangents of the angles at the three corners."""
    xx = xy = yy = 0.0
    for d in range(3):
        xx += edges[0, d] * edges[0, d]
        xy += edges[0, d] * edges[1, d]
        yy += edges[1, d] * edges[1, d]
    factor = 0.25 / area
    return factor * xy, factor * (xx - xy), factor * (yy - xy)


@compiled
def _add_laplacians(
    vectors: ndarray,
    surfaces: ndarray,
    faces: ndarray,
    first: int,
    last: int,
    images: ndarray,
    masses: ndarray,
) -> float:
    """Add L h to `images` and vertex areas to `masses`; return infinity if there is no area."""
    edges = onp.empty((2, 3))
    total = 0.0
    for t in range(first, last):
        one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
        for i in range(surfaces.shape[1]):
            area = fill_edges(surfaces, faces[t], i, edges)
            if area == 0.0:
                total = math.inf
                continue
            at_one, at_two, at_three = _half_cotangents(edges, area)
            for d in range(3):
                toward_two = at_three * (vectors[two, i, d] - vectors[one, i, d])
                toward_three = at_two * (vectors[three, i, d] - vectors[one, i, d])
                between = at_one * (vectors[three, i, d] - vectors[two, i, d])
                images[one, i, d] -= toward_two + toward_three
                images[two, i, d] += toward_two - between
                images[three, i, d] += toward_three + between
            for corner in faces[t]:
                masses[corner, i] += area / 3.0
    return total


@compiled
def _add_slopes(
    vectors: ndarray,
    surfaces: ndarray,
    ratios: ndarray,
    faces: ndarray,
    weight: float,
    first: int,
    last: int,
    vector_slopes: ndarray,
    surface_slopes: ndarray,
) -> None:
    """Add the slopes of w Σ |L h|²/A: those of 2 zᵀL h − Σ |z|² A/w with z = w L h/A held."""
    edges = onp.empty((2, 3))
    for t in range(first, last):
        one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
        for i in range(surfaces.shape[1]):
            area = fill_edges(surfaces, faces[t], i, edges)
            at_one, at_two, at_three = _half_cotangents(edges, area)
            product12 = product13 = product23 = squared = 0.0
            for d in range(3):
                z1, z2, z3 = ratios[one, i, d], ratios[two, i, d], ratios[three, i, d]
                h12 = vectors[two, i, d] - vectors[one, i, d]
                h13 = vectors[three, i, d] - vectors[one, i, d]
                product12 += (z2 - z1) * h12
                product13 += (z3 - z1) * h13
                product23 += (z3 - z2) * (h13 - h12)
                squared += z1 * z1 + z2 * z2 + z3 * z3
                toward_two = 2.0 * at_three * (z2 - z1)
                toward_three = 2.0 * at_two * (z3 - z1)
                between = 2.0 * at_one * (z3 - z2)
                vector_slopes[one, i, d] -= toward_two + toward_three
                vector_slopes[two, i, d] += toward_two - between
                vector_slopes[three, i, d] += toward_three + between
            energy = product23 * at_one + product13 * at_two + product12 * at_three
            # The half cotangents are inner products of edges over 4 areas.
            factor = 0.5 / area
            mixed = product23 - product13 - product12
            for d in range(3):
                x, y = edges[0, d], edges[1, d]
                step_two = factor * (mixed * y + 2.0 * product13 * x)
                step_three = factor * (mixed * x + 2.0 * product12 * y)
                surface_slopes[two, i, d] += step_two
                surface_slopes[three, i, d] += step_three
                surface_slopes[one, i, d] -= step_two + step_three
            by_area = -2.0 * energy / area - squared / (3.0 * weight)
            add_area_slope(surface_slopes, faces[t], i, edges, area, by_area)
