"""Checks of a solver: it fulfils the contract of its kind."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import a_solver, checked, one_of, positive
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import (
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    MeanSolver,
    TransportSolver,
)
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


Strategy = GeodesicSolver | ExpSolver | LogSolver | TransportSolver | MeanSolver


@checked(solver=a_solver, tolerance=positive)
def check_solver(
    solver: Strategy,
    metric: RiemannianMetric,
    points: Array,
    *,
    contract: type[object] | None = None,
    tolerance: float = 1e-6,
) -> PropertyReport:
    r"""Check on a few points that a solver satisfies its contract.

    `riemhuman.geometry.strategies` has the contracts: of geodesics, exponentials, logarithms,
    transport and means.

    Parameters
    ----------
    solver : object
        The solver.
    metric : RiemannianMetric
        A metric for which the solver is made.
    points : array, shape (n, \*shape)
        Two points or more, all different.
    contract : type, optional
        `GeodesicSolver`, `ExpSolver`, `LogSolver`, `TransportSolver` or `MeanSolver`. By default
        the one that the class of the solver inherits from, and `GeodesicSolver` if it inherits from
        none.
    tolerance : float
        Largest relative error; for first-order terms it is 0.01.

    Examples
    --------
    >>> plane = rh.VectorSpace((2,))
    >>> rh.testing.check_solver(rh.solvers.LinearPath(), plane.metric, [[0, 0], [1, 2]]).passed
    True

    >>> class Addition:
    ...     def solve(self, metric, tangent_vec, base_point):
    ...         return types.SimpleNamespace(end=base_point + tangent_vec)
    >>> import types
    >>> from riemhuman.geometry.strategies import ExpSolver
    >>> points = [[0, 0], [1, 2]]
    >>> rh.testing.check_solver(Addition(), plane.metric, points, contract=ExpSolver).passed
    True
    """
    check_metric(metric)
    points = metric.check_points(points)
    if len(points) < 2:
        raise ArgumentError(f"points must hold two points or more; found {len(points)}")
    if contract is None:
        contract = _contract_of(solver)
    contract = one_of(contract, "contract", tuple(_TRIALS))
    trial = _TRIALS[contract](solver, metric, points)
    properties = {"arguments are not changed": trial.unchanged, **trial.properties()}
    tolerances = {_EXP_BEGINS: _FIRST_ORDER, _LOG_BEGINS: _FIRST_ORDER}
    return report_of(solver, properties, tolerance, tolerances)


@dataclass(frozen=True)
class _Trial(ABC):  # type: ignore[explicit-any]  # each subclass tries solvers of one contract
    """A trial of a solver on some points; a subclass for each contract."""

    solver: Any  # type: ignore[explicit-any]
    metric: RiemannianMetric
    points: Array

    @property
    def start(self) -> Array:
        start: Array = self.points[0]
        return start

    @property
    def end(self) -> Array:
        end: Array = self.points[1]
        return end

    @property
    def vector(self) -> Array:
        """The tangent vector from the first point towards the second."""
        return np.asarray(self.metric.space.to_tangent(self.end - self.start, self.start))

    @property
    def zero(self) -> Array:
        return np.zeros_like(self.start)

    @property
    def length(self) -> float:
        return float(np.abs(self.vector).max())

    @abstractmethod
    def arguments(self) -> tuple[Array | None, ...]:
        """Return what `solve` is given after the metric."""

    @abstractmethod
    def properties(self) -> Properties:
        """Return the properties that the contract promises."""

    def unchanged(self) -> float:
        arguments = self.arguments()
        copies = deepcopy(arguments)
        self.solver.solve(self.metric, *arguments)
        pairs = zip(copies, arguments, strict=True)
        return not all(np.array_equal(np.array(copy), np.array(array)) for copy, array in pairs)


class _GeodesicTrial(_Trial):
    def arguments(self) -> tuple[Array | None, ...]:
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

    def path(self, start: Array, end: Array) -> Array:
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
    def arguments(self) -> tuple[Array | None, ...]:
        return _SHORT * self.vector, self.start

    def properties(self) -> Properties:
        return {_EXP_BEGINS: self.begins, "with velocity 0 they stay in place": self.still}

    def exp(self, velocity: Array) -> Array:
        return np.asarray(self.solver.solve(self.metric, velocity, self.start).end)

    def begins(self) -> float:
        moved = self.exp(_SHORT * self.vector) - self.start
        return difference(moved / _SHORT, self.vector)

    def still(self) -> float:
        return difference(self.exp(self.zero), self.start)


class _LogTrial(_Trial):
    @property
    def near(self) -> Array:
        return np.asarray(self.metric.space.projection(self.start + _SHORT * self.vector))

    def arguments(self) -> tuple[Array | None, ...]:
        return self.near, self.start

    def properties(self) -> Properties:
        return {_LOG_BEGINS: self.begins, "the logarithm of the base point is 0": self.still}

    def log(self, point: Array) -> Array:
        return np.asarray(self.solver.solve(self.metric, point, self.start).tangent_vec)

    def begins(self) -> float:
        return difference(self.log(self.near) / _SHORT, self.vector)

    def still(self) -> float:
        return difference(self.log(self.start), self.zero, self.length)


class _TransportTrial(_Trial):
    def arguments(self) -> tuple[Array | None, ...]:
        return self.vector, self.start, None, self.end

    def properties(self) -> Properties:
        return {
            "transport from a point to itself does not change vectors": self.still,
            "transport is linear": self.linearity,
            "the vector 0 stays 0": self.zero_stays,
        }

    def carried(self, vector: Array, end: Array) -> Array:
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
    def weights(self) -> Array:
        return np.arange(1.0, len(self.points) + 1)

    def arguments(self) -> tuple[Array | None, ...]:
        return self.points, self.weights

    def properties(self) -> Properties:
        return {
            "the mean is no worse than any of the points": self.best,
            "the variance is that of the mean": self.variance,
            "if one point has all the weight, it is the mean": self.follows_weights,
        }

    def variance_at(self, point: Array, weights: Array | None = None) -> float:
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


_TrialClass = Callable[[Strategy, RiemannianMetric, Array], _Trial]

_TRIALS: dict[type[object], _TrialClass] = {
    GeodesicSolver: _GeodesicTrial,
    ExpSolver: _ExpTrial,
    LogSolver: _LogTrial,
    TransportSolver: _TransportTrial,
    MeanSolver: _MeanTrial,
}


def _contract_of(solver: Strategy) -> type[object]:
    """Return the contract that the class of a solver inherits from; by default of geodesics."""
    # `isinstance` would look at the names of methods, which are the same in all contracts.
    for contract in _TRIALS:
        if contract in type(solver).__mro__:
            return contract
    return GeodesicSolver
