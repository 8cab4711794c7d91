r"""The driver of a sum of terms: inner products by definition, and all else in compiled loops.

Each term makes a pass of its own over the triangles. Along paths terms share the records of
triangles, see `riemhuman.kernels.triangles`, some thousand at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.kernels import surface, triangles
from riemhuman.kernels.surface import Derivatives, follow_up
from riemhuman.kernels.threads import in_tiles, of_one_kind, padded, rounding, sums_in_chunks
from riemhuman.terms.flat import FlatTerm
from riemhuman.terms.term import Fields, Term

Features = tuple[ndarray, ...]

# Below this many triangles times surfaces, threads cost more than they bring.
_WORTH_THREADS = 50_000
# Triangles times surfaces whose records stay in a core's own cache from one pass to the next.
_IN_CACHE = 8192


class SumOfTerms:
    """A weighted sum of terms on the surfaces over a template, which others have checked.

    Features are what distances need to know of surfaces: of each term an array, and its rounding.
    """

    term_class = Term

    def __init__(self, terms: Sequence[Term], template: Any) -> None:
        self.terms, self.template = tuple(terms), template
        self.n_arrays = 2 * len(self.terms)
        self.needs_area = any(term.needs_area for term in self.terms)
        self._faces, self._frames = template.faces, template.frame_coefficients
        self.areas = template.face_areas

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.terms, self.template)

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of the derivatives of the fields along h and k."""
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        surface.refuse_degenerate(first.degenerate, "base_point")
        along_h = surface.frame_components(first, *surface.partial_derivatives(h, operator))
        along_k = along_h
        if k is not h:
            along_k = surface.frame_components(first, *surface.partial_derivatives(k, operator))
        total: Any = 0.0
        for term in self.terms:
            form = term.form(first)
            if form.ndim == 2:
                values = surface.dot(np.matmul(along_h, form), along_k)
            else:
                values = np.einsum("...i,...ij,...j->...", along_h, form, along_k)
            scale = term.weight * self.areas * first.areas**term.area_power
            total = total + np.sum(scale * values, axis=-1)
        return total

    def features(self, points: ndarray, precision: str) -> Features:
        """Return the features of surfaces."""
        faces, frames, areas = self._faces, self._frames, self.areas
        found: Features = ()
        for term in self.terms:
            found += _room(term, len(points), len(faces), precision)
        degenerate = onp.zeros((len(points), len(faces)), dtype=bool)
        for i, f in enumerate(of_one_kind(points)):
            if self.needs_area:
                triangles.mark_degenerate(f, faces, frames, degenerate[i])
                if degenerate[i].any():
                    continue
            for term, kept, gaps in zip(self.terms, found[::2], found[1::2], strict=True):
                gap = term.pack_surface(f, faces, frames, areas, kept[i])
                gaps[i] = rounding(gap, kept)
        if degenerate.any():
            surface.refuse_degenerate(degenerate)
        return found

    def rounding(self, features: Features) -> ndarray:
        """Return a bound on the rounding error of each point's features, as a distance."""
        total: Any = 0.0
        for term, gaps in zip(self.terms, features[1::2], strict=True):
            total = total + term.weight * gaps**2
        return onp.sqrt(total)

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        """Return all squared distances between two sets of points."""

        def run(pair: tuple[Features, Features]) -> ndarray:
            total: Any = 0.0
            for term, one, other in zip(self.terms, *pair, strict=True):
                total = total + term.weight * term.squared_distances(one, other, self.areas)
            return total

        return in_tiles(run, a[::2], b[::2], n_threads)

    def path_energy(self, path: ndarray, *, gradient: bool = True) -> tuple[float, Any]:
        """Return the closed-form path energy n Σ d²(f_i, f_{i+1}) and its gradient."""
        faces, frames, areas = self._faces, self._frames, self.areas
        # Vertex by vertex, all times together: what one triangle reads lies close together.
        by_vertex = onp.ascontiguousarray(onp.swapaxes(path, 0, 1))
        by_vertex.flags.writeable = False  # the kind that loops are compiled for
        n_times = len(path)

        def run(first: int, last: int) -> tuple[Any, ...]:
            total, found = 0.0, onp.zeros(by_vertex.shape if gradient else 0)
            size = max(1, min(_IN_CACHE // n_times, last - first))
            records, slopes = onp.empty((2, n_times, triangles.LENGTH, size))
            for start in range(first, last, size):
                end = min(start + size, last)
                if end - start < size:
                    records, slopes = onp.empty((2, n_times, triangles.LENGTH, end - start))
                slopes[:] = 0.0
                triangles.fill_records(by_vertex, faces, frames, start, end, records)
                for term in self.terms:
                    total += term.add_segments(records, slopes, areas[start:end])
                if gradient:
                    triangles.add_gradient(records, slopes, faces, frames, start, end, found)
            return total, found

        threaded = len(faces) * n_times > _WORTH_THREADS
        energy, slope = sums_in_chunks(run, len(faces), threaded=threaded)
        if not gradient:
            return energy * (n_times - 1), None
        slope *= n_times - 1
        return energy * (n_times - 1), onp.ascontiguousarray(onp.swapaxes(slope, 0, 1))

    def squared_dists(
        self,
        point: ndarray,
        others: ndarray,
        weights: ndarray,
        other_faces: ndarray | None = None,
    ) -> tuple[ndarray, ndarray]:
        """Return the squared distances of one surface from others, and the slope of their sum."""
        faces, frames, areas = self._faces, self._frames, self.areas
        other_faces = faces if other_faces is None else other_faces
        f = of_one_kind(point)[:, None]
        kinds = [of_one_kind(other)[:, None] for other in others]

        def run(first: int, last: int) -> tuple[ndarray, ndarray]:
            squared, gradient = onp.zeros(len(others)), onp.zeros((len(point), 1, 3))
            size = max(1, min(_IN_CACHE // 2, last - first))
            records, slopes = onp.empty((2, 2, triangles.LENGTH, size))
            for start in range(first, last, size):
                end = min(start + size, last)
                if end - start < size:
                    records, slopes = onp.empty((2, 2, triangles.LENGTH, end - start))
                slopes[:] = 0.0
                triangles.fill_records(f, faces, frames, start, end, records[1:])
                for i, other in enumerate(kinds):
                    # The slopes by these are added up as well, and not used.
                    triangles.fill_records(other, other_faces, frames, start, end, records[:1])
                    weighted = of_one_kind(weights[i] * areas[start:end])
                    for term in self.terms:
                        squared[i] += term.add_segments(records, slopes, weighted)
                triangles.add_gradient(records[1:], slopes[1:], faces, frames, start, end, gradient)
            return squared, gradient

        threaded = len(faces) * len(others) > _WORTH_THREADS
        squared, gradient = sums_in_chunks(run, len(faces), threaded=threaded)
        return squared / weights, gradient[:, 0]

    def matrix(self, surfaces: ndarray) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""
        blocks = onp.zeros((len(self._faces), 9, 9))
        for f in surfaces:
            first = surface.derivatives(f, self.template.differential_operator)
            surface.refuse_degenerate(first.degenerate, "base_point")
            forms = [term.form(first) for term in self.terms]
            shares = self.areas / len(surfaces)
            scales = [term.weight * shares * first.areas**term.area_power for term in self.terms]
            # Those of terms that treat all triangles alike are one product of matrices.
            alike = [k for k, form in enumerate(forms) if form.ndim == 2]
            constant = onp.reshape([forms[k] for k in alike], (len(alike), 36))
            weights = onp.reshape([scales[k] for k in alike], (len(alike), len(blocks)))
            total = (weights.T @ constant).reshape(-1, 6, 6)
            for form, scale in zip(forms, scales, strict=True):
                if form.ndim > 2:
                    total = total + scale[:, None, None] * form
            triangles.add_blocks(blocks, f, self._faces, total)
        return self.template.assembler.assemble(blocks)


class TermOfFields(SumOfTerms):
    """One term on fields that are no surface's."""

    def __init__(self, term: Term, template: Any, fields_of: Callable[[ndarray], Fields]) -> None:
        super().__init__([term], template)
        self._fields_of = fields_of

    def features(self, points: ndarray, precision: str) -> Features:
        return field_features(self.terms[0], self._fields_of(points), self.areas, precision)


def field_features(term: Term, fields: Fields, areas: ndarray, precision: str) -> Features:
    """Return the features of fields of one term, and their rounding."""
    fields = tuple(map(of_one_kind, fields))
    kept, gaps = _room(term, len(fields[0]), len(areas), precision)
    for i, row in enumerate(kept):
        gaps[i] = rounding(term.pack(tuple(field[i] for field in fields), areas, row), row)
    return kept, gaps


def _room(term: Term, n_points: int, n_faces: int, precision: str) -> Features:
    """Return zeros for the features of a term, and for their rounding."""
    shape = (n_points, *term.feature_shape(n_faces))
    return padded(shape, precision if term.single else "double"), onp.zeros(n_points)


# Partial derivatives of three triangles on each of two surfaces, nearly those of the template.
_TRIANGLES = onp.random.default_rng(0).uniform(-0.3, 0.3, (2, 2, 3, 3))
_TRIANGLES += onp.eye(2, 3)[:, None, None]


def checked_terms(terms: Any, term_class: type) -> tuple[Any, ...]:
    """Return the terms of a metric after checking that loops over triangles can run them.

    A loop trusts the shapes of the fields; wrong ones would have it write beyond its arrays.
    """
    if not isinstance(terms, Sequence) or isinstance(terms, str):
        raise ArgumentTypeError(f"terms must be a sequence of terms; found {terms!r}")
    if not terms:
        raise ArgumentError("terms must hold at least one term; found none")
    for term in terms:
        if not isinstance(term, term_class):
            raise ArgumentTypeError(
                f"terms must hold instances of {term_class.__name__}; found {term!r}"
            )
        if isinstance(term, Term):
            with onp.errstate(all="ignore"):
                _check_fields(term)
    return tuple(terms)


def _check_fields(term: Term) -> None:
    name, shape = type(term).__name__, _TRIANGLES.shape[1:3]
    together = _fields(term, follow_up(*_TRIANGLES))
    for field in together:
        dimensions = (3,) if isinstance(term, FlatTerm) else (2, 3)
        if field.shape[:2] != shape or field.ndim not in dimensions:
            expected = " or ".join(["(..., F)", "(..., F, n)"][-len(dimensions) :])
            raise ArgumentError(
                f"the fields of {name} must have shape {expected}; for derivatives of shape "
                f"(2, 3, 3), of three triangles on each of two surfaces, found {field.shape}"
            )
        _refuse_infinite(field, f"the fields of {name}")
    alone = _fields(term, follow_up(*_TRIANGLES[:, 1:, 2:]))
    for whole, part in zip(together, alone, strict=True):
        if not onp.allclose(whole[1:, 2:], part, rtol=1e-8, atol=1e-8):
            raise ArgumentError(
                f"the fields of {name} must be computed triangle by triangle; found values that "
                "change with the other triangles"
            )
    for other in (together, tuple(field[::-1] for field in together)):
        found = onp.asarray(term.squared_dist(together, other))
        if found.shape != shape:
            raise ArgumentError(
                f"squared_dist of {name} must return shape (..., F), one number a triangle; for "
                f"fields of three triangles on each of two surfaces, found {found.shape}"
            )
        _refuse_infinite(found, f"squared_dist of {name}")


def _refuse_infinite(found: ndarray, name: str) -> None:
    if not onp.isfinite(found).all():
        first = found[~onp.isfinite(found)][0]
        raise ArgumentError(f"{name} must be finite on ordinary triangles; found {first}")


def _fields(term: Term, first: Derivatives) -> tuple[ndarray, ...]:
    name, fields = type(term).__name__, term.fields(first)
    if not isinstance(fields, tuple) or not fields:
        raise ArgumentTypeError(
            f"fields of {name} must return a tuple of arrays; found {type(fields).__name__}"
        )
    for field in fields:
        if onp.asarray(field).dtype.kind != "f":
            raise ArgumentTypeError(
                f"the fields of {name} must be arrays of real numbers; found "
                f"{onp.asarray(field).dtype}"
            )
    return tuple(map(onp.asarray, fields))
