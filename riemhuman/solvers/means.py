"""Fréchet means and geometric medians: the estimators, and the strategies that they are given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self, TypedDict

import numpy as np

from riemhuman.arrays import Array, Callback, Points, PointsOrBatches
from riemhuman.checks import (
    a_basis,
    a_function,
    a_solver,
    checked,
    choice,
    flag,
    positive,
    real,
    values_of,
    whole,
)
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.estimator import Estimator
from riemhuman.geometry import Manifold, RiemannianMetric
from riemhuman.geometry.manifold import metric_of
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import MeanSolver
from riemhuman.solvers._alignment import AlignedMembers, align_members
from riemhuman.solvers._dispersion import Dispersion, area_check, metric_of_search, with_weight
from riemhuman.solvers._lbfgs import Minimum, minimize_from
from riemhuman.solvers._preconditioners import CholeskyFactor, metric_factor
from riemhuman.solvers.results import (
    MeanResult,
    Status,
    complete_mean,
    finish,
)
from riemhuman.surfaces.deformation_basis import DeformationBasis

# Default tolerances: over a basis each iteration gains much, in all coordinates the last ones gain
# little and cost a second each at full resolution.
_TOLERANCE = 1e-8
_TOLERANCE_OF_ALL = 1e-5

# In all coordinates, share of the value that the second half of the iterations may have gained: of
# soft directions, such as a limb as a whole, the preconditioner promises too little.
_RECENT_DECREASE = 3e-3

# Tolerance of means that are only a start: those of a sample, and those from which medians begin.
_ROUGH_TOLERANCE = 1e-4

# Iterations after which the metric's matrix is factored anew: in all coordinates it changes much
# as limbs straighten.
_REFRESH = 25
_REFRESH_OF_ALL = 10

# Standard deviations by which distances are smoothed near 0, where they have no gradient.
_SMOOTHING = 1e-6

# Share of the standard deviation below which a distance does not enlarge a weight further.
_LEAST_DISTANCE = 1e-9

# Steps of gradient descent are halved until they are shorter than this share of a full one.
_SMALLEST_STEP = 1e-6

# Squared lengths, and variances near the mean, are rounding errors below this share.
_ROUNDING = 1e-12


@checked(
    basis=a_basis,
    with_differences=flag,
    companion_weight=real(minimum=0.0),
    tolerance=positive,
    max_iter=whole(minimum=1),
    sample_size=whole(minimum=1),
    callback=a_function,
    progress=flag,
)
@dataclass(frozen=True)
class BasisMean(MeanSolver):
    """The point x̄ = x₀ + Σ_j β_j D_j of least mean squared distance, over a basis or over all.

    Algorithm 2 of the paper: minimisation by L-BFGS, preconditioned by the metric's matrix. With a
    basis the result is the mean over the span of the basis and of the points' differences, and its
    message says so; points outside the span may have a smaller variance. Under a metric of normals
    alone, the search minimises something other than the variance: see `companion_weight`. If the
    metric ignores rotations and translations, the points are first aligned with their average, and
    with it to the template, in whose axes the basis is given. The mean then does not depend on how
    the points are turned. It is turned back to the orientation of x₀, or of the first point.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations D_j; by default all coordinates are free.
    with_differences : bool
        Whether to add the differences of the points from x₀ to the basis, because a basis of
        motions does not describe differences in body shape. The paper's algorithm does not.
    companion_weight : float
        An elastic metric of normals alone (a = 0) does not measure the lengths of edges, so arms
        would stretch and shrink in its means. The search therefore minimises the mean squared
        distance under the sum of the metric and this weight times (1, 1, 0), in units of c. Under
        the metric alone, other points may have a smaller variance, even the average of the
        vertices.
    tolerance : float, optional
        Stop when a Newton step would gain at most this share of the variance, estimated from the
        preconditioned gradient. By default it is 1e-8 over a basis. In all coordinates it is 1e-5,
        and the second half of the iterations must also have gained less than 0.3 %.
    max_iter : int
    sample_size : int
        If points come in batches, the number of evenly spaced points from whose mean the search
        starts, and whose differences are added to the basis.
    callback, progress
        See `BasisPath`; they receive the variance and the point.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.AlignedSurfaces(bodies.template).metric
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> rh.solvers.BasisMean(basis).solve(metric, bodies.points[:30:10]).point.shape
    (1202, 3)
    """

    basis: DeformationBasis | None = None
    with_differences: bool = True
    companion_weight: float = 1.0
    tolerance: float | None = None
    max_iter: int = 500
    sample_size: int = 64
    callback: Callback | None = None
    progress: bool = False

    @checked(exponent=choice(1, 2))
    def solve(
        self,
        metric: RiemannianMetric,
        points: PointsOrBatches,
        weights: Array | None = None,
        initial_point: Points | None = None,
        exponent: int = 2,
    ) -> MeanResult:
        r"""Find the mean.

        Parameters
        ----------
        metric : RiemannianMetric
        points : array, shape (n, \*shape), or iterable of batches, arrays of shape (m, \*shape)
            Every evaluation reads the batches once.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.
        initial_point : array, shape (\*shape,), optional
            x₀, by default the arithmetic mean or the best of the points, whichever is better; the
            paper starts from the first point.
        exponent : int
            2 for the mean, 1 for the geometric median.

        Returns
        -------
        MeanResult
            `variance` is that of the metric alone. `variances`, which the search minimises, include
            the companion metric; for medians they are mean distances.
        """
        check_metric(metric)
        of_search = metric_of_search(metric, self.companion_weight)
        dispersion = Dispersion(of_search, points, weights, self.sample_size)
        is_given = initial_point is not None
        if initial_point is None:
            model = dispersion.points[np.argmax(dispersion.weights > 0)]
        else:
            model = metric.check_points(values_of(initial_point, "initial_point")[None])[0]
        return finish(self, self._find(metric, dispersion, model, is_given, exponent))

    def _find(
        self,
        metric: RiemannianMetric,
        dispersion: Dispersion,
        model: Array,
        is_given: bool,
        exponent: int,
    ) -> MeanResult:
        """Return the mean, which stands as a model does."""
        of_search = dispersion.metric
        members = align_members(of_search, dispersion.points, dispersion.weights, model)
        dispersion = dispersion.with_points(members.points)
        point = members.aligned(model) if is_given else self._origin(dispersion.sample)
        minimum, dispersion = self._reporting(members)._minimum(dispersion, point, exponent)
        variance = minimum.value
        if of_search is not metric or dispersion.smoothing is not None:
            variance = dispersion.variance_by(metric).value(minimum.x)
        mean = members.turned_back(minimum.x)
        return MeanResult(mean, variance, minimum.values, **minimum.outcome)

    def _reporting(self, members: AlignedMembers) -> Self:
        """Return the solver whose callback is given points that stand as the mean should."""
        callback = self.callback
        if callback is None:
            return self

        def report(iteration: int, value: float, point: Points) -> None:
            callback(iteration, value, members.turned_back(point))

        return replace(self, callback=report)

    def _minimum(
        self, dispersion: Dispersion, point: Points, exponent: int
    ) -> tuple[Minimum, Dispersion]:
        """Return the best point, after rough searches if they pay off, and its functional."""
        if dispersion.in_batches or exponent == 1:
            tolerance = max(self.tolerance or 0.0, _ROUGH_TOLERANCE)
            rough = replace(self, tolerance=tolerance, callback=None, progress=False)
            start = rough._search(dispersion.sample, point)
            if exponent == 1 and start.value > 0.0 and start.status is not Status.INTERRUPTED:
                dispersion = dispersion.smoothed(_SMOOTHING * np.sqrt(start.value))
                if dispersion.in_batches:
                    start = rough._search(dispersion.sample, start.x)
            point = start.x
            if start.status is Status.INTERRUPTED:
                return start, dispersion.sample
        return self._search(dispersion, point), dispersion

    def _origin(self, dispersion: Dispersion) -> Array:
        """Return the better of the arithmetic mean and the best of the points."""
        space, points = dispersion.metric.space, dispersion.points
        medoid = dispersion.medoid()
        average = space.projection(np.tensordot(dispersion.weights, points, axes=1))
        # Bodies that face each other average to a flat body.
        if not np.all(space.belongs(average)):
            return medoid
        return min(medoid, average, key=dispersion.value)

    def _directions(self, flat: Array, points: Points, origin: Array) -> Array:
        """Return the basis and, across it, the differences of points, as rows."""
        if flat.shape[1] != origin.size:
            raise ArgumentError(
                f"basis must hold vectors of {origin.size} numbers, as many as a point has; "
                f"found {flat.shape[1]}"
            )
        if not self.with_differences:
            return flat
        differences = points.reshape(len(points), -1) - origin.ravel()
        outside = differences - (differences @ flat.T) @ flat
        # The few right singular vectors, computed from the matrix of inner products.
        squares, axes = np.linalg.eigh(outside @ outside.T)
        is_known = squares > _ROUNDING * max(squares.max(), np.abs(origin).max() ** 2)
        rows = axes[:, is_known].T @ outside / np.sqrt(squares[is_known, None])
        return np.concatenate([flat, rows])

    def _search(self, dispersion: Dispersion, origin: Array) -> Minimum:
        """Return the best point over the basis and the differences of the points, or over all."""
        metric, space = dispersion.metric, dispersion.metric.space
        variance, check_areas = dispersion.value(origin), area_check(space, dispersion.points)
        directions = None
        if self.basis is not None:
            directions = self._directions(self.basis.flat, dispersion.points, origin)

        def function(point: Points) -> tuple[float, Array]:
            if not np.all(space.belongs(point)):
                return np.inf, np.zeros_like(point)
            return dispersion.value_and_gradient(point)

        def factor_at(point: Points) -> CholeskyFactor:
            scale = 1.0 / dispersion.curvature(variance)
            return metric_factor(metric, point[None], scale, directions)

        def report(iteration: int, value: float, point: Points) -> None:
            check_areas(point)
            if self.callback is not None:
                self.callback(iteration, value, point)

        over_all = directions is None
        minimum = minimize_from(
            origin,
            space,
            directions,
            function,
            factor_at,
            report,
            tolerance=self.tolerance or (_TOLERANCE_OF_ALL if over_all else _TOLERANCE),
            max_iter=self.max_iter,
            recent_decrease=_RECENT_DECREASE if over_all and self.tolerance is None else np.inf,
            refresh=_REFRESH_OF_ALL if over_all else _REFRESH,
            # Distances of points that coincide to rounding error have no gradient to follow.
            floor=dispersion.floor(origin),
            progress="mean" if self.progress else "",
        )
        if directions is None:
            return minimum
        message = f"{minimum.message}, over the span of {len(directions)} deformations"
        return replace(minimum, message=message)


@checked(tolerance=positive, max_iter=whole(minimum=1))
@dataclass(frozen=True)
class GradientDescentMean(MeanSolver):
    """x ← exp_x(Σ_i w_i log_x(x_i)), for metrics that have exp and log in closed form.

    Steps are halved if the variance would increase. Medians weight the logarithms by the inverse
    distances as well (Fletcher, Venkatasubramanian and Joshi, "The geometric median on Riemannian
    manifolds with application to robust atlas estimation", NeuroImage 45, 2009).

    Parameters
    ----------
    tolerance : float
        Stop when the norm of the mean of the logarithms is at most this share of the standard
        deviation (for medians, of the mean distance).
    max_iter : int

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.GradientDescentMean().solve(metric, [[0.0], [1.0]]).point.round(6)
    array([0.5])
    """

    tolerance: float = 1e-8
    max_iter: int = 2000

    @checked(exponent=choice(1, 2))
    def solve(
        self,
        metric: RiemannianMetric,
        points: PointsOrBatches,
        weights: Array | None = None,
        initial_point: Points | None = None,
        exponent: int = 2,
    ) -> MeanResult:
        """Find the mean, by default from the first point of positive weight; medians from the mean.

        The other parameters are those of `BasisMean.solve`. If a point has no logarithm at an
        iterate, an OutsideManifoldError is raised.
        """
        check_metric(metric)
        if metric.log_solver is None and not metric.has_closed_form_geodesic:
            raise NotDefinedError(
                "GradientDescentMean needs a closed form of log, or a log_solver; "
                f"{type(metric).__name__} has neither: use BasisMean"
            )
        dispersion = Dispersion(metric, points, weights)
        if initial_point is None:
            first_points, _ = next(dispersion.of_batches(with_weight))
            point = first_points[0]
        else:
            point = metric.space.check_point(initial_point)
        result = self._descend(dispersion, point)
        # Points that coincide are their median.
        if exponent == 1 and result.variance > 0.0:
            smoothing = _LEAST_DISTANCE * np.sqrt(result.variance)
            result = self._descend(dispersion.smoothed(smoothing), result.point)
        return finish(self, result)

    def _descend(self, dispersion: Dispersion, point: Points) -> MeanResult:
        metric = dispersion.metric
        values, n_evaluations = [dispersion.value(point)], 1
        floor, step = dispersion.floor(point), 1.0
        status, message = Status.MAX_ITER, "the maximum number of iterations was reached"
        for _ in range(self.max_iter):
            direction = _mean_of_logarithms(dispersion, point)
            size = float(metric.norm(direction, point))
            spread = np.sqrt(values[-1]) if dispersion.smoothing is None else values[-1]
            if values[-1] <= floor or size <= self.tolerance * spread:
                status = Status.CONVERGED
                message = (
                    "the mean of the logarithms is below the tolerance, or all points coincide"
                )
                break
            # Without this, rounding errors off the manifold would double with every step.
            candidate = metric.space.projection(metric.exp(step * direction, point))
            value = dispersion.value(candidate)
            n_evaluations += 1
            # Near the mean the variance falls by less than its rounding error.
            if value <= values[-1] * (1 + _ROUNDING):
                point = candidate
                values.append(value)
                continue
            step *= 0.5
            if step < _SMALLEST_STEP:
                status = Status.STALLED
                message = "no step along the mean of the logarithms lowers the variance"
                break
        variance = values[-1]
        if dispersion.smoothing is not None:
            variance = dispersion.smoothed(None).value(point)
        return MeanResult(
            point,
            variance,
            np.array(values),
            n_iterations=len(values) - 1,
            n_evaluations=n_evaluations,
            status=status,
            message=message,
        )


def _mean_of_logarithms(dispersion: Dispersion, point: Points) -> Array:
    """Return Σ_i w_i log_x(x_i)/Σ_i w_i, for medians with the weights w_i/d(x_i, x)."""
    total, sum_of_weights = np.zeros(np.shape(point)), 0.0
    for points, weights in dispersion.of_batches(with_weight):
        logarithms = dispersion.metric.log(points, point)
        if dispersion.smoothing is not None:
            squared = dispersion.metric.squared_norm(logarithms, point)
            weights = weights / np.hypot(np.sqrt(squared), dispersion.smoothing)
        total += np.tensordot(weights, logarithms, axes=1)
        sum_of_weights += weights.sum()
    return total / sum_of_weights


class _MeanSettings(TypedDict, total=False):
    """The arguments of solvers; those for means only need not know about medians."""

    exponent: int


class FrechetMean(Estimator):
    r"""The point x̄ that minimises Σ_i w_i d(x_i, x̄)² (section 4 of the paper).

    If `BasisMean` has a basis, it minimises this over a span. To a metric of normals alone it adds
    a second metric. Its message says what it minimises.

    Parameters
    ----------
    space : Manifold
        A manifold equipped with a metric.
    solver : object, optional
        Strategy. By default `GradientDescentMean` where geodesics have a closed form, else
        `BasisMean()`, which frees all coordinates: on surfaces, all vertices.

    Attributes
    ----------
    estimate_ : array, shape (\*shape,)
        The mean, after `fit`.
    variance_ : float
        Weighted mean of the squared distances to it.
    n_iter_ : int
        Iterations of the solver.
    result_ : MeanResult

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.FrechetMean(plane).fit([[0.0, 0.0], [1.0, 3.0]]).estimate_.round(6).tolist()
    [0.5, 1.5]
    >>> rh.FrechetMean(plane).fit([[[0.0, 0.0]], [[1.0, 3.0]]]).variance_  # in two batches
    2.5
    """

    estimate_: Array
    variance_: float
    n_iter_: int
    result_: MeanResult
    _settings: ClassVar[_MeanSettings] = {}

    def __init__(self, space: Manifold, solver: MeanSolver | None = None) -> None:
        self.space = space
        self.solver = solver

    def fit(self, X: PointsOrBatches, y: object = None, weights: Array | None = None) -> Self:
        r"""Find the mean of points.

        Parameters
        ----------
        X : array, shape (n, \*shape), or iterable of batches, arrays of shape (m, \*shape)
            Points. Batches are read once for every evaluation, so that the points need not fit
            into memory, as ``[x[i : i + 256] for i in range(0, len(x), 256)]`` for an array `x`
            that is mapped from a file.
        y : object
            Not used.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.
        """
        metric, solver = metric_of(self.space), self.solver
        if solver is None:
            # Logarithms found by strategies belong to geodesics, whose lengths are not the
            # distances of pull-backs: their mean is no descent direction.
            solver = GradientDescentMean() if metric.has_closed_form_geodesic else BasisMean()
        a_solver(solver, "solver")
        result = complete_mean(solver.solve(metric, X, weights, **self._settings))
        self.result_ = result
        self.estimate_ = result.point
        self.variance_ = result.variance
        self.n_iter_ = result.n_iterations
        return self


class GeometricMedian(FrechetMean):
    r"""The point that minimises Σ_i w_i d(x_i, x); `FrechetMean` says what `BasisMean` adds.

    Parameters
    ----------
    space, solver
        See `FrechetMean`; the solver is called with ``exponent=1``.

    Attributes
    ----------
    estimate_ : array, shape (\*shape,)
        The median, after `fit`.
    variance_, n_iter_, result_
        See `FrechetMean`; the result's `variances` are weighted mean distances.

    Examples
    --------
    >>> points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [100.0, 100.0]]
    >>> rh.GeometricMedian(rh.VectorSpace((2,))).fit(points).estimate_.round(3).tolist()
    [0.5, 0.5]
    """

    _settings: ClassVar[_MeanSettings] = {"exponent": 1}
