"""Weighted sums of terms: energies of paths, inner products, features and tables of distances.

A metric on surfaces checks its arguments and leaves inner products, their matrices and energies of
paths to a `SumOnSurfaces`: `SumOfTerms` if its terms have distances in closed form (`Term`),
`SumOfQuadraticTerms` if they are given by their inner products alone (`QuadraticTerm`).

Distances of many pairs are asked of what has them in closed form, the `bulk` of a metric: of
`SumOfTerms` itself for metrics on surfaces, of `SumOfFields` for metrics on fields, which have a
term but no surfaces. Both are `TablesOfTerms`. `riemhuman.geometry.pairwise` says what a bulk is,
and has those of products and of metrics without terms.

All that compiled loops need to know of a triangle is a record of `LENGTH` numbers: f_u, f_v, the
unit normal n, the area ratio A = ‖f_u × f_v‖, and e = f_u·f_u, m = f_u·f_v. On a triangle without
area n and A are 0. Slopes of a sum over triangles by the numbers of a record, each taken for
independent, become slopes by the vertices. Arrays of records hold each number of many triangles in
a row, so that loops over triangles run in vector registers; along paths some thousand triangles at
a time.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

import numpy as onp
from scipy.sparse import csr_array

from riemhuman.arrays import Array, Features, Fields, Points, TangentVectors, Triangles
from riemhuman.checks import values_of
from riemhuman.kernels import surface
from riemhuman.kernels.compilation import FUSED, compiled
from riemhuman.kernels.threads import LANES, in_tiles, of_one_kind, sums_in_chunks
from riemhuman.surfaces.template import Template
from riemhuman.terms._quadratic import QuadraticTerm, by_vertex
from riemhuman.terms.term import LENGTH, Term

# Below this many triangles times surfaces, threads cost more than they gain.
_WORTH_THREADS = 50_000
# Triangles times surfaces whose records stay in a core's own cache from one pass to the next.
_IN_CACHE = 8192


class SumOnSurfaces(Protocol):
    """A weighted sum of terms on the surfaces over a template, which others have checked."""

    @abstractmethod
    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        """Return the inner products of deformations h and k at surfaces f, differentiably."""

    @abstractmethod
    def matrix(self, surfaces: Points) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""

    @abstractmethod
    def path_energy(self, path: Points, *, gradient: bool = True) -> tuple[float, Array]:
        """Return the energy of a path, infinite where it has none, and its gradient if wanted."""


class TablesOfTerms(ABC):
    """Distances of many pairs, by a weighted sum of terms over triangles with these areas.

    Features hold two arrays for each term: its rows, filled up to whole vector registers, and
    bounds on the points' rounding errors, as distances. The first axis of both is that of the
    points.
    """

    def __init__(self, terms: Sequence[Term], areas: Array) -> None:
        self.terms, self.areas = tuple(terms), areas
        self.n_arrays = 2 * len(self.terms)
        self._row_length = LANES * math.ceil(len(areas) / LANES)

    @abstractmethod
    def features(self, points: Points, precision: str) -> Features:
        """Return the features of points."""

    def rounding(self, features: Features) -> Array:
        """Return a bound on the rounding error of each point's features, as a distance."""
        squared = onp.zeros(())
        for term, gaps in zip(self.terms, features[1::2], strict=True):
            squared = squared + term.weight * gaps**2
        return onp.sqrt(squared)

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> Array:
        """Return all squared distances between two sets of points."""

        def run(pair: tuple[Features, Features]) -> Array:
            total = onp.zeros(())
            for term, row_features, column_features in zip(self.terms, *pair, strict=True):
                total = total + term.weight * term.squared_distances(
                    row_features, column_features, self.areas
                )
            return total

        return in_tiles(run, a[::2], b[::2], n_threads)


class SumOfFields(TablesOfTerms):
    """Distances by one term, of the fields that a function computes of points."""

    def __init__(self, term: Term, areas: Array, fields: Callable[[Points], Fields]) -> None:
        super().__init__([term], areas)
        self._fields = fields

    def features(self, points: Points, precision: str) -> Features:
        [term] = self.terms
        fields = tuple(of_one_kind(field) for field in self._fields(points))
        real = onp.float32 if precision == "single" and term.single else onp.float64
        rows = onp.zeros((len(fields[0]), term.n_features, self._row_length), real)
        gaps = onp.zeros(len(rows))
        for i, row in enumerate(rows):
            gap = term.pack(tuple(field[i] for field in fields), self.areas, row)
            if rows.dtype == onp.float32:
                gaps[i] = math.sqrt(gap)
        return rows, gaps


class SumOfTerms(TablesOfTerms, SumOnSurfaces):
    """A sum of terms with distances in closed form, which energies of paths add up."""

    def __init__(self, terms: Sequence[Term], template: Template) -> None:
        super().__init__(terms, template.face_areas)
        self.template = template
        self.needs_area = any(term.needs_area for term in self.terms)
        self._faces, self._frames = template.faces, template.frame_coefficients

    def __reduce__(self) -> tuple[object, ...]:
        # Copied by themselves, the arrays could be written to, and loops are compiled for such
        # arrays anew.
        return type(self), (self.terms, self.template)

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        """Return the inner product of the derivatives of the fields along h and k."""
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        return surface.product_by_forms(h, k, first, operator, self._forms(first))

    def _forms(self, first: surface.Derivatives) -> surface.Forms:
        surface.refuse_degenerate(first.degenerate, "base_point")
        scales = [term.weight * self.areas * first.areas**term.area_power for term in self.terms]
        return [(term.form(first), scale) for term, scale in zip(self.terms, scales, strict=True)]

    def path_energy(self, path: Points, *, gradient: bool = True) -> tuple[float, Array]:
        """Return the closed-form path energy n Σ d²(f_i, f_{i+1}) and its gradient."""
        faces, frames, areas = self._faces, self._frames, self.areas
        surfaces, n_times = of_one_kind(path), len(path)

        def run(first: int, last: int) -> tuple[float, Array]:
            total, slopes_of_path = 0.0, onp.zeros(surfaces.shape if gradient else 0)
            size = max(1, min(_IN_CACHE // n_times, last - first))
            records, slopes = onp.empty((2, n_times, LENGTH, size))
            for start in range(first, last, size):
                end = min(start + size, last)
                if end - start < size:
                    records, slopes = onp.empty((2, n_times, LENGTH, end - start))
                slopes[:] = 0.0
                fill_records(surfaces, faces, frames, start, end, records)
                for term in self.terms:
                    total += term.add_segments(records, slopes, areas[start:end])
                if gradient:
                    add_gradient(records, slopes, faces, frames, start, end, slopes_of_path)
            return total, slopes_of_path

        threaded = len(faces) * n_times > _WORTH_THREADS
        energy, slope = sums_in_chunks(run, len(faces), threaded=threaded)
        if not gradient:
            return energy * (n_times - 1), slope
        slope *= n_times - 1
        return energy * (n_times - 1), slope

    def squared_dists(
        self,
        point: Points,
        targets: Points,
        weights: Array,
        target_faces: Triangles | None = None,
    ) -> tuple[Array, Array]:
        """Return the squared distances of one surface from others, and the slope of their sum."""
        faces, frames, areas = self._faces, self._frames, self.areas
        faces_of_targets = faces if target_faces is None else of_one_kind(target_faces)
        f = of_one_kind(point)[None]
        surfaces = [of_one_kind(target)[None] for target in targets]

        def run(first: int, last: int) -> tuple[Array, Array]:
            squared, gradient = onp.zeros(len(targets)), onp.zeros((1, len(point), 3))
            size = max(1, min(_IN_CACHE // 2, last - first))
            for start in range(first, last, size):
                end = min(start + size, last)
                records, slopes = onp.zeros((2, 2, LENGTH, end - start))
                fill_records(f, faces, frames, start, end, records[1:])
                for i, target in enumerate(surfaces):
                    # The slopes by these are summed as well but not used.
                    fill_records(target, faces_of_targets, frames, start, end, records[:1])
                    weighted = of_one_kind(weights[i] * areas[start:end])
                    for term in self.terms:
                        squared[i] += term.add_segments(records, slopes, weighted)
                add_gradient(records[1:], slopes[1:], faces, frames, start, end, gradient)
            return squared, gradient

        threaded = len(faces) * len(targets) > _WORTH_THREADS
        squared, gradient = sums_in_chunks(run, len(faces), threaded=threaded)
        return squared / weights, gradient[0]

    def matrix(self, surfaces: Points) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""
        blocks = onp.zeros((len(self._faces), 9, 9))
        for f in surfaces:
            first = surface.derivatives(f, self.template.differential_operator)
            surface.add_blocks(blocks, f, self._faces, self._forms(first))
        return self.template.assembler.assemble(blocks / len(surfaces))

    def features(self, points: Points, precision: str) -> Features:
        """Return the features of surfaces; those of all terms come from the same records."""
        n_faces = len(self.areas)
        features: Features = ()
        for term in self.terms:
            real = onp.float32 if precision == "single" and term.single else onp.float64
            rows = onp.zeros((len(points), term.n_features, self._row_length), real)
            features += rows, onp.zeros(len(points))
        records = onp.empty((1, LENGTH, n_faces))
        degenerate = onp.zeros((len(points), n_faces), dtype=bool)
        for i, point in enumerate(points):
            surface_alone = of_one_kind(point)[None]
            fill_records(surface_alone, self._faces, self._frames, 0, n_faces, records)
            if self.needs_area and not records[0, 9].all():
                degenerate[i] = records[0, 9] == 0.0
                continue
            for term, rows, gaps in zip(self.terms, features[::2], features[1::2], strict=True):
                gap = term.pack_record(records[0], self.areas, rows[i])
                if rows.dtype == onp.float32:
                    gaps[i] = math.sqrt(gap)
        if degenerate.any():
            surface.refuse_degenerate(degenerate)
        return features


class SumOfQuadraticTerms(SumOnSurfaces):
    """A sum of terms that are given by their inner products, taken at midpoints along paths."""

    def __init__(self, terms: Sequence[QuadraticTerm], template: Template) -> None:
        self.terms, self.template = tuple(terms), template

    def inner_product(self, h: TangentVectors, k: TangentVectors, f: Points) -> Array:
        """Return the inner product of deformations."""
        self._refuse_degenerate(f)
        total = onp.zeros(())
        for term in self.terms:
            total = total + term.inner_product(h, k, f)
        return total

    def matrix(self, surfaces: Points) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""
        self._refuse_degenerate(surfaces)
        size = surfaces[0].size
        total = csr_array((size, size))
        for f in surfaces:
            for term in self.terms:
                total = total + term.matrix(f)
        return total / len(surfaces)

    def path_energy(self, path: Points, *, gradient: bool = True) -> tuple[float, Array]:
        """Return n Σ G at the midpoints of the n segments of a path, and its gradient."""
        n_segments = len(path) - 1
        surfaces, steps = by_vertex(0.5 * (path[:-1] + path[1:])), by_vertex(onp.diff(path, axis=0))
        parts = [term.squared_norms_and_slopes(steps, surfaces) for term in self.terms]
        values, in_steps, in_surfaces = (sum(part) for part in zip(*parts, strict=True))
        slopes = onp.zeros(path.shape)
        slopes[:-1] = by_vertex(0.5 * in_surfaces - in_steps)
        slopes[1:] += by_vertex(0.5 * in_surfaces + in_steps)
        return n_segments * float(values), n_segments * slopes

    def _refuse_degenerate(self, f: Points) -> None:
        first = surface.derivatives(values_of(f), self.template.differential_operator)
        surface.refuse_degenerate(first.degenerate, "base_point")


# Records are filled in the file of their loops: names of compiled functions are bound in modules
# that define some, and elsewhere every call would look its function up.


@compiled(forceinline=True)
def first_forms(
    u0: float, u1: float, u2: float, v0: float, v1: float, v2: float
) -> tuple[float, float, float, float, float, float]:
    """Return e = f_u·f_u, m = f_u·f_v, f_u × f_v and its length A, 0 for triangles without area."""
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    e = u0 * u0 + u1 * u1 + u2 * u2
    g = v0 * v0 + v1 * v1 + v2 * v2
    area = math.sqrt(squared) if squared > surface.DEGENERATE * e * g else 0.0
    return e, u0 * v0 + u1 * v1 + u2 * v2, n0, n1, n2, area


@compiled
def fill_records(
    f: Points, faces: Triangles, frames: Array, first: int, last: int, records: Array
) -> None:
    """Fill the records of the triangles from `first` to `last`."""
    for i in range(len(f)):
        record, corners = records[i], f[i]
        for t in range(first, last):
            v1, v2, v3 = faces[t, 0], faces[t, 1], faces[t, 2]
            scale_u, scale_v, skew = frames[t, 0], frames[t, 1], frames[t, 2]
            for k in range(3):
                edge = corners[v2, k] - corners[v1, k]
                record[k, t - first] = edge * scale_u
                third = (corners[v3, k] - corners[v1, k]) * scale_v
                record[3 + k, t - first] = third - edge * skew
        _complete(record)


@compiled(forceinline=True, fastmath=FUSED)
def _complete(record: Array) -> None:
    """Fill what follows from f_u and f_v."""
    u0, u1, u2, v0, v1, v2 = record[0], record[1], record[2], record[3], record[4], record[5]
    normal0, normal1, normal2 = record[6], record[7], record[8]
    areas, first, mixed = record[9], record[10], record[11]
    for t in range(record.shape[1]):
        e, m, n0, n1, n2, area = first_forms(u0[t], u1[t], u2[t], v0[t], v1[t], v2[t])
        scale = 1.0 / area if area > 0.0 else 0.0
        normal0[t], normal1[t], normal2[t] = n0 * scale, n1 * scale, n2 * scale
        areas[t], first[t], mixed[t] = area, e, m


@compiled
def add_gradient(
    records: Array,
    slopes: Array,
    faces: Triangles,
    frames: Array,
    first: int,
    last: int,
    gradient: Array,
) -> None:
    """Add slopes by records up to slopes by vertices; triangles without area have none."""
    for i in range(len(records)):
        slope, added = slopes[i], gradient[i]
        _join(records[i], slope)
        for t in range(first, last):
            v1, v2, v3 = faces[t, 0], faces[t, 1], faces[t, 2]
            scale_u, scale_v, skew = frames[t, 0], frames[t, 1], frames[t, 2]
            for k in range(3):
                in_u, in_v = slope[k, t - first], slope[3 + k, t - first]
                at_two = scale_u * in_u - skew * in_v
                at_three = scale_v * in_v
                added[v2, k] += at_two
                added[v3, k] += at_three
                added[v1, k] -= at_two + at_three


@compiled(forceinline=True, fastmath=FUSED)
def _join(record: Array, slope: Array) -> None:
    """Add slopes by what follows from f_u and f_v up to slopes by these."""
    for t in range(record.shape[1]):
        has_area = record[9, t] > 0.0
        # N', the slope in f_u × f_v = A n; that in n counts along the triangle alone.
        scale = 1.0 / record[9, t] if has_area else 0.0
        radial = 0.0
        for k in range(6, 9):
            radial += record[k, t] * slope[k, t]
        along = slope[9, t] - radial * scale
        doubled, mixed = 2.0 * slope[10, t], slope[11, t]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            n_i = along * record[6 + i, t] + slope[6 + i, t] * scale
            n_j = along * record[6 + j, t] + slope[6 + j, t] * scale
            # f_v × N' and N' × f_u.
            in_u = record[3 + i, t] * n_j - record[3 + j, t] * n_i
            in_v = n_i * record[j, t] - n_j * record[i, t]
            in_u += slope[k, t] + doubled * record[k, t] + mixed * record[3 + k, t]
            in_v += slope[3 + k, t] + mixed * record[k, t]
            slope[k, t] = in_u if has_area else 0.0
            slope[3 + k, t] = in_v if has_area else 0.0


def _records(surfaces: Points, template: Template) -> Iterator[Array]:
    """Yield the records of one surface after the other, in one array."""
    records = onp.empty((1, LENGTH, template.n_faces))
    faces, frames = template.faces, template.frame_coefficients
    for f in surfaces:
        fill_records(of_one_kind(f)[None], faces, frames, 0, len(faces), records)
        yield records[0]


def area_ratios(surfaces: Points, template: Template) -> Iterator[Array]:
    """Yield the area ratios of the triangles of one surface after the other."""
    for record in _records(surfaces, template):
        yield record[9]


def nearly_degenerate(surfaces: Points, template: Template) -> Array:
    """Return which triangles of surfaces have no area, or almost none."""
    flagged = onp.empty((len(surfaces), template.n_faces), dtype=bool)
    for record, marked in zip(_records(surfaces, template), flagged, strict=True):
        squared, mixed = record[9] ** 2, record[11]
        # A² + m² = e g.
        marked[:] = squared <= surface.NEARLY_DEGENERATE * (squared + mixed**2)
    return flagged
