"""The weighted mean of squared distances to a set of points, which Fréchet means minimise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, StretchInvarianceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.threads import slices
from riemhuman.solvers.paths import rounding_energy
from riemhuman.surfaces.measures import triangle_areas

# Points whose features are held together.
_BLOCK = 64


class Dispersion(InheritsDocstrings):
    r"""V(x) = Σ_i w_i d(x_i, x)²/Σ_i w_i.

    The functional of section 4 of the paper, divided by the sum of the weights.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric whose distance has a closed form or a solver.
    points : array, shape (n, \*shape)
        Points x_i.
    weights : array, shape (n,), optional
        Weights w_i ≥ 0, not all 0; by default all are 1.
    """

    def __init__(
        self, metric: RiemannianMetric, points: ndarray, weights: ndarray | None = None
    ) -> None:
        self.metric = metric
        self.points = metric.check_points(points)
        metric.space.check_scale(self.points, "points")
        if not len(self.points):
            raise ArgumentError("points must hold at least one point; found none")
        self.weights = check_weights(weights, len(self.points))

    def squared_dists(self, point: ndarray) -> ndarray:
        r"""Return the squared distances d(x_i, x)².

        Parameters
        ----------
        point : array, shape (\*shape,)
            Point x.

        Returns
        -------
        array, shape (n,)
        """
        metric, one = self.metric, self.metric.features(point[None])
        blocks = np.split(self.points, range(_BLOCK, len(self.points), _BLOCK))
        try:
            squared = [metric.bulk.squared_distances(one, metric.features(some)) for some in blocks]
        except ArgumentError:
            # Its message counts from the first point of a block, that of all points from theirs.
            metric.features(self.points)
            raise
        return np.concatenate(squared, axis=1)[0]

    def value(self, point: ndarray) -> float:
        r"""Return V(x).

        Parameters
        ----------
        point : array, shape (\*shape,)
            Point x.

        Returns
        -------
        float
        """
        return float(self.weights @ self.squared_dists(point))

    def medoid(self) -> int:
        """Return the index of the point with the least V.

        Returns
        -------
        int
        """
        distances = self.metric.dist_pairwise(self.points, n_jobs=-1, precision="double")
        return int(np.argmin(distances**2 @ self.weights))

    def value_and_gradient(self, point: ndarray) -> tuple[float, ndarray]:
        r"""Return V(x) and its gradient, from the energy of paths of one segment.

        Parameters
        ----------
        point : array, shape (\*shape,)
            Point x.

        Returns
        -------
        value : float
        gradient : array, shape (\*shape,)
        """
        squared, gradient = self.metric.squared_dists_and_gradient(point, *self._used)
        return float(self._used[1] @ squared), gradient

    def curvature(self, value: float) -> float:
        """Return the factor by which the metric's matrix approximates the Hessian of V.

        Parameters
        ----------
        value : float
            V(x).

        Returns
        -------
        float
        """
        return 2.0

    def floor(self, point: ndarray) -> float:
        r"""Return the part of V that is due to rounding errors.

        Parameters
        ----------
        point : array, shape (\*shape,)
            Where the search starts.

        Returns
        -------
        float
        """
        return rounding_energy(self.metric, point)

    @cached_property
    def _used(self) -> tuple[ndarray, ndarray]:
        """The points that have a weight, and their weights."""
        used = self.weights > 0
        points = self.points if used.all() else self.points[used]
        return points, self.weights[used]


class MeanDistance(Dispersion):
    r"""S(x) = Σ_i w_i √(d(x_i, x)² + ε²)/Σ_i w_i, which geometric medians minimise.

    Parameters
    ----------
    smoothing : float
        ε > 0. S exceeds the mean distance by at most ε; distances alone have no gradient at 0.
    """

    def __init__(
        self,
        metric: RiemannianMetric,
        points: ndarray,
        weights: ndarray | None = None,
        *,
        smoothing: float,
    ) -> None:
        super().__init__(metric, points, weights)
        self._smoothing = smoothing

    def value(self, point: ndarray) -> float:
        """Return S(x)."""
        return float(self.weights @ self._smooth(self.squared_dists(point)))

    def value_and_gradient(self, point: ndarray) -> tuple[float, ndarray]:
        """Return S(x) and its gradient."""
        points, weights = self._used
        distances = self._smooth(self.squared_dists(point)[self.weights > 0])
        shares = 0.5 * weights / distances
        _, gradient = self.metric.squared_dists_and_gradient(point, points, shares)
        return float(weights @ distances), gradient

    def curvature(self, value: float) -> float:
        """Return 1/S, at most Σ_i w_i/d(x_i, x)."""
        return 1.0 / value

    def floor(self, point: ndarray) -> float:
        """Return the part of S that is due to rounding errors."""
        return float(self._smooth(np.array(super().floor(point))))

    def _smooth(self, squared: ndarray) -> ndarray:
        return np.sqrt(squared + self._smoothing**2)


class StreamedDispersion(Dispersion):
    r"""V(x), or S(x), of more points than memory holds, read batch by batch for every value.

    Parameters
    ----------
    points : sequence, shape (n, \*shape)
        An array, which may be mapped from a file, or any object whose slices are arrays of points.
    weights : array, shape (n,)
        Weights of at least 0 that sum to one.
    batch_size : int
        Number of points read together.
    sample : array, shape (m, \*shape)
        Some of the points, used instead of all where that is enough.
    of_batch : callable
        Maps metric, points and weights of a batch to the quantity that is averaged over batches.
    """

    def __init__(
        self,
        metric: RiemannianMetric,
        points: Any,
        weights: ndarray,
        batch_size: int,
        sample: ndarray,
        of_batch: Callable[..., Dispersion] = Dispersion,
    ) -> None:
        super().__init__(metric, sample)
        self._all, self._all_weights, self._batch_size = points, weights, batch_size
        self._of_batch, self._one = of_batch, of_batch(metric, sample[:1])

    def value(self, point: ndarray) -> float:
        """Return V(x)."""
        return float(sum(share * one for share, one in self._each(lambda one: one.value(point))))

    def value_and_gradient(self, point: ndarray) -> tuple[float, ndarray]:
        """Return V(x) and its gradient."""
        value, gradient = 0.0, np.zeros(np.shape(point))
        for share, found in self._each(lambda batch: batch.value_and_gradient(point)):
            of_batch, slope = found
            value += share * of_batch
            gradient += share * slope
        return value, gradient

    def curvature(self, value: float) -> float:
        """Return the factor by which the metric's matrix approximates the Hessian."""
        return self._one.curvature(value)

    def floor(self, point: ndarray) -> float:
        """Return the part of the value that is due to rounding errors."""
        return self._one.floor(point)

    def _each(self, compute: Callable[[Dispersion], Any]) -> Iterator[tuple[float, Any]]:
        """Yield what is computed of every batch, with its share of the weights."""
        for some in slices(len(self._all_weights), self._batch_size):
            weights = self._all_weights[some]
            if not weights.any():
                continue
            try:
                found = compute(self._of_batch(self.metric, self._all[some], weights))
            except ArgumentError as error:
                # Its message counts from the first point of the batch.
                where = f"points[{some.start}:{some.start + len(weights)}]"
                raise type(error)(f"{where}: {error}") from error
            yield float(weights.sum()), found


def check_weights(weights: ndarray | None, n_points: int) -> ndarray:
    """Return weights that sum to one after checking them.

    Parameters
    ----------
    weights : array_like, shape (n_points,), optional
        Weights of at least 0, not all 0; by default all are the same.
    n_points : int
        Number of points.

    Returns
    -------
    array, shape (n_points,)
    """
    if weights is None:
        return np.full(n_points, 1.0 / n_points)
    weights = real_array(weights, "weights", (n_points,), batched=False)
    smallest, largest = weights.min(), weights.max()
    if smallest < 0 or largest <= 0:
        raise ArgumentError(
            f"weights must be at least 0 and not all 0; the smallest is {smallest:g}, the largest "
            f"{largest:g}"
        )
    # Their sum might overflow.
    weights = weights / largest
    return weights / weights.sum()


# Share of a triangle's area on the points, in the median, below which it has shrunk away.
_SHRUNK = 1e-2


def seeing_lengths(metric: Any, weight: float) -> Any:
    """Return the metric for the search of a mean, with a companion where it does not see lengths.

    Parameters
    ----------
    metric : RiemannianMetric
        Any metric.
    weight : float
        Weight of the companion, 0 for none.

    Returns
    -------
    RiemannianMetric
        The metric itself if it sees lengths, or has no companion.

    Warns
    -----
    StretchInvarianceWarning
        If the returned metric does not see lengths.
    """
    if weight > 0:
        metric = metric.with_stretching(weight)
    if metric.is_stretch_invariant:
        warn(
            f"{metric!r} does not see the lengths of edges: limbs of the mean may stretch or "
            "shrink like rubber. Use a metric that sees lengths, such as ElasticMetric with a > 0, "
            "a companion (companion_weight > 0 of BasisMean), or a medoid "
            "(riemhuman.statistics.KMedoids)",
            StretchInvarianceWarning,
        )
    return metric


class AreaCheck:
    """Refuses surfaces whose triangles have collapsed.

    Pointwise, metric fields are points of a cone. If most of them are more than a right angle
    apart, θ > π/2, as for dissimilar bodies and small λ, the mean squared distance decreases
    towards the tip of the cone, a triangle without area.

    Parameters
    ----------
    space : Manifold
        The space; only surfaces are checked.
    points : array, shape (n, V, 3)
        Points whose mean is searched.
    """

    def __init__(self, space: Any, points: ndarray) -> None:
        self._faces = None
        if space.is_surface_space:
            self._faces = space.template.faces
            # One by one: the corners of all triangles at once would take much memory.
            self._areas = np.median([triangle_areas(f, self._faces) for f in points], axis=0)

    def refuse_collapse(self, point: ndarray) -> None:
        """Refuse a surface whose triangles have collapsed.

        Parameters
        ----------
        point : array, shape (V, 3)
            Current point of the search.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has less than a hundredth of its median area on the points.
        """
        if self._faces is None:
            return
        shrunk = triangle_areas(point, self._faces) < _SHRUNK * self._areas
        if np.any(shrunk):
            raise DegenerateSurfaceError(
                f"the mean has collapsed: {int(shrunk.sum())} of {len(self._faces)} triangles have "
                "shrunk to less than a hundredth of their area, and the variance decreases as they "
                "shrink. The points are too dissimilar for so small a lam, or for a metric that "
                "does not see areas: use lam = 1, or a medoid (riemhuman.statistics.KMedoids)"
            )
