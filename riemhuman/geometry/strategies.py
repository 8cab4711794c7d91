"""Contracts of strategies that metrics and estimators take; no class need be subclassed.

`riemhuman.testing.check_solver` tries a strategy out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol, TypedDict, TypeGuard

import numpy as np
from autograd.extend import defvjp_argnums, primitive

from riemhuman.arrays import Array, Points, PointsOrBatches, TangentVectors
from riemhuman.checks import check_methods
from riemhuman.errors import NotDefinedError, OutsideManifoldError

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric

__all__ = [
    "ExpSolver",
    "GeodesicSolver",
    "LogSolver",
    "MeanSolver",
    "PathEnergy",
    "Solvers",
    "TransportSolver",
    "check_strategy",
    "solve_geodesic",
]


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


class SolvedMean(Protocol):
    """The result of a `MeanSolver`."""

    @property
    def point(self) -> Points: ...

    @property
    def variance(self) -> float: ...


class GeodesicSolver(Protocol):
    """A strategy for paths of least energy between two points."""

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> SolvedPath:
        """Return an object with `path`, shape (n_nodes, *shape), with both ends, and `energy`.

        It may have `energies`, `n_iterations`, `n_evaluations`, `converged` and `message`, as
        `riemhuman.solvers.PathResult` has.
        """


class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start for unit time.

    Autograd differentiates through it if it has a method ``derivatives(metric, path, tangent_vec,
    covectors)`` and its results a `path`, see `riemhuman.solvers.DiscreteExponential`.
    """

    def solve(
        self, metric: RiemannianMetric, tangent_vec: TangentVectors, base_point: Points
    ) -> SolvedExp:
        """Return an object with `end`, the point reached.

        It may have `complete`, False where the geodesic was not followed to its end, and `message`.
        """


class SolvedCurve(SolvedExp, Protocol):
    """The result of a `DifferentiableExpSolver`."""

    @property
    def path(self) -> Points: ...


class DifferentiableExpSolver(Protocol):
    """An `ExpSolver` that autograd differentiates through."""

    def solve(
        self, metric: RiemannianMetric, tangent_vec: TangentVectors, base_point: Points
    ) -> SolvedCurve:
        """Return an object with `end`, the point reached, and `path`, all points on the way."""

    def derivatives(
        self,
        metric: RiemannianMetric,
        path: Points,
        tangent_vec: TangentVectors,
        covectors: TangentVectors,
    ) -> Sequence[TangentVectors]:
        """Return the derivatives of a pairing with the path by velocity and by base point."""


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
        given. The mean minimises Σ w_i d^exponent: 2, or 1 for
        medians.
        """


class PathEnergy(Protocol):
    """An energy of discrete paths, with its gradient."""

    def value(self, metric: RiemannianMetric, path: Points) -> float:
        """Return the energy of a path, shape (n_nodes, ...)."""

    def value_and_gradient(self, metric: RiemannianMetric, path: Points) -> tuple[float, Array]:
        """Return the energy, which may be infinite, and its gradient by all points."""


class Solvers(TypedDict, total=False):
    """Keyword arguments of all metrics: strategies for what has no closed form."""

    geodesic_solver: GeodesicSolver | None
    exp_solver: ExpSolver | None
    log_solver: LogSolver | None
    transport_solver: TransportSolver | None


_STRATEGY = "an object with a method solve, such as LinearPath() for paths or BasisMean() for means"


def check_strategy(solver: object, name: str) -> None:
    """Raise an ArgumentTypeError for what has no method `solve`, and for classes."""
    check_methods(solver, name, _STRATEGY, "solve")


@primitive
def solve_geodesic(
    tangent_vec: TangentVectors, base_point: Points, metric: RiemannianMetric, solver: ExpSolver
) -> Array:
    """Return the path of the geodesic that a solver finds if it has derivatives, else its end."""
    if _is_differentiable(solver):
        curve = solver.solve(metric, tangent_vec, base_point)
        _check_complete(curve, solver)
        return np.asarray(curve.path)
    result = solver.solve(metric, tangent_vec, base_point)
    _check_complete(result, solver)
    return np.asarray(result.end)[None]


def _is_differentiable(solver: ExpSolver) -> TypeGuard[DifferentiableExpSolver]:
    return hasattr(solver, "derivatives")


def _check_complete(result: SolvedExp, solver: ExpSolver) -> None:
    if not getattr(result, "complete", True):
        where = getattr(result, "message", "a point on the way")
        raise OutsideManifoldError(
            f"tangent_vec must be the velocity of a geodesic that {type(solver).__name__} "
            f"can follow for unit time; it stopped at {where}"
        )


def _derivatives(
    argnums: Sequence[int],
    path: Points,
    args: tuple[TangentVectors, Points, RiemannianMetric, ExpSolver],
    kwargs: dict[str, object],
) -> Callable[[Array], tuple[Array, ...]]:
    tangent_vec, _, metric, solver = args

    def pull_back(covectors: TangentVectors) -> tuple[Array, ...]:
        if not _is_differentiable(solver):
            raise NotDefinedError(
                f"{type(solver).__name__} has no derivatives of exp; "
                "riemhuman.solvers.DiscreteExponential() has"
            )
        both = solver.derivatives(metric, path, tangent_vec, covectors)
        return tuple(both[number] for number in argnums)

    return pull_back


defvjp_argnums(solve_geodesic, _derivatives)
