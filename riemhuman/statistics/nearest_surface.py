"""The surface whose fields are nearest to given fields: the way back from Φ(f) = (g, n)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import autograd.numpy as np
from autograd import value_and_grad
from numpy import ndarray

from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.protocols import PulledBackMetric
from riemhuman.solvers.dispersion import check_weights
from riemhuman.solvers.preconditioner import CholeskyFactor
from riemhuman.solvers.results import MeanResult, warn_unless_converged
from riemhuman.solvers.spatial_factors import SparseCholeskyFactor, spatial_factor

# λ of the metric field's share of a companion.
_COMPANION_LAM = 1.0

# Steps that bring less, or more, than these shares of their promise raise, or lower, the damping.
_POOR, _GOOD = 0.25, 0.6
_LEAST_DAMPING = 1e-3


@dataclass(frozen=True)
class NearestSurface:
    r"""The surface f that minimises Σ_i w_i d(Φ(f), y_i)²/Σ_i w_i over all its vertices.

    With one target y, a point of the image space that need not come from a surface, it is the
    projection of y to surfaces; with the images of several surfaces it is their Karcher mean, the
    functional of section 4 of the paper with no basis. The minimisation is that of Levenberg and
    Marquardt: the metric's matrix at f stands for half the Hessian.

    A metric of metric fields alone (c = 0) hardly sees how a surface bends, and one of normals
    alone (a = 0) not how large its triangles are. A companion metric, of small weight, keeps what
    is not seen as it is at the start: ε d_companion(f, start)² joins the functional.

    Parameters
    ----------
    companion : ElasticMetric, optional
        Companion. By default, of an `ElasticMetric` whose weight a or c is 0, the part that it
        lacks; of other metrics there is none.
    companion_weight : float
        ε, of at least 0.
    tolerance : float
        Stop when a step promises to lower the functional by at most this share of its first value.
    max_iter : int
        Most steps tried.
    """

    companion: ElasticMetric | None = None
    companion_weight: float = 1e-2
    tolerance: float = 1e-5
    max_iter: int = 200

    def __post_init__(self) -> None:
        real_number(self.companion_weight, "companion_weight", minimum=0.0)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)

    def solve(
        self,
        metric: PulledBackMetric,
        images: ndarray,
        start: ndarray,
        weights: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the surface.

        Parameters
        ----------
        metric : PulledBackMetric
            A metric on surfaces, pulled back by Φ = ``metric.map``.
        images : array, shape (n, \*target_shape)
            Targets y_i, points of the space of ``metric.target_metric``.
        start : array, shape (V, 3)
            Surface to start from.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.

        Returns
        -------
        MeanResult
            `variance` is the weighted mean squared distance, without the companion's share;
            `variances` are with it.

        Raises
        ------
        ArgumentError
            If an array does not fit the metric.
        DegenerateSurfaceError
            If a triangle of `start` has no area.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        target = metric.target_metric
        images = target.check_points(images, "images")
        weights = check_weights(weights, len(images))
        start = real_array(start, "start", metric.space.shape, batched=False)
        companion = self.companion or _missing_part(metric)
        if not self.companion_weight:
            companion = None

        def variance(f: ndarray) -> Any:
            return np.dot(weights, target.squared_dist(metric.map(f), images))

        def functional(f: ndarray) -> Any:
            if companion is None:
                return variance(f)
            return variance(f) + self.companion_weight * companion.squared_dist(start, f)

        result = self._descend(metric, companion, functional, start)
        found = MeanResult(
            result.point,
            float(variance(result.point)),
            result.variances,
            **result.outcome,
        )
        warn_unless_converged(self, found)
        return found

    def _descend(
        self, metric: PulledBackMetric, companion: ElasticMetric | None, functional: Any, f: ndarray
    ) -> MeanResult:
        slope = value_and_grad(functional)
        value, gradient = slope(f)
        values, n_evaluations, damping = [float(value)], 1, 0.0
        converged, message = False, "the most steps were tried"
        while n_evaluations <= self.max_iter:
            step = self._step(metric, companion, f, gradient, damping)
            promise = -0.5 * float(np.sum(gradient * step))
            if promise <= self.tolerance * values[0]:
                converged, message = True, "a step promises less than the tolerance"
                break
            n_evaluations += 1
            try:
                value, new_gradient = slope(f + step)
            except DegenerateSurfaceError:
                value = np.inf
            share = (values[-1] - value) / promise
            if share > 0.0:
                f, gradient = f + step, new_gradient
                values.append(float(value))
            if share < _POOR:
                damping = max(4.0 * damping, self.companion_weight, _LEAST_DAMPING)
            elif share > _GOOD:
                damping *= 0.25
        return MeanResult(
            f,
            values[-1],
            np.array(values),
            n_iterations=len(values) - 1,
            n_evaluations=n_evaluations,
            converged=converged,
            message=message,
        )

    def _step(
        self,
        metric: Any,
        companion: ElasticMetric | None,
        f: ndarray,
        gradient: ndarray,
        damping: float,
    ) -> ndarray:
        """Return the step of Levenberg and Marquardt, damped where the metric sees little."""
        if companion is None:
            factor: CholeskyFactor = spatial_factor(metric, f[np.newaxis], 1.0 / (1.0 + damping))
        else:
            unseen = (self.companion_weight + damping) * companion.metric_matrix(f)
            factor = SparseCholeskyFactor(metric.metric_matrix(f) + unseen)
        column = -0.5 * gradient.reshape(-1, 1)
        return factor.solve_transposed(factor.solve(column)).reshape(f.shape)


def _missing_part(metric: PulledBackMetric) -> ElasticMetric | None:
    """Return the part of the family that an elastic metric with a = 0 or c = 0 lacks."""
    if not isinstance(metric, ElasticMetric) or metric.a * metric.c > 0:
        return None
    if metric.a == 0:
        return ElasticMetric(metric.space, a=1.0, lam=_COMPANION_LAM, c=0.0)
    return ElasticMetric(metric.space, a=0.0, lam=0.0, c=1.0)
