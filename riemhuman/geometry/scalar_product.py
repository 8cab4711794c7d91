"""Multiples of metrics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import metric_weight
from riemhuman.geometry.bulk import Bulk, SumOfFactors
from riemhuman.geometry.metric import RiemannianMetric


class ScalarProductMetric(RiemannianMetric):
    """A metric times a number: ``2.0 * metric``.

    Inner products, energies and squared distances are multiplied; geodesics, exponential, logarithm
    and parallel transport stay.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    scale : float
        The number, above 0.
    """

    def __init__(self, metric: RiemannianMetric, scale: float) -> None:
        super().__init__(
            metric.space,
            metric.geodesic_solver,
            exp_solver=metric.exp_solver,
            log_solver=metric.log_solver,
            transport_solver=metric.transport_solver,
        )
        self.underlying_metric = metric
        self._scale = metric_weight(scale, "scale", strict=True)

    @property
    def scale(self) -> float:
        """The number."""
        return self._scale

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether the metric has distances in closed form."""
        return self.underlying_metric.has_closed_form_dist

    @property
    def has_inner_product(self) -> bool:
        """Whether the metric defines an inner product."""
        return self.underlying_metric.has_inner_product

    @property
    def has_closed_form_geodesic(self) -> bool:
        """Whether the metric has geodesics in closed form."""
        return self.underlying_metric.has_closed_form_geodesic

    @property
    def has_closed_form_transport(self) -> bool:
        """Whether the metric has parallel transport in closed form."""
        return self.underlying_metric.has_closed_form_transport

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        r"""Return the inner product of the metric, multiplied."""
        product = self.underlying_metric.inner_product(tangent_vec_a, tangent_vec_b, base_point)
        return self.scale * product

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the covectors of the metric, multiplied."""
        return self.scale * self.underlying_metric.covector(tangent_vec, base_point)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        r"""Return the squared distance of the metric, multiplied."""
        return self.scale * self.underlying_metric.squared_dist(point_a, point_b)

    @property
    def bulk(self) -> Bulk:
        """The bulk work of the metric, multiplied."""
        return SumOfFactors([(lambda points: points, self.scale, self.underlying_metric.bulk)])

    def energy(self, path: ndarray) -> ndarray:
        r"""Return the energy of the metric, multiplied."""
        return self.scale * self.underlying_metric.energy(path)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        r"""Return the energy of one path and its gradient, multiplied.

        Returns
        -------
        energy : float
        gradient : array, shape (n_times, \*shape)
        """
        energy, gradient = self.underlying_metric.energy_and_gradient(path)
        return self.scale * energy, self.scale * gradient

    def length(self, path: ndarray) -> ndarray:
        r"""Return the length of the metric, times the square root of the number."""
        return np.sqrt(self.scale) * self.underlying_metric.length(path)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the Gram matrix of the metric, multiplied."""
        return self.scale * self.underlying_metric.gram_matrix(vectors, base_point)

    def remove_drift(self, path: ndarray) -> ndarray:
        r"""Remove drift as the metric does."""
        return self.underlying_metric.remove_drift(path)

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the exponential of the metric."""
        return self.underlying_metric.exp(tangent_vec, base_point)

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the logarithm of the metric."""
        return self.underlying_metric.log(point, base_point)

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        r"""Transport vectors as the metric does."""
        return self.underlying_metric.parallel_transport(
            tangent_vec, base_point, direction, end_point
        )

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        r"""Return the radius of the metric, times the square root of the number."""
        return np.sqrt(self.scale) * self.underlying_metric.injectivity_radius(base_point)

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return ⟨R(a, b) b, a⟩ of the metric, multiplied."""
        form = self.underlying_metric.curvature_form(tangent_vec_a, tangent_vec_b, base_point)
        return self.scale * form

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        return self.underlying_metric._geodesic_between(start, end)
