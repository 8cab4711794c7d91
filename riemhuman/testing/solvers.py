"""Checks of a solver: it fulfils the contract of its kind."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.testing.reports import (
    Properties,
    PropertyReport,
    difference,
    excess,
    report_of,
    share,
)

__all__ = ["check_solver"]

# Length of short vectors relative to the distance of the points, and error of first order in it.
_SHORT = 1e-3
_FIRST_ORDER = 1e-2
_EXP_BEGINS = "geodesics start with their initial velocity"
_LOG_BEGINS = "logarithms of nearby points lead to these points"


def check_solver(
    solver: Any,  # any object with a method `solve`: its kind follows from its arguments
    metric: RiemannianMetric,
    points: ndarray,
    *,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a solver satisfies the contract of its kind.

    The kind follows from the argument names of `solve`: geodesics, exponentials, logarithms,
    transport or means; `riemhuman.geometry.strategies` has the contracts.

    Parameters
    ----------
    solver : object
        The solver.
    metric : RiemannianMetric
        A metric for which the solver is made.
    points : array, shape (n, \*shape)
        Two points or more, all different.
    tolerance : float
        Largest relative error; for first-order terms it is 0.01.

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.testing.check_solver(rh.solvers.LinearPath(), plane.metric, [[0, 0], [1, 2]]).passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    check_metric(metric)
    points = metric.check_points(points)
    if len(points) < 2:
        raise ArgumentError(f"points must hold two points or more; found {len(points)}")
    trial = _trial_class(solver)(solver, metric, points)
    properties = {"arguments are not changed": trial.unchanged, **trial.properties()}
    tolerances = {_EXP_BEGINS: _FIRST_ORDER, _LOG_BEGINS: _FIRST_ORDER}
    return report_of(solver, properties, tolerance, tolerances)


@dataclass(frozen=True)
class _Trial:
    """A trial of a solver on some points; a subclass for each kind of solver."""

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
        """The tangent vector from the first point towards the second."""
        return np.asarray(self.metric.space.to_tangent(self.end - self.start, self.start))

    @property
    def zero(self) -> ndarray:
        return np.zeros_like(self.start)

    @property
    def length(self) -> float:
        return float(np.abs(self.vector).max())

    def arguments(self) -> tuple[ndarray | None, ...]:
        """Return what `solve` is given after the metric."""
        raise NotImplementedError

    def properties(self) -> Properties:
        """Return the properties of this kind of solver."""
        raise NotImplementedError

    def unchanged(self) -> float:
        arguments = self.arguments()
        copies = deepcopy(arguments)
        self.solver.solve(self.metric, *arguments)
        pairs = zip(copies, arguments, strict=True)
        return not all(np.array_equal(np.array(copy), np.array(array)) for copy, array in pairs)


class _GeodesicTrial(_Trial):
    def arguments(self) -> tuple[ndarray | None, ...]:
        return self.start, self.end

    def properties(self) -> Properties:
        return {
            "paths have shape (n_nodes, *shape of a point)": self.shape,
            "paths run from start to end": self.ends,
            "paths stay on the manifold": self.members,
            "the energy is that of the path": self.energy,
            "the path from a point to itself is constant": self.still,
            "a second search finds the same path": self.repeated,
        }

    def path(self, start: ndarray, end: ndarray) -> ndarray:
        return np.asarray(self.solver.solve(self.metric, start, end).path)

    def shape(self) -> float:
        path = self.path(self.start, self.end)
        return path.ndim == 0 or len(path) < 2 or path.shape[1:] != self.start.shape

    def ends(self) -> float:
        path = self.path(self.start, self.end)
        return difference(
            path[[0, -1]], np.stack([self.start, self.end]), np.abs(self.points).max()
        )

    def members(self) -> float:
        return share(~np.asarray(self.metric.space.belongs(self.path(self.start, self.end))))

    def energy(self) -> float:
        result = self.solver.solve(self.metric, self.start, self.end)
        return difference(float(result.energy), float(self.metric.energy(np.asarray(result.path))))

    def still(self) -> float:
        path = self.path(self.start, self.start)
        return difference(path, np.repeat(self.start[None], len(path), axis=0))

    def repeated(self) -> float:
        first, second = self.path(self.start, self.end), self.path(self.start, self.end)
        return not np.array_equal(first, second)


class _ExpTrial(_Trial):
    def arguments(self) -> tuple[ndarray | None, ...]:
        return _SHORT * self.vector, self.start

    def properties(self) -> Properties:
        return {_EXP_BEGINS: self.begins, "with velocity 0 they stay in place": self.still}

    def exp(self, velocity: ndarray) -> ndarray:
        return np.asarray(self.solver.solve(self.metric, velocity, self.start).end)

    def begins(self) -> float:
        moved = self.exp(_SHORT * self.vector) - self.start
        return difference(moved / _SHORT, self.vector)

    def still(self) -> float:
        return difference(self.exp(self.zero), self.start)


class _LogTrial(_Trial):
    @property
    def near(self) -> ndarray:
        return np.asarray(self.metric.space.projection(self.start + _SHORT * self.vector))

    def arguments(self) -> tuple[ndarray | None, ...]:
        return self.near, self.start

    def properties(self) -> Properties:
        return {_LOG_BEGINS: self.begins, "the logarithm of the base point is 0": self.still}

    def log(self, point: ndarray) -> ndarray:
        return np.asarray(self.solver.solve(self.metric, point, self.start).tangent_vec)

    def begins(self) -> float:
        return difference(self.log(self.near) / _SHORT, self.vector)

    def still(self) -> float:
        return difference(self.log(self.start), self.zero, self.length)


class _TransportTrial(_Trial):
    def arguments(self) -> tuple[ndarray | None, ...]:
        return self.vector, self.start, None, self.end

    def properties(self) -> Properties:
        return {
            "transport from a point to itself does not change vectors": self.still,
            "transport is linear": self.linearity,
            "the vector 0 stays 0": self.zero_stays,
        }

    def carried(self, vector: ndarray, end: ndarray) -> ndarray:
        result = self.solver.solve(self.metric, vector, self.start, None, end)
        return np.asarray(result.tangent_vec)

    def still(self) -> float:
        return difference(self.carried(self.vector, self.start), self.vector)

    def linearity(self) -> float:
        doubled = self.carried(2.0 * self.vector, self.end)
        return difference(doubled, 2.0 * self.carried(self.vector, self.end), self.length)

    def zero_stays(self) -> float:
        return difference(self.carried(self.zero, self.end), self.zero, self.length)


class _MeanTrial(_Trial):
    @property
    def weights(self) -> ndarray:
        return np.arange(1.0, len(self.points) + 1)

    def arguments(self) -> tuple[ndarray | None, ...]:
        return self.points, self.weights

    def properties(self) -> Properties:
        return {
            "the mean is no worse than any of the points": self.best,
            "the variance is that of the mean": self.variance,
            "if one point has all the weight, it is the mean": self.follows_weights,
        }

    def variance_at(self, point: ndarray, weights: ndarray | None = None) -> float:
        paths = [np.stack([x, np.asarray(point)]) for x in self.points]
        squares = [float(self.metric.energy(path)) for path in paths]
        return float(np.average(squares, weights=weights))

    def best(self) -> float:
        least = min(self.variance_at(point) for point in self.points)
        mean = self.solver.solve(self.metric, self.points).point
        return excess(self.variance_at(mean), least, least)

    def variance(self) -> float:
        result = self.solver.solve(self.metric, self.points, self.weights)
        return difference(float(result.variance), self.variance_at(result.point, self.weights))

    def follows_weights(self) -> float:
        last = self.points[-1]
        mean = self.solver.solve(self.metric, self.points, np.eye(len(self.points))[-1]).point
        energy = float(self.metric.energy(np.stack([np.asarray(mean), last])))
        return energy / self.variance_at(last)


# The arguments of `solve` after the metric, of each kind of solver.
_KINDS: dict[str, tuple[tuple[str, ...], Callable[[Any, RiemannianMetric, ndarray], _Trial]]] = {
    "geodesic": (("start", "end"), _GeodesicTrial),
    "transport": (("tangent_vec", "base_point", "direction", "end_point"), _TransportTrial),
    "exp": (("tangent_vec", "base_point"), _ExpTrial),
    "log": (("point", "base_point"), _LogTrial),
    "mean": (("points", "weights"), _MeanTrial),
}


def _trial_class(solver: Any) -> Callable[[Any, RiemannianMetric, ndarray], _Trial]:
    """Return the trial of a solver, whose kind follows from the arguments of `solve`."""
    solve = getattr(solver, "solve", None)
    if solve is None:
        raise ArgumentError(f"solver must have a method solve; {type(solver).__name__} has none")
    # Strategies have no base class: names of arguments are what contracts differ in.
    names = list(inspect.signature(solve).parameters)[1:]
    for arguments, trial in _KINDS.values():
        if tuple(names[: len(arguments)]) == arguments:
            return trial
    listed = "; ".join(f"{kind}: {', '.join(names)}" for kind, (names, _) in _KINDS.items())
    raise ArgumentError(
        f"solve of {type(solver).__name__} takes {', '.join(names)} after the metric, unlike any "
        f"known kind of solver ({listed})"
    )
