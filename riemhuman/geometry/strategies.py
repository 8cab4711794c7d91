"""Contracts of strategies that metrics and estimators take; no class need be subclassed.

`riemhuman.testing.check_solver` tries a strategy out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypedDict

import numpy as np
from autograd.extend import defvjp_argnums, primitive
from numpy import ndarray

from riemhuman.checks import check_methods
from riemhuman.errors import NotDefinedError, OutsideManifoldError

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


class GeodesicSolver(Protocol):
    """A strategy for paths of least energy between two points."""

    def solve(self, metric: Any, start: ndarray, end: ndarray) -> Any:
        """Return an object with `path`, shape (n_nodes, *shape), with both ends, and `energy`."""


class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start for unit time.

    Autograd differentiates through it if it has a method ``derivatives(metric, path, tangent_vec,
    covectors)`` and its results a `path`, see `riemhuman.solvers.DiscreteExponential`.
    """

    def solve(self, metric: Any, tangent_vec: ndarray, base_point: ndarray) -> Any:
        """Return an object with `end`, the point reached.

        It may have `complete`, False where the geodesic was not followed to its end, and `message`.
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

        Either `direction`, the initial velocity, or `end_point` is given.
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
        """Return an object with `point`, the mean, and `variance`; medians have exponent 1."""


class PathEnergy(Protocol):
    """An energy of discrete paths, with its gradient."""

    def value(self, metric: Any, path: ndarray) -> float:
        """Return the energy of a path, shape (n_nodes, ...)."""

    def value_and_gradient(self, metric: Any, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy, which may be infinite, and its gradient by all points."""


class Solvers(TypedDict, total=False):
    """Keyword arguments of all metrics: strategies for what has no closed form."""

    geodesic_solver: GeodesicSolver | None
    exp_solver: ExpSolver | None
    log_solver: LogSolver | None
    transport_solver: TransportSolver | None


_STRATEGY = "a strategy with a method solve, as LinearPath() for paths, BasisMean() for means"


def check_strategy(solver: Any, name: str) -> None:
    """Raise an ArgumentTypeError for what has no method `solve`, and for classes."""
    check_methods(solver, name, _STRATEGY, "solve")


@primitive
def solve_geodesic(
    tangent_vec: ndarray, base_point: ndarray, metric: Any, solver: ExpSolver
) -> ndarray:
    """Return the path of the geodesic that a solver finds if it has derivatives, else its end."""
    result: Any = solver.solve(metric, tangent_vec, base_point)
    if not getattr(result, "complete", True):
        where = getattr(result, "message", "a point on the way")
        raise OutsideManifoldError(
            f"tangent_vec must be the velocity of a geodesic that {type(solver).__name__} "
            f"can follow for unit time; it stopped at {where}"
        )
    if hasattr(solver, "derivatives"):
        return np.asarray(result.path)
    return np.asarray(result.end)[None]


def _derivatives(
    argnums: Sequence[int], path: ndarray, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Callable[[ndarray], tuple[ndarray, ...]]:
    tangent_vec, _, metric, solver = args

    def pull_back(covectors: ndarray) -> tuple[ndarray, ...]:
        if not hasattr(solver, "derivatives"):
            raise NotDefinedError(
                f"{type(solver).__name__} has no derivatives of exp; "
                "riemhuman.solvers.DiscreteExponential() has"
            )
        both = solver.derivatives(metric, path, tangent_vec, covectors)
        return tuple(both[number] for number in argnums)

    return pull_back


defvjp_argnums(solve_geodesic, _derivatives)
