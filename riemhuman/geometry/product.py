"""Metrics made from others: products of manifolds with weighted sums, and pull-backs by maps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Unpack

import autograd.numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans, Points, TangentVectors
from riemhuman.checks import (
    Rng,
    checked,
    each,
    generator,
    instance,
    joint_shape,
    metric_weight,
    real_array,
)
from riemhuman.errors import ArgumentError
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import POINT, RiemannianMetric
from riemhuman.geometry.pairwise import Bulk, Factor, SumOfFactors
from riemhuman.geometry.point_space import PointSpace
from riemhuman.geometry.strategies import Solvers


class ProductManifold(Manifold):
    """The product of manifolds; a point is the concatenation of its flattened factors.

    Parameters
    ----------
    factors : sequence of Manifold
        Manifolds, each equipped with a metric.
    equip : bool
        Whether to equip the product with `ProductMetric`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> factors = [rh.MetricFields(bodies.template), rh.NormalFields(bodies.template)]
    >>> product = rh.ProductManifold(factors)
    >>> g, n = product.project_from_product(product.random_point(rng=0))
    >>> g.shape, n.shape
    ((2400, 2, 2), (2400, 3))
    """

    @checked(factors=each(instance(Manifold), "a list of manifolds"))
    def __init__(self, factors: Sequence[Manifold], equip: bool = True) -> None:
        if not factors:
            raise ArgumentError("factors must hold at least one manifold; found none")
        self.factors = tuple(factors)
        self._sizes = [math.prod(factor.shape) for factor in self.factors]
        self._ends = np.cumsum(self._sizes).tolist()
        super().__init__(sum(factor.dim for factor in self.factors), (sum(self._sizes),), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return ProductMetric

    def embed_to_product(self, points: Sequence[Array]) -> Array:
        """Join points or tangent vectors of the factors, shape (..., size).

        Parameters
        ----------
        points : sequence of array, the k-th with the shape of the k-th factor
        """
        flat = []
        for k, (factor, point) in enumerate(zip(self.factors, points, strict=True)):
            point = real_array(point, f"points[{k}]", factor.shape)
            leading = point.shape[: -len(factor.shape)]
            flat.append(np.reshape(point, (*leading, self._sizes[k])))
        leads = {f"points[{k}]": np.zeros(point.shape[:-1]) for k, point in enumerate(flat)}
        leading = joint_shape(**leads)
        # Adding zeros broadcasts and keeps the tape; autograd has no rule for broadcast_to.
        flat = [point + np.zeros((*leading, 1)) for point in flat]
        return np.concatenate(flat, axis=-1)

    def project_from_product(self, point: Points) -> tuple[Array, ...]:
        """Split a point or tangent vector into its factors.

        Parameters
        ----------
        point : array, shape (..., size)
        """
        return tuple(self.component(point, k) for k in range(len(self.factors)))

    def component(self, point: Points, index: int) -> Array:
        """Return one factor of a point or tangent vector.

        Parameters
        ----------
        point : array, shape (..., size)
        index : int
        """
        factor = self.factors[index]
        point = real_array(point, "point", self.shape, finite=False)
        start = self._ends[index - 1] if index else 0
        flat = point[..., start : self._ends[index]]
        return np.reshape(flat, flat.shape[:-1] + factor.shape)

    def belongs(self, point: Points, atol: float = 1e-9) -> Booleans:
        point, finite = self._candidates(point, "point")
        components = self.project_from_product(point)
        verdicts = [
            factor.belongs(component, atol)
            for factor, component in zip(self.factors, components, strict=True)
        ]
        return finite & np.all(np.stack(verdicts), axis=0)

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        vectors = self.project_from_product(vector)
        points: Sequence[Array | None] = [None] * len(vectors)
        if base_point is not None:
            points = self.project_from_product(base_point)
        parts = zip(self.factors, vectors, points, strict=True)
        return self.embed_to_product([factor.to_tangent(v, x) for factor, v, x in parts])

    def projection(self, point: Points) -> Array:
        parts = zip(self.factors, self.project_from_product(point), strict=True)
        return self.embed_to_product([factor.projection(x) for factor, x in parts])

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        rng, n_samples = generator(rng), sample_count(n_samples)
        samples = [
            factor.random_point(n_samples, bound, rng).reshape(n_samples, *factor.shape)
            for factor in self.factors
        ]
        return stack_samples(self.embed_to_product(samples), n_samples)


class ProductMetric(RiemannianMetric):
    """The weighted sum of the metrics of the factors.

    A factor of weight 0 does not contribute to distances and inner products, and is not evaluated.

    Parameters
    ----------
    space : ProductManifold
    weights : sequence of float, optional
        A weight w_k ≥ 0 for each factor, not all 0; by default all are 1.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> product = rh.ProductManifold([rh.VectorSpace((1,)), rh.VectorSpace((1,))])
    >>> metric = rh.ProductMetric(product, weights=[1.0, 4.0])
    >>> float(metric.squared_dist(np.array([0.0, 0.0]), np.array([1.0, 1.0])))
    5.0
    """

    space: ProductManifold

    def __init__(
        self,
        space: ProductManifold,
        weights: Sequence[float] | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        super().__init__(space, **solvers)
        count = len(space.factors)
        for k, factor in enumerate(space.factors):
            if not factor.is_equipped:
                raise ArgumentError(
                    f"factors[{k}] must be equipped with a metric; found {type(factor).__name__} "
                    "without one"
                )
        given = [1.0] * count if weights is None else weights
        checked = real_array(given, "weights", (count,), batched=False)
        self.weights = tuple(
            metric_weight(value, f"weights[{k}]") for k, value in enumerate(checked)
        )
        if not any(self.weights):
            raise ArgumentError("weights must not all be 0: every distance would be 0")

    @property
    def has_closed_form_dist(self) -> bool:
        return all(factor.metric.has_closed_form_dist for _, factor, _ in self._weighted_factors())

    @property
    def has_closed_form_geodesic(self) -> bool:
        return all(factor.metric.has_closed_form_geodesic for factor in self.space.factors)

    @property
    def has_closed_form_transport(self) -> bool:
        return all(factor.metric.has_closed_form_transport for factor in self.space.factors)

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        def of_factor(k: int, metric: RiemannianMetric) -> Array:
            a = self.space.component(tangent_vec_a, k)
            b = self.space.component(tangent_vec_b, k)
            x = None if base_point is None else self.space.component(base_point, k)
            return metric.inner_product(a, b, x)

        return self._weighted_sum(of_factor)

    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        """Return Σ_k w_k d_k² (Theorem 2)."""

        def of_factor(k: int, metric: RiemannianMetric) -> Array:
            x = self.space.component(point_a, k)
            return metric.squared_dist(x, self.space.component(point_b, k))

        return self._weighted_sum(of_factor)

    @property
    def bulk(self) -> Bulk:
        return SumOfFactors(
            [
                Factor(partial(self.space.component, index=k), weight, factor.metric.bulk)
                for k, factor, weight in self._weighted_factors()
            ]
        )

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        parts = self._parts(velocity, point)
        return self.space.embed_to_product([metric.exp(v, x) for metric, v, x in parts])

    def _log(self, point: Points, start: Points) -> Array:
        parts = self._parts(point, start)
        return self.space.embed_to_product([metric.log(y, x) for metric, y, x in parts])

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        velocities = self.space.project_from_product(velocity)
        ends = [
            metric.parallel_transport(u, x, v)
            for (metric, u, x), v in zip(self._parts(vector, point), velocities, strict=True)
        ]
        return self.space.embed_to_product(ends)

    def _geodesic_between(self, start: Points, end: Points) -> Callable[[ArrayLike], Points]:
        curves = [metric.geodesic(x, end_point=y) for metric, x, y in self._parts(start, end)]
        return lambda t: self.space.embed_to_product([curve(t) for curve in curves])

    def _parts(self, a: Array, b: Array) -> Iterator[tuple[RiemannianMetric, Array, Array]]:
        """Yield the metric of every factor with its components of two points or vectors."""
        components_a, components_b = map(self.space.project_from_product, (a, b))
        for k, factor in enumerate(self.space.factors):
            yield factor.metric, components_a[k], components_b[k]

    def _weighted_sum(self, value: Callable[[int, RiemannianMetric], Array]) -> Array:
        """Return Σ_k w_k x_k, with x_k the value of k and the metric of the k-th factor."""
        return sum(
            (weight * value(k, factor.metric) for k, factor, weight in self._weighted_factors()),
            start=np.zeros(()),
        )

    def _weighted_factors(self) -> list[tuple[int, Manifold, float]]:
        """Return number, factor and weight of the factors whose weight is not 0."""
        pairs = zip(self.space.factors, self.weights, strict=True)
        return [(k, factor, weight) for k, (factor, weight) in enumerate(pairs) if weight > 0]


class PullbackMetric(RiemannianMetric):
    r"""The pull-back of any metric by any autograd-differentiable map φ.

    .. math:: \begin{split} \langle a, b\rangle_x &=
              \langle d_x\varphi(a), d_x\varphi(b)\rangle_{\varphi(x)}, \\
              d(x, y) &= d_{target}(\varphi(x), \varphi(y)) \end{split}

    `dist` is the distance of the images (equation 4 of the paper). It is a lower bound of the
    length of every path between x and y; `length` and `energy` are for paths.

    Parameters
    ----------
    space : Manifold
    target_metric : RiemannianMetric
    map : callable
        φ, from arrays (..., \*space.shape) to (..., \*target_metric.space.shape), acting on each
        point of a batch separately, written with `autograd.numpy`.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> heights = rh.VectorSpace((bodies.template.n_vertices,))
    >>> metric = rh.PullbackMetric(space, heights.metric, lambda f: f[..., 1])
    >>> float(metric.dist(bodies[0], bodies[0] + [1.0, 0.0, 0.0]))
    0.0
    """

    has_target_metric = True

    def __init__(
        self,
        space: PointSpace,
        target_metric: RiemannianMetric,
        map: Callable[[Array], Array],
        **solvers: Unpack[Solvers],
    ) -> None:
        super().__init__(space, **solvers)
        self._target_metric = target_metric
        # The function itself, which shows in representations and tells jobs which metric this is.
        self.map = map  # type: ignore[method-assign, assignment]

    @property
    def target_metric(self) -> RiemannianMetric:
        return self._target_metric

    @property
    def has_closed_form_dist(self) -> bool:
        return self.target_metric.has_closed_form_dist

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec_a = self._vectors(tangent_vec_a, "tangent_vec_a")
        image_a = image_b = self.differential(tangent_vec_a, base_point)
        if tangent_vec_b is not tangent_vec_a:
            tangent_vec_b = self._vectors(tangent_vec_b, "tangent_vec_b")
            joint_shape(tangent_vec_a=tangent_vec_a, tangent_vec_b=tangent_vec_b)
            image_b = self.differential(tangent_vec_b, base_point)
        return self.target_metric.inner_product(image_a, image_b, self.map(base_point))

    @checked(point_a=POINT, point_b=POINT)
    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        joint_shape(point_a=point_a, point_b=point_b)
        return self.target_metric.squared_dist(self.map(point_a), self.map(point_b))

    @property
    def bulk(self) -> Bulk:

        def image(points: Points) -> Array:
            return self.map(self.space.check_point(points, "points"))

        return SumOfFactors([Factor(image, 1.0, self.target_metric.bulk)])

    def _squared_segments(self, path: Points) -> Array:
        return self.target_metric._squared_segments(self.map(path))
