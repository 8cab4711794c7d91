"""Vector spaces of arrays, with a flat metric."""

from __future__ import annotations

import math

import autograd.numpy as np

from riemhuman.arrays import Array, Booleans, Fields, Points, TangentVectors
from riemhuman.checks import (
    Rng,
    checked,
    generator,
    instance,
    metric_weight,
    real_array,
    real_number,
)
from riemhuman.errors import NotDefinedError
from riemhuman.geometry.fields import FieldMetric
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.kernels.surface import Derivatives, joined_axes
from riemhuman.terms import FlatTerm


class VectorSpace(Manifold):
    """The vector space of real arrays of a given shape.

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
        super().__init__(math.prod(shape), tuple(int(n) for n in shape), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return FlatMetric

    def belongs(self, point: Points, atol: float = 1e-9) -> Booleans:
        return self._candidates(point, "point")[1]

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        return real_array(vector, "vector", self.shape)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        n_samples, bound = sample_count(n_samples), real_number(bound, "bound", minimum=0.0)
        points = generator(rng).uniform(-bound, bound, (n_samples, *self.shape))
        return stack_samples(points, n_samples)


class _Numbers(FlatTerm):
    """Numbers of points of a vector space, compared as fields of surfaces are."""

    n_features = 1

    def field(self, first: Derivatives) -> Array:
        raise NotDefinedError("the numbers of a vector space are no fields of surfaces")


class FlatMetric(FieldMetric):
    """The weighted sum of squares Σ_t w_t ‖a_t‖² on a vector space.

    With template areas as weights, this is the L² metric of fields on a template.

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

    _term = _Numbers()

    @checked(space=instance(Manifold))
    def __init__(self, space: Manifold, weights: Array | None = None) -> None:
        super().__init__(space)
        length = space.shape[0]
        if weights is None:
            weights = np.ones(length)
        # A copy: a metric keeps its parameters.
        weights = real_array(weights, "weights", (length,), batched=False).copy()
        metric_weight(weights.min(), "the least of weights")
        self._weights = weights

    @property
    def _areas(self) -> Array:
        """A triangle for each number, with its weight for an area."""
        return np.repeat(self._weights, int(np.prod(self.space.shape[1:])))

    def _fields(self, point: Points, name: str) -> Fields:
        return (self._numbers(self.space.check_point(point, name))[..., None],)

    def _numbers(self, arrays: Array) -> Array:
        return joined_axes(arrays, self.space.point_ndim)

    def lower_bound_coordinates(self, points: Points) -> Array:
        """Return weighted coordinates, whose Euclidean distances equal those of the points."""
        return self._numbers(self.space.check_point(points, "points")) * np.sqrt(self._areas)

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        # Inner products are the same at every point.
        point = np.zeros(self.space.shape) if base_point is None else base_point
        return super().inner_product(tangent_vec_a, tangent_vec_b, point)

    def _products(self, a: Array, b: Array, point: Points) -> Array:
        return self._numbers(a * b)

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        return point + velocity

    def _log(self, point: Points, start: Points) -> Array:
        return point - start

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        return vector + np.zeros_like(point + velocity)
