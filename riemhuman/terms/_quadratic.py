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
from typing import NamedTuple

import autograd.numpy as np
import numpy as onp
from scipy.sparse import bsr_array, csr_array, diags_array, eye_array, kron

from riemhuman.arrays import Array, Booleans, Integers, Points, TangentVectors, Triangles
from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import distinct_pairs, triangle_sides
from riemhuman.kernels import surface
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import apply_operator, cotangent_laplacian
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.surfaces.template import Template

# Below this many triangles times surfaces, threads cost more than they gain.
_WORTH_THREADS = 20_000

ValueAndSlopes = tuple[float, Array, Array]


def by_vertex(surfaces: Points) -> Array:
    """Return surfaces vertex by vertex, or back."""
    return onp.ascontiguousarray(onp.swapaxes(surfaces, 0, 1))


class QuadraticTerm(ABC):
    """A term of a metric on surfaces, given by its inner product."""

    is_translation_invariant = True
    is_stretch_invariant = False
    is_reparametrization_invariant = False

    @abstractmethod
    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        """Return the inner product of deformations, by `autograd.numpy`: the definition."""

    @abstractmethod
    def matrix(self, f: Points) -> csr_array:
        """Return the matrix M of the inner product, ⟨h, k⟩ = h·(M k), vertices flattened."""

    @abstractmethod
    def squared_norms_and_slopes(self, vectors: TangentVectors, surfaces: Points) -> ValueAndSlopes:
        """Return the sum of the squared norms of deformations at surfaces, and its slopes."""


class FirstOrderWeights(NamedTuple):
    """Weights of the parts of the first-order change."""

    a1: float = 0.0
    b1: float = 0.0
    c1: float = 0.0
    d1: float = 0.0
    bend: float = 0.0

    def forms(self) -> tuple[Array, Array]:
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
    def from_forms(cls, moving: Array, still: Array) -> FirstOrderWeights | None:
        """Return the weights that have these forms, or None if there are none."""
        term = cls(
            a1=moving[0, 0] - moving[0, 3],
            b1=moving[0, 0] + moving[0, 3],
            c1=moving[4, 4],
            d1=moving[1, 1] - moving[1, 2],
            bend=still[4, 4],
        )
        size = onp.abs(moving).max() + onp.abs(still).max()
        for form, given in zip(term.forms(), (moving, still), strict=True):
            if onp.abs(form - given).max() > 1e-12 * size:
                return None
        return term


class FirstOrderTerm(QuadraticTerm):
    """The weighted sum of the parts, integrated."""

    def __init__(self, template: Template, weights: FirstOrderWeights) -> None:
        self.template, self.weights = template, weights
        self.is_stretch_invariant = weights.a1 == 0.0 and weights.b1 == 0.0

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        return surface.product_by_forms(h, k, first, operator, self._forms(first))

    def _forms(self, first: surface.Derivatives) -> surface.Forms:
        areas, (moving, still) = self.template.face_areas, self.weights.forms()
        return [(moving, areas * first.areas), (still, areas)]

    def matrix(self, f: Points) -> csr_array:
        first = surface.derivatives(f, self.template.differential_operator)
        blocks = onp.zeros((self.template.n_faces, 9, 9))
        surface.add_blocks(blocks, f, self.template.faces, self._forms(first))
        return self.template.assembler.assemble(blocks)

    def squared_norms_and_slopes(self, vectors: TangentVectors, surfaces: Points) -> ValueAndSlopes:
        faces, areas, weights = self.template.faces, self.template.face_areas, tuple(self.weights)

        def run(first: int, last: int) -> ValueAndSlopes:
            slopes = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)
            value = _first_order_norms(
                surfaces, faces, vectors, areas, weights, first, last, slopes
            )
            return value, *slopes

        return sums_in_chunks(run, len(faces), threaded=_is_large(surfaces, faces))


def _is_large(surfaces: Points, faces: Triangles) -> bool:
    """Return whether loops over the triangles of surfaces, vertex by vertex, gain from threads."""
    n_surfaces: int = surfaces.shape[1]
    return len(faces) * n_surfaces > _WORTH_THREADS


@compiled(inline="always")
def _frame_of(surfaces: Points, face: Integers, i: int) -> tuple[float, ...]:
    """Return the frame of a triangle at time i."""
    # e₁ runs along q₂ − q₁ = p e₁, e₂ across it, and q₃ − q₁ = q e₁ + r e₂.
    v1, v2, v3 = face[0], face[1], face[2]
    x0 = surfaces[v2, i, 0] - surfaces[v1, i, 0]
    x1 = surfaces[v2, i, 1] - surfaces[v1, i, 1]
    x2 = surfaces[v2, i, 2] - surfaces[v1, i, 2]
    y0 = surfaces[v3, i, 0] - surfaces[v1, i, 0]
    y1 = surfaces[v3, i, 1] - surfaces[v1, i, 1]
    y2 = surfaces[v3, i, 2] - surfaces[v1, i, 2]
    n0, n1, n2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    xx = x0 * x0 + x1 * x1 + x2 * x2
    if squared <= surface.DEGENERATE * xx * (y0 * y0 + y1 * y1 + y2 * y2):
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
def _derivatives_in_frame(
    vectors: TangentVectors, face: Integers, i: int, frame: tuple[float, ...]
) -> tuple[float, ...]:
    """Return M_kj = e_k·∂_j h, the derivatives of a deformation h along e₁ and e₂."""
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    v1, v2, v3 = face[0], face[1], face[2]
    x0 = vectors[v2, i, 0] - vectors[v1, i, 0]
    x1 = vectors[v2, i, 1] - vectors[v1, i, 1]
    x2 = vectors[v2, i, 2] - vectors[v1, i, 2]
    y0 = over_r * (vectors[v3, i, 0] - vectors[v1, i, 0]) - skew * x0
    y1 = over_r * (vectors[v3, i, 1] - vectors[v1, i, 1]) - skew * x1
    y2 = over_r * (vectors[v3, i, 2] - vectors[v1, i, 2]) - skew * x2
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
def _add_to_corners(
    slopes: Array, face: Integers, i: int, frame: tuple[float, ...], entries: tuple[float, ...]
) -> None:
    """Add slopes in e_k·∂_j h up to slopes at the corners, by the transpose."""
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    k11, k12, k21, k22, k31, k32 = entries
    k11, k21, k31 = (
        over_p * k11 - skew * k12,
        over_p * k21 - skew * k22,
        over_p * k31 - skew * k32,
    )
    k12, k22, k32 = over_r * k12, over_r * k22, over_r * k32
    v1, v2, v3 = face[0], face[1], face[2]
    x0, y0 = k11 * a0 + k21 * b0 + k31 * c0, k12 * a0 + k22 * b0 + k32 * c0
    x1, y1 = k11 * a1 + k21 * b1 + k31 * c1, k12 * a1 + k22 * b1 + k32 * c1
    x2, y2 = k11 * a2 + k21 * b2 + k31 * c2, k12 * a2 + k22 * b2 + k32 * c2
    slopes[v1, i, 0] -= x0 + y0
    slopes[v1, i, 1] -= x1 + y1
    slopes[v1, i, 2] -= x2 + y2
    slopes[v2, i, 0] += x0
    slopes[v2, i, 1] += x1
    slopes[v2, i, 2] += x2
    slopes[v3, i, 0] += y0
    slopes[v3, i, 1] += y1
    slopes[v3, i, 2] += y2


@compiled
def _first_order_norms(
    surfaces: Points,
    faces: Triangles,
    vectors: TangentVectors,
    areas: Array,
    weights: tuple[float, ...],
    first: int,
    last: int,
    slopes: tuple[Array, Array],
) -> float:
    """Return the sum of squared norms, and add their slopes by vectors and by surfaces."""
    a1, b1, c1, d1, bend = weights
    vector_slopes, surface_slopes = slopes
    total = 0.0
    for t in range(first, last):
        for i in range(surfaces.shape[1]):
            frame = _frame_of(surfaces, faces[t], i)
            area = frame[0]
            if area == 0.0:
                total = math.inf
                continue
            m11, m12, m21, m22, m31, m32 = _derivatives_in_frame(vectors, faces[t], i, frame)
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
            by_vectors = (k11, k12, k21, k22, k31, k32)
            _add_to_corners(vector_slopes, faces[t], i, frame, by_vectors)
            # Of the surface's own derivatives in the frame, the symmetric part stretches the
            # triangle, the antisymmetric part turns the frame, and the last row tilts it.
            shear = m11 * k12 + m12 * k11 + m21 * k22 + m22 * k21 + m31 * k32 + m32 * k31
            spin = m11 * k21 + m12 * k22 - m21 * k11 - m22 * k12
            by_surface = (
                moving - m11 * k11 - m21 * k21 - m31 * k31,
                0.5 * (spin - shear),
                -0.5 * (spin + shear),
                moving - m12 * k12 - m22 * k22 - m32 * k32,
                k11 * m31 + k12 * m32 - k31 * m11 - k32 * m12,
                k21 * m31 + k22 * m32 - k31 * m21 - k32 * m22,
            )
            _add_to_corners(surface_slopes, faces[t], i, frame, by_surface)
    return total


def corner_averages(faces: Triangles, n_vertices: int) -> csr_array:
    """Return the matrix that takes values at vertices to their means over triangles."""
    ends = np.arange(0, faces.size + 1, 3)
    return csr_array(
        (np.full(faces.size, 1.0 / 3.0), faces.ravel(), ends), shape=(len(faces), n_vertices)
    )


def vertex_areas(f: Points, template: Template, averages: csr_array) -> Array:
    """Return a third of the area of the triangles around each vertex, differentiably."""
    first = surface.derivatives(f, template.differential_operator)
    return apply_operator(averages.T, (template.face_areas * first.areas)[..., None])[..., 0]


class ZerothOrderTerm(QuadraticTerm):
    """w Σ_v A_v ⟨h_v, k_v⟩ with the vertex areas A of the surface."""

    is_translation_invariant = False

    def __init__(self, template: Template, weight: float) -> None:
        self.template, self.weight = template, weight
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        masses = vertex_areas(f, self.template, self._averages)
        return self.weight * np.sum(masses * surface.dot(h, k), axis=-1)

    def matrix(self, f: Points) -> csr_array:
        masses = vertex_areas(f, self.template, self._averages)
        return csr_array(kron(diags_array(self.weight * masses), eye_array(3)))

    def squared_norms_and_slopes(self, vectors: TangentVectors, surfaces: Points) -> ValueAndSlopes:
        densities = self.weight * surface.dot(vectors, vectors)
        sums = _vertex_sums(surfaces, self.template, by_areas=densities)
        value = sums.infinite + float(onp.sum(sums.areas * densities))
        return value, 2.0 * self.weight * sums.areas[..., None] * vectors, sums.slopes


class VertexValues(NamedTuple):
    """Inputs of sums over the triangles around vertices; those not needed are empty."""

    h: TangentVectors
    z: Array
    by_areas: Array
    by_normals: Array


class VertexSums(NamedTuple):
    """Sums that `_add_vertex_sums` fills; those not requested are empty."""

    infinite: float
    areas: Array
    normals: Array
    images: Array
    slopes: Array


def _vertex_sums(
    surfaces: Points,
    template: Template,
    h: TangentVectors | None = None,
    z: Array | None = None,
    by_areas: Array | None = None,
    by_normals: Array | None = None,
) -> VertexSums:
    """Return sums around the vertices: normals alone, or those that the given values are for."""
    faces, shape, nothing = template.faces, surfaces.shape, (0, 0, 0)
    has_images, has_slopes = z is not None, by_areas is not None or by_normals is not None
    # Arrays that are not given are empty, so that the loop is compiled only once.
    values = VertexValues(
        h=onp.empty(nothing) if h is None else onp.ascontiguousarray(h),
        z=onp.empty(nothing) if z is None else onp.ascontiguousarray(z),
        by_areas=onp.empty((0, 0)) if by_areas is None else onp.ascontiguousarray(by_areas),
        by_normals=onp.empty(nothing) if by_normals is None else onp.ascontiguousarray(by_normals),
    )

    def run(first: int, last: int) -> tuple[float, Array, Array, Array, Array]:
        sums = (
            onp.zeros(shape[:2]),
            onp.zeros(nothing if has_images or has_slopes else shape),
            onp.zeros(shape if has_images else nothing),
            onp.zeros(shape if has_slopes else nothing),
        )
        infinite = _add_vertex_sums(surfaces, faces, values, first, last, sums)
        return infinite, *sums

    return VertexSums(*sums_in_chunks(run, len(faces), threaded=_is_large(surfaces, faces)))


@compiled
def _add_vertex_sums(
    surfaces: Points,
    faces: Triangles,
    values: VertexValues,
    first: int,
    last: int,
    sums: tuple[Array, Array, Array, Array],
) -> float:
    """Add vertex areas A, sums N of area vectors, L z, and the slopes of 2 zᵀL h + Σ (a A + b·N).

    L is the cotangent Laplacian of the surface; a and b are the slopes `by_areas` and `by_normals`.
    The result is infinite if a triangle has no area.
    """
    # In one piece, because split into inlined functions it takes 1.3 to 1.7 times as long.
    h, z, by_areas, by_normals = values
    areas, normals, images, slopes = sums
    x, y, n, b = onp.empty(3), onp.empty(3), onp.empty(3), onp.empty(3)
    total = 0.0
    for t in range(first, last):
        v1, v2, v3 = faces[t, 0], faces[t, 1], faces[t, 2]
        for i in range(surfaces.shape[1]):
            xx = xy = yy = squared = 0.0
            for d in range(3):
                x[d] = surfaces[v2, i, d] - surfaces[v1, i, d]
                y[d] = surfaces[v3, i, d] - surfaces[v1, i, d]
                xx += x[d] * x[d]
                xy += x[d] * y[d]
                yy += y[d] * y[d]
            for d in range(3):
                e, g = (d + 1) % 3, (d + 2) % 3
                n[d] = x[e] * y[g] - x[g] * y[e]
                squared += n[d] * n[d]
            if squared <= surface.DEGENERATE * xx * yy:
                total = math.inf
                continue
            area = 0.5 * math.sqrt(squared)
            for corner in faces[t]:
                areas[corner, i] += area / 3.0
                if len(normals) > 0:
                    for d in range(3):
                        normals[corner, i, d] += 0.5 * n[d]
            # The half cotangents of the angles are inner products of edges over 4 A.
            factor = 0.25 / area
            at_one, at_two, at_three = factor * xy, factor * (xx - xy), factor * (yy - xy)
            if len(z) > 0:
                for d in range(3):
                    toward_two = at_three * (z[v2, i, d] - z[v1, i, d])
                    toward_three = at_two * (z[v3, i, d] - z[v1, i, d])
                    between = at_one * (z[v3, i, d] - z[v2, i, d])
                    images[v1, i, d] -= toward_two + toward_three
                    images[v2, i, d] += toward_two - between
                    images[v3, i, d] += toward_three + between
            if len(by_areas) > 0:
                by_area = (by_areas[v1, i] + by_areas[v2, i] + by_areas[v3, i]) / 3.0
                product12 = product13 = product23 = 0.0
                if len(h) > 0:
                    for d in range(3):
                        h12, h13 = h[v2, i, d] - h[v1, i, d], h[v3, i, d] - h[v1, i, d]
                        z12, z13 = z[v2, i, d] - z[v1, i, d], z[v3, i, d] - z[v1, i, d]
                        product12 += z12 * h12
                        product13 += z13 * h13
                        product23 += (z13 - z12) * (h13 - h12)
                    energy = product23 * at_one + product13 * at_two + product12 * at_three
                    by_area -= 2.0 * energy / area
                in_xx = factor * (4.0 * product13 + yy * by_area)
                in_xy = factor * (2.0 * (product23 - product13 - product12) - xy * by_area)
                in_yy = factor * (4.0 * product12 + xx * by_area)
                for d in range(3):
                    step_two, step_three = in_xx * x[d] + in_xy * y[d], in_xy * x[d] + in_yy * y[d]
                    slopes[v2, i, d] += step_two
                    slopes[v3, i, d] += step_three
                    slopes[v1, i, d] -= step_two + step_three
            if len(by_normals) > 0:
                for d in range(3):
                    b[d] = by_normals[v1, i, d] + by_normals[v2, i, d] + by_normals[v3, i, d]
                for d in range(3):
                    e, g = (d + 1) % 3, (d + 2) % 3
                    step_two = 0.5 * (y[e] * b[g] - y[g] * b[e])
                    step_three = 0.5 * (b[e] * x[g] - b[g] * x[e])
                    slopes[v2, i, d] += step_two
                    slopes[v3, i, d] += step_three
                    slopes[v1, i, d] -= step_two + step_three
    return total


def surrounded_vertices(faces: Triangles, n_vertices: int) -> Booleans:
    """Return which vertices are interior: neither on a border nor outside all triangles."""
    edges, _, counts = distinct_pairs(onp.sort(triangle_sides(faces), axis=1))
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


def refuse_seams(template: Template, part: str) -> None:
    """Raise an error if vertices are doubled along seams, which would hide neighbours."""
    seams = template.seams
    if seams:
        raise ArgumentError(
            f"the template has {seams.n_copies} duplicated vertices along seams, where {part} "
            "would be cut; join them with template.join_seams()"
        )


class SecondOrderTerm(QuadraticTerm):
    """w Σ_v ⟨(L h)_v, (L k)_v⟩/A_v over the vertices that triangles surround."""

    def __init__(self, template: Template, weight: float) -> None:
        refuse_seams(template, "second derivatives (a2 > 0)")
        self.template, self.weight = template, weight
        self.surrounded = surrounded_vertices(template.faces, template.n_vertices)
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        # √det g times the inverse of g, as an integrand over the template.
        squared_v = surface.dot(first.f_v, first.f_v)
        scale = self.template.face_areas / first.areas
        e, m, g = ((scale * value)[..., None] for value in (first.e, first.m, squared_v))

        def laplacian(values: Array) -> Array:
            v_u, v_v = surface.partial_derivatives(values, operator)
            fluxes = np.concatenate([g * v_u - m * v_v, e * v_v - m * v_u], axis=-2)
            return apply_operator(operator.T, fluxes)

        image_h = laplacian(h)
        image_k = image_h if k is h else laplacian(k)
        shares = self._shares(vertex_areas(f, self.template, self._averages))
        return np.sum(shares * surface.dot(image_h, image_k), axis=-1)

    def matrix(self, f: Points) -> csr_array:
        laplacian = cotangent_laplacian(f, self.template.faces)
        shares = self._shares(vertex_areas(f, self.template, self._averages))
        return csr_array(kron(laplacian @ diags_array(shares) @ laplacian, eye_array(3)))

    def squared_norms_and_slopes(self, vectors: TangentVectors, surfaces: Points) -> ValueAndSlopes:
        value, z = self._laplacians(vectors, surfaces)
        # Those of 2 zᵀL h − Σ |z|² A/w, where z = w/A L h is held.
        by_areas = -surface.dot(z, z) / self.weight
        sums = _vertex_sums(surfaces, self.template, vectors, z, by_areas)
        return value, 2.0 * sums.images, sums.slopes

    def _laplacians(self, vectors: TangentVectors, surfaces: Points) -> tuple[float, Array]:
        """Return the sum of the squared norms, infinite without areas, and w/A L h."""
        sums = _vertex_sums(surfaces, self.template, z=vectors)
        if sums.infinite > 0.0:
            return math.inf, sums.images
        z = self._shares(sums.areas.T).T[..., None] * sums.images
        return float(onp.sum(z * sums.images)), z

    def _shares(self, masses: Array) -> Array:
        """Return w/A at the vertices surrounded, 0 at the others."""
        return self.weight * self.surrounded / np.where(self.surrounded, masses, 1.0)


# Below this share of the areas around a vertex, the sum of the area vectors is rounding error.
_CANCELLED = 1e-12


def vertex_normals(f: Points, template: Template, averages: csr_array) -> Array:
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
            f"the normals of the triangles around vertex {vertex} cancel, so the vertex has no "
            "normal; orient all triangles of the template consistently"
        )
    sums = np.where(unused[..., None], 1.0, sums)
    unit = sums / np.sqrt(surface.dot(sums, sums))[..., None]
    return np.where(unused[..., None], 0.0, unit)


def mixed_edges(faces: Triangles) -> Integers:
    """Return the edges that both triangles pass in the same direction: these face opposite ways."""
    sides = triangle_sides(faces)
    edges, edge_of_side, _ = distinct_pairs(onp.sort(sides, axis=1))
    n_ahead = onp.bincount(edge_of_side, weights=sides[:, 0] < sides[:, 1])
    mixed: Integers = edges[(onp.bincount(edge_of_side) == 2) & (n_ahead != 1)]
    return mixed


def project(h: TangentVectors, f: Points, template: Template, averages: csr_array) -> Array:
    """Return P_f h = ⟨h, n⟩ n: the definition."""
    normals = vertex_normals(f, template, averages)
    return surface.dot(h, normals)[..., None] * normals


class NormalPartTerm(QuadraticTerm):
    """A term of the normal parts of deformations, ⟨P h, P k⟩."""

    is_translation_invariant = False
    is_reparametrization_invariant = True

    def __init__(self, template: Template, term: QuadraticTerm) -> None:
        mixed = mixed_edges(template.faces)
        if len(mixed):
            raise ArgumentError(
                f"the two triangles at the edge between the vertices {mixed[0, 0]} and "
                f"{mixed[0, 1]} of the template have opposite orientations (and so do those at "
                f"{len(mixed) - 1} other edges), so vertices have no normals; orient all "
                "triangles of the template consistently"
            )
        refuse_seams(template, "the normals of vertices")
        self.template, self.term = template, term
        self.is_stretch_invariant = term.is_stretch_invariant
        self._averages = corner_averages(template.faces, template.n_vertices)

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        normal_h = project(h, f, self.template, self._averages)
        normal_k = normal_h if k is h else project(k, f, self.template, self._averages)
        return self.term.inner_product(normal_h, normal_k, f)

    def matrix(self, f: Points) -> csr_array:
        normals = vertex_normals(f, self.template, self._averages)
        numbers, ends = onp.arange(len(normals)), onp.arange(len(normals) + 1)
        blocks = bsr_array((normals[:, :, None] * normals[:, None, :], numbers, ends))
        projection = csr_array(blocks)
        return projection @ self.term.matrix(f) @ projection

    def squared_norms_and_slopes(self, vectors: TangentVectors, surfaces: Points) -> ValueAndSlopes:
        sums = _vertex_sums(surfaces, self.template)
        lengths = onp.linalg.norm(sums.normals, axis=-1, keepdims=True)
        cancelled = (lengths[..., 0] <= 3.0 * _CANCELLED * sums.areas) & (sums.areas > 0.0)
        lengths = onp.where(lengths > 0.0, lengths, 1.0)
        normals = sums.normals / lengths

        def along(vectors: TangentVectors) -> Array:
            return surface.dot(vectors, normals)[..., None]

        parts = along(vectors) * normals
        value, in_parts, in_surfaces = self.term.squared_norms_and_slopes(parts, surfaces)
        in_normals = along(vectors) * in_parts + along(in_parts) * vectors
        in_sums = (in_normals - along(in_normals) * normals) / lengths
        through_normals = _vertex_sums(surfaces, self.template, by_normals=in_sums).slopes
        in_vectors = along(in_parts) * normals
        return math.inf if cancelled.any() else value, in_vectors, in_surfaces + through_normals
