"""Results of solvers, and how they end."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from html import escape
from typing import Any, Self, TypeVar, get_type_hints

import numpy as np
from numpy import ndarray

from riemhuman.errors import ConvergenceWarning, FileFormatError, warn
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.kernels.threads import is_abandoned
from riemhuman.provided import notebook_pictures
from riemhuman.representation import Record, field_texts

INTERRUPTED_MESSAGE = "interrupted from the keyboard"

_CLASS = "result_class"
# Smaller arrays are points of other spaces.
_FEWEST_VERTICES = 100


class Status(StrEnum):
    """How a solver ended: its stopping test was met, or why it stopped before.

    ``STALLED``: no step improved the result. ``OUTSIDE_MANIFOLD``: it met the boundary of the
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


# Kinds of arrays that the single values of a result may be in a file; all others are numbers.
_KINDS: dict[type, str] = {int: "iu", bool: "b", float: "fiu", str: "U", Status: "U"}


@dataclass(frozen=True, kw_only=True, repr=False)
class Result(Record):
    """How a solver ended; subclasses add its solution.

    Attributes
    ----------
    n_iterations, n_evaluations : int
        Iterations, and evaluations of the objective and its gradient.
    status, message : Status, str
        How it ended, for code and for people.

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
    def outcome(self) -> dict[str, Any]:
        """The fields of `Result`, by name, for another result that ended in the same way."""
        return {field.name: getattr(self, field.name) for field in fields(Result)}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to an .npz file.

        Parameters
        ----------
        path : path_like
            The file, with its ending; an existing file is replaced, whole or not at all.
        """
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: np.asarray(value) for name, value in values.items() if value is not None}
        save_arrays(path, {_CLASS: np.array(type(self).__name__), **arrays})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a result of this class that `save` wrote.

        Parameters
        ----------
        path : path_like
        """
        required = [field.name for field in fields(cls) if field.default is dataclasses.MISSING]
        arrays = load_arrays(path, [_CLASS, *required], [field.name for field in fields(cls)])
        name = str(arrays.pop(_CLASS))
        if name != cls.__name__:
            raise FileFormatError(f"{path} must hold a {cls.__name__}; found a {name[:60]}")
        values: dict[str, Any] = {}
        types = get_type_hints(cls)
        for field in fields(cls):
            if (array := arrays.get(field.name)) is not None:
                single = types[field.name] in _KINDS
                kinds = _KINDS.get(types[field.name], "fiub")
                if array.dtype.kind not in kinds or (single and array.ndim):
                    raise FileFormatError(
                        f"{path}: {field.name} cannot be {array.dtype} of shape {array.shape}"
                    )
                values[field.name] = array.item() if array.ndim == 0 else array
        if "status" in values:
            try:
                values["status"] = Status(values["status"])
            except ValueError as error:
                raise FileFormatError(f"{path}: {error}") from error
        return cls(**values)

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>"
            for name, text in field_texts(self).items()
        )
        table = f"<table><caption>{type(self).__name__}</caption>{rows}</table>"
        surfaces = self._surfaces()
        if surfaces is None:
            return table
        return notebook_pictures().surfaces_html(surfaces, None, repr(self)) + table

    def _surfaces(self) -> ndarray | None:
        """Return the first array of the result as surfaces to draw, if it has their shape."""
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, ndarray) and value.ndim in (2, 3):
                is_surface = value.shape[-1] == 3 and value.shape[-2] >= _FEWEST_VERTICES
                return value.reshape(-1, *value.shape[-2:]) if is_surface else None
        return None


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
        Squared distance of the ends where the metric has a closed form, else 0: no path has less
        energy, discrete or continuous.
    gap : float
        Estimate, in per cent of the energy, of how much further iterations would reduce it, on
        bodies at least a fifth of that; nan where there is none, as for paths that do not minimise
        energy.
    n_iterations, n_evaluations, status, message
        See `Result`.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.LinearPath(n_nodes=3).solve(metric, [0.0], [2.0]).path.tolist()
    [[0.0], [1.0], [2.0]]
    """

    path: ndarray
    energy: float
    energies: ndarray
    lower_bound: float = 0.0
    gap: float = np.nan


@dataclass(frozen=True, repr=False)
class MeanResult(Result):
    r"""A point that minimises a weighted sum of squared distances, and how it was found.

    Attributes
    ----------
    point : array, shape (\*shape,)
    variance : float
        Weighted mean of the squared distances to it, Σ w_i d²/Σ w_i.
    variances : array, shape (n_iterations + 1,)
        What is minimised, at the start and after each iteration: the same, unless `BasisMean` adds
        a metric of lengths to one of normals alone.
    n_iterations, n_evaluations, status, message
        See `Result`; a mean over a basis is one within the span that the message names.

    Examples
    --------
    >>> rh.FrechetMean(rh.VectorSpace((1,))).fit([[0.0], [2.0]]).result_.point
    array([1.])
    """

    point: ndarray
    variance: float
    variances: ndarray


ResultType = TypeVar("ResultType", bound=Result)


class Interrupted(KeyboardInterrupt):
    """A solver was stopped from the keyboard.

    Parameters
    ----------
    result : Result
        The best that it had found so far.

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
        count = f"{result.n_iterations} iteration{'' if result.n_iterations == 1 else 's'}"
        warn(
            f"{type(solver).__name__} stopped without converging after {count}: {result.message}",
            ConvergenceWarning,
        )
    return result


def complete(found: Any, cls: type[ResultType]) -> ResultType:
    """Return the result of anybody's solver, a solution and its value, with defaults."""
    if isinstance(found, cls):
        return found
    point, value, values = (f.name for f in fields(cls) if f.default is dataclasses.MISSING)
    last = float(getattr(found, value))
    arrays: dict[str, Any] = {
        point: np.asarray(getattr(found, point), dtype=float),
        value: last,
        values: np.asarray(getattr(found, values, [last]), dtype=float),
    }
    converged = bool(getattr(found, "converged", True))
    return cls(
        **arrays,
        n_iterations=int(getattr(found, "n_iterations", 0)),
        n_evaluations=int(getattr(found, "n_evaluations", 0)),
        status=Status.CONVERGED if converged else Status.STALLED,
        message=str(getattr(found, "message", "")),
    )
