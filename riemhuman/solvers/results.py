"""What solvers return."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Protocol

from numpy import ndarray

from riemhuman.errors import ConvergenceWarning


@dataclass(frozen=True)
class PathResult:
    r"""A path between two points, and how it was found.

    Attributes
    ----------
    path : array, shape (n_nodes, \*shape)
        Points of the path at equally spaced times, both ends included.
    energy : float
        Energy of the path.
    energies : array, shape (n_iterations + 1,)
        Energy at the start and after each iteration.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of energy and gradient.
    converged : bool
        Whether the solver's stopping test was met.
    message : str
        Why it stopped.
    """

    path: ndarray
    energy: float
    energies: ndarray
    n_iterations: int
    n_evaluations: int
    converged: bool
    message: str


@dataclass(frozen=True)
class MeanResult:
    r"""A point that minimises a weighted sum of squared distances, and how it was found.

    Attributes
    ----------
    point : array, shape (\*shape,)
        The mean.
    variance : float
        Weighted mean of the squared distances to it, Σ w_i d²/Σ w_i.
    variances : array, shape (n_iterations + 1,)
        The same at the start and after each iteration.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of variance and gradient.
    converged : bool
        Whether the solver's stopping test was met.
    message : str
        Why it stopped.
    """

    point: ndarray
    variance: float
    variances: ndarray
    n_iterations: int
    n_evaluations: int
    converged: bool
    message: str


class Outcome(Protocol):
    """What every result says of how its solver ended."""

    @property
    def converged(self) -> bool:
        """Whether the stopping test was met."""

    @property
    def n_iterations(self) -> int:
        """Number of iterations."""

    @property
    def message(self) -> str:
        """Why it stopped."""


def warn_unless_converged(solver: object, result: Outcome) -> None:
    """Warn once if a solver has stopped without converging.

    Parameters
    ----------
    solver : object
        The solver; the warning names its class.
    result : Outcome
        What it found.

    Warns
    -----
    ConvergenceWarning
        If `result.converged` is false.
    """
    if not result.converged:
        warnings.warn(
            f"{type(solver).__name__} stopped without converging after {result.n_iterations} "
            f"iterations: {result.message}",
            ConvergenceWarning,
            stacklevel=3,
        )
