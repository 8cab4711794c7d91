"""Mean squared distances and mean distances to points, in memory or in batches; their checks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from copy import copy
from typing import TypeVar

import numpy as np

from riemhuman.arrays import Array, Integers, Points, PointsOrBatches
from riemhuman.checks import values_of, weight_shares
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, StretchInvarianceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces
from riemhuman.geometry.point_space import PointSpace
from riemhuman.solvers.paths import rounding_energy
from riemhuman.surfaces.measures import triangle_areas

# Points whose features are in memory together.
_BLOCK = 64

# Share of its median area over the points below which a triangle has collapsed.
_SHRUNK = 1e-2

Computed = TypeVar("Computed")


class Dispersion:
    """V(x) = Σ_i w_i d(x_i, x)²/Σ_i w_i, the functional of section 4 of the paper."""

    # With smoothing ε it is S(x) = Σ_i w_i √(d(x_i, x)² + ε²)/Σ_i w_i, which geometric medians
    # minimise: distances alone have no gradient at 0, and S exceeds their mean by at most ε.
    # Every evaluation reads an iterable of batches again. `points` are then a sample: at most
    # `sample_size` points, evenly spaced among those of weight; otherwise they are all points.

    def __init__(
        self,
        metric: RiemannianMetric,
        points: PointsOrBatches,
        weights: Array | None = None,
        sample_size: int = 1,
    ) -> None:
        self.metric = metric
        self.smoothing: float | None = None
        self.in_batches = _are_batches(metric, points)
        self._batches: Iterable[Points] = points if self.in_batches else [self._checked(points)]
        n_points = sum(len(batch) for batch in self._batches)
        if not n_points:
            raise ArgumentError("points must hold at least one point; found none")
        self._all_weights = weight_shares(weights, n_points)
        if self.in_batches:
            used = np.flatnonzero(self._all_weights)
            spaced = np.linspace(0, len(used) - 1, min(sample_size, len(used)))
            numbers = used[spaced.astype(int)]
            self.points = self._checked(_points_of_batches(self._batches, numbers))
            self.weights = weight_shares(self._all_weights[numbers], len(numbers))
        else:
            self.points = next(iter(self._batches))
            self.weights = self._all_weights

    def _checked(self, points: object) -> Array:
        points = self.metric.check_points(points)
        self.metric.space.check_scale(points, "points")
        return points

    @property
    def sample(self) -> Dispersion:
        """The functional of the sample, or of all points if they are in memory."""
        if not self.in_batches:
            return self
        return Dispersion(self.metric, self.points, self.weights).smoothed(self.smoothing)

    def with_points(self, points: Points) -> Dispersion:
        """Return the same functional with other `points`, which it cannot tell from these."""
        changed = copy(self)
        changed.points = points
        return changed

    def smoothed(self, smoothing: float | None) -> Dispersion:
        """Return S with this smoothing, or V without one, of the same points."""
        changed = copy(self)
        changed.smoothing = smoothing
        return changed

    def variance_by(self, metric: RiemannianMetric) -> Dispersion:
        """Return V of the same points by another metric."""
        changed = self.smoothed(None)
        changed.metric = metric
        return changed

    def of_batches(self, compute: Callable[[Array, Array], Computed]) -> Iterator[Computed]:
        """Yield the results of a function of the points of each batch and their weights."""
        first = 0
        for batch in self._batches:
            weights = self._all_weights[first : first + len(batch)]
            try:
                if weights.any():
                    yield compute(self._checked(batch) if self.in_batches else batch, weights)
            except ArgumentError as error:
                if not self.in_batches:
                    raise
                # The message counts from the first point of the batch.
                raise type(error)(f"points[{first}:{first + len(batch)}]: {error}") from error
            first += len(batch)

    def value(self, point: Points) -> float:
        """Return V(x), or S(x)."""

        def of_batch(points: Points, weights: Array) -> float:
            return float(weights @ self._lengths(self._squared_dists(point, points)))

        return sum(self.of_batches(of_batch))

    def value_and_gradient(self, point: Points) -> tuple[float, Array]:
        """Return V(x), or S(x), and its gradient."""

        def of_batch(points: Points, weights: Array) -> tuple[float, Array]:
            points, weights = with_weight(points, weights)
            shares = weights
            if self.smoothing is not None:
                shares = 0.5 * weights / self._lengths(self._squared_dists(point, points))
            squared, gradient = self.metric.squared_dists_and_gradient(point, points, shares)
            return float(weights @ self._lengths(squared)), gradient

        parts = list(self.of_batches(of_batch))
        gradient: Array = np.sum([part for _, part in parts], axis=0)
        return sum(value for value, _ in parts), gradient

    def medoid(self) -> Array:
        """Return the point of least V among the points."""
        distances = self.metric.dist_pairwise(self.points, n_jobs=-1, precision="double")
        nearest: Points = self.points[int(np.argmin(distances**2 @ self.weights))]
        return nearest

    def curvature(self, value: float) -> float:
        """Return the factor by which the metric's matrix approximates the Hessian at this value."""
        # Of S it is Σ_i w_i/d(x_i, x), of which 1/S is a lower bound.
        return 2.0 if self.smoothing is None else 1.0 / value

    def floor(self, point: Points) -> float:
        """Return the part of the value that is due to rounding errors."""
        return float(self._lengths(np.asarray(rounding_energy(self.metric, point))))

    def _lengths(self, squared: Array) -> Array:
        return squared if self.smoothing is None else np.sqrt(squared + self.smoothing**2)

    def _squared_dists(self, point: Points, points: Points) -> Array:
        metric, features = self.metric, self.metric.features(point[None])
        blocks = np.split(points, range(_BLOCK, len(points), _BLOCK))
        try:
            squared = [
                metric.bulk.squared_distances(features, metric.features(block)) for block in blocks
            ]
        except ArgumentError:
            # The message counts from the first point of a block; this one counts from all points.
            metric.features(points)
            raise
        row: Array = np.concatenate(squared, axis=1)[0]
        return row


def _points_of_batches(batches: Iterable[Points], numbers: Integers) -> Array:
    """Return the points of these numbers, ascending, reading the batches once."""
    points, first = [], 0
    for batch in batches:
        is_inside = (numbers >= first) & (numbers < first + len(batch))
        points += [np.asarray(batch[k : k + 1]) for k in numbers[is_inside] - first]
        first += len(batch)
    return np.concatenate(points)


def with_weight(points: Points, weights: Array) -> tuple[Array, Array]:
    """Return the points that have a weight, and their weights."""
    used = weights > 0
    return (points if used.all() else points[used]), weights[used]


def _are_batches(metric: RiemannianMetric, points: PointsOrBatches) -> bool:
    if hasattr(points, "__array__") or isinstance(points, memoryview):
        return False
    if not hasattr(points, "__iter__"):
        return False
    if iter(points) is points:
        raise ArgumentError(
            "points are read several times, so they must be an array, or batches that can be "
            f"read again, such as a list of arrays; found {type(points).__name__}"
        )
    first = next(iter(points), None)
    return values_of(first, "points").ndim == len(metric.space.shape) + 1


def metric_of_search(metric: RiemannianMetric, companion_weight: float) -> RiemannianMetric:
    """Return the metric, with a companion if it does not measure lengths; warn if none does."""
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


def area_check(space: PointSpace, points: Points) -> Callable[[Array], None]:
    """Return a check that no triangles have collapsed, compared with those of the points."""
    # Where most metric fields are more than a right angle apart on their cone, θ > π/2, the mean
    # squared distance decreases towards its tip, a triangle without area.
    if not holds_surfaces(space):
        return lambda point: None
    faces = space.template.faces
    # One by one, because the corners of all triangles together would need much memory.
    areas = np.median([triangle_areas(f, faces) for f in points], axis=0)

    def check(point: Points) -> None:
        n_shrunk = int(np.sum(triangle_areas(point, faces) < _SHRUNK * areas))
        if n_shrunk:
            raise DegenerateSurfaceError(
                f"the mean has collapsed: {n_shrunk} of {len(faces)} triangles have shrunk to "
                "less than a hundredth of their area, and the variance decreases as they "
                "shrink. The points are too different for such a small lam, or for a metric "
                "that does not measure areas: use lam = 1, or a medoid "
                "(riemhuman.statistics.KMedoids)"
            )

    return check
