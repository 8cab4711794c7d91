"""Metrics on aligned surfaces as sums of terms."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import check_shape
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.metric_of_terms import MetricOfTerms
from riemhuman.geometry.pairwise import Points
from riemhuman.geometry.term_fields import TermFields
from riemhuman.kernels import surface
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.sketches import patch_coordinates, triangle_patches
from riemhuman.terms.sum import SumOfTerms
from riemhuman.terms.term import Fields, Term


class SurfaceMetric(MetricOfTerms):
    r"""A sum of terms, each a metric on fields of a surface, pulled back and weighted.

    .. math:: d(f_1, f_2)^2 = \sum_k w_k \int_T d_k(\varphi_k(f_1), \varphi_k(f_2))^2\, dx

    `dist` is the distance of the images (equation 4 of the paper). It bounds the length of every
    path between two surfaces from below; `length` and `energy` are those of a path.

    Parameters
    ----------
    terms : sequence of Term
        The terms, at least one; see `riemhuman.terms`.

    Raises
    ------
    ArgumentError
        If there is no term.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> terms = [rh.terms.EbinTerm(1.0, lam=1.0), rh.terms.NormalTerm(0.1)]
    >>> metric = rh.SurfaceMetric(space, terms)
    >>> elastic = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> bool(abs(metric.dist(bodies[0], bodies[1]) - elastic.dist(bodies[0], bodies[1])) < 1e-12)
    True
    """

    driver = SumOfTerms
    _sum: SumOfTerms
    is_translation_invariant = True

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return the sum of the squared distances of fields (equation 5).

        Raises
        ------
        DegenerateSurfaceError
            If a term needs the area of a triangle that has none.
        """
        one = self._derivatives(self.space.check_point(point_a, "point_a"))
        other = self._derivatives(self.space.check_point(point_b, "point_b"))
        total: Any = 0.0
        for term in self.terms:
            total = total + self._integral(term, term.fields(one), term.fields(other))
        return total

    def squared_dists_and_gradient(
        self, point: ndarray, others: ndarray, weights: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Return the squared distances of a surface from others, and the gradient of their sum.

        Computed in compiled loops, which read each triangle of the surface once.

        Returns
        -------
        squared : array, shape (n,)
            d(f_i, f)², infinite where a term needs the area of a triangle that has none.
        gradient : array, shape (V, 3)
            Gradient of Σ_i w_i d(f_i, f)² with respect to f.
        """
        point = self.check_points(point[None], "point")[0]
        others = self.check_points(others, "others")
        return self._sum.squared_dists(point, others, weights)

    @property
    def bulk(self) -> SumOfTerms:
        """Features of the fields of surfaces, in compiled passes over the triangles of each."""
        return self._sum

    @property
    def is_stretch_invariant(self) -> bool:
        """Whether no term changes with the lengths of edges."""
        return all(term.is_stretch_invariant for term in self.terms)

    def remove_drift(self, path: ndarray) -> ndarray:
        """Remove rigid motions that the metric does not see from a path.

        No term sees translations of a surface, and some see no rotations either: a minimiser of the
        energy is free to drift. Of all paths that differ by such motions of the interior surfaces,
        this one is nearest to the straight path between the ends, by the sum of the vertices'
        distances.

        Returns
        -------
        array, shape (n_times, V, 3)
            A path of the same energy with the same ends.
        """
        path = self.check_points(path, "path")
        rotations = all(term.is_rotation_invariant for term in self.terms)
        return still_path(path, self.space.template.vertex_areas, rotations=rotations)

    def lower_bound_coordinates(self, points: ndarray, n_patches: int | None = None) -> ndarray:
        """Return coordinates whose Euclidean distances are at most those of the metric.

        See `riemhuman.kernels.sketches`. A term without a chart adds nothing to them.

        Parameters
        ----------
        points : array, shape (..., V, 3)
            Surfaces.
        n_patches : int, optional
            Number of patches of triangles to average over; by default there is no averaging, and
            the bound is tightest.

        Returns
        -------
        array, shape (..., m)
        """
        template, patches = self.space.template, None
        if n_patches is not None:
            patches = triangle_patches(template.vertices, template.faces, n_patches)
        points = self.space.check_point(points, "points")
        first = self._derivatives(points)
        sketches = [np.zeros((*points.shape[:-2], 0))]
        for term in self.terms:
            chart = term.chart(term.fields(first))
            if chart is not None:
                chart = np.sqrt(term.weight) * chart
                sketches.append(patch_coordinates(chart, template.face_areas, patches))
        return np.concatenate(sketches, axis=-1)

    @property
    def target_metric(self) -> RiemannianMetric:
        """The metric of the fields, on a space where geodesics have a closed form.

        Raises
        ------
        NotDefinedError
            If there is no such space for the fields of a term.
        """
        return self._images.metric

    def map(self, f: ndarray) -> ndarray:
        r"""Return the fields of surfaces, as points of the space of `target_metric`.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., \*target_shape)
        """
        return self._images.of(self._derivatives(self.space.check_point(f, "f")))

    def differential(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the derivatives of the fields along deformations, as tangent vectors.

        Parameters
        ----------
        tangent_vec : array, shape (..., V, 3)
            Deformations h.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., \*target_shape)
        """
        operator = self.space.template.differential_operator
        tangent_vec = self.space.check_tangent_vec(tangent_vec)
        first = surface.derivatives(self.space.check_immersed(base_point, "base_point"), operator)
        return self._images.changes(first, *surface.partial_derivatives(tangent_vec, operator))

    def _derivatives(self, f: ndarray) -> surface.Derivatives:
        operator = self.space.template.differential_operator
        first = surface.follow_up(*surface.partial_derivatives(f, operator))
        if self._sum.needs_area and first.degenerate.any():
            surface.refuse_degenerate(first.degenerate)
        return first

    @cached_property
    def _images(self) -> TermFields:
        return TermFields(self.terms, self.space.template)

    def _squared_segments(self, path: ndarray) -> ndarray:
        first, times = self._derivatives(path), (slice(None),) * (path.ndim - 3)
        total: Any = 0.0
        for term in self.terms:
            fields = term.fields(first)
            before, after = (
                tuple(field[(*times, part)] for field in fields)
                for part in (slice(None, -1), slice(1, None))
            )
            total = total + self._integral(term, before, after)
        return total

    def _integral(self, term: Term, fields_a: Fields, fields_b: Fields) -> ndarray:
        """Return w ∫ d² dx of one term."""
        values = term.squared_dist(fields_a, fields_b) * self._sum.areas
        return term.weight * np.sum(values, axis=-1)

    def _members(self, points: Points, name: str) -> ndarray:
        points = self.space.check_point(points, name)
        check_shape(points, name, ("n_points", *self.space.shape), batched=False)
        return points
