"""Checks that a metric, manifold, solver or data set of one's own has the properties it needs.

In a test of your own, ``report = check_metric(metric, points)`` is followed by
``assert report.passed, report``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from autograd import grad
from numpy import ndarray

from riemhuman.checks import Rng, generator, is_missing_label, real_number
from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.geometry import Manifold, RiemannianMetric
from riemhuman.representation import Record

__all__ = [
    "PropertyCheck",
    "PropertyReport",
    "check_dataset",
    "check_manifold",
    "check_metric",
    "check_solver",
]

# Remainders smaller than this share of the values are rounding.
_ROUNDING = 1e-13
_TAYLOR_STEPS = np.logspace(-2, -6, 9)
_LIMIT_STEPS = np.logspace(-2, -8, 7)
# How far below 2 the measured order of an exact gradient may lie.
_ORDER_TOLERANCE = 0.1
# Distance from the manifold, relative to its points, of arrays that projection must bring back.
_NEAR = 1e-4
# Largest number of coordinates for which the trace of to_tangent, of as many vectors, is computed.
_MOST_COORDINATES = 1000
# Length of short vectors relative to the distance of the points, and error of first order in it.
_SHORT = 1e-3
_FIRST_ORDER = 1e-2
_LIMIT = "short distances are norms of tangent vectors"
_GRADIENT = "the gradient of the energy is exact"
_EXP_BEGINS = "geodesics begin with their initial velocity"
_LOG_BEGINS = "logarithms of points nearby lead there"
# Number of random points of a manifold.
_N_POINTS = 4
# Number of surfaces of a data set, which may be larger than memory, that are read.
_N_READ = 8

# What `solve` returns by the kind of the solver, and its arguments after the metric.
_KINDS = {
    "geodesic": ("path", ("start", "end")),
    "transport": ("tangent_vec", ("tangent_vec", "base_point", "direction", "end_point")),
    "exp": ("end", ("tangent_vec", "base_point")),
    "log": ("tangent_vec", ("point", "base_point")),
    "mean": ("point", ("points", "weights")),
}


@dataclass(frozen=True)
class PropertyCheck:
    """The error of an object in one property.

    Attributes
    ----------
    name : str
        Name of the property.
    error : float
        By how much it is violated, relative to the size of the compared values; NaN where the
        object returns NaN.
    tolerance : float
        Largest error that passes.

    Examples
    --------
    >>> rh.testing.PropertyCheck("the inner product is symmetric", 0.0, 1e-6).holds
    True
    """

    name: str
    error: float
    tolerance: float

    @property
    def holds(self) -> bool:
        """Whether the object has the property, within the tolerance."""
        return bool(self.error <= self.tolerance)

    def __str__(self) -> str:
        verdict, sign = ("holds", "≤") if self.holds else ("FAILS", ">")
        return f"{verdict}  {self.name:<48} {self.error:8.1e} {sign} {self.tolerance:.0e}"


@dataclass(frozen=True, repr=False)
class PropertyReport(Record):
    """The properties of an object that were checked; it prints as a table.

    Attributes
    ----------
    name : str
        Class of the object.
    checks : tuple of PropertyCheck
        One for every property.

    Examples
    --------
    >>> rh.testing.check_manifold(rh.VectorSpace((2,))).name
    'VectorSpace'
    """

    name: str
    checks: tuple[PropertyCheck, ...]

    @property
    def failures(self) -> tuple[PropertyCheck, ...]:
        """The properties that failed."""
        return tuple(check for check in self.checks if not check.holds)

    @property
    def passed(self) -> bool:
        """Whether all properties hold."""
        return not self.failures

    def __str__(self) -> str:
        n_held = len(self.checks) - len(self.failures)
        lines = [f"{self.name}: {n_held} of {len(self.checks)} properties hold"]
        return "\n".join([*lines, *map(str, self.checks)])


def _report(
    subject: object,
    properties: Mapping[str, Callable[[], Any]],
    tolerance: float,
    tolerances: Mapping[str, float] = MappingProxyType({}),
) -> PropertyReport:
    """Return the errors of an object; where it raises an error of the library they are NaN."""
    checks = []
    with np.errstate(all="ignore"):  # what is not finite fails anyway
        for name, measure in properties.items():
            try:
                error = float(measure())
            except RiemhumanError:
                error = np.nan
            checks.append(PropertyCheck(name, error, float(tolerances.get(name, tolerance))))
    return PropertyReport(type(subject).__name__, tuple(checks))


def _difference(value: Any, expected: Any, size: Any = None) -> float:
    """Return the largest difference relative to a size; infinite if the shapes differ."""
    if np.shape(value) != np.shape(expected):
        return np.inf
    gap = np.abs(np.subtract(value, expected)).max()
    size = np.abs(expected).max() if size is None else size
    return 0.0 if gap == 0 else float(gap / np.float64(size))


def _excess(smaller: Any, larger: Any, size: Any) -> float:
    """Return by how much an inequality is violated, relative to a size."""
    return _difference(np.maximum(np.subtract(smaller, larger), 0.0), np.zeros_like(smaller), size)


def _share(wrong: object) -> float:
    return float(np.mean(np.asarray(wrong, dtype=float)))


def check_metric(
    metric: RiemannianMetric,
    points: ndarray,
    tangent_vecs: ndarray | None = None,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a metric is a metric, and that its methods agree.

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
        Largest relative error of an equation or inequality. That of the limit above is its square
        root, and orders may lie 0.1 below 2.

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.testing.check_metric(plane.metric, plane.random_point(3, rng=0)).passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    points, space = metric.check_points(points), metric.space
    if len(points) < 3:
        raise ArgumentError(f"points must hold three points or more; found {len(points)}")
    if tangent_vecs is None:
        tangent_vecs = space.to_tangent(np.roll(points, -1, axis=0) - points, points)
    a = metric.check_points(tangent_vecs, "tangent_vecs")
    if len(a) != len(points):
        raise ArgumentError(f"tangent_vecs must hold {len(points)} vectors; found {len(a)}")
    b = space.to_tangent(np.roll(a, 1, axis=0) - 0.5 * a, points)

    def products(a: ndarray, b: ndarray) -> ndarray:
        """Return the inner products, computed for one point after the other."""
        return np.array([metric.inner_product(*each) for each in zip(a, b, points, strict=True)])

    @cache
    def size() -> float:
        return float(np.abs([products(a, a), products(b, b)]).max())

    def positivity() -> float:
        norms = products(a, a)
        return _excess(-norms, np.zeros_like(norms), size()) if np.any(norms != 0) else np.inf

    def covectors() -> float:
        pairings = [np.sum(metric.covector(v, x) * w) for v, w, x in zip(a, b, points, strict=True)]
        return _difference(pairings, products(a, b), size())

    def least_energy() -> float:
        energy = metric.energy(points)
        bounds = [metric.length(points) ** 2]
        if metric.has_closed_form_dist:
            bounds.append(metric.squared_dist(points[0], points[-1]))
        return _excess(bounds, np.full(len(bounds), energy), float(energy))

    properties: dict[str, Callable[[], float]] = {
        "the inner product is symmetric": lambda: _difference(
            products(a, b), products(b, a), size()
        ),
        "the inner product is linear": lambda: _difference(
            products(2.0 * a - 3.0 * b, b), 2.0 * products(a, b) - 3.0 * products(b, b), size()
        ),
        "the inner product is positive": positivity,
        "inner products in a stack are those of each": lambda: _difference(
            metric.inner_product(a, b, points), products(a, b), size()
        ),
        "covectors represent the inner product": covectors,
    }
    if metric.has_closed_form_dist:
        properties |= _of_distances(metric, points)
        properties[_LIMIT] = lambda: _limit(metric, points, a, products(a, a), size())
    properties |= {
        "energy ≥ squared length ≥ squared distance": least_energy,
        _GRADIENT: lambda: _order(metric, points, a),
    }
    tolerances = {_LIMIT: np.sqrt(tolerance), _GRADIENT: _ORDER_TOLERANCE}
    return _report(metric, properties, tolerance, tolerances)


def _of_distances(metric: RiemannianMetric, points: ndarray) -> dict[str, Callable[[], float]]:
    @cache
    def distances() -> ndarray:
        """Return all distances of the points and of those half way, computed pair by pair."""
        half_way = metric.space.projection(0.5 * (points[1:] + points[:-1]))
        every = [*points, *half_way]
        return np.array([[metric.dist(x, y) for y in every] for x in every])

    def flat_diagonal() -> float:
        slope: Callable[..., ndarray] = grad(metric.squared_dist, 1)
        slopes = [slope(x, x) for x in points]
        return _difference(slopes, np.zeros_like(points), distances().max() ** 2)

    def triangle_inequality() -> float:
        detours = distances()[:, :, None] + distances()[None, :, :]
        return _excess(distances(), detours.min(axis=1), distances().max())

    def stacked() -> float:
        n, squares = len(points), distances() ** 2
        return _difference(
            metric.squared_dist(points[:, None], points[None]), squares[:n, :n], squares.max()
        )

    return {
        "points are at distance 0 from themselves": lambda: _difference(
            np.diag(distances()), np.zeros(len(distances())), distances().max()
        ),
        "squared distances are flat where points meet": flat_diagonal,
        "distances are symmetric": lambda: _difference(distances(), distances().T),
        "no detour is shorter (triangle inequality)": triangle_inequality,
        "distances in a stack are those of each": stacked,
    }


def _limit(
    metric: RiemannianMetric, points: ndarray, a: ndarray, squared_norms: ndarray, size: float
) -> float:
    """Return how near d²(x, x ± εa)/ε² comes to ⟨a, a⟩, at the best ε."""
    projection, errors = metric.space.projection, []
    for step in _LIMIT_STEPS:
        ahead, behind = projection(points + step * a), projection(points - step * a)
        squares = [
            0.5 * (metric.squared_dist(x, y) + metric.squared_dist(x, z)) / step**2
            for x, y, z in zip(points, ahead, behind, strict=True)
        ]
        errors.append(_difference(squares, squared_norms, size))
    return float(np.nanmin(errors)) if np.isfinite(errors).any() else np.inf


def _order(metric: RiemannianMetric, points: ndarray, a: ndarray) -> float:
    """Return how far below 2 the order of the remainder of the energy's gradient lies."""
    energy, gradient = metric.energy_and_gradient(points)
    slope = np.sum(gradient * a)
    if not np.isfinite([energy, slope]).all():
        return np.nan
    moved = [metric.space.projection(points + step * a) for step in _TAYLOR_STEPS]
    energies = np.array([metric.energy(path) for path in moved])
    remainders = np.abs(energies - energy - _TAYLOR_STEPS * slope)
    significant = np.flatnonzero(remainders > _ROUNDING * abs(energy))[-4:]
    if len(significant) < 4:
        return 0.0
    order = np.polyfit(np.log(_TAYLOR_STEPS[significant]), np.log(remainders[significant]), 1)[0]
    return float(np.maximum(2.0 - order, 0.0))


def check_manifold(space: Manifold, rng: Rng = 0, *, tolerance: float = 1e-9) -> PropertyReport:
    """Check the consistency of a manifold on a few random points.

    The dimension of tangent spaces is checked for points of at most 1000 numbers.

    Parameters
    ----------
    space : Manifold
        The manifold.
    rng : int or numpy.random.Generator, optional
        Seed, or the generator that points are drawn from.
    tolerance : float
        Largest relative error.

    Examples
    --------
    >>> rh.testing.check_manifold(rh.VectorSpace((2,))).passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    rng, shape = generator(rng), space.shape

    @cache
    def points() -> ndarray:
        return np.asarray(space.random_point(_N_POINTS, rng=rng))

    @cache
    def noise() -> ndarray:
        return rng.standard_normal((_N_POINTS, *shape))

    @cache
    def vectors() -> ndarray:
        return np.asarray(space.to_tangent(noise(), points()))

    def shapes() -> bool:
        return np.shape(space.random_point(rng=rng)) != shape or (
            points().shape != (_N_POINTS, *shape)
        )

    def members() -> float:
        verdicts = np.asarray(space.belongs(points()))
        return _share(~verdicts) if verdicts.shape == (_N_POINTS,) else np.inf

    def nan() -> float:
        spoilt = points().copy()
        spoilt[0].flat[0] = np.nan
        return _share(np.asarray(space.belongs(spoilt)) != (np.arange(_N_POINTS) > 0))

    def reached() -> float:
        near = points() + _NEAR * np.abs(points()).max() * noise() / np.abs(noise()).max()
        return _share(~np.asarray(space.belongs(space.projection(near))))

    def linearity() -> float:
        other = np.roll(noise(), 1, axis=0)
        together = space.to_tangent(2.0 * noise() - 3.0 * other, points())
        apart = 2.0 * vectors() - 3.0 * np.asarray(space.to_tangent(other, points()))
        return _difference(together, apart)

    def stacked() -> float:
        alone = [space.to_tangent(v, x) for v, x in zip(noise(), points(), strict=True)]
        return _difference(alone, vectors())

    def random_vectors() -> float:
        at_each = np.asarray(space.random_tangent_vec(points(), rng=rng))
        at_one = space.random_tangent_vec(points()[0], 3, rng=rng)
        if at_each.shape != points().shape or np.shape(at_one) != (3, *shape):
            return np.inf
        verdicts = [*space.is_tangent(at_each, points()), *space.is_tangent(at_one, points()[0])]
        return _share(~np.array(verdicts))

    def dimension() -> float:
        every = np.eye(points()[0].size)
        projected = space.to_tangent(every.reshape(-1, *shape), points()[0])
        return abs(float(np.trace(np.reshape(projected, every.shape))) - space.dim)

    properties: dict[str, Callable[[], Any]] = {
        "random points have the shape that they should": shapes,
        "random points are drawn anew": lambda: np.array_equal(
            space.random_point(), space.random_point()
        ),
        "random points of one seed are the same": lambda: (
            not np.array_equal(space.random_point(rng=3), space.random_point(rng=3))
        ),
        "random points belong": members,
        "arrays of another shape do not belong": lambda: _share(
            space.belongs(np.concatenate([points(), points()[..., :1]], axis=-1))
        ),
        "arrays with NaN do not belong": nan,
        "projection leaves points where they are": lambda: _difference(
            space.projection(points()), points()
        ),
        "projections of arrays nearby belong": reached,
        "tangent vectors stay what they are": lambda: _difference(
            space.to_tangent(vectors(), points()), vectors()
        ),
        "to_tangent is linear": linearity,
        "tangent vectors in a stack are those of each": stacked,
        "random tangent vectors are tangent": random_vectors,
    }
    if np.prod(shape) <= _MOST_COORDINATES:
        properties["tangent spaces have dimension dim"] = dimension
    return _report(space, properties, tolerance)


def check_solver(
    solver: Any,
    metric: RiemannianMetric,
    points: ndarray,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a solver fulfils the contract of its kind.

    The kind follows from the argument names of `solve`: geodesics, exponentials, logarithms,
    transport or means; `riemhuman.geometry.strategies` has the contracts.

    Parameters
    ----------
    solver : object
        The solver.
    metric : RiemannianMetric
        A metric that the solver is made for.
    points : array, shape (n, \*shape)
        Two points or more, all different.
    tolerance : float
        Largest relative error; that of first-order terms is 0.01.

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.testing.check_solver(rh.solvers.LinearPath(), plane.metric, [[0, 0], [1, 2]]).passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    points = metric.check_points(points)
    if len(points) < 2:
        raise ArgumentError(f"points must hold two points or more; found {len(points)}")
    kind = _kind_of(solver)
    start, end = points[0], points[1]
    vector = np.asarray(metric.space.to_tangent(end - start, start))
    short = _SHORT * vector
    near = np.asarray(metric.space.projection(start + short))
    weights = np.arange(1.0, len(points) + 1)
    arguments: dict[str, tuple[Any, ...]] = {
        "geodesic": (start, end),
        "exp": (short, start),
        "log": (near, start),
        "transport": (vector, start, None, end),
        "mean": (points, weights),
    }

    def unchanged() -> bool:
        before = deepcopy(arguments[kind])
        solver.solve(metric, *arguments[kind])
        pairs = zip(before, arguments[kind], strict=True)
        return not all(np.array_equal(np.array(a), np.array(b)) for a, b in pairs)

    def found(*given: Any) -> ndarray:
        return np.asarray(getattr(solver.solve(metric, *given), _KINDS[kind][0]))

    def carried(vector: ndarray, end: ndarray = end) -> ndarray:
        return found(vector, start, None, end)

    def path_shape() -> bool:
        shape = found(start, end).shape
        return not (len(shape) == points.ndim and shape[0] > 1 and shape[1:] == start.shape)

    def path_energy() -> float:
        result = solver.solve(metric, start, end)
        return _difference(float(result.energy), float(metric.energy(np.asarray(result.path))))

    def still_path() -> float:
        path = found(start, start)
        return _difference(path, np.repeat(start[None], len(path), axis=0))

    def variance(point: ndarray, weights: ndarray | None = None) -> float:
        squares = [float(metric.energy(np.stack([x, np.asarray(point)]))) for x in points]
        return float(np.average(squares, weights=weights))

    def mean_is_best() -> float:
        best = min(variance(point) for point in points)
        return _excess(variance(found(points)), best, best)

    def mean_variance() -> float:
        result = solver.solve(metric, points, weights)
        return _difference(float(result.variance), variance(result.point, weights))

    def follows_weights() -> float:
        point = found(points, np.eye(len(points))[-1])
        return float(metric.energy(np.stack([point, points[-1]]))) / variance(points[-1])

    length, zero = np.abs(vector).max(), np.zeros_like(start)
    properties: dict[str, dict[str, Callable[[], Any]]] = {
        "geodesic": {
            "paths have the points' shape behind their nodes": path_shape,
            "paths run from start to end": lambda: _difference(
                found(start, end)[[0, -1]], np.stack([start, end]), np.abs(points).max()
            ),
            "paths stay on the manifold": lambda: _share(
                ~np.asarray(metric.space.belongs(found(start, end)))
            ),
            "the energy is that of the path": path_energy,
            "the path from a point to itself stays there": still_path,
            "the same path is found twice": lambda: (
                not np.array_equal(found(start, end), found(start, end))
            ),
        },
        "exp": {
            _EXP_BEGINS: lambda: _difference((found(short, start) - start) / _SHORT, vector),
            "without velocity they stay": lambda: _difference(found(zero, start), start),
        },
        "log": {
            _LOG_BEGINS: lambda: _difference(found(near, start) / _SHORT, vector),
            "the logarithm of the base point is 0": lambda: _difference(
                found(start, start), zero, length
            ),
        },
        "transport": {
            "vectors that go nowhere stay what they are": lambda: _difference(
                carried(vector, start), vector
            ),
            "transport is linear": lambda: _difference(
                carried(2.0 * vector), 2.0 * carried(vector), length
            ),
            "the vector 0 stays 0": lambda: _difference(carried(zero), zero, length),
        },
        "mean": {
            "the mean is no worse than any of the points": mean_is_best,
            "the variance is that of the mean": mean_variance,
            "with all weight on one point it is the mean": follows_weights,
        },
    }
    tolerances = {_EXP_BEGINS: _FIRST_ORDER, _LOG_BEGINS: _FIRST_ORDER}
    checked = {"what is given is not changed": unchanged, **properties[kind]}
    return _report(solver, checked, tolerance, tolerances)


def _kind_of(solver: Any) -> str:
    solve = getattr(solver, "solve", None)
    if solve is None:
        raise ArgumentError(f"solver must have a method solve; {type(solver).__name__} has none")
    names = list(inspect.signature(solve).parameters)[1:]
    for kind, (_, arguments) in _KINDS.items():
        if tuple(names[: len(arguments)]) == arguments:
            return kind
    listed = "; ".join(f"{kind}: {', '.join(names)}" for kind, (_, names) in _KINDS.items())
    raise ArgumentError(
        f"solve of {type(solver).__name__} takes {', '.join(names)} after the metric, unlike any "
        f"known kind of solver ({listed})"
    )


def check_dataset(dataset: Any) -> PropertyReport:
    """Check that a data set has what tables, reports and estimators read.

    That is its length; ``points``, surfaces of shape (n, V, 3), an array or an object whose slices
    and items are arrays; ``template``; and labels ``subject`` and ``pose``, of shape (n,), none of
    them missing, or None; it may also have ``model``, the body model that the surfaces come from.
    `check_dataset` reads a few surfaces. `riemhuman.datasets.Bodies` is such a data set.

    Parameters
    ----------
    dataset : object
        The data set.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.testing.check_dataset(bodies).passed
    True
    """

    def some_surfaces() -> list[ndarray]:
        last = min(len(dataset), len(dataset.points)) - 1
        numbers = np.unique(np.linspace(0, last, _N_READ).astype(int))
        return [np.asarray(dataset.points[int(number)]) for number in numbers]

    def slices() -> bool:
        expected = [np.asarray(dataset.points[k]) for k in range(min(2, len(dataset)))]
        return not np.array_equal(np.asarray(dataset.points[:2]), np.array(expected))

    def labels() -> float:
        kinds = [labels for labels in (dataset.subject, dataset.pose) if labels is not None]
        wrong = [
            len(labels) != len(dataset)
            or getattr(labels, "ndim", 1) != 1
            or any(map(is_missing_label, labels))
            for labels in kinds
        ]
        return _share(wrong or [False])

    needed = ("points", "template", "subject", "pose")
    n_lacking = sum(not hasattr(dataset, name) for name in needed)
    properties: dict[str, Callable[[], Any]] = {
        "it has points, template, subject and pose": lambda: n_lacking
    }
    if n_lacking == 0:
        shape = np.shape(dataset.template.vertices)
        properties |= {
            "it is as long as its points": lambda: (
                len(dataset) != len(dataset.points) or len(dataset) == 0
            ),
            "surfaces have the template's vertices": lambda: _share(
                [surface.shape != shape for surface in some_surfaces()]
            ),
            "vertices are finite": lambda: _share(
                [not np.isfinite(surface).all() for surface in some_surfaces()]
            ),
            "slices of points are those points": slices,
            "there is a label for every surface": labels,
        }
    return _report(dataset, properties, 0.0)
