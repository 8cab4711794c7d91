"""Fréchet mean and geometric median as estimators, by any mean solver."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.estimator import Estimator
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import INTERRUPTED, MeanSolver, was_interrupted
from riemhuman.solvers.basis_mean import BasisMean
from riemhuman.solvers.dispersion import Dispersion
from riemhuman.solvers.gradient_descent_mean import GradientDescentMean
from riemhuman.solvers.results import MeanResult, warn_unless_converged, whole_mean_result
from riemhuman.solvers.streaming_mean import StreamingMedian


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
        return whole_mean_result(solver.solve(metric, X, weights, **start))

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
            if was_interrupted(mean):
                message = INTERRUPTED
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
            converged=converged,
            message=message,
        )
        warn_unless_converged(self, result)
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
