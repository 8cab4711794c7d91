"""Property checks for solvers, on a few points."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.solvers.property_checks import PropertyReport, difference, excess, property_report

# Short vectors, as a share of the distance of the points, and how far first-order results are off.
_SHORT = 1e-3
_FIRST_ORDER = 1e-2

# How solvers of each kind call what `solve` takes behind the metric.
_ARGUMENTS = {
    "geodesic": ("start", "end"),
    "transport": ("tangent_vec", "base_point", "direction", "end_point"),
    "exp": ("tangent_vec", "base_point"),
    "log": ("point", "base_point"),
    "mean": ("points", "weights"),
}


def check_solver(
    solver: Any,
    metric: RiemannianMetric,
    points: ndarray,
    kind: str | None = None,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a solver fulfils the contract of its kind.

    See `riemhuman.protocols` for the contracts. Paths must run between the points, with the energy
    that they have; exponential and logarithm must start in the given direction; a mean must be no
    worse than any of the points and follow the weights; transport must be linear, and the identity
    along a constant path. No solver may change its arguments, and each must return the same result
    twice.

    In a test of your own, ``report = check_solver(solver, metric, points)`` is followed by
    ``assert report.passed, report``.

    Parameters
    ----------
    solver : object
        The solver.
    metric : RiemannianMetric
        A metric that the solver is made for.
    points : array, shape (n, \*shape)
        Two points or more, all different.
    kind : {"geodesic", "exp", "log", "transport", "mean"}, optional
        Kind of the solver; by default inferred from the argument names of `solve`.
    tolerance : float
        Largest relative error; that of first-order terms is 0.01.

    Returns
    -------
    PropertyReport

    Raises
    ------
    ArgumentError
        If the solver has no method `solve` of a known kind, or there are fewer than two points.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> plane = rh.VectorSpace((2,))
    >>> points = np.random.default_rng(0).normal(size=(3, 2))
    >>> report = rh.solvers.check_solver(rh.solvers.LinearPath(), plane.metric, points)
    >>> report.passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    points = metric.check_points(points)
    if len(points) < 2:
        raise ArgumentError(f"points must hold two points or more; found {len(points)}")
    kind = _kind_of(solver) if kind is None else one_of(kind, "kind", tuple(_ARGUMENTS))
    sample = _Sample(solver, metric, points)
    properties = {"what is given is not changed": _unchanged(kind), **_PROPERTIES[kind]}
    tolerances = {
        name: _FIRST_ORDER if error in (_exp_begins, _log_begins) else tolerance
        for name, error in properties.items()
    }
    measured = {name: partial(error, sample) for name, error in properties.items()}
    return property_report(solver, measured, tolerances)


def _kind_of(solver: Any) -> str:
    solve = getattr(solver, "solve", None)
    if solve is None:
        raise ArgumentError(f"solver must have a method solve; {type(solver).__name__} has none")
    names = list(inspect.signature(solve).parameters)[1:]
    for kind, arguments in _ARGUMENTS.items():
        if tuple(names[: len(arguments)]) == arguments:
            return kind
    listed = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in _ARGUMENTS.items())
    raise ArgumentError(
        f"kind must be given: solve of {type(solver).__name__} takes {', '.join(names)} after the "
        f"metric, unlike any known kind ({listed})"
    )


@dataclass(frozen=True)
class _Sample:
    """A solver with a metric and points to try it on."""

    solver: Any
    metric: RiemannianMetric
    points: ndarray

    @property
    def start(self) -> ndarray:
        return self.points[0]

    @property
    def end(self) -> ndarray:
        return self.points[1]

    @property
    def vector(self) -> ndarray:
        """A tangent vector at the start, as long as the straight line to the end."""
        return np.asarray(self.metric.space.to_tangent(self.end - self.start, self.start))

    def arguments(self, kind: str) -> tuple[ndarray | None, ...]:
        """Return arguments for `solve`."""
        return {
            "geodesic": (self.start, self.end),
            "exp": (_SHORT * self.vector, self.start),
            "log": (self.near, self.start),
            "transport": (self.vector, self.start, None, self.end),
            "mean": (self.points, np.arange(1.0, len(self.points) + 1)),
        }[kind]

    @property
    def near(self) -> ndarray:
        """A point near the start, in the direction of the vector."""
        return np.asarray(self.metric.space.projection(self.start + _SHORT * self.vector))

    def solve(self, *arguments: Any) -> Any:
        return self.solver.solve(self.metric, *arguments)


def _unchanged(kind: str) -> Callable[[_Sample], float]:
    def error(s: _Sample) -> float:
        arguments = s.arguments(kind)
        before = deepcopy(arguments)
        s.solve(*arguments)
        pairs = zip(before, arguments, strict=True)
        return float(not all(np.array_equal(np.array(a), np.array(b)) for a, b in pairs))

    return error


def _path_shape(s: _Sample) -> float:
    path = np.asarray(s.solve(s.start, s.end).path)
    good = path.ndim == s.points.ndim and len(path) > 1 and path.shape[1:] == s.metric.space.shape
    return float(not good)


def _ends(s: _Sample) -> float:
    path = np.asarray(s.solve(s.start, s.end).path)
    return difference(path[[0, -1]], np.stack([s.start, s.end]), np.abs(s.points).max())


def _path_belongs(s: _Sample) -> float:
    path = np.asarray(s.solve(s.start, s.end).path)
    return float(np.mean(~np.asarray(s.metric.space.belongs(path))))


def _energy(s: _Sample) -> float:
    found = s.solve(s.start, s.end)
    energy = float(s.metric.energy(np.asarray(found.path)))
    return difference(float(found.energy), energy, energy)


def _nowhere(s: _Sample) -> float:
    path = np.asarray(s.solve(s.start, s.start).path)
    return difference(path, np.repeat(s.start[None], len(path), axis=0), np.abs(s.start).max())


def _same_path(s: _Sample) -> float:
    one, other = (np.asarray(s.solve(s.start, s.end).path) for _ in range(2))
    return float(not np.array_equal(one, other))


def _exp_begins(s: _Sample) -> float:
    end = np.asarray(s.solve(_SHORT * s.vector, s.start).end)
    return difference((end - s.start) / _SHORT, s.vector, np.abs(s.vector).max())


def _exp_of_nothing(s: _Sample) -> float:
    end = s.solve(np.zeros_like(s.start), s.start).end
    return difference(end, s.start, np.abs(s.start).max())


def _log_begins(s: _Sample) -> float:
    vector = np.asarray(s.solve(s.near, s.start).tangent_vec)
    return difference(vector / _SHORT, s.vector, np.abs(s.vector).max())


def _log_of_nothing(s: _Sample) -> float:
    vector = s.solve(s.start, s.start).tangent_vec
    return difference(vector, np.zeros_like(s.start), np.abs(s.vector).max())


def _carried_nowhere(s: _Sample) -> float:
    carried = s.solve(s.vector, s.start, None, s.start)
    return difference(carried.tangent_vec, s.vector, np.abs(s.vector).max())


def _transport_is_linear(s: _Sample) -> float:
    once, twice = (
        np.asarray(s.solve(size * s.vector, s.start, None, s.end).tangent_vec)
        for size in (1.0, 2.0)
    )
    return difference(twice, 2.0 * once, np.abs(twice).max())


def _transport_of_nothing(s: _Sample) -> float:
    carried = s.solve(np.zeros_like(s.vector), s.start, None, s.end).tangent_vec
    return difference(carried, np.zeros_like(s.vector), np.abs(s.vector).max())


def _mean_no_worse(s: _Sample) -> float:
    dispersion = Dispersion(s.metric, s.points)
    at_points = min(dispersion.value(point) for point in s.points)
    return excess(dispersion.value(np.asarray(s.solve(s.points).point)), at_points, at_points)


def _variance(s: _Sample) -> float:
    weights = np.arange(1.0, len(s.points) + 1)
    found = s.solve(s.points, weights)
    variance = Dispersion(s.metric, s.points, weights).value(np.asarray(found.point))
    return difference(float(found.variance), variance, variance)


def _follows_weights(s: _Sample) -> float:
    weights = np.eye(len(s.points))[-1]
    point = np.asarray(s.solve(s.points, weights).point)
    spread = Dispersion(s.metric, s.points).value(s.points[-1])
    return float(s.metric.squared_dist(point, s.points[-1])) / spread


_PROPERTIES: dict[str, dict[str, Callable[[_Sample], float]]] = {
    "geodesic": {
        "paths have the points' shape behind their nodes": _path_shape,
        "paths run from start to end": _ends,
        "paths stay on the manifold": _path_belongs,
        "the energy is that of the path": _energy,
        "the path from a point to itself stays there": _nowhere,
        "the same path is found twice": _same_path,
    },
    "exp": {
        "geodesics begin with their initial velocity": _exp_begins,
        "without velocity they stay": _exp_of_nothing,
    },
    "log": {
        "logarithms of points nearby lead there": _log_begins,
        "the logarithm of the base point is 0": _log_of_nothing,
    },
    "transport": {
        "vectors that go nowhere stay what they are": _carried_nowhere,
        "transport is linear": _transport_is_linear,
        "the vector 0 stays 0": _transport_of_nothing,
    },
    "mean": {
        "the mean is no worse than any of the points": _mean_no_worse,
        "the variance is that of the mean": _variance,
        "with all weight on one point it is the mean": _follows_weights,
    },
}
