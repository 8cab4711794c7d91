"""Property checks for metrics, on a few points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from autograd import grad
from numpy import ndarray

from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.solvers.property_checks import PropertyCheck, PropertyReport, difference, excess

# Remainders smaller than this share of the values are rounding.
_ROUNDING = 1e-13
_TAYLOR_STEPS = np.logspace(-2, -6, 9)
_LIMIT_STEPS = np.logspace(-2, -8, 7)
# How far below 2 the measured order of an exact gradient may lie.
_ORDER_TOLERANCE = 0.1


def check_metric(
    metric: RiemannianMetric,
    points: ndarray,
    tangent_vecs: ndarray | None = None,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a metric is a metric, and that its methods agree.

    The inner product must be symmetric, linear, positive and the same for points in a stack as for
    each alone; `covector` must represent it. Where `squared_dist` has a closed form, it must
    satisfy the axioms of a metric (zero on the diagonal with zero gradient, symmetric, with the
    triangle inequality, the same in a stack), and for small steps ε along a tangent vector v

    .. math:: d^2(x, x + \varepsilon v) = \varepsilon^2 \langle v, v\rangle_x + O(\varepsilon^3).

    Of the path through the points, the energy must be at least the squared length and the squared
    distance of its ends, and its gradient exact:
    E(γ + εv) − E(γ) − ε⟨∇E, v⟩ is of order two in ε.

    In a test of your own, ``report = check_metric(metric, points)`` is followed by
    ``assert report.passed, report``.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    points : array, shape (n, \*shape)
        Three points or more, all different.
    tangent_vecs : array, shape (n, \*shape), optional
        A tangent vector at each; by default towards the next point.
    tolerance : float
        Largest relative error of an equation or inequality. That of the limit above is its square
        root, and orders may lie 0.1 below 2.

    Returns
    -------
    PropertyReport

    Raises
    ------
    ArgumentError
        If there are fewer than three points, or an array has another shape.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> report = rh.solvers.check_metric(rh.SRNFMetric(space), bodies.points[:3])
    >>> report.passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    points = metric.check_points(points)
    if len(points) < 3:
        raise ArgumentError(f"points must hold three points or more; found {len(points)}")
    if tangent_vecs is None:
        tangent_vecs = metric.space.to_tangent(np.roll(points, -1, axis=0) - points, points)
    vectors = metric.check_points(tangent_vecs, "tangent_vecs")
    if len(vectors) != len(points):
        raise ArgumentError(f"tangent_vecs must hold {len(points)} vectors; found {len(vectors)}")
    sample = _Sample(metric, points, vectors)
    properties = dict(_OF_INNER_PRODUCTS)
    if metric.has_closed_form_dist:
        properties |= _OF_DISTANCES
    properties |= _OF_ENERGIES
    tolerances: dict[Callable[[_Sample], float], float] = {
        _limit: np.sqrt(tolerance),
        _order: _ORDER_TOLERANCE,
    }
    with np.errstate(all="ignore"):  # what is not finite fails, and says so
        checks = tuple(
            PropertyCheck(name, float(error(sample)), float(tolerances.get(error, tolerance)))
            for name, error in properties.items()
        )
    return PropertyReport(type(metric).__name__, checks)


@dataclass(frozen=True)
class _Sample:
    """A metric, points, and at each of them two tangent vectors."""

    metric: RiemannianMetric
    points: ndarray
    a: ndarray

    @cached_property
    def b(self) -> ndarray:
        mixed = np.roll(self.a, 1, axis=0) - 0.5 * self.a
        return np.asarray(self.metric.space.to_tangent(mixed, self.points))

    def products(self, a: ndarray, b: ndarray) -> ndarray:
        """Return the inner products, computed for one point after the other."""
        inner_product = self.metric.inner_product
        return np.array([inner_product(*each) for each in zip(a, b, self.points, strict=True)])

    @cached_property
    def squared_norms(self) -> ndarray:
        return self.products(self.a, self.a)

    @property
    def size(self) -> float:
        """Size of the inner products."""
        return float(np.abs([self.squared_norms, self.products(self.b, self.b)]).max())

    @cached_property
    def distances(self) -> ndarray:
        """All distances of the points and of those half way, computed pair by pair."""
        half_way = self.metric.space.projection(0.5 * (self.points[1:] + self.points[:-1]))
        every = [*self.points, *half_way]
        return np.array([[self.metric.dist(x, y) for y in every] for x in every])


def _symmetry(s: _Sample) -> float:
    return difference(s.products(s.a, s.b), s.products(s.b, s.a), s.size)


def _linearity(s: _Sample) -> float:
    together = s.products(2.0 * s.a - 3.0 * s.b, s.b)
    apart = 2.0 * s.products(s.a, s.b) - 3.0 * s.products(s.b, s.b)
    return difference(together, apart, s.size)


def _positivity(s: _Sample) -> float:
    norms = s.squared_norms
    return excess(-norms, np.zeros_like(norms), s.size) if np.any(norms != 0) else np.inf


def _stacked_products(s: _Sample) -> float:
    return difference(s.metric.inner_product(s.a, s.b, s.points), s.products(s.a, s.b), s.size)


def _covectors(s: _Sample) -> float:
    found = [
        np.sum(s.metric.covector(a, x) * b) for a, b, x in zip(s.a, s.b, s.points, strict=True)
    ]
    return difference(found, s.products(s.a, s.b), s.size)


def _diagonal(s: _Sample) -> float:
    return difference(np.diag(s.distances), np.zeros(len(s.distances)), s.distances.max())


def _flat_diagonal(s: _Sample) -> float:
    slope: Callable[..., ndarray] = grad(s.metric.squared_dist, 1)
    slopes = [slope(x, x) for x in s.points]
    return difference(slopes, np.zeros_like(s.points), s.distances.max() ** 2)


def _symmetric_distances(s: _Sample) -> float:
    return difference(s.distances, s.distances.T, s.distances.max())


def _triangle_inequality(s: _Sample) -> float:
    detours = s.distances[:, :, None] + s.distances[None, :, :]
    return excess(s.distances, detours.min(axis=1), s.distances.max())


def _stacked_distances(s: _Sample) -> float:
    n = len(s.points)
    stacked = s.metric.squared_dist(s.points[:, None], s.points[None])
    return difference(stacked, s.distances[:n, :n] ** 2, s.distances.max() ** 2)


def _limit(s: _Sample) -> float:
    """Return how near d²(x, x ± εa)/ε² comes to ⟨a, a⟩, at the best ε."""
    projection, errors = s.metric.space.projection, []
    for step in _LIMIT_STEPS:
        there, back = projection(s.points + step * s.a), projection(s.points - step * s.a)
        squares = [
            0.5 * (s.metric.squared_dist(x, y) + s.metric.squared_dist(x, z)) / step**2
            for x, y, z in zip(s.points, there, back, strict=True)
        ]
        errors.append(difference(squares, s.squared_norms, s.size))
    return float(np.nanmin(errors)) if np.isfinite(errors).any() else np.inf


def _least_energy(s: _Sample) -> float:
    energy = s.metric.energy(s.points)
    bounds = [s.metric.length(s.points) ** 2]
    if s.metric.has_closed_form_dist:
        bounds.append(s.metric.squared_dist(s.points[0], s.points[-1]))
    return excess(bounds, np.full(len(bounds), energy), float(energy))


def _order(s: _Sample) -> float:
    """Return how far below 2 the order of the remainder of the energy's gradient lies."""
    energy, gradient = s.metric.energy_and_gradient(s.points)
    slope = np.sum(gradient * s.a)
    if not np.isfinite([energy, slope]).all():
        return np.nan
    moved = [s.metric.space.projection(s.points + step * s.a) for step in _TAYLOR_STEPS]
    found = np.array([s.metric.energy(path) for path in moved])
    remainders = np.abs(found - energy - _TAYLOR_STEPS * slope)
    seen = np.flatnonzero(remainders > _ROUNDING * abs(energy))[-4:]
    if len(seen) < 4:
        return 0.0
    order = np.polyfit(np.log(_TAYLOR_STEPS[seen]), np.log(remainders[seen]), 1)[0]
    return float(np.maximum(2.0 - order, 0.0))


_OF_INNER_PRODUCTS: dict[str, Callable[[_Sample], float]] = {
    "the inner product is symmetric": _symmetry,
    "the inner product is linear": _linearity,
    "the inner product is positive": _positivity,
    "inner products in a stack are those of each": _stacked_products,
    "covectors represent the inner product": _covectors,
}
_OF_DISTANCES: dict[str, Callable[[_Sample], float]] = {
    "points are at distance 0 from themselves": _diagonal,
    "squared distances are flat where points meet": _flat_diagonal,
    "distances are symmetric": _symmetric_distances,
    "no detour is shorter (triangle inequality)": _triangle_inequality,
    "distances in a stack are those of each": _stacked_distances,
    "short distances are norms of tangent vectors": _limit,
}
_OF_ENERGIES: dict[str, Callable[[_Sample], float]] = {
    "energy ≥ squared length ≥ squared distance": _least_energy,
    "the gradient of the energy is exact": _order,
}
