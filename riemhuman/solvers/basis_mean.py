"""Karcher means over a basis of deformations: Algorithm 2 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray

from riemhuman.checks import one_of, real_number, values_of, whole_number
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.space import Space
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.protocols import Basis, MeanSolver
from riemhuman.solvers.dispersion import Dispersion
from riemhuman.solvers.minimization import LocalProblem, Minimum, minimize_in_rounds
from riemhuman.solvers.preconditioner import CholeskyFactor
from riemhuman.solvers.results import MeanResult, warn_unless_converged
from riemhuman.solvers.sound_means import AreaCheck, seeing_lengths

STARTS = ("lowest", "first", "medoid", "euclidean")


@dataclass(frozen=True)
class BasisMean(InheritsDocstrings, MeanSolver):
    r"""The point x̄ = x₀ + Σ_j β_j D_j of least weighted mean squared distance.

    Algorithm 2 of the paper, with the coefficients preconditioned by the metric's Gram matrix.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations D_j; without them, the differences of the points alone.
    start : str
        x₀: "first", the first point as in the paper; "medoid", the best of the points; "euclidean",
        their arithmetic mean, or the medoid if the mean is no point of the space; "lowest", the
        better of the last two.
    with_differences : bool
        Whether to add the differences of the points from x₀ to the basis. A basis of motions
        describes how one body moves, and not how bodies differ in build; the paper's algorithm does
        without.
    companion_weight : float
        An elastic metric of normals alone, a = 0, does not see the lengths of edges: in its means,
        arms stretch and shrink like rubber. This weight times the metric (1, 1, 0), in units of c,
        is therefore added during the search; 0 adds nothing.
    tolerance : float
        Stop when a Newton step would gain at most this share of the variance, as far as the
        preconditioned gradient tells.
    max_iter : int
        Largest number of iterations.
    callback : callable, optional
        Called with (iteration, variance, point) after each iteration.
    progress : bool
        Whether to show a progress bar.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> result = rh.solvers.BasisMean(basis).solve(metric, bodies.points[:30:10])
    >>> result.point.shape, result.converged
    ((1202, 3), True)
    """

    basis: Basis | None = None
    start: str = "lowest"
    with_differences: bool = True
    companion_weight: float = 1.0
    tolerance: float = 1e-8
    max_iter: int = 500
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        if self.basis is None and not self.with_differences:
            raise ArgumentError("with_differences must be True where there is no basis")
        one_of(self.start, "start", STARTS)
        real_number(self.companion_weight, "companion_weight", minimum=0.0)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)

    def solve(
        self,
        metric: RiemannianMetric,
        points: ndarray,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the mean.

        Parameters
        ----------
        initial_point : array, shape (\*shape,), optional
            x₀, instead of `start`.

        Returns
        -------
        MeanResult
            `variance` is that of the metric alone; `variances` include the companion metric.

        Raises
        ------
        ArgumentError
            If the points, weights or basis do not fit the metric's space.
        DegenerateSurfaceError
            If triangles of the mean vanish, as between dissimilar bodies for a small λ.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        UnseenLengthsWarning
            If neither the metric nor a companion sees the lengths of edges.
        """
        searched = seeing_lengths(metric, self.companion_weight)
        dispersion = Dispersion(searched, points, weights)
        origin = self._origin(dispersion, initial_point)
        alone = dispersion if searched is metric else Dispersion(metric, points, weights)
        return self._result(dispersion, alone, origin)

    def _result(self, dispersion: Dispersion, alone: Dispersion, origin: ndarray) -> MeanResult:
        """Search from a point; `alone` is by the metric without a companion."""
        family = _Family(alone.metric.space, origin, self._directions(dispersion, origin))
        minimum = self._minimize(dispersion, family)
        point, variance = family.point(minimum.x), minimum.value
        if alone is not dispersion:
            variance = alone.value(point)
        result = MeanResult(
            point,
            variance,
            minimum.values,
            **minimum.outcome,
        )
        warn_unless_converged(self, result)
        return result

    def _origin(self, dispersion: Dispersion, initial_point: ndarray | None) -> ndarray:
        space, points = dispersion.metric.space, dispersion.points
        if initial_point is not None:
            point = values_of(initial_point, "initial_point")
            return dispersion.metric.check_points(point[None])[0]
        if self.start == "first":
            return points[0]
        candidates = []
        if self.start in ("medoid", "lowest"):
            candidates.append(points[dispersion.medoid()])
        if self.start in ("euclidean", "lowest"):
            average = space.projection(np.tensordot(dispersion.weights, points, axes=1))
            # Bodies that face each other average to a flat one: then the medoid is left.
            is_sound = np.all(space.belongs(average))
            candidates = [*candidates, average] if is_sound else [points[dispersion.medoid()]]
        if len(candidates) == 1:
            return candidates[0]
        return min(candidates, key=dispersion.value)

    def _directions(self, dispersion: Dispersion, origin: ndarray) -> ndarray:
        flat = np.zeros((0, origin.size)) if self.basis is None else self.basis.flat
        if flat.shape[1] != origin.size:
            raise ArgumentError(
                f"basis must hold vectors of {origin.size} numbers, those of a point; "
                f"found {flat.shape[1]}"
            )
        if not self.with_differences:
            return flat
        differences = dispersion.points.reshape(len(dispersion.points), -1) - origin.ravel()
        outside = differences - (differences @ flat.T) @ flat
        # The few right singular vectors, from the matrix of inner products.
        squares, axes = np.linalg.eigh(outside @ outside.T)
        kept = squares > 1e-12 * max(squares.max(), np.abs(origin).max() ** 2)
        rows = axes[:, kept].T @ outside / np.sqrt(squares[kept, None])
        return np.concatenate([flat, rows])

    @single_threaded_libraries()
    def _minimize(self, dispersion: Dispersion, family: _Family) -> Minimum:
        """Return the coefficients β of least variance."""
        start = np.zeros(len(family.directions))
        origin = family.point(start)
        variance, _ = dispersion.value_and_gradient(origin)
        if not np.isfinite(variance):
            dispersion.value(origin)  # names the triangle without area, if the metric can
        floor = dispersion.floor(origin)
        # Distances of points that coincide to rounding error have no gradient to follow.
        if variance <= floor:
            values = np.array([variance])
            return Minimum(start, variance, values, n_evaluations=1, message="all points coincide")

        def around(coefficients: ndarray) -> LocalProblem:
            point = family.point(coefficients)
            vectors = family.directions.reshape(len(start), *point.shape)
            gram = dispersion.metric.gram_matrix(vectors, point)
            factor = CholeskyFactor(dispersion.curvature(variance) * gram / variance)

            def position(variables: ndarray) -> ndarray:
                return coefficients + factor.solve_transposed(variables)

            def objective(variables: ndarray) -> tuple[float, ndarray]:
                point, pull_back = family.point_and_pull_back(position(variables))
                value, gradient = dispersion.value_and_gradient(point)
                return value / variance, factor.solve(pull_back(gradient)) / variance

            return LocalProblem(objective, position, variance)

        areas = AreaCheck(family.space, dispersion.points)

        def report(iteration: int, value: float, coefficients: ndarray) -> None:
            point = family.point(coefficients)
            areas.refuse_collapse(point)
            if self.callback is not None:
                self.callback(iteration, value, point)

        return minimize_in_rounds(
            around,
            start,
            max_iter=self.max_iter,
            expected_decrease=self.tolerance,
            floor=floor,
            callback=report,
            progress=self.progress,
            description="mean",
        )


@dataclass(frozen=True)
class _Family:
    """The points origin + Σ_j β_j D_j, brought back to the manifold where that is needed."""

    space: Space
    origin: ndarray
    directions: ndarray

    def point(self, coefficients: ndarray) -> ndarray:
        """Return the point with these coefficients."""
        shift = (coefficients @ self.directions).reshape(self.origin.shape)
        return self.space.projection(self.origin + shift)

    def point_and_pull_back(
        self, coefficients: ndarray
    ) -> tuple[ndarray, Callable[[ndarray], ndarray]]:
        """Return the point, and the map from gradients there to gradients in the coefficients."""
        shift = (coefficients @ self.directions).reshape(self.origin.shape)
        transposed, point = make_vjp(self.space.projection, self.origin + shift)
        return point, lambda gradient: self.directions @ np.ravel(transposed(gradient))
