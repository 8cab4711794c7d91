"""Contracts of strategies that metrics and estimators take; no class need be subclassed.

`riemhuman.testing.check_solver` tries a strategy out.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Protocol

from numpy import ndarray

__all__ = [
    "ExpSolver",
    "GeodesicSolver",
    "LogSolver",
    "MeanSolver",
    "PathEnergy",
    "TransportSolver",
    "default_strategy",
    "register_defaults",
]


_defaults: dict[str, Callable[[Any], Any]] = {}


def register_defaults(**factories: Callable[[Any], Any]) -> None:
    """Set the strategies, made for a metric, that metrics without their own use."""
    _defaults.update(factories)


def default_strategy(name: str, metric: Any) -> Any:
    """Return the default strategy of a metric; `riemhuman.solvers` registers them."""
    if name not in _defaults:
        import_module("riemhuman.solvers")
    return _defaults[name](metric)


class GeodesicSolver(Protocol):
    """A strategy for paths of least energy between two points."""

    def solve(self, metric: Any, start: ndarray, end: ndarray) -> Any:
        """Return an object with `path`, shape (n_nodes, *shape), both ends included, and `energy`.

        It may have all else that `riemhuman.solvers.PathResult` has.
        """


class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start for unit time.

    Autograd differentiates through it if it has a method ``derivatives(metric, path, tangent_vec,
    covectors)`` and its results a `path`, see `riemhuman.solvers.DiscreteExponential`.
    """

    def solve(self, metric: Any, tangent_vec: ndarray, base_point: ndarray) -> Any:
        """Return an object with `end`, the point reached.

        It may also have `complete`, False where the geodesic could not be followed to its end, and
        `message`, the reason.
        """


class LogSolver(Protocol):
    """A strategy for the initial velocity of a geodesic between two points."""

    def solve(self, metric: Any, point: ndarray, base_point: ndarray) -> Any:
        """Return an object with `tangent_vec`, the initial velocity at `base_point`."""


class TransportSolver(Protocol):
    """A strategy that transports tangent vectors along geodesics."""

    def solve(
        self,
        metric: Any,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> Any:
        """Return an object with `tangent_vec`, the vector at the end of the geodesic.

        Exactly one of its initial velocity `direction`, followed for unit time, and its `end_point`
        is given.
        """


class MeanSolver(Protocol):
    """A strategy for a point of least weighted mean squared distance."""

    def solve(
        self,
        metric: Any,
        points: ndarray,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
        exponent: int = 2,
    ) -> Any:
        """Return an object with `point`, the mean, and `variance`.

        It may have all else that `riemhuman.solvers.MeanResult` has. `riemhuman.FrechetMean` passes
        `metric`, `points` and `weights` alone, `riemhuman.GeometricMedian` also ``exponent=1``.
        """


class PathEnergy(Protocol):
    """An energy of discrete paths, with its gradient."""

    def value(self, metric: Any, path: ndarray) -> float:
        """Return the energy of a path, shape (n_nodes, *shape)."""

    def value_and_gradient(self, metric: Any, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy of a path, and its gradient with respect to all points.

        The energy may be infinite where the path leaves the manifold.
        """
