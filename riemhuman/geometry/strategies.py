"""Contracts of strategies that metrics and estimators take; a class need not inherit from its own.

`riemhuman.testing.check_solver` tries a strategy out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypedDict

from riemhuman.arrays import Array, Points, PointsOrBatches, TangentVectors

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric


class SolvedPath(Protocol):
    """The result of a `GeodesicSolver`."""

    @property
    def path(self) -> Points: ...

    @property
    def energy(self) -> float: ...


class SolvedExp(Protocol):
    """The result of an `ExpSolver`."""

    @property
    def end(self) -> Points: ...


class SolvedVector(Protocol):
    """The result of a `LogSolver` or a `TransportSolver`."""

    @property
    def tangent_vec(self) -> TangentVectors: ...


class GeodesicSolver(Protocol):
    """A strategy for paths of least energy between two points."""

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> SolvedPath:
        """Return an object with `path`, shape (n_nodes, *shape), with both ends, and `energy`.

        It may have `energies`, `n_iterations`, `n_evaluations`, `converged` and `message`, as
        `riemhuman.solvers.PathResult` has.
        """


class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start for unit time."""

    def solve(
        self, metric: RiemannianMetric, tangent_vec: TangentVectors, base_point: Points
    ) -> SolvedExp:
        """Return an object with `end`, the point reached.

        It may have `complete`, False where the geodesic was not followed to its end, and `message`.
        """


class LogSolver(Protocol):
    """A strategy for the initial velocity of a geodesic between two points."""

    def solve(self, metric: RiemannianMetric, point: Points, base_point: Points) -> SolvedVector:
        """Return an object with `tangent_vec`, the initial velocity at `base_point`."""


class TransportSolver(Protocol):
    """A strategy that transports tangent vectors along geodesics."""

    def solve(
        self,
        metric: RiemannianMetric,
        tangent_vec: TangentVectors,
        base_point: Points,
        direction: TangentVectors | None = None,
        end_point: Points | None = None,
    ) -> SolvedVector:
        """Return an object with `tangent_vec`, the vector at the end of the geodesic.

        Either `direction`, the initial velocity, or `end_point` is given.
        """


class Solvers(TypedDict, total=False):
    """Keyword arguments of all metrics: strategies for what has no closed form."""

    geodesic_solver: GeodesicSolver | None
    exp_solver: ExpSolver | None
    log_solver: LogSolver | None
    transport_solver: TransportSolver | None


class DefaultSolvers(Protocol):
    """Strategies of a metric that was given none, see `riemhuman.solvers.defaults`."""

    def geodesic_solver(self, metric: RiemannianMetric) -> GeodesicSolver: ...

    def exp_solver(self, metric: RiemannianMetric) -> ExpSolver: ...

    def log_solver(self, metric: RiemannianMetric) -> LogSolver: ...

    def transport_solver(self, metric: RiemannianMetric) -> TransportSolver: ...


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
