"""Checks of a metric: inner products, distances, energies and gradients agree."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from autograd import grad

from riemhuman.arrays import Array
from riemhuman.checks import checked, instance, positive
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.testing.reports import Properties, PropertyReport, difference, excess, report_of

__all__ = ["check_metric"]

# Remainders smaller than this share of the values are rounding.
_ROUNDING = 1e-13
_TAYLOR_STEPS = np.logspace(-2, -6, 9)
# Number of remainders whose slope is measured; with fewer, the energy is all but quadratic.
_N_REMAINDERS = 4
_LIMIT_STEPS = np.logspace(-2, -8, 7)
# How far below 2 the measured order of an exact gradient may lie.
_ORDER_TOLERANCE = 0.1
_LIMIT = "short distances are norms of tangent vectors"
_GRADIENT = "the gradient of the energy is exact"


@checked(
    metric=instance(RiemannianMetric, "a metric, such as ElasticMetric(space)"), tolerance=positive
)
def check_metric(
    metric: RiemannianMetric,
    points: Array,
    tangent_vecs: Array | None = None,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a metric satisfies its axioms, and that its methods agree.

    Short distances must be norms: d²(x, x + εv) = ε²⟨v, v⟩ + O(ε³) for tangent vectors v. The
    gradient of the energy of the path through the points must be exact: E(γ + εv) − E(γ) − ε⟨∇E, v⟩
    is of order two in ε.

    Parameters
    ----------
    metric : RiemannianMetric
    points : array, shape (n, \*shape)
        Three points or more, all different.
    tangent_vecs : array, shape (n, \*shape), optional
        A tangent vector at each; by default towards the next point.
    tolerance : float
        Largest relative error of an equation or inequality. For the limit above, the tolerance is
        its square root, and orders may be as low as 1.9.

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.testing.check_metric(plane.metric, plane.random_point(3, rng=0)).passed
    True
    """
    points, space = metric.check_points(points), metric.space
    if len(points) < 3:
        raise ArgumentError(f"points must hold three points or more; found {len(points)}")
    if tangent_vecs is None:
        tangent_vecs = space.to_tangent(np.roll(points, -1, axis=0) - points, points)
    vectors = metric.check_points(tangent_vecs, "tangent_vecs")
    if len(vectors) != len(points):
        raise ArgumentError(f"tangent_vecs must hold {len(points)} vectors; found {len(vectors)}")
    other_vectors = space.to_tangent(np.roll(vectors, 1, axis=0) - 0.5 * vectors, points)

    products = _InnerProducts(metric, points, vectors, other_vectors)
    energies = _Energies(metric, points, vectors)
    properties = dict(products.properties())
    if metric.has_closed_form_dist:
        properties |= _Distances(metric, points).properties()
        properties[_LIMIT] = products.limit
    properties |= {
        "energy ≥ squared length ≥ squared distance": energies.least,
        _GRADIENT: energies.order,
    }
    tolerances = {_LIMIT: np.sqrt(tolerance), _GRADIENT: _ORDER_TOLERANCE}
    return report_of(metric, properties, tolerance, tolerances)


@dataclass(frozen=True)
class _InnerProducts:
    """Inner products of two tangent vectors at each point."""

    metric: RiemannianMetric
    points: Array
    first: Array
    second: Array

    def properties(self) -> Properties:
        return {
            "the inner product is symmetric": self.symmetry,
            "the inner product is linear": self.linearity,
            "the inner product is positive": self.positivity,
            "inner products of a stack are those of each pair": self.stack,
            "covectors represent the inner product": self.covectors,
        }

    def of(self, first: Array, second: Array) -> Array:
        """Return the inner products, computed for one point after the other."""
        pairs = zip(first, second, self.points, strict=True)
        return np.array([self.metric.inner_product(v, w, x) for v, w, x in pairs])

    @cached_property
    def size(self) -> float:
        squares = [self.of(self.first, self.first), self.of(self.second, self.second)]
        return float(np.abs(squares).max())

    def symmetry(self) -> float:
        forward, backward = self.of(self.first, self.second), self.of(self.second, self.first)
        return difference(forward, backward, self.size)

    def linearity(self) -> float:
        first, second = self.first, self.second
        together = self.of(2.0 * first - 3.0 * second, second)
        apart = 2.0 * self.of(first, second) - 3.0 * self.of(second, second)
        return difference(together, apart, self.size)

    def positivity(self) -> float:
        norms = self.of(self.first, self.first)
        if not np.any(norms != 0):
            return np.inf
        return excess(-norms, np.zeros_like(norms), self.size)

    def stack(self) -> float:
        together = self.metric.inner_product(self.first, self.second, self.points)
        return difference(together, self.of(self.first, self.second), self.size)

    def covectors(self) -> float:
        vectors = zip(self.first, self.second, self.points, strict=True)
        pairings = [np.sum(self.metric.covector(v, x) * w) for v, w, x in vectors]
        return difference(pairings, self.of(self.first, self.second), self.size)

    def limit(self) -> float:
        """Return how near d²(x, x ± εv)/ε² comes to ⟨v, v⟩, at the best ε."""
        squared_norms, size = self.of(self.first, self.first), self.size
        project, squared_dist = self.metric.space.projection, self.metric.squared_dist
        errors = []
        for step in _LIMIT_STEPS:
            ahead = project(self.points + step * self.first)
            behind = project(self.points - step * self.first)
            squares = [
                0.5 * (squared_dist(x, y) + squared_dist(x, z)) / step**2
                for x, y, z in zip(self.points, ahead, behind, strict=True)
            ]
            errors.append(difference(squares, squared_norms, size))
        return float(np.nanmin(errors)) if np.isfinite(errors).any() else np.inf


@dataclass(frozen=True)
class _Distances:
    """Distances of the points, and of the points half way between them."""

    metric: RiemannianMetric
    points: Array

    def properties(self) -> Properties:
        return {
            "points are at distance 0 from themselves": self.zero_diagonal,
            "squared distances are flat where points meet": self.flat_diagonal,
            "distances are symmetric": self.symmetry,
            "no detour is shorter (triangle inequality)": self.triangle_inequality,
            "distances of a stack are those of each pair": self.stack,
        }

    @cached_property
    def table(self) -> Array:
        """All distances, computed pair by pair."""
        half_way = self.metric.space.projection(0.5 * (self.points[1:] + self.points[:-1]))
        places = [*self.points, *half_way]
        return np.array([[self.metric.dist(x, y) for y in places] for x in places])

    def zero_diagonal(self) -> float:
        return difference(np.diag(self.table), np.zeros(len(self.table)), self.table.max())

    def flat_diagonal(self) -> float:
        slope = grad(self.metric.squared_dist, 1)
        slopes = [slope(x, x) for x in self.points]
        return difference(slopes, np.zeros_like(self.points), self.table.max() ** 2)

    def symmetry(self) -> float:
        return difference(self.table, self.table.T)

    def triangle_inequality(self) -> float:
        detours = self.table[:, :, None] + self.table[None, :, :]
        return excess(self.table, detours.min(axis=1), self.table.max())

    def stack(self) -> float:
        n, squares = len(self.points), self.table**2
        together = self.metric.squared_dist(self.points[:, None], self.points[None])
        return difference(together, squares[:n, :n], squares.max())


@dataclass(frozen=True)
class _Energies:
    """The energy of the path through the points, and of paths moved along tangent vectors."""

    metric: RiemannianMetric
    points: Array
    directions: Array

    def least(self) -> float:
        energy = self.metric.energy(self.points)
        bounds = [self.metric.length(self.points) ** 2]
        if self.metric.has_closed_form_dist:
            bounds.append(self.metric.squared_dist(self.points[0], self.points[-1]))
        return excess(bounds, np.full(len(bounds), energy), float(energy))

    def order(self) -> float:
        """Return how far below 2 the order of the remainder of the gradient lies."""
        energy, gradient = self.metric.energy_and_gradient(self.points)
        slope = np.sum(gradient * self.directions)
        if not np.isfinite([energy, slope]).all():
            return np.nan
        project = self.metric.space.projection
        moved = [project(self.points + step * self.directions) for step in _TAYLOR_STEPS]
        energies = np.array([self.metric.energy(path) for path in moved])
        remainders = np.abs(energies - energy - _TAYLOR_STEPS * slope)
        # The shortest steps whose remainders are not rounding errors.
        significant = np.flatnonzero(remainders > _ROUNDING * abs(energy))[-_N_REMAINDERS:]
        if len(significant) < _N_REMAINDERS:
            return 0.0
        log_steps, log_remainders = (
            np.log(_TAYLOR_STEPS[significant]),
            np.log(remainders[significant]),
        )
        order, _ = np.polyfit(log_steps, log_remainders, 1)
        return float(np.maximum(2.0 - order, 0.0))
