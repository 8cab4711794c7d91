"""Results of solvers, and how they end."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from html import escape
from typing import Self, TypedDict, TypeVar

import numpy as np

from riemhuman.arrays import Array, Points
from riemhuman.errors import (
    ConvergenceWarning,
    FileFormatError,
    counted,
    warn,
)
from riemhuman.geometry.strategies import SolvedMean, SolvedPath
from riemhuman.io.arrays import fields_of, load_arrays, save_arrays, stored_fields
from riemhuman.io.files import format_errors
from riemhuman.kernels.threads import is_abandoned
from riemhuman.provided import notebook_pictures
from riemhuman.representation import Record, field_texts

INTERRUPTED_MESSAGE = "interrupted from the keyboard"

# Name of the field of a file that names the class of the result.
_CLASS = "result_class"

# Points with fewer rows of three numbers are no surfaces.
_FEWEST_VERTICES = 100


class Status(StrEnum):
    """How a solver ended: its stopping test was met, or the reason why it stopped earlier.

    ``STALLED``: no step improved the result. ``OUTSIDE_MANIFOLD``: it reached the boundary of the
    manifold. ``INTERRUPTED``: it was stopped from the keyboard.

    Examples
    --------
    >>> rh.solvers.Status.CONVERGED.value
    'converged'
    """

    CONVERGED = "converged"
    MAX_ITER = "max_iter"
    STALLED = "stalled"
    OUTSIDE_MANIFOLD = "outside_manifold"
    INTERRUPTED = "interrupted"


class Outcome(TypedDict):
    """How a solver ended: the fields of `Result`."""

    n_iterations: int
    n_evaluations: int
    status: Status
    message: str


@dataclass(frozen=True, kw_only=True, repr=False)
class Result(Record):
    """How a solver ended; subclasses add its solution.

    `save` writes numbers, text and arrays: all fields, also those that your own subclass adds. It
    must override `points_to_draw` if notebooks are to draw its surfaces.

    Attributes
    ----------
    n_iterations, n_evaluations : int
        Iterations, and evaluations of the objective and its gradient.
    status, message : Status, str
        How the solver ended, for code (`status`) and for people (`message`).

    Examples
    --------
    >>> rh.solvers.Result(status=rh.solvers.Status.MAX_ITER).converged
    False
    """

    n_iterations: int = 0
    n_evaluations: int = 0
    status: Status = Status.CONVERGED
    message: str = ""

    @property
    def converged(self) -> bool:
        """Whether the solver's stopping test was met."""
        return self.status is Status.CONVERGED

    @property
    def outcome(self) -> Outcome:
        """The fields of `Result`, by name, for another result that ended in the same way."""
        return {
            "n_iterations": self.n_iterations,
            "n_evaluations": self.n_evaluations,
            "status": self.status,
            "message": self.message,
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write all fields to an .npz file.

        Parameters
        ----------
        path : path_like
            The file, with its ending; an existing file is replaced, whole or not at all.
        """
        save_arrays(path, {_CLASS: type(self).__name__, **fields_of(self)})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a result of this class that `save` wrote.

        Parameters
        ----------
        path : path_like
        """
        arrays = load_arrays(path, [_CLASS])
        stored_class = str(arrays.pop(_CLASS))
        if stored_class != cls.__name__:
            raise FileFormatError(f"{path} must hold a {cls.__name__}; found a {stored_class[:60]}")
        with format_errors(os.fspath(path), f"a {cls.__name__}"):
            values = stored_fields(cls, arrays)
            return cls(**{**values, "status": Status(values["status"])})

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>"
            for name, text in field_texts(self).items()
        )
        table = f"<table><caption>{type(self).__name__}</caption>{rows}</table>"
        points = self.points_to_draw()
        if points is None or not _are_surfaces(points):
            return table
        surfaces = points.reshape(-1, *points.shape[-2:])
        return notebook_pictures().surfaces_html(surfaces, None, repr(self)) + table

    def points_to_draw(self) -> Points | None:
        """Return the points that notebooks draw if they are surfaces; by default there are none."""
        return None


def _are_surfaces(points: Points) -> bool:
    """Return whether arrays are vertices of surfaces, rather than points of another space."""
    if points.ndim not in (2, 3):
        return False
    return bool(points.shape[-1] == 3 and points.shape[-2] >= _FEWEST_VERTICES)


@dataclass(frozen=True, repr=False)
class PathResult(Result):
    r"""A path between two points, and how it was found.

    Attributes
    ----------
    path : array, shape (n_nodes, \*shape)
        Points of the path at equally spaced times, both ends included.
    energy : float
    energies : array, shape (n_iterations + 1,)
        Energy at the start and after each iteration.
    lower_bound : float
        Squared distance of the ends if the metric has a closed form, otherwise 0. No path has less
        energy, discrete or continuous.
    gap : float
        Estimate, in per cent of the energy, of how much further iterations would reduce it; on
        bodies, the estimate was at least a fifth of the true value. NaN if there is no estimate, as
        for paths that do not minimise energy.
    n_iterations, n_evaluations, status, message
        See `Result`.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.LinearPath(n_nodes=3).solve(metric, [0.0], [2.0]).path.tolist()
    [[0.0], [1.0], [2.0]]
    """

    path: Points
    energy: float
    energies: Array
    lower_bound: float = 0.0
    gap: float = np.nan

    def points_to_draw(self) -> Points:
        return self.path


@dataclass(frozen=True, repr=False)
class MeanResult(Result):
    r"""A point that minimises a weighted sum of squared distances, and how it was found.

    Attributes
    ----------
    point : array, shape (\*shape,)
    variance : float
        Weighted mean of the squared distances to it, Σ w_i d²/Σ w_i.
    variances : array, shape (n_iterations + 1,)
        The value that is minimised, at the start and after each iteration. It is the variance,
        unless `BasisMean` adds a metric of lengths to one of normals alone.
    n_iterations, n_evaluations, status, message
        See `Result`; a mean over a basis lies within the span that the message names.

    Examples
    --------
    >>> rh.FrechetMean(rh.VectorSpace((1,))).fit([[0.0], [2.0]]).result_.point
    array([1.])
    """

    point: Points
    variance: float
    variances: Array

    def points_to_draw(self) -> Points:
        return self.point


ResultType = TypeVar("ResultType", bound=Result)


class Interrupted(KeyboardInterrupt):
    """A solver was stopped from the keyboard.

    Parameters
    ----------
    result : Result
        The best result so far.

    Examples
    --------
    >>> issubclass(rh.solvers.Interrupted, KeyboardInterrupt)
    True
    """

    def __init__(self, result: Result) -> None:
        super().__init__(f"{result.message}; the best so far is the `result` of this exception")
        self.result = result


@contextmanager
def interruptible(best: Callable[[Result | None], Result]) -> Iterator[None]:
    """Raise `Interrupted` where the block is stopped from the keyboard, with the best so far.

    `best` is given the result of a solver that the block called, if that was what was stopped.
    """
    try:
        yield
    except KeyboardInterrupt as stopped:
        if is_abandoned():
            raise
        inner = stopped.result if isinstance(stopped, Interrupted) else None
        result = replace(best(inner), status=Status.INTERRUPTED, message=INTERRUPTED_MESSAGE)
        raise Interrupted(result) from None


def finish(solver: object, result: ResultType) -> ResultType:
    """Return a solver's result; warn if it has not converged, raise `Interrupted` if stopped."""
    if result.status is Status.INTERRUPTED:
        raise Interrupted(result)
    if not result.converged:
        count = counted(result.n_iterations, "iteration", "iterations")
        warn(
            f"{type(solver).__name__} stopped without converging after {count}: {result.message}",
            ConvergenceWarning,
        )
    return result


def complete_path(solved: SolvedPath) -> PathResult:
    """Return the result of a user-defined geodesic solver, a path and its energy, with defaults."""
    if isinstance(solved, PathResult):
        return solved
    energy = float(solved.energy)
    return PathResult(
        path=np.asarray(solved.path, dtype=float),
        energy=energy,
        energies=np.asarray(getattr(solved, "energies", [energy]), dtype=float),
        **_completed_outcome(solved),
    )


def complete_mean(solved: SolvedMean) -> MeanResult:
    """Return the result of a user-defined mean solver, a point and its variance, with defaults."""
    if isinstance(solved, MeanResult):
        return solved
    variance = float(solved.variance)
    return MeanResult(
        point=np.asarray(solved.point, dtype=float),
        variance=variance,
        variances=np.asarray(getattr(solved, "variances", [variance]), dtype=float),
        **_completed_outcome(solved),
    )


def _completed_outcome(solved: SolvedPath | SolvedMean) -> Outcome:
    return {
        "n_iterations": int(getattr(solved, "n_iterations", 0)),
        "n_evaluations": int(getattr(solved, "n_evaluations", 0)),
        "status": Status.CONVERGED if getattr(solved, "converged", True) else Status.STALLED,
        "message": str(getattr(solved, "message", "")),
    }
