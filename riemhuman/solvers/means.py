"""Karcher means over a basis of deformations: Algorithm 2 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray

from riemhuman.checks import one_of, real_number, values_of, whole_number
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import Manifold, RiemannianMetric
from riemhuman.geometry.strategies import MeanSolver
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.solvers._dispersion import (
    AreaCheck,
    Dispersion,
    MeanDistance,
    StreamedDispersion,
    check_weights,
    seeing_lengths,
)
from riemhuman.solvers._preconditioners import CholeskyFactor
from riemhuman.solvers.minimization import LocalProblem, Minimum, minimize_in_rounds
from riemhuman.solvers.paths import rounding_energy
from riemhuman.solvers.results import MeanResult, Status, complete_mean_result, finish

if TYPE_CHECKING:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

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

    basis: DeformationBasis | None = None
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
        StretchInvarianceWarning
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
        finish(self, result)
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

    space: Manifold
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


_SMALLEST_STEP = 1e-6


@dataclass(frozen=True)
class GradientDescentMean(InheritsDocstrings, MeanSolver):
    """x ← exp_x(step · Σ_i w_i log_x(x_i)), for metrics that have exp and log in closed form.

    The step is halved where the variance would increase.

    Parameters
    ----------
    step : float
        First step; 1 follows the mean of the logarithms.
    tolerance : float
        Stop when the norm of the mean of the logarithms is at most this share of the standard
        deviation.
    max_iter : int
        Most iterations.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> plane = rh.VectorSpace((2,))
    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 3.0]])
    >>> rh.solvers.GradientDescentMean().solve(plane.metric, points).point.round(6).tolist()
    [1.0, 1.0]
    """

    step: float = 1.0
    tolerance: float = 1e-8
    max_iter: int = 2000

    def __post_init__(self) -> None:
        real_number(self.step, "step", minimum=0.0, strict=True)
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
        metric : RiemannianMetric
            A metric with `exp` and `log`.
        initial_point : array, shape (\*shape,), optional
            Where to start, by default at the first point of positive weight.

        Returns
        -------
        MeanResult

        Raises
        ------
        OutsideManifoldError
            If a point has no logarithm at a point on the way.
        NotDefinedError
            If the metric has no closed form for exp and log.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        dispersion = Dispersion(metric, points, weights)
        used = dispersion.weights > 0
        weights, points = dispersion.weights[used], dispersion.points[used]
        point = points[0] if initial_point is None else metric.space.check_point(initial_point)
        variances = [dispersion.value(point)]
        floor = rounding_energy(metric, point)
        n_evaluations, step = 1, self.step
        converged, message = False, "the most iterations were made"
        for _ in range(self.max_iter):
            if variances[-1] <= floor:
                converged, message = True, "the variance is no more than rounding errors"
                break
            direction = np.tensordot(weights, metric.log(points, point), axes=1)
            size = float(metric.norm(direction, point))
            if size <= self.tolerance * np.sqrt(variances[-1]):
                converged, message = True, "the mean of the logarithms is below the tolerance"
                break
            # Without it, rounding errors off the manifold would double with every step.
            candidate = metric.space.projection(metric.exp(step * direction, point))
            variance = dispersion.value(candidate)
            n_evaluations += 1
            # Near the mean the variance falls by less than its rounding error.
            if variance > variances[-1] * (1 + 1e-12):
                step *= 0.5
                if step < _SMALLEST_STEP:
                    message = "no step along the mean of the logarithms lowers the variance"
                    break
                continue
            point = candidate
            variances.append(variance)
        result = MeanResult(
            point,
            variances[-1],
            np.array(variances),
            n_iterations=len(variances) - 1,
            n_evaluations=n_evaluations,
            status=Status.of(converged),
            message=message,
        )
        finish(self, result)
        return result


# The mean of the sample is only a start.
_SAMPLE_TOLERANCE = 1e-4

# Standard deviations by which distances are smoothed near 0.
_SMOOTHING = 1e-6


@dataclass(frozen=True)
class StreamingMean(BasisMean):
    r"""`BasisMean` for points that are read batch by batch, such as an array in a file.

    The search starts from the mean of a sample, evenly spaced among the points; then every
    evaluation of the variance reads all points once. The result is the mean over the basis and the
    differences of the sample from its mean. Its variance exceeds the minimum by a few times
    `tolerance`, as a share, so that the mean is about √tolerance standard deviations off.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations D_j; without them, the differences of the sample alone.
    start : str
        Start of the search for the mean of the sample, as in `BasisMean`.
    with_differences : bool
        Whether to add the differences of the sample from its mean to the basis.
    tolerance : float
        Stop when a Newton step would gain at most this share of what is minimised, the variance or
        the mean distance, as far as the preconditioned gradient tells.
    callback : callable, optional
        Called with (iteration, what is minimised, point) after each iteration.
    sample_size : int
        Number of points in the sample.
    batch_size : int
        Points that are read together.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> solver = rh.solvers.StreamingMean(sample_size=4, batch_size=5)
    >>> result = solver.solve(metric, bodies.points[:12])
    >>> result.point.shape, result.converged
    ((1202, 3), True)
    """

    tolerance: float = 1e-7
    sample_size: int = 64
    batch_size: int = 256

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number(self.sample_size, "sample_size", minimum=1)
        whole_number(self.batch_size, "batch_size", minimum=1)

    def solve(
        self,
        metric: RiemannianMetric,
        points: Any,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the mean.

        Parameters
        ----------
        points : sequence, shape (n, \*shape)
            An array, which may be mapped from a file, or any object with a length whose slices are
            points.
        initial_point : array, shape (\*shape,), optional
            Start of the search for the mean of the sample, instead of `start`.

        Returns
        -------
        MeanResult
            `variance` is by the metric alone; `variances` are with the companion's share.

        Raises
        ------
        ArgumentError
            If the points, weights or basis do not fit the metric's space.
        DegenerateSurfaceError
            If triangles of the mean shrink away, as between unlike bodies for a small λ.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        StretchInvarianceWarning
            If neither the metric nor a companion sees how long edges are.
        """
        searched = seeing_lengths(metric, self.companion_weight)
        sample = _Sample(points, weights, self.sample_size)
        first = self._of_sample(searched, sample, initial_point)
        streamed = self._streamed(searched, sample, Dispersion)
        alone = streamed if searched is metric else self._streamed(metric, sample, Dispersion)
        return self._result(streamed, alone, first.point)

    def _of_sample(
        self, metric: RiemannianMetric, sample: _Sample, initial_point: ndarray | None
    ) -> MeanResult:
        """Return the mean of the sample alone, roughly."""
        mean = BasisMean(
            self.basis,
            start=self.start,
            with_differences=self.with_differences,
            companion_weight=0.0,
            tolerance=max(self.tolerance, _SAMPLE_TOLERANCE),
            max_iter=self.max_iter,
        )
        return mean.solve(metric, sample.points, sample.weights, initial_point)

    def _streamed(
        self, metric: RiemannianMetric, sample: _Sample, of_batch: Callable[..., Dispersion]
    ) -> StreamedDispersion:
        return StreamedDispersion(
            metric, sample.all, sample.all_weights, self.batch_size, sample.points, of_batch
        )


@dataclass(frozen=True)
class StreamingMedian(StreamingMean):
    r"""The point x̄ = x₀ + Σ_j β_j D_j of least weighted mean distance Σ_i w_i d(x_i, x̄).

    As in `StreamingMean`, points are read batch by batch. The search goes from the mean of a sample
    to the median of the sample; then every evaluation reads all points once. The result is the
    median over the basis and the differences of the sample from its mean. Its mean distance exceeds
    the minimum by a few times `tolerance`, as a share, and by at most another millionth, since
    distances are smoothed where they have no gradient.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1)
    >>> solver = rh.solvers.StreamingMedian(sample_size=4, batch_size=5)
    >>> median = rh.statistics.GeometricMedian(space, solver=solver).fit(bodies.points[:12])
    >>> median.estimate_.shape
    (1202, 3)
    """

    def solve(
        self,
        metric: RiemannianMetric,
        points: Any,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the median.

        Returns
        -------
        MeanResult
            `variance` is the weighted mean of squared distances, by the metric alone; `variances`
            are weighted mean distances and include the companion metric.

        Raises
        ------
        ArgumentError
            If the points, weights or basis do not fit the metric's space.
        DegenerateSurfaceError
            If triangles of the median vanish, as between dissimilar bodies for a small λ.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        StretchInvarianceWarning
            If neither the metric nor a companion sees how long edges are.
        """
        searched = seeing_lengths(metric, self.companion_weight)
        sample = _Sample(points, weights, self.sample_size)
        first = self._of_sample(searched, sample, initial_point)
        if first.variance == 0.0:
            return first
        mean_distance = partial(MeanDistance, smoothing=_SMOOTHING * np.sqrt(first.variance))
        nearer = replace(self, tolerance=_SAMPLE_TOLERANCE, callback=None)._result(
            mean_distance(searched, sample.points, sample.weights),
            Dispersion(searched, sample.points, sample.weights),
            first.point,
        )
        streamed = self._streamed(searched, sample, mean_distance)
        alone = self._streamed(metric, sample, Dispersion)
        return self._result(streamed, alone, nearer.point)


class _Sample:
    """Points, and some of them, evenly spaced among those that have a weight."""

    def __init__(self, points: Any, weights: ndarray | None, size: int) -> None:
        if not len(points):
            raise ArgumentError("points must hold at least one point; found none")
        self.all, self.all_weights = points, check_weights(weights, len(points))
        used = np.flatnonzero(self.all_weights)
        spaced = np.linspace(0, len(used) - 1, min(size, len(used)))
        chosen = used[spaced.astype(int)]
        self.points = np.concatenate([np.asarray(points[i : i + 1]) for i in chosen])
        self.weights = self.all_weights[chosen]


class FrechetMean(Estimator):
    r"""The point x̄ that minimises Σ_i w_i d(x_i, x̄)² (section 4 of the paper).

    Parameters
    ----------
    space : Manifold
        A manifold equipped with a metric.
    solver : object, optional
        Strategy. By default `GradientDescentMean` where geodesics have a closed form, else
        `BasisMean` over the differences of the points; a basis of deformations makes better means
        of surfaces.

    Attributes
    ----------
    estimate_ : array, shape (\*shape,)
        The mean, after `fit`.
    variance_ : float
        Weighted mean of the squared distances to it.
    n_iter_ : int
        Iterations of the solver.
    result_ : MeanResult
        The solver's whole result.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> normals = rh.NormalFields(bodies.template)
    >>> samples = normals.random_point(3, rng=0)
    >>> mean = rh.FrechetMean(normals, solver=rh.solvers.GradientDescentMean()).fit(samples)
    >>> mean.estimate_.shape
    (2400, 3)
    """

    estimate_: ndarray
    variance_: float
    n_iter_: int
    result_: MeanResult

    def __init__(self, space: Manifold, solver: MeanSolver | None = None) -> None:
        self.space = space
        self.solver = solver

    def fit(self, X: ndarray, y: object = None, weights: ndarray | None = None) -> Self:
        r"""Find the mean of points.

        Parameters
        ----------
        X : array, shape (n, \*shape)
            Points.
        y : object
            Not used.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.

        Returns
        -------
        Estimator
            The estimator itself.
        """
        self._keep(self._mean(X, weights))
        return self

    def _mean(self, X: ndarray, weights: ndarray | None, **start: ndarray) -> MeanResult:
        """Return the Fréchet mean, as the solver finds it."""
        metric = self.space.metric
        solver = default_mean_solver(metric) if self.solver is None else self.solver
        return complete_mean_result(solver.solve(metric, X, weights, **start))

    def _keep(self, result: MeanResult) -> None:
        self.result_ = result
        self.estimate_ = result.point
        self.variance_ = result.variance
        self.n_iter_ = result.n_iterations


class GeometricMedian(FrechetMean):
    r"""The point that minimises Σ_i w_i d(x_i, x), by Weiszfeld's algorithm.

    Each round is the Fréchet mean with weights w_i/d(x_i, x) of the last round.

    Parameters
    ----------
    solver : object, optional
        Strategy for Fréchet means, by default that of `FrechetMean`; or `StreamingMedian`, for the
        median itself, with its own tolerance.
    tolerance : float
        Stop when a round decreases the sum of distances by at most this share.
    max_iter : int
        Largest number of rounds.

    Attributes
    ----------
    estimate_ : array, shape (\*shape,)
        The median, after `fit`.
    variance_ : float
        Weighted mean of the squared distances to it.
    n_iter_ : int
        Number of rounds.
    result_ : MeanResult
        Point and variance; `variances` holds the weighted mean distance after every round.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> plane = rh.VectorSpace((2,))
    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [100.0, 100.0]])
    >>> median = rh.GeometricMedian(plane, solver=rh.solvers.GradientDescentMean()).fit(points)
    >>> median.estimate_.round(3).tolist()
    [0.5, 0.5]
    """

    def __init__(
        self,
        space: Manifold,
        solver: MeanSolver | None = None,
        *,
        tolerance: float = 1e-9,
        max_iter: int = 200,
    ) -> None:
        super().__init__(space, solver)
        self.tolerance = tolerance
        self.max_iter = max_iter

    def fit(self, X: ndarray, y: object = None, weights: ndarray | None = None) -> Self:
        r"""Find the geometric median of points.

        Warns
        -----
        ConvergenceWarning
            If the sum of distances was still decreasing after the last round, or the search was
            interrupted from the keyboard; the result is then the best point so far.
        """
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)
        if isinstance(self.solver, StreamingMedian):
            self._keep(self._mean(X, weights))
            return self
        dispersion = Dispersion(self.space.metric, X, weights)
        mean = self._mean(X, dispersion.weights)
        point, n_evaluations = mean.point, mean.n_evaluations
        sums: list[float] = []
        converged, message = False, "the most rounds were made"
        for _ in range(self.max_iter):
            distances = np.sqrt(dispersion.squared_dists(point))
            sums.append(float(dispersion.weights @ distances))
            if len(sums) > 1 and sums[-2] - sums[-1] <= self.tolerance * sums[-2]:
                converged, message = True, "the sum of distances no longer falls"
                break
            # A sample that the median has reached keeps a large but finite weight.
            floor = max(1e-9 * distances.max(), np.finfo(float).tiny)
            pull = dispersion.weights / np.maximum(distances, floor)
            mean = self._mean(X, pull, initial_point=point)
            point = mean.point
            n_evaluations += mean.n_evaluations
        result = MeanResult(
            point,
            float(dispersion.weights @ dispersion.squared_dists(point)),
            np.array(sums),
            n_iterations=len(sums) - 1,
            n_evaluations=n_evaluations,
            status=Status.of(converged),
            message=message,
        )
        finish(self, result)
        self._keep(result)
        return self


def default_mean_solver(metric: RiemannianMetric) -> MeanSolver:
    """Return a solver for Fréchet means that suits a metric.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.

    Returns
    -------
    GradientDescentMean or BasisMean
        The first where geodesics have a closed form; else the second, over the differences of the
        points. Logarithms found by strategies belong to geodesics, whose lengths are not the
        distances of pull-backs; their mean is no descent direction.
    """
    return GradientDescentMean() if metric.has_closed_form_geodesic else BasisMean()
