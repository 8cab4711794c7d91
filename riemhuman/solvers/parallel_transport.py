"""Parallel transport by ladders of geodesics, exact where the metric has a closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import GeodesicSolver, TransportSolver
from riemhuman.solvers._geodesic_equation import GeodesicEquation, Triple
from riemhuman.solvers.paths import check_end_points, rounding_energy
from riemhuman.solvers.results import Result, Solver, Status, finish
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

    tangent_vec: ndarray
    tangent_vecs: ndarray
    path: ndarray


@dataclass(frozen=True)
class PoleLadder(Solver, TransportSolver):
    r"""Parallel transport along the diagonals of geodesic parallelograms.

    For each segment (p, q) with midpoint m, the points exp_p(±w) are reflected in m; the results
    are exp_q(∓w'). Exact on symmetric spaces, such as spheres and their products; otherwise the
    error is of second order in the length of the segments (Guigui and Pennec, "Numerical accuracy
    of ladder schemes for parallel transport on manifolds", Foundations of Computational Mathematics
    22, 2022). Along geodesics, metrics that have transport in closed form use it. Without
    closed-form geodesics each side of a rung is one discrete segment.

    Parameters
    ----------
    n_rungs : int
        Number of segments of a closed-form geodesic; a solver's path has its own.
    basis : DeformationBasis, optional
        Deformations that span the discrete segments together with those of the path and the vector;
        by default all coordinates are free.
    geodesic_solver : object, optional
        Solver for the geodesic, by default the metric's own.
    tolerance, max_iter
        As of `DiscreteExponential`, for each equation.

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
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
        path: ndarray | None = None,
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
        if sum(way is not None for way in (direction, end_point, path)) != 1:
            raise ArgumentError("solve needs exactly one of direction, end_point and path")
        vector = real_array(tangent_vec, "tangent_vec", metric.space.shape, batched=False)
        if path is not None:
            return self._climb(metric, vector, _check_path(metric, base_point, path))
        if direction is not None:
            direction = real_array(direction, "direction", metric.space.shape, batched=False)
            times = np.linspace(0.0, 1.0, self.n_rungs + 1)
            path = metric.geodesic(base_point, initial_tangent_vec=direction)(times)
            start, end = path[0], path[-1]
        else:
            start, end = check_end_points(metric, base_point, np.asarray(end_point))
        if metric.has_closed_form_transport:
            way = {"end_point": end} if direction is None else {"direction": direction}
            vectors = np.stack([vector, metric.parallel_transport(vector, start, **way)])
            ends = np.stack([start, end])
            return TransportResult(vectors[-1], vectors, ends, message="closed form")
        if path is None:
            path = self._geodesic(metric, start, end)
        return self._climb(metric, vector, path)

    def _geodesic(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> ndarray:
        if metric.has_closed_form_geodesic:
            return metric.geodesic(start, end_point=end)(np.linspace(0.0, 1.0, self.n_rungs + 1))
        solver = self.geodesic_solver or metric.geodesic_solver
        if solver is None:
            raise NotDefinedError(
                f"{type(metric).__name__} has no closed form for geodesics; pass path=, or a "
                f"strategy such as {type(self).__name__}(geodesic_solver=BasisPath(basis))"
            )
        return np.asarray(solver.solve(metric, start, end).path)

    def _climb(self, metric: RiemannianMetric, vector: ndarray, path: ndarray) -> TransportResult:
        geometry: _ClosedForms | _SingleSegments
        if metric.has_closed_form_geodesic:
            geometry = _ClosedForms(metric)
        else:
            basis = self.basis
            if basis is not None:
                basis = basis.extend(np.stack([path[-1] - path[0], vector]))
            geometry = _SingleSegments(
                GeodesicEquation(metric, basis, self.tolerance, self.max_iter)
            )
        vectors, floor = [vector], np.sqrt(rounding_energy(metric, path[0]))
        for start, end in pairwise(path):
            length = float(metric.norm(vectors[-1], start))
            rung = float(metric.length(np.stack([start, end])))
            if length == 0.0 or rung <= floor:
                vectors.append(vectors[-1])
                continue
            share = rung / length  # the sides exp_p(±w) are as long as the segment
            vectors.append(self._rung(geometry, start, end, share * vectors[-1]) / share)
        converged = geometry.error <= self.tolerance
        unsolved = "" if converged else f"; an equation is solved to {geometry.error:.1e} only"
        result = TransportResult(
            vectors[-1],
            np.stack(vectors),
            path,
            n_iterations=geometry.n_iterations,
            n_evaluations=geometry.n_evaluations,
            status=Status.CONVERGED if converged else Status.MAX_ITER,
            message=f"{len(path) - 1} rungs{unsolved}",
        )
        return finish(self, result)

    def _rung(self, geometry: Any, start: ndarray, end: ndarray, vector: ndarray) -> ndarray:
        middle = geometry.halfway(start, end)
        behind, ahead = geometry.sides(start, vector)
        return geometry.displacement(
            geometry.reflected(ahead, middle), end, geometry.reflected(behind, middle)
        )


@dataclass(frozen=True)
class SchildLadder(PoleLadder):
    r"""Parallel transport along the sides of geodesic parallelograms.

    For each segment (p, q), p is reflected in the points halfway from exp_p(±w) to q; the results
    are exp_q(±w'). The error is of first order in the length of the segments in general, and of
    second order when the two signs are averaged, as here. See `PoleLadder` for the source.

    Parameters
    ----------
    n_rungs, basis, geodesic_solver, tolerance, max_iter
        As of `PoleLadder`.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.SchildLadder().solve(metric, [1.0], [0.0], end_point=[2.0]).tangent_vec
    array([1.])
    """

    def _rung(self, geometry: Any, start: ndarray, end: ndarray, vector: ndarray) -> ndarray:
        behind, ahead = (
            geometry.reflected(start, geometry.halfway(side, end))
            for side in geometry.sides(start, vector)
        )
        return geometry.displacement(behind, end, ahead)


@dataclass
class _ClosedForms:
    """Geodesics by the metric's own exponential and logarithm."""

    _metric: RiemannianMetric
    n_iterations: int = 0
    n_evaluations: int = 0
    error: float = 0.0

    def sides(self, middle: ndarray, displacement: ndarray) -> tuple[ndarray, ndarray]:
        return self._metric.exp(-displacement, middle), self._metric.exp(displacement, middle)

    def halfway(self, start: ndarray, end: ndarray) -> ndarray:
        return self._metric.exp(0.5 * self._metric.log(end, start), start)

    def reflected(self, point: ndarray, middle: ndarray) -> ndarray:
        return self._metric.exp(-self._metric.log(point, middle), middle)

    def displacement(self, before: ndarray, middle: ndarray, after: ndarray) -> ndarray:
        return 0.5 * (self._metric.log(after, middle) - self._metric.log(before, middle))


@dataclass
class _SingleSegments:
    """Geodesics of one discrete segment."""

    _equation: GeodesicEquation
    n_iterations: int = 0
    n_evaluations: int = 0
    error: float = 0.0

    def sides(self, middle: ndarray, displacement: ndarray) -> tuple[ndarray, ndarray]:
        points = self._solved(self._equation.both_sides, middle, displacement)
        return points[0], points[2]

    def halfway(self, start: ndarray, end: ndarray) -> ndarray:
        return self._solved(self._equation.middle_point, start, end)[1]

    def reflected(self, point: ndarray, middle: ndarray) -> ndarray:
        return self._solved(self._equation.next_point, point, middle)[2]

    def displacement(self, before: ndarray, middle: ndarray, after: ndarray) -> ndarray:
        return self._equation.metric.space.to_tangent(0.5 * (after - before), middle)

    def _solved(
        self, equation: Callable[[ndarray, ndarray], Triple], first: ndarray, second: ndarray
    ) -> ndarray:
        """Return the points that solve an equation, and count what it took."""
        triple = equation(first, second)
        self.n_iterations += triple.n_iterations
        self.n_evaluations += triple.n_evaluations
        self.error = max(self.error, triple.error)
        return triple.points


def _check_path(metric: RiemannianMetric, base_point: ndarray, path: Any) -> ndarray:
    path = metric.check_points(path, "path")
    base_point, _ = check_end_points(metric, base_point, base_point)
    if len(path) < 2:
        raise ArgumentError(f"path must have at least two times; found {len(path)}")
    gap = np.abs(path[0] - base_point).max()
    if gap > 1e-9 * np.abs(base_point).max():
        raise ArgumentError(f"path must start at base_point; it is off by {gap:.3g}")
    return path
