"""Parallel transport by a ladder of geodesics, exact where the metric has a closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Points, TangentVectors
from riemhuman.checks import a_basis, a_solver, checked, positive, whole
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import GeodesicSolver, TransportSolver
from riemhuman.solvers._alignment import align_ends
from riemhuman.solvers._geodesic_equation import GeodesicEquation, Triple
from riemhuman.solvers.paths import check_end_points, check_path_from, rounding_energy, vector_of
from riemhuman.solvers.results import Result, Status, finish
from riemhuman.surfaces.deformation_basis import DeformationBasis


@dataclass(frozen=True, repr=False)
class TransportResult(Result):
    r"""A tangent vector, transported along a path.

    Attributes
    ----------
    tangent_vec : array, shape (\*shape,)
        The vector at the end of the path.
    tangent_vecs : array, shape (n_nodes, \*shape)
        The vector at every point of the path.
    path : array, shape (n_nodes, \*shape)
    n_iterations, n_evaluations, status, message
        See `Result`; counts are those of the rungs' equations, 0 for closed forms.

    Examples
    --------
    >>> metric, ladder = rh.VectorSpace((1,)).metric, rh.solvers.PoleLadder()
    >>> ladder.solve(metric, [1.0], [0.0], end_point=[2.0]).tangent_vecs.tolist()
    [[1.0], [1.0]]
    """

    tangent_vec: TangentVectors
    tangent_vecs: TangentVectors
    path: Points

    def points_to_draw(self) -> Points:
        return self.path


@checked(
    n_rungs=whole(minimum=1),
    basis=a_basis,
    geodesic_solver=a_solver,
    tolerance=positive,
    max_iter=whole(minimum=1),
)
@dataclass(frozen=True)
class PoleLadder(TransportSolver):
    r"""Parallel transport along the diagonals of geodesic parallelograms.

    For each segment (p, q) with midpoint m, the points exp_p(±w) are reflected in m; the results
    are exp_q(∓w'). Exact on symmetric spaces, such as spheres and their products; otherwise the
    error is of second order in the length of the segments (Guigui and Pennec, "Numerical accuracy
    of ladder schemes for parallel transport on manifolds", Foundations of Computational Mathematics
    22, 2022). Along geodesics, metrics that have transport in closed form use it. Without
    closed-form geodesics, each side of a rung is one discrete segment. If the metric ignores
    rotations and translations, the end point is first aligned with the base point; the path and the
    vectors are turned back.

    Parameters
    ----------
    n_rungs : int
        Number of segments of a closed-form geodesic; the path of a solver has its own number.
    basis : DeformationBasis, optional
        Deformations that, together with those of the path and the vector, span the discrete
        segments; by default all coordinates are free.
    geodesic_solver : object, optional
        Solver for the geodesic, by default the metric's own.
    tolerance, max_iter
        See `DiscreteExponential`; they apply to every equation.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.PoleLadder().solve(metric, [1.0], [0.0], end_point=[2.0]).tangent_vec
    array([1.])
    """

    n_rungs: int = 10
    basis: DeformationBasis | None = None
    geodesic_solver: GeodesicSolver | None = None
    tolerance: float = 1e-10
    max_iter: int = 50

    def solve(
        self,
        metric: RiemannianMetric,
        tangent_vec: TangentVectors,
        base_point: Points,
        direction: TangentVectors | None = None,
        end_point: Points | None = None,
        path: Points | None = None,
    ) -> TransportResult:
        r"""Transport a tangent vector along a geodesic, or along a path.

        Parameters
        ----------
        metric : RiemannianMetric
        tangent_vec : array, shape (\*shape,)
            Tangent vector at the base point.
        base_point : array, shape (\*shape,)
            Where the path starts.
        direction : array, shape (\*shape,), optional
            Initial velocity of the geodesic, which is followed for unit time by the metric's `exp`.
        end_point : array, shape (\*shape,), optional
            End of the geodesic.
        path : array, shape (n_nodes, \*shape), optional
            Path from the base point, with one rung per segment; exactly one of the three is given.
        """
        check_metric(metric)
        n_given = (direction is not None) + (end_point is not None) + (path is not None)
        if n_given != 1:
            raise ArgumentError("solve needs exactly one of direction, end_point and path")
        vector = vector_of(tangent_vec, "tangent_vec", metric)
        if path is not None:
            return self._climb(metric, vector, check_path_from(metric, path, base_point))
        if direction is not None:
            direction = vector_of(direction, "direction", metric)
            base_point, _ = check_end_points(metric, base_point, base_point)
            times = np.linspace(0.0, 1.0, self.n_rungs + 1)
            path = metric.geodesic(base_point, initial_tangent_vec=direction)(times)
            start, end = path[0], path[-1]
        else:
            start, end = check_end_points(metric, base_point, np.asarray(end_point))
        if metric.has_closed_form_transport:
            if direction is None:
                transported = metric.parallel_transport(vector, start, end_point=end)
            else:
                transported = metric.parallel_transport(vector, start, direction=direction)
            vectors, ends = np.stack([vector, transported]), np.stack([start, end])
            return TransportResult(transported, vectors, ends, message="closed form")
        if path is not None:
            return self._climb(metric, vector, path)
        aligned = align_ends(metric, start, end)
        path = self._geodesic(metric, start, aligned.end)
        result = self._climb(metric, vector, path)
        vectors = aligned.vectors_turned_back(result.tangent_vecs)
        path = aligned.turned_back(result.path)
        return replace(result, tangent_vec=vectors[-1], tangent_vecs=vectors, path=path)

    def _geodesic(self, metric: RiemannianMetric, start: Points, end: Points) -> Array:
        if metric.has_closed_form_geodesic:
            return metric.geodesic(start, end_point=end)(np.linspace(0.0, 1.0, self.n_rungs + 1))
        solver = self.geodesic_solver or metric.geodesic_solver
        if solver is None:
            raise NotDefinedError(
                f"{type(metric).__name__} has no closed form for geodesics; pass path=, or a "
                "strategy such as PoleLadder(geodesic_solver=BasisPath(basis))"
            )
        return np.asarray(solver.solve(metric, start, end).path)

    def _climb(
        self, metric: RiemannianMetric, vector: TangentVectors, path: Points
    ) -> TransportResult:
        """Return a vector transported along a path."""
        vectors = [vector]
        equation: _ClosedForms | GeodesicEquation = _ClosedForms(metric)
        if not metric.has_closed_form_geodesic:
            basis = self.basis
            if basis is not None:
                basis = basis.extend(np.stack([path[-1] - path[0], vector]))
            equation = GeodesicEquation(metric, basis, self.tolerance, self.max_iter)
        floor = np.sqrt(rounding_energy(metric, path[0]))
        solved: list[Triple] = []
        for start, end in pairwise(path):
            length = float(metric.norm(vectors[-1], start))
            rung = float(metric.length(np.stack([start, end])))
            if length == 0.0 or rung <= floor:
                vectors.append(vectors[-1])
                continue
            share = rung / length  # the sides exp_p(±w) are as long as the segment
            halves = equation.middle_point(start, end)
            sides = equation.both_sides(start, share * vectors[-1])
            behind, _, ahead = sides.points
            # These two end at exp_q(∓w').
            before = equation.next_point(ahead, halves.points[1])
            after = equation.next_point(behind, halves.points[1])
            solved += [halves, sides, before, after]
            vectors.append(equation.velocity(before.points[2], end, after.points[2]) / share)
        error = max((triple.error for triple in solved), default=0.0)
        converged = error <= self.tolerance
        unsolved = "" if converged else f"; an equation was solved only to {error:.1e}"
        result = TransportResult(
            vectors[-1],
            np.stack(vectors),
            path,
            n_iterations=sum(triple.n_iterations for triple in solved),
            n_evaluations=sum(triple.n_evaluations for triple in solved),
            status=Status.CONVERGED if converged else Status.MAX_ITER,
            message=f"{len(path) - 1} rungs{unsolved}",
        )
        return finish(self, result)


class _ClosedForms(NamedTuple):
    """What `GeodesicEquation` solves, by the metric's own exponential and logarithm."""

    metric: RiemannianMetric

    def next_point(self, before: Array, middle: Array) -> Triple:
        after = self.metric.exp(-self.metric.log(before, middle), middle)
        return Triple(np.stack([before, middle, after]))

    def both_sides(self, middle: Array, displacement: Array) -> Triple:
        before = self.metric.exp(-displacement, middle)
        after = self.metric.exp(displacement, middle)
        return Triple(np.stack([before, middle, after]))

    def middle_point(self, start: Points, end: Points) -> Triple:
        middle = self.metric.exp(0.5 * self.metric.log(end, start), start)
        return Triple(np.stack([start, middle, end]))

    def velocity(self, before: Array, middle: Array, after: Array) -> Array:
        return 0.5 * (self.metric.log(after, middle) - self.metric.log(before, middle))
