"""The driver of a sum of terms in compiled loops: features, pairs, path energies and matrices.

Each term makes a pass of its own over the triangles. Along paths terms share the records of
triangles, see `riemhuman.kernels.triangles`, some thousand at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.kernels import triangles
from riemhuman.kernels.surface import Derivatives
from riemhuman.kernels.threads import in_chunks
from riemhuman.kernels.tiles import of_one_kind, padded, rounding
from riemhuman.terms.term import Fields, Term

Features = tuple[ndarray, ...]

# Below this many triangles times surfaces, threads cost more than they bring.
_WORTH_THREADS = 50_000
# Triangles times surfaces whose records stay in a core's own cache from one pass to the next.
_IN_CACHE = 4096


def surface_features(
    terms: Sequence[Term],
    template: Any,
    points: ndarray,
    precision: str,
    refuse: Callable[[ndarray], None],
) -> Features:
    """Return what distances need to know of surfaces, each term's features and their rounding.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    template : Template
        Its `faces`, `frame_coefficients` and `face_areas` are used.
    points : array, shape (n, V, 3)
        Surfaces.
    precision : {"single", "double"}
        Precision of the features of terms that know single precision.
    refuse : callable
        Called with the triangles without area, shape (n, F), where a term needs areas.

    Returns
    -------
    tuple of array, each of shape (n, ...)
    """
    faces, frames, areas = template.faces, template.frame_coefficients, template.face_areas
    surfaces = of_one_kind(points)
    if any(term.needs_area for term in terms):
        degenerate = np.empty((len(points), len(faces)), dtype=bool)
        for f, marked in zip(surfaces, degenerate, strict=True):
            triangles.mark_degenerate(f, faces, frames, marked)
        refuse(degenerate)
    packers = [_Packer(term, len(points), areas, precision) for term in terms]
    for i, f in enumerate(surfaces):
        for packer in packers:
            packer.gaps[i] = packer.term.pack_surface(f, faces, frames, areas, packer.kept[i])
    return tuple(array for packer in packers for array in packer.features())


def field_features(term: Term, fields: Fields, areas: ndarray, precision: str) -> Features:
    """Return the features of fields of one term, and their rounding.

    Parameters
    ----------
    term : Term
        The term.
    fields : tuple of array, each of shape (n, F, ...)
        Fields.
    areas : array, shape (F,)
        Template areas.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    tuple of array, each of shape (n, ...)
    """
    fields = tuple(of_one_kind(field) for field in fields)
    packer = _Packer(term, len(fields[0]), areas, precision)
    for i in range(len(fields[0])):
        some = tuple(field[i] for field in fields)
        packer.gaps[i] = term.pack(some, areas, packer.kept[i])
    return packer.features()


class _Packer:
    """The features of one term, filled surface by surface."""

    def __init__(self, term: Term, n_points: int, areas: ndarray, precision: str) -> None:
        self.term, self.areas = term, areas
        self.precision = precision if term.single else "double"
        self.kept = padded((n_points, *term.feature_shape(len(areas))), self.precision)
        self.gaps = np.zeros(n_points)

    def features(self) -> Features:
        return self.kept, rounding(self.gaps, self.term.underflow(self.areas), self.precision)


def squared_distances(
    terms: Sequence[Term], areas: ndarray, a: Features, b: Features, n_threads: int = 1
) -> ndarray:
    """Return all squared distances between two sets of points given by their features.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    areas : array, shape (F,)
        Template areas.
    a, b : tuple of array
        Features; one object twice for the distances within one set.
    n_threads : int
        Number of threads.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    total: Any = 0.0
    for k, term in enumerate(terms):
        squared = term.squared_distances(a[2 * k], b[2 * k], areas, n_threads)
        squared *= term.weight
        total = squared if k == 0 else total + squared
    return total


def roundings(terms: Sequence[Term], features: Features) -> ndarray:
    """Return how far points are, at most, from those that their features stand for.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    features : tuple of array
        Features of n points.

    Returns
    -------
    array, shape (n,)
    """
    squares = (term.weight * features[2 * k + 1] ** 2 for k, term in enumerate(terms))
    return np.sqrt(sum(squares))


def path_energy(terms: Sequence[Term], template: Any, path: ndarray) -> tuple[float, ndarray]:
    """Return the closed-form path energy n Σ d²(f_i, f_{i+1}) and its gradient.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    template : Template
        Its `faces`, `frame_coefficients` and `face_areas` are used.
    path : array, shape (n_times, V, 3)
        Surfaces f_i.

    Returns
    -------
    energy : float
        Infinite where a surface has no fields.
    gradient : array, shape (n_times, V, 3)
        Gradient with respect to all surfaces, 0 in triangles without area.
    """
    faces, frames, areas = template.faces, template.frame_coefficients, template.face_areas
    # Vertex by vertex, all times together: what one triangle reads lies close together.
    by_vertex = np.ascontiguousarray(np.swapaxes(path, 0, 1))
    n_times = len(path)

    def run(first: int, last: int) -> tuple[float, ndarray]:
        total, gradient = 0.0, np.zeros(by_vertex.shape)
        size = max(1, min(_IN_CACHE // n_times, last - first))
        records = np.empty((size, n_times, triangles.LENGTH))
        slopes = np.empty_like(records)
        for start in range(first, last, size):
            end = min(start + size, last)
            some, their_slopes = records[: end - start], slopes[: end - start]
            triangles.fill_records(by_vertex, faces, frames, start, end, some)
            their_slopes[:] = 0.0
            for term in terms:
                total += term.add_segments(some, their_slopes, areas[start:end])
            triangles.add_gradient(some, their_slopes, faces, frames, start, end, gradient)
        return total, gradient

    parts = in_chunks(run, len(faces), threaded=len(faces) * n_times > _WORTH_THREADS)
    energy = (n_times - 1) * sum(value for value, _ in parts)
    gradient = parts[0][1]
    for _, more in parts[1:]:
        gradient += more
    gradient *= n_times - 1
    return float(energy), np.ascontiguousarray(np.swapaxes(gradient, 0, 1))


def squared_dists(
    terms: Sequence[Term],
    template: Any,
    point: ndarray,
    others: ndarray,
    weights: ndarray,
    other_faces: ndarray | None = None,
) -> tuple[ndarray, ndarray]:
    """Return the squared distances of one surface from others, and the slope of their sum.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    template : Template
        Its `faces`, `frame_coefficients` and `face_areas` are used.
    point : array, shape (V, 3)
        Surface f.
    others : array, shape (n, V, 3)
        Surfaces f_i.
    weights : array, shape (n,)
        Weights w_i > 0.
    other_faces : array of int, shape (F, 3), optional
        Where the corners of the others' triangles are, by default where those of f are.

    Returns
    -------
    squared : array, shape (n,)
        d²(f_i, f), infinite where a surface has no fields.
    gradient : array, shape (V, 3)
        Gradient of Σ_i w_i d²(f_i, f) with respect to f, 0 in triangles without area.
    """
    faces, frames, areas = (
        template.faces,
        template.frame_coefficients,
        template.face_areas,
    )
    other_faces = faces if other_faces is None else other_faces
    surface = np.ascontiguousarray(point)[:, None]
    kinds = [np.ascontiguousarray(other)[:, None] for other in others]

    def run(first: int, last: int) -> tuple[ndarray, ndarray]:
        squared, gradient = np.zeros(len(others)), np.zeros((len(point), 1, 3))
        size = max(1, min(_IN_CACHE // 2, last - first))
        both = np.empty((size, 2, triangles.LENGTH))
        one = np.empty((size, 1, triangles.LENGTH))
        slopes = np.empty_like(both)
        for start in range(first, last, size):
            end = min(start + size, last)
            records, own, added = (
                both[: end - start],
                one[: end - start],
                slopes[: end - start],
            )
            triangles.fill_records(surface, faces, frames, start, end, own)
            records[:, 1] = own[:, 0]
            added[:] = 0.0
            for i, other in enumerate(kinds):
                triangles.fill_records(other, other_faces, frames, start, end, own)
                # The slopes by these are added up as well, and not used.
                records[:, 0] = own[:, 0]
                weighted = weights[i] * areas[start:end]
                for term in terms:
                    squared[i] += term.add_segments(records, added, weighted)
            own[:, 0] = added[:, 1]
            slope = own.copy()
            own[:, 0] = records[:, 1]
            triangles.add_gradient(own, slope, faces, frames, start, end, gradient)
        return squared, gradient

    threaded = len(faces) * len(others) > _WORTH_THREADS
    parts = in_chunks(run, len(faces), threaded=threaded)
    squared, gradient = parts[0]
    for more_squared, more_gradient in parts[1:]:
        squared += more_squared
        gradient += more_gradient
    return squared / weights, gradient[:, 0]


def add_blocks(
    terms: Sequence[Term], template: Any, f: ndarray, first: Derivatives, blocks: ndarray
) -> None:
    """Add the matrices of the metric at a surface, one a triangle.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    template : Template
        Its `faces`, `frame_coefficients` and `face_areas` are used.
    f : array, shape (V, 3)
        Surface, whose triangles have an area.
    first : Derivatives
        Its first derivatives.
    blocks : array, shape (F, 9, 9)
        Added to; rows and columns run over the coordinates of the first, second, third corner.
    """
    forms = [term.form(first) for term in terms]
    scales = [term.weight * template.face_areas * first.areas**term.area_power for term in terms]
    # Those of terms that treat all triangles alike are one product of matrices.
    alike = [k for k, form in enumerate(forms) if form.ndim == 2]
    constant = np.reshape([forms[k] for k in alike], (len(alike), 36))
    weights = np.reshape([scales[k] for k in alike], (len(alike), len(template.faces)))
    total = (weights.T @ constant).reshape(-1, 6, 6)
    for form, scale in zip(forms, scales, strict=True):
        if form.ndim > 2:
            total = total + scale[:, None, None] * form
    triangles.add_blocks(blocks, f, template.faces, template.frame_coefficients, total)
