"""Geodesic regression of points on a number, such as a height or an age."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

import autograd.numpy as np
from autograd import value_and_grad

from riemhuman.arrays import Array, ArrayLike, Points, TangentVectors
from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, OutsideManifoldError
from riemhuman.geometry import Manifold, ProductMetric, RiemannianMetric
from riemhuman.geometry.strategies import MeanSolver
from riemhuman.kernels.threads import slices
from riemhuman.solvers._lbfgs import Descent, Minimum
from riemhuman.solvers._preconditioners import metric_factor
from riemhuman.solvers.nearest_surface import NearestSurface
from riemhuman.solvers.results import MeanResult, finish
from riemhuman.solvers.tangent_pca import ImageEstimator

# Number of points whose misfits are differentiated together, which bounds memory.
_BLOCK = 8


class GeodesicRegression(ImageEstimator):
    r"""The geodesic that minimises :math:`\sum_i d(\exp_p((t_i - \bar t) v), y_i)^2` [1]_.

    The search starts from the straight line that fits the logarithms at the Karcher mean; a
    quasi-Newton method then refines p and v. Surfaces are mapped to their fields as by
    `TangentPCA`.

    Parameters
    ----------
    space, mean, image, nearest
        As in `TangentPCA`.
    tolerance : float
        The refinement stops when a Newton step would gain at most this share of the sum of squared
        distances to the mean.
    max_iter : int
        Largest number of iterations; 0 keeps the regression in the tangent space.

    Attributes
    ----------
    mean_ : array, shape (\*shape,)
        Karcher mean of the points.
    center_ : float
        Mean :math:`\bar t` of the numbers.
    intercept_ : array, shape (\*image_shape,)
        p, the point of the geodesic at the centre; of surfaces, its fields.
    velocity_ : array, shape (\*image_shape,)
        v, tangent at the intercept, for a change of t by 1.
    n_iter_ : int
        Number of iterations of the refinement.

    References
    ----------
    .. [1] Fletcher, "Geodesic regression and the theory of least squares on Riemannian manifolds",
       International Journal of Computer Vision 105, 2013.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template, equip=False)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
    >>> points, regression = bodies.points[:50:10], rh.GeodesicRegression(space)
    >>> regression.fit(points[:, :, 1].max(axis=1), points).predict([1.8]).shape
    (1, 1202, 3)
    """

    mean_: Array
    center_: float
    intercept_: Array
    velocity_: Array
    n_iter_: int

    def __init__(
        self,
        space: Manifold,
        *,
        mean: MeanSolver | ArrayLike | None = None,
        image: str = "auto",
        nearest: NearestSurface | None = None,
        tolerance: float = 1e-6,
        max_iter: int = 200,
    ) -> None:
        self.space = space
        self.mean = mean
        self.image = image
        self.nearest = nearest
        self.tolerance = tolerance
        self.max_iter = max_iter

    def fit(self, X: Array, y: Array) -> Self:
        r"""Find the geodesic.

        Parameters
        ----------
        X : array, shape (n,) or (n, 1)
            Numbers t_i, not all the same.
        y : array, shape (n, \*shape)
            Points, at least two. A point without a logarithm at the mean raises an
            OutsideManifoldError.
        """
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=0)
        points = self._metric.check_points(y, "y")
        times = _numbers(X)
        if len(times) != len(points):
            raise ArgumentError(f"X holds {len(times)} numbers and y {len(points)} points")
        if len(points) < 2 or np.ptp(times) == 0:
            raise ArgumentError("X must hold at least two different numbers")
        self.center_ = float(times.mean())
        # In units of the largest distance from the centre, so that velocities are like distances.
        unit = float(np.abs(times - self.center_).max())
        times = (times - self.center_) / unit

        metric = self._image_metric
        if self.max_iter and not metric.has_closed_form_geodesic:
            raise ArgumentError(
                f"max_iter must be 0 because {type(metric).__name__} has no closed form for exp: "
                "the refinement needs its derivative"
            )
        self.mean_ = self._mean_point(self.mean, points)
        images, base = self._embed(points), self._embed(self.mean_[None])[0]
        point, velocity = _tangent_regression(metric, base, times, images)
        spread = float(np.mean(metric.squared_dist(base, images))) if self.max_iter else 0.0
        minimum = None
        if spread > 0:
            point, velocity, minimum = self._refine(metric, times, images, spread, point, velocity)
        self.intercept_, self.velocity_ = point, velocity / unit
        self.n_iter_ = 0
        if minimum is not None:
            self.n_iter_ = minimum.n_iterations
            finish(self, MeanResult(point, minimum.value, minimum.values, **minimum.outcome))
        return self

    def predict(self, X: Array) -> Array:
        r"""Return the points of the geodesic.

        Parameters
        ----------
        X : array, shape (n,) or (n, 1)
        """
        self._require_fit("velocity_")
        times = _numbers(X) - self.center_
        vectors = times.reshape(-1, *(1,) * self.velocity_.ndim) * self.velocity_
        return self._restore(self._image_metric.exp(vectors, self.intercept_), self.mean_)

    def score(self, X: Array, y: Array) -> float:
        r"""Return R² = 1 − Σ_i d(prediction, y_i)²/Σ_i d(mean, y_i)², with the mean found by `fit`.

        Parameters
        ----------
        X, y
            See `fit`.
        """
        metric = self._metric
        points, predictions = metric.check_points(y, "y"), self.predict(X)
        if len(points) != len(predictions):
            raise ArgumentError(f"X holds {len(predictions)} numbers and y {len(points)} points")
        residual = sum(
            float(metric.squared_dist(prediction, point))
            for prediction, point in zip(predictions, points, strict=True)
        )
        total = sum(float(metric.squared_dist(self.mean_, point)) for point in points)
        if total == 0.0:
            raise ArgumentError("y must hold a point other than the mean, or R² is not defined")
        return 1.0 - residual / total

    def gram_matrix(self, y: Array) -> Array:
        r"""Return the inner products of the logarithms of points at the mean, shape (n, n).

        Parameters
        ----------
        y : array, shape (n, \*shape)
        """
        self._require_fit("mean_")
        metric, base = self._image_metric, self._embed(self.mean_[None])[0]
        logs = metric.log(self._embed(self._metric.check_points(y, "y")), base)
        return metric.gram_matrix(logs, base)

    def _refine(
        self,
        metric: RiemannianMetric,
        times: Array,
        images: Array,
        spread: float,
        point: Points,
        velocity: TangentVectors,
    ) -> tuple[Array, Array, Minimum]:
        """Minimise the sum in both, in variables in which it is nearly a sum of squares."""
        space, shape = metric.space, point.shape
        inverse = _inverse_matrix(metric, point, 0.5 * spread)
        # A velocity larger by this moves the points as far as a unit of the intercept does.
        unit_velocity = 1.0 / np.sqrt(np.mean(times**2))
        columns = times.reshape(-1, *(1,) * point.ndim)

        def line(changes: Array) -> Array:
            # The factor is all but singular on directions that leave the manifold.
            changes = space.to_tangent(changes, point)
            moved = space.projection(metric.exp(changes[0], point))
            return np.stack([moved, space.to_tangent(velocity + changes[1], moved)])

        def misfit(changes: Array, block: slice[int, int, None]) -> Array:
            start = line(changes)
            predictions = metric.exp(columns[block] * start[1], start[0])
            return np.sum(metric.squared_dist(predictions, images[block])) / (len(times) * spread)

        slope = value_and_grad(misfit)
        blocks = list(slices(len(times), _BLOCK))

        def objective(x: Array) -> tuple[float, Array]:
            try:
                parts = [slope(x.reshape(2, *shape), block) for block in blocks]
            except (DegenerateSurfaceError, OutsideManifoldError):
                return np.inf, np.zeros_like(x)
            # Plus one, so that the stopping test is a share of the variance, not of the misfit.
            value = sum(part for part, _ in parts)
            gradient = sum(part for _, part in parts)
            return 1.0 + float(value), np.ravel(gradient)

        def inverse_hessian(gradient: Array) -> Array:
            by_point, by_velocity = gradient.reshape(2, -1, 1)
            step_of_point = inverse(by_point)
            step_of_velocity = unit_velocity**2 * inverse(by_velocity)
            return np.concatenate([step_of_point, step_of_velocity]).ravel()

        start = np.zeros(2 * point.size)
        minimum = Descent(
            objective, start, lambda x: inverse_hessian, self.tolerance, self.max_iter
        ).minimize()
        intercept, refined_velocity = line(minimum.x.reshape(2, *shape))
        return intercept, refined_velocity, minimum


def _tangent_regression(
    metric: RiemannianMetric, base: Array, times: Array, images: Array
) -> tuple[Array, Array]:
    """Return the geodesic whose ends fit the logarithms of the points best."""
    logs = metric.log(images, base)
    offset = logs.mean(axis=0)
    slope = np.tensordot(times, logs, axes=1) / (times @ times)
    point = metric.exp(offset, base)
    return point, metric.log(metric.exp(offset + slope, base), point)


def _numbers(X: Array) -> Array:
    times = real_array(X, "X")
    if times.ndim not in (1, 2) or (times.ndim == 2 and times.shape[1] != 1):
        raise ArgumentError(f"X must have shape (n,) or (n, 1); found {times.shape}")
    return times.reshape(-1)


def _inverse_matrix(
    metric: RiemannianMetric, point: Points, scale: float
) -> Callable[[Array], Array]:
    """Return the inverse of the metric's matrix at a point, factor by factor of a product."""
    if not isinstance(metric, ProductMetric):
        return metric_factor(metric, point[None], scale).inverse
    parts = metric.space.project_from_product(point)
    inverses = []
    for factor, part, weight in zip(metric.space.factors, parts, metric.weights, strict=True):
        # Entries without weight do not matter; 1 keeps their matrix finite.
        scale_of_factor = scale / weight if weight > 0 else scale
        inverses.append(_inverse_matrix(factor.metric, part, scale_of_factor))
    ends = np.cumsum([part.size for part in parts])[:-1]

    def inverse_matrix(columns: Array) -> Array:
        blocks = np.split(columns, ends)
        return np.concatenate(
            [inverse(block) for inverse, block in zip(inverses, blocks, strict=True)]
        )

    return inverse_matrix
