"""Mean squared distances and mean distances to points, in memory or in batches; their checks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import weight_shares
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, StretchInvarianceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.solvers.paths import rounding_energy
from riemhuman.surfaces.measures import triangle_areas

# Points whose features are in memory together.
_BLOCK = 64

# Share of a triangle's median area on the points, below which it has collapsed.
_SHRUNK = 1e-2


class Dispersion:
    r"""V(x) = Σ_i w_i d(x_i, x)²/Σ_i w_i, the functional of section 4 of the paper.

    With smoothing ε it is S(x) = Σ_i w_i √(d(x_i, x)² + ε²)/Σ_i w_i, which geometric medians
    minimise: distances alone have no gradient at 0, and S exceeds their mean by at most ε.
    """

    def __init__(
        self, metric: RiemannianMetric, points: ndarray, weights: ndarray | None = None
    ) -> None:
        self.metric = metric
        self.points = metric.check_points(points)
        metric.space.check_scale(self.points, "points")
        if not len(self.points):
            raise ArgumentError("points must hold at least one point; found none")
        self.weights = weight_shares(weights, len(self.points))
        self.smoothing: float | None = None

    @property
    def sample(self) -> Dispersion:
        """The same functional of some of the points, all in memory: here of all points."""
        return self

    def changed(
        self, metric: RiemannianMetric | None = None, smoothing: float | None = None
    ) -> Dispersion:
        """Return the functional of the same points by another metric, smoothed or not."""
        changed = copy(self)
        changed.metric, changed.smoothing = metric or self.metric, smoothing
        return changed

    def batches(self) -> Iterator[tuple[ndarray, ndarray]]:
        """Yield points that have a weight, and their weights."""
        used = self.weights > 0
        yield (self.points if used.all() else self.points[used]), self.weights[used]

    def squared_dists(self, point: ndarray) -> ndarray:
        """Return the squared distances d(x_i, x)², shape (n,)."""
        metric, features = self.metric, self.metric.features(point[None])
        blocks = np.split(self.points, range(_BLOCK, len(self.points), _BLOCK))
        try:
            squared = [
                metric.bulk.squared_distances(features, metric.features(block)) for block in blocks
            ]
        except ArgumentError:
            # The message counts from the first point of a block; this one counts from all points.
            metric.features(self.points)
            raise
        return np.concatenate(squared, axis=1)[0]

    def value(self, point: ndarray) -> float:
        """Return V(x), or S(x)."""
        return float(self.weights @ self._lengths(self.squared_dists(point)))

    def value_and_gradient(self, point: ndarray) -> tuple[float, ndarray]:
        r"""Return V(x), or S(x), and its gradient, shape (\*shape,)."""
        (points, weights), *_ = self.batches()
        shares = weights
        if self.smoothing is not None:
            squared = self.squared_dists(point)[self.weights > 0]
            shares = 0.5 * weights / self._lengths(squared)
        squared, gradient = self.metric.squared_dists_and_gradient(point, points, shares)
        return float(weights @ self._lengths(squared)), gradient

    def medoid(self) -> ndarray:
        """Return the point of least V among the points."""
        distances = self.metric.dist_pairwise(self.points, n_jobs=-1, precision="double")
        return self.points[int(np.argmin(distances**2 @ self.weights))]

    def curvature(self, value: float) -> float:
        """Return the factor by which the metric's matrix approximates the Hessian at this value."""
        # Of S it is Σ_i w_i/d(x_i, x), of which 1/S is a lower bound.
        return 2.0 if self.smoothing is None else 1.0 / value

    def floor(self, point: ndarray) -> float:
        """Return the part of the value that is due to rounding errors."""
        return float(self._lengths(rounding_energy(self.metric, point)))

    def _lengths(self, squared: Any) -> Any:
        return squared if self.smoothing is None else np.sqrt(squared + self.smoothing**2)


class BatchedDispersion(Dispersion):
    """V(x), or S(x), of points that every evaluation reads batch by batch.

    `points` are then a sample: at most `sample_size` points, evenly spaced among those of weight.
    """

    def __init__(
        self, metric: RiemannianMetric, batches: Any, weights: ndarray | None, sample_size: int
    ) -> None:
        if iter(batches) is batches:
            raise ArgumentError(
                "points are read several times and must be an array, or batches that can be read "
                f"again, such as a list of arrays; found {type(batches).__name__}"
            )
        self._all = batches
        n_points = sum(len(batch) for batch in batches)
        if not n_points:
            raise ArgumentError("points must hold at least one point; found none")
        self._all_weights = weight_shares(weights, n_points)
        used = np.flatnonzero(self._all_weights)
        spaced = np.linspace(0, len(used) - 1, min(sample_size, len(used)))
        chosen = used[spaced.astype(int)]
        sample = [
            np.asarray(batch[k - first : k - first + 1])
            for first, batch in self._numbered()
            for k in chosen[(chosen >= first) & (chosen < first + len(batch))]
        ]
        super().__init__(metric, np.concatenate(sample), self._all_weights[chosen])

    @property
    def sample(self) -> Dispersion:
        """The functional of the sample."""
        sample = Dispersion(self.metric, self.points, self.weights)
        sample.smoothing = self.smoothing
        return sample

    def batches(self) -> Iterator[tuple[ndarray, ndarray]]:
        for share, batch in self._each(lambda batch: next(batch.batches())):
            yield batch[0], share * batch[1]

    def value(self, point: ndarray) -> float:
        return float(sum(share * value for share, value in self._each(lambda b: b.value(point))))

    def value_and_gradient(self, point: ndarray) -> tuple[float, ndarray]:
        value, gradient = 0.0, np.zeros(np.shape(point))
        for share, (of_batch, slope) in self._each(lambda b: b.value_and_gradient(point)):
            value += share * of_batch
            gradient += share * slope
        return value, gradient

    def _numbered(self) -> Iterator[tuple[int, Any]]:
        """Yield batches, each with the number of its first point."""
        first = 0
        for batch in self._all:
            yield first, batch
            first += len(batch)

    def _each(self, compute: Callable[[Dispersion], Any]) -> Iterator[tuple[float, Any]]:
        """Yield what is computed from every batch, with its share of the weights."""
        for first, batch in self._numbered():
            weights = self._all_weights[first : first + len(batch)]
            if not weights.any():
                continue
            try:
                dispersion = Dispersion(self.metric, batch, weights)
                dispersion.smoothing = self.smoothing
                result = compute(dispersion)
            except ArgumentError as error:
                # The message counts from the first point of the batch.
                raise type(error)(f"points[{first}:{first + len(batch)}]: {error}") from error
            yield float(weights.sum()), result


def dispersion_of(
    metric: RiemannianMetric, points: Any, weights: ndarray | None, sample_size: int
) -> Dispersion:
    """Return the mean squared distance to the points of an array, or of an iterable of batches."""
    if not hasattr(points, "__array__") and hasattr(points, "__iter__"):
        is_iterator = iter(points) is points
        first: Any = None if is_iterator else next(iter(points), None)
        if is_iterator or np.ndim(first) == len(metric.space.shape) + 1:
            return BatchedDispersion(metric, points, weights, sample_size)
    return Dispersion(metric, points, weights)


def metric_of_search(metric: Any, companion_weight: float) -> Any:
    """Return the metric, with a companion where it does not measure lengths; warn if none does."""
    if companion_weight > 0:
        metric = metric.with_stretching(companion_weight)
    if metric.is_stretch_invariant:
        warn(
            f"{metric!r} does not measure the lengths of edges: limbs of the mean may stretch or "
            "shrink like rubber. Use a metric that does, such as ElasticMetric with a > 0, "
            "a companion (companion_weight > 0 of BasisMean), or a medoid "
            "(riemhuman.statistics.KMedoids)",
            StretchInvarianceWarning,
        )
    return metric


class AreaCheck:
    """Raises an error where triangles have collapsed, compared with those of the points.

    Where most metric fields are more than a right angle apart on their cone, θ > π/2, the mean
    squared distance decreases towards its tip, a triangle without area.
    """

    def __init__(self, space: Any, points: ndarray) -> None:
        self._faces = None
        if space.is_surface_space:
            self._faces = space.template.faces
            # One by one: the corners of all triangles at once would take much memory.
            self._areas = np.median([triangle_areas(f, self._faces) for f in points], axis=0)

    def __call__(self, point: ndarray) -> None:
        if self._faces is None:
            return
        shrunk = triangle_areas(point, self._faces) < _SHRUNK * self._areas
        if np.any(shrunk):
            raise DegenerateSurfaceError(
                f"the mean has collapsed: {int(shrunk.sum())} of {len(self._faces)} triangles have "
                "shrunk to less than a hundredth of their area, and the variance decreases as they "
                "shrink. The points are too dissimilar for so small a lam, or for a metric that "
                "does not measure areas: use lam = 1, or a medoid (riemhuman.statistics.KMedoids)"
            )
