"""The L² metric of motions: bodies are compared at the same times."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.terms.sum import Features


class RateDependentMetric(RiemannianMetric):
    r"""The integral over time of a metric on frames.

    .. math:: d(m_1, m_2)^2 = \int_0^1 d(m_1(t), m_2(t))^2\, dt

    by the trapezoidal rule over equally spaced times. A motion and the same motion at another speed
    are far apart; see `DynamicTimeWarping` and `RateInvariantMetric`.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    metric : RiemannianMetric, optional
        Metric on frames; by default that of their space.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> motions = rh.motions.MotionSpace(space, n_times=4)
    >>> m1, m2 = motions.resample(knees[:30]), motions.resample(other[:30])
    >>> bool(motions.metric.dist(m1, m2) > 0)
    True
    """

    space: Any

    def __init__(
        self,
        space: Any,
        metric: RiemannianMetric | None = None,
        geodesic_solver: GeodesicSolver | None = None,
    ) -> None:
        super().__init__(space, geodesic_solver)
        self.metric = space.frames.metric if metric is None else metric
        weights = np.full(space.n_times, 1.0 / (space.n_times - 1))
        weights[[0, -1]] *= 0.5
        self.time_weights = weights

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether the metric on frames has a closed form."""
        return self.metric.has_closed_form_dist

    def inner_product(
        self,
        tangent_vec_a: ndarray,
        tangent_vec_b: ndarray,
        base_point: ndarray | None = None,
    ) -> ndarray:
        """Return the mean over time of the inner products of deformations of frames."""
        products = self.metric.inner_product(tangent_vec_a, tangent_vec_b, base_point)
        return np.sum(self.time_weights * products, axis=-1)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return the mean over time of the squared distances of frames."""
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        return np.sum(self.time_weights * self.metric.squared_dist(point_a, point_b), axis=-1)

    @property
    def bulk(self) -> Bulk:
        """The bulk work of the metric on frames, time by time."""
        return _OverTime(self.metric.bulk, self.time_weights)


class _OverTime(Bulk):
    """Features of all frames, and weighted sums of their squared distances."""

    def __init__(self, bulk: Bulk, weights: ndarray) -> None:
        self._bulk, self._weights, self.n_arrays = bulk, weights, bulk.n_arrays

    def features(self, points: ndarray, precision: str) -> Features:
        frames = self._bulk.features(points.reshape(-1, *points.shape[2:]), precision)
        return tuple(f.reshape(*points.shape[:2], *f.shape[1:]) for f in frames)

    def rounding(self, features: Features) -> ndarray:
        squares = [
            w * self._bulk.rounding(_at(features, t)) ** 2 for t, w in enumerate(self._weights)
        ]
        return np.sqrt(np.sum(squares, axis=0))

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        total: Any = 0.0
        for t, weight in enumerate(self._weights):
            one = _at(a, t)
            other = one if b is a else _at(b, t)
            total = total + weight * self._bulk.squared_distances(one, other, n_threads)
        return total


def _at(features: Features, t: int) -> Features:
    return tuple(np.ascontiguousarray(feature[:, t]) for feature in features)
