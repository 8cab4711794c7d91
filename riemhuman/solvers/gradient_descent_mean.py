"""Fréchet means by gradient descent with exponential and logarithm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import MeanSolver
from riemhuman.solvers.dispersion import Dispersion
from riemhuman.solvers.results import MeanResult, warn_unless_converged
from riemhuman.solvers.rounding import rounding_energy

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
            converged=converged,
            message=message,
        )
        warn_unless_converged(self, result)
        return result
