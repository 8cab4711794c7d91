"""Vector spaces of arrays, with a flat metric."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, joint_shape, metric_weight, real_array
from riemhuman.geometry.manifold import Manifold, sample_bound, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk, Features
from riemhuman.kernels.threads import in_tiles
from riemhuman.terms.flat import flat_distances, vector_features


class VectorSpace(Manifold):
    """All real arrays of one shape.

    Parameters
    ----------
    shape : tuple of int
    equip : bool
        Whether to equip the space with `FlatMetric`.

    Examples
    --------
    >>> space = rh.VectorSpace((2, 3))
    >>> space.random_point(4, rng=0).shape
    (4, 2, 3)
    """

    def __init__(self, shape: tuple[int, ...], equip: bool = True) -> None:
        super().__init__(int(np.prod(shape)), tuple(shape), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return FlatMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        return self._candidates(point, "point")[1]

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        return real_array(vector, "vector", self.shape)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        n_samples, bound = sample_count(n_samples), sample_bound(bound)
        points = generator(rng).uniform(-bound, bound, (n_samples, *self.shape))
        return stack_samples(points, n_samples)


class FlatMetric(RiemannianMetric):
    """The weighted sum of squares Σ_t w_t ‖a_t‖² on a vector space.

    With template areas for weights, the L² metric of fields on a template.

    Parameters
    ----------
    space : VectorSpace
    weights : array, shape (shape[0],), optional
        A weight w_t ≥ 0 for each index of the first axis of a point; by default all are 1.

    Examples
    --------
    >>> metric = rh.FlatMetric(rh.VectorSpace((2,)), weights=np.array([1.0, 4.0]))
    >>> float(metric.squared_dist(np.zeros(2), np.ones(2)))
    5.0
    """

    def __init__(self, space: Manifold, weights: ndarray | None = None) -> None:
        super().__init__(space)
        length = space.shape[0]
        if weights is None:
            weights = np.ones(length)
        # A copy: a metric keeps its parameters.
        weights = real_array(weights, "weights", (length,), batched=False).copy()
        for k in (weights.argmin(), weights.argmax()):
            metric_weight(weights[k], f"weights[{k}]")
        self._weights = np.expand_dims(weights, space._point_axes[1:])

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        start = np.zeros(self.space.shape) if base_point is None else base_point
        start = self.space.check_point(start, "base_point")
        joint_shape(tangent_vec_a=tangent_vec_a, tangent_vec_b=tangent_vec_b, base_point=start)
        # The base point takes part in broadcasting alone.
        product = tangent_vec_a * tangent_vec_b + np.zeros_like(start)
        return np.sum(self._weights * product, axis=self.space._point_axes)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        joint_shape(point_a=point_a, point_b=point_b)
        difference = point_a - point_b
        return np.sum(self._weights * difference * difference, axis=self.space._point_axes)

    def _exp(self, velocity: ndarray, point: ndarray) -> ndarray:
        return point + velocity

    def _log(self, point: ndarray, start: ndarray) -> ndarray:
        return point - start

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray | None = None,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        # Vectors stay as they are, wherever they go.
        start = np.zeros(self.space.shape) if base_point is None else base_point
        if direction is None and end_point is None:
            direction = np.zeros(self.space.shape)
        return super().parallel_transport(tangent_vec, start, direction, end_point)

    def _transport(self, vector: ndarray, point: ndarray, velocity: ndarray) -> ndarray:
        return vector + np.zeros_like(point + velocity)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        leading = np.shape(base_point)[: -self.space.point_ndim] if base_point is not None else ()
        return np.full(leading, np.inf)

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        return 0.0 * self.inner_product(tangent_vec_a, tangent_vec_b, base_point)

    @property
    def bulk(self) -> Bulk:
        return _Vectors(self._weights.ravel(), self.space.shape)


class _Vectors(Bulk):
    n_arrays = 2

    def __init__(self, weights: ndarray, shape: tuple[int, ...]) -> None:
        self._weights, self._size = weights, int(np.prod(shape[1:]))

    def features(self, points: ndarray, precision: str) -> Features:
        vectors = points.reshape(len(points), len(self._weights), self._size)
        return vector_features(vectors, self._weights, precision)

    def rounding(self, features: Features) -> ndarray:
        return features[1]

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        return in_tiles(lambda pair: flat_distances(*pair[0], *pair[1]), a[:1], b[:1], n_threads)
