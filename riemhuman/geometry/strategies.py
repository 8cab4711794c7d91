"""Contracts of strategies that metrics and estimators take; a class need not inherit from its own.

`riemhuman.testing.check_solver` tries a strategy out.
"""

from __future__ import annotations

from typing import Protocol

from riemhuman.arrays import Array, Points, PointsOrBatches
from riemhuman.geometry.metric import (
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    RiemannianMetric,
    SolvedPath,
    Solvers,
    TransportSolver,
)

__all__ = [
    "ExpSolver",
    "GeodesicSolver",
    "LogSolver",
    "MeanSolver",
    "PathEnergy",
    "SolvedMean",
    "SolvedPath",
    "Solvers",
    "TransportSolver",
]


class SolvedMean(Protocol):
    """The result of a `MeanSolver`."""

    @property
    def point(self) -> Points: ...

    @property
    def variance(self) -> float: ...


class MeanSolver(Protocol):
    """A strategy for a point of least weighted mean squared distance."""

    def solve(
        self,
        metric: RiemannianMetric,
        points: PointsOrBatches,
        weights: Array | None = None,
        initial_point: Points | None = None,
        exponent: int = 2,
    ) -> SolvedMean:
        """Return an object with `point`, the mean, and `variance`, Σ w_i d²/Σ w_i at the mean.

        It may have what else `riemhuman.solvers.MeanResult` has. All weights are 1 if none are
        given. The mean minimises Σ w_i d^exponent; an exponent of 1 gives medians.
        """


class PathEnergy(Protocol):
    """An energy of discrete paths, with its gradient."""

    def value(self, metric: RiemannianMetric, path: Points) -> float:
        """Return the energy of a path, shape (n_nodes, ...)."""

    def value_and_gradient(self, metric: RiemannianMetric, path: Points) -> tuple[float, Array]:
        """Return the energy, which may be infinite, and its gradient by all points."""
