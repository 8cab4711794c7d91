"""Many geodesics at once, with any solver."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

from numpy import ndarray

from riemhuman.checks import values_of
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError, ConvergenceWarning, RiemhumanError, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.kernels.threads import mapped, single_threaded_libraries, thread_count
from riemhuman.progress import ProgressBar
from riemhuman.protocols import uninterrupted
from riemhuman.solvers.results import PathResult, whole_path_result


class ManyPaths(InheritsDocstrings, ABC):
    """A base class that lets a geodesic solver solve many pairs of points."""

    @abstractmethod
    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        r"""Return a path between two points.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        start, end : array, shape (\*shape,)
            End points.

        Returns
        -------
        PathResult
        """

    def solve_many(
        self: GeodesicSolver,
        metric: RiemannianMetric,
        pairs: Sequence[Any] | ndarray,
        *,
        n_jobs: int | None = None,
        progress: bool = False,
    ) -> list[PathResult]:
        r"""Find a path between the points of every pair.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        pairs : array or sequence, shape (n_pairs, 2, \*shape)
            Pairs of end points: an array, or anything with a length whose items are two points.
        n_jobs : int, optional
            Number of threads, -1 for one per core; by default one. Paths do not depend on it.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        list of PathResult
            In the order of the pairs; see `rh.path_job` for more than memory holds.

        Raises
        ------
        ArgumentError
            If an item is not two points, or `solve` refuses them; the error names the item.

        Warns
        -----
        ConvergenceWarning
            If some paths have not converged; one warning counts them.
        """
        n_threads = thread_count(n_jobs)

        def solve(number: int) -> PathResult:
            return _solve_pair(self, metric, pairs, number)

        bar = ProgressBar(total=len(pairs), desc="Geodesics", disable=not progress, unit=" paths")
        found: list[PathResult] = []
        with warnings.catch_warnings(), single_threaded_libraries(), bar:
            warnings.simplefilter("ignore", ConvergenceWarning)
            for result in mapped(solve, range(len(pairs)), n_threads):
                found.append(result)
                bar.update()
        n_unfinished = sum(not result.converged for result in found)
        if n_unfinished:
            warn(
                f"{type(self).__name__} stopped without converging on {n_unfinished} of "
                f"{len(pairs)} pairs; `converged` of their results is False",
                ConvergenceWarning,
            )
        return found


def _solve_pair(
    solver: GeodesicSolver, metric: RiemannianMetric, pairs: Any, number: int
) -> PathResult:
    pair = pairs[number]
    if not hasattr(pair, "__len__") or len(pair) != 2:
        raise ArgumentError(f"pairs[{number}] must be two points; found {type(pair).__name__}")
    start, end = (
        values_of(point, f"{name} of pairs[{number}]")
        for point, name in zip(pair, ("start", "end"), strict=True)
    )
    try:
        return whole_path_result(uninterrupted(solver.solve(metric, start, end)))
    except RiemhumanError as error:
        raise type(error)(f"pairs[{number}]: {error}") from error
