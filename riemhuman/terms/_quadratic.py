r"""Terms that have an inner product at every surface, and no distance in closed form.

A deformation h of a surface f changes g by δg and n by δn. With A = g⁻¹δg, its traceless part A₀
and ξ = dfᵀdh − dhᵀdf,

.. math:: |dh_m|^2 = \tfrac14 \operatorname{tr} A_0^2, \quad
          |dh_+|^2 = \tfrac18 (\operatorname{tr} A)^2, \quad
          |dh_\perp|^2 = |\delta n|^2, \quad
          |dh_0|^2 = \tfrac14 \operatorname{tr}(g^{-1}\xi g^{-1}\xi^\top)

add up to |dh|², the Dirichlet energy (Su, Bauer, Preston, Laga, Klassen, "Shape analysis of
surfaces using general elastic metrics", Journal of Mathematical Imaging and Vision 62, 2020). In an
orthonormal frame e₁, e₂, n of a triangle, with M_kj = e_k·∂_j h, they are

.. math:: \tfrac12((M_{11} - M_{22})^2 + (M_{12} + M_{21})^2), \quad
          \tfrac12(M_{11} + M_{22})^2, \quad M_{31}^2 + M_{32}^2, \quad
          \tfrac12(M_{12} - M_{21})^2.

Masses of vertices are lumped: a third of the area of the triangles around each.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array, diags_array, eye_array, kron

from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.kernels import surface, triangles
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import apply_operator, cotangent_laplacian
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.kernels.triangles import (
    add_area_slope,
    add_to_corners,
    by_vertex,
    derivatives_in_frame,
    fill_edges,
    frame_of,
    is_worth_threads,
)

Slopes = tuple[float, ndarray, ndarray]


class QuadraticTerm(ABC):
    """A term of a metric on surfaces, given by its inner product."""

    is_translation_invariant = True
    is_stretch_invariant = False
    is_reparametrization_invariant = False

    @abstractmethod
    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of deformations, by `autograd.numpy`: the definition."""

    @abstractmethod
    def matrix(self, f: ndarray) -> csr_array:
        """Return the matrix M of the inner product, ⟨h, k⟩ = h·(M k), vertices flattened."""

    def squared_norms(self, vectors: ndarray, surfaces: ndarray) -> float:
        """Return the sum of the squared norms of deformations, see `squared_norms_and_slopes`."""
        return self.squared_norms_and_slopes(vectors, surfaces)[0]

    @abstractmethod
    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        """Return the sum of the squared norms of deformations at surfaces, and its slopes."""


class SumOfQuadraticTerms:
    """The driver of a sum of terms that are given by their inner products."""

    term_class = QuadraticTerm

    def __init__(self, terms: Sequence[QuadraticTerm], template: Any) -> None:
        self.terms, self.template = tuple(terms), template

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of deformations."""
        self._refuse_degenerate(f)
        total: Any = 0.0
        for term in self.terms:
            total = total + term.inner_product(h, k, f)
        return total

    def matrix(self, surfaces: ndarray) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""
        self._refuse_degenerate(surfaces)
        size = surfaces[0].size
        total = csr_array((size, size))
        for f in surfaces:
            for term in self.terms:
                total = total + term.matrix(f)
        return total / len(surfaces)

    def path_energy(self, path: ndarray, *, gradient: bool = True) -> tuple[float, Any]:
        """Return n Σ G at the midpoints of the n segments of a path, and its gradient."""
        n_segments = len(path) - 1
        surfaces, steps = by_vertex(0.5 * (path[:-1] + path[1:])), by_vertex(onp.diff(path, axis=0))
        if not gradient:
            values = sum(term.squared_norms(steps, surfaces) for term in self.terms)
            return n_segments * float(values), None
        parts = [term.squared_norms_and_slopes(steps, surfaces) for term in self.terms]
        values, in_steps, in_surfaces = (sum(part) for part in zip(*parts, strict=True))
        slopes = onp.zeros(path.shape)
        slopes[:-1] = by_vertex(0.5 * in_surfaces - in_steps)
        slopes[1:] += by_vertex(0.5 * in_surfaces + in_steps)
        return n_segments * float(values), n_segments * slopes

    def _refuse_degenerate(self, f: ndarray) -> None:
        first = surface.derivatives(values_of(f), self.template.differential_operator)
        surface.refuse_degenerate(first.degenerate, "base_point")


class FirstOrderWeights(NamedTuple):
    """Weights of the parts of the first-order change."""

    a1: float = 0.0
    b1: float = 0.0
    c1: float = 0.0
    d1: float = 0.0
    bend: float = 0.0

    def forms(self) -> tuple[ndarray, ndarray]:
        """Return the quadratic forms of `surface.frame_components`, by area of both surfaces."""
        a1, b1, c1, d1, bend = self
        moving = onp.zeros((6, 6))
        moving[[0, 3], [0, 3]], moving[[0, 3], [3, 0]] = 0.5 * (b1 + a1), 0.5 * (b1 - a1)
        moving[[1, 2], [1, 2]], moving[[1, 2], [2, 1]] = 0.5 * (a1 + d1), 0.5 * (a1 - d1)
        moving[[4, 5], [4, 5]] = c1
        still = onp.zeros((6, 6))
        still[[4, 5], [4, 5]] = bend
        return moving, still

    @classmethod
    def from_forms(cls, moving: ndarray, still: ndarray) -> FirstOrderWeights | None:
        """Return the weights that have these forms, or None if there are none."""
        found = cls(
            a1=moving[0, 0] - moving[0, 3],
            b1=moving[0, 0] + moving[0, 3],
            c1=moving[4, 4],
            d1=moving[1, 1] - moving[1, 2],
            bend=still[4, 4],
        )
        size = onp.abs(moving).max() + onp.abs(still).max()
        for one, other in zip(found.forms(), (moving, still), strict=True):
            if onp.abs(one - other).max() > 1e-12 * size:
                return None
        return found


class FirstOrderTerm(QuadraticTerm):
    """The weighted sum of the parts, integrated."""

    def __init__(self, template: Any, weights: FirstOrderWeights) -> None:
        self.template, self.weights = template, weights
        self.is_stretch_invariant = weights.a1 == 0.0 and weights.b1 == 0.0

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        operator, areas = self.template.differential_operator, self.template.face_areas
        first = surface.derivatives(f, operator)
        along_h = surface.frame_components(first, *surface.partial_derivatives(h, operator))
        along_k = along_h
        if k is not h:
            along_k = surface.frame_components(first, *surface.partial_derivatives(k, operator))
        moving, still = self.weights.forms()
        values = first.areas * surface.dot(np.matmul(along_h, moving), along_k)
        values = values + surface.dot(np.matmul(along_h, still), along_k)
        return np.sum(values * areas, axis=-1)

    def matrix(self, f: ndarray) -> csr_array:
        template = self.template
        first = surface.derivatives(f, template.differential_operator)
        moving, still = template.face_areas * first.areas, template.face_areas
        moving_form, still_form = self.weights.forms()
        forms = moving[:, None, None] * moving_form + still[:, None, None] * still_form
        blocks = onp.zeros((template.n_faces, 9, 9))
        triangles.add_blocks(blocks, f, template.faces, forms)
        return template.assembler.assemble(blocks)

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        weights = self.template.face_areas, tuple(self.weights)
        given = surfaces, self.template.faces, vectors, *weights
        return _in_chunks(_first_order_norms, given, surfaces.shape, surfaces.shape)


def _in_chunks(
    loop: Callable[..., float], given: tuple[Any, ...], *shapes: tuple[int, ...]
) -> tuple[Any, ...]:
    """Return the value of a loop over the triangles of surfaces, and the arrays it adds up."""
    surfaces, faces = given[:2]

    def run(first: int, last: int) -> tuple[Any, ...]:
        added = [onp.zeros(shape) for shape in shapes]
        return loop(*given, first, last, *added), *added

    return sums_in_chunks(run, len(faces), threaded=is_worth_threads(surfaces, faces))


@compiled
def _first_order_norms(
    surfaces: ndarray,
    faces: ndarray,
    vectors: ndarray,
    areas: ndarray,
    weights: tuple[float, ...],
    first: int,
    last: int,
    vector_slopes: ndarray,
    surface_slopes: ndarray,
) -> float:
    a1, b1, c1, d1, bend = weights
    total = 0.0
    for t in range(first, last):
        for i in range(surfaces.shape[1]):
            frame = frame_of(surfaces, faces[t], i)
            area = frame[0]
            if area == 0.0:
                total = math.inf
                continue
            m11, m12, m21, m22, m31, m32 = derivatives_in_frame(vectors, faces[t], i, frame)
            across, along = m11 - m22, m12 + m21
            trace, turn = m11 + m22, m12 - m21
            tilt = m31 * m31 + m32 * m32
            density = 0.5 * (a1 * (across * across + along * along) + b1 * trace * trace)
            moving = area * (density + 0.5 * d1 * turn * turn + c1 * tilt)
            total += moving + bend * areas[t] * tilt
            # Slopes K in M.
            k11, k22 = area * (b1 * trace + a1 * across), area * (b1 * trace - a1 * across)
            k12, k21 = area * (a1 * along + d1 * turn), area * (a1 * along - d1 * turn)
            bending = 2.0 * (c1 * area + bend * areas[t])
            k31, k32 = bending * m31, bending * m32
            slopes = (k11, k12, k21, k22, k31, k32)
            add_to_corners(vector_slopes, faces[t], i, frame, slopes)
            # Of the surface's own derivatives in the frame, the symmetric part stretches the
            # triangle, the antisymmetric part turns the frame, and the last row tilts it.
            shear = m11 * k12 + m12 * k11 + m21 * k22 + m22 * k21 + m31 * k32 + m32 * k31
            spin = m11 * k21 + m12 * k22 - m21 * k11 - m22 * k12
            slopes = (
                moving - m11 * k11 - m21 * k21 - m31 * k31,
                0.5 * (spin - shear),
                -0.5 * (spin + shear),
                moving - m12 * k12 - m22 * k22 - m32 * k32,
                k11 * m31 + k12 * m32 - k31 * m11 - k32 * m12,
                k21 * m31 + k22 * m32 - k31 * m21 - k32 * m22,
            )
            add_to_corners(surface_slopes, faces[t], i, frame, slopes)
    return total


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
        given = surfaces, self.template.faces, vectors, self.weight
        return _in_chunks(_zeroth_order_norms, given, surfaces.shape, surfaces.shape)


@compiled
def _zeroth_order_norms(
    surfaces: ndarray,
    faces: ndarray,
    vectors: ndarray,
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
        value, ratios = self._laplacians(vectors, surfaces)
        if value == math.inf:
            return value, onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)
        given = surfaces, self.template.faces, vectors, ratios, self.weight
        _, *slopes = _in_chunks(_add_laplacian_slopes, given, surfaces.shape, surfaces.shape)
        return value, *slopes

    def _laplacians(self, vectors: ndarray, surfaces: ndarray) -> tuple[float, ndarray]:
        """Return the sum of the squared norms, infinite without areas, and w/A L h."""
        given, shape = (surfaces, self.template.faces, vectors), surfaces.shape
        value, images, masses = _in_chunks(_add_laplacians, given, shape, shape[:2])
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
    surfaces: ndarray,
    faces: ndarray,
    vectors: ndarray,
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
def _add_laplacian_slopes(
    surfaces: ndarray,
    faces: ndarray,
    vectors: ndarray,
    ratios: ndarray,
    weight: float,
    first: int,
    last: int,
    vector_slopes: ndarray,
    surface_slopes: ndarray,
) -> float:
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
    return 0.0


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


def projection_matrix(normals: ndarray) -> csr_array:
    """Return the matrix P of the projection."""
    coordinates = onp.arange(normals.size).reshape(-1, 3)
    blocks = normals[:, :, None] * normals[:, None, :]
    columns = onp.broadcast_to(coordinates[:, None, :], blocks.shape)
    ends = onp.arange(0, blocks.size + 1, 3)
    return csr_array((blocks.ravel(), columns.ravel(), ends), shape=(normals.size,) * 2)


@compiled
def _add_area_vectors(
    surfaces: ndarray, faces: ndarray, first: int, last: int, sums: ndarray, around: ndarray
) -> float:
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
    return 0.0


@compiled
def _add_normal_slopes(
    surfaces: ndarray,
    faces: ndarray,
    sum_slopes: ndarray,
    first: int,
    last: int,
    surface_slopes: ndarray,
) -> float:
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
    return 0.0


class NormalProjections:
    """The projections at surfaces, and the way back for slopes, in compiled loops."""

    def __init__(self, surfaces: ndarray, faces: ndarray) -> None:
        self._given, shape = (surfaces, faces), surfaces.shape
        _, sums, around = _in_chunks(_add_area_vectors, self._given, shape, shape[:2])
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
        given = *self._given, tangential / self._lengths
        _, surface_slopes = _in_chunks(_add_normal_slopes, given, slopes.shape)
        return along * self._normals, surface_slopes

    def _along(self, vectors: ndarray) -> ndarray:
        return onp.einsum("vid,vid->vi", vectors, self._normals)[..., None]


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
        projection = projection_matrix(vertex_normals(f, self.template, self._averages))
        return projection @ self.term.matrix(f) @ projection

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        projections = NormalProjections(surfaces, self.template.faces)
        parts = projections.project(vectors)
        value, in_parts, in_surfaces = self.term.squared_norms_and_slopes(parts, surfaces)
        in_vectors, through_normals = projections.slopes(vectors, in_parts)
        return value if projections.exist else onp.inf, in_vectors, in_surfaces + through_normals
