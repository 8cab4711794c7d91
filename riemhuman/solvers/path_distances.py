"""Lengths of paths as distances, with the closed form as a lower bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.solvers.many_paths import ManyPaths
from riemhuman.solvers.results import PathResult, Result


@dataclass(frozen=True, repr=False)
class PathDistances(Result):
    """Distances within a set of points by the lengths of paths between them.

    The closed-form distance of a pull-back metric is that of the ends in a larger space, a lower
    bound of the geodesic distance; the length of a path within the surfaces is an upper bound.

    Attributes
    ----------
    lengths : array, shape (n, n)
        Lengths of the paths; symmetric, with zero diagonal.
    bounds : array, shape (n, n)
        Distances in closed form, 0 where the metric has none: no path is shorter.
    gaps : array, shape (n, n)
        `PathResult.gap` of the paths, per cent of their energies.
    n_iterations, n_evaluations : int
        Iterations and evaluations of all paths together.
    converged : bool
        Whether all solvers' stopping tests were met.
    message : str
        How many paths converged.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> solver = rh.solvers.PoissonPath(n_nodes=5)
    >>> found = rh.solvers.path_distances(solver, space.metric, bodies.points[:3])
    >>> found.lengths.shape, bool((found.excess >= 0).all())
    ((3, 3), True)
    """

    lengths: ndarray
    bounds: ndarray
    gaps: ndarray

    @property
    def excess(self) -> ndarray:
        """By how much lengths exceed the bounds, per cent, for the pairs i < j in order."""
        pairs = np.triu_indices(len(self.lengths), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return 100.0 * (self.lengths[pairs] / self.bounds[pairs] - 1.0)


def path_distances(
    solver: GeodesicSolver,
    metric: RiemannianMetric,
    points: Sequence[Any] | ndarray,
    *,
    n_jobs: int | None = None,
    progress: bool = False,
) -> PathDistances:
    r"""Return the lengths of paths between all points of a set, each pair in one direction.

    Parameters
    ----------
    solver : GeodesicSolver
        Solver for the paths.
    metric : RiemannianMetric
        The metric.
    points : array or sequence, shape (n, \*shape)
        Points.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    PathDistances

    Raises
    ------
    ArgumentError
        If a point is wrong.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> solver = rh.solvers.LinearPath(n_nodes=3)
    >>> rh.solvers.path_distances(solver, space.metric, bodies.points[:2]).lengths.shape
    (2, 2)
    """
    pairs = PairsOfPoints(points)
    found = ManyPaths.solve_many(solver, metric, pairs, n_jobs=n_jobs, progress=progress)
    return distances_of(len(points), np.array([row_of(metric, result) for result in found]))


class PairsOfPoints(Sequence[Any]):
    """The pairs i < j of a set of points, row by row.

    Parameters
    ----------
    points : array or sequence
        Points.
    """

    def __init__(self, points: Sequence[Any] | ndarray) -> None:
        self._points = points
        self._rows, self._columns = np.triu_indices(len(points), 1)

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[k] for k in range(*number.indices(len(self)))]
        return self._points[int(self._rows[number])], self._points[int(self._columns[number])]


def row_of(metric: RiemannianMetric, result: PathResult) -> ndarray:
    """Return the row of a path in the table.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    result : PathResult
        The path.

    Returns
    -------
    array, shape (6,)
        Length, distance in closed form, gap, iterations, evaluations, and whether it converged.
    """
    length, bound = float(metric.length(result.path)), float(np.sqrt(result.lower_bound))
    counts = result.n_iterations, result.n_evaluations, result.converged
    return np.array([length, bound, result.gap, *counts], dtype=float)


def distances_of(n_points: int, rows: ndarray) -> PathDistances:
    """Return the table of the rows of all pairs.

    Parameters
    ----------
    n_points : int
        Number of points n.
    rows : array, shape (n (n − 1)/2, 6)
        Row of each pair, see `row_of`.

    Returns
    -------
    PathDistances
    """
    rows = rows.reshape(-1, 6)
    tables = np.zeros((3, n_points, n_points))
    i, j = np.triu_indices(n_points, 1)
    tables[:, i, j] = tables[:, j, i] = rows[:, :3].T
    n_converged = int(rows[:, 5].sum())
    return PathDistances(
        *tables,
        n_iterations=int(rows[:, 3].sum()),
        n_evaluations=int(rows[:, 4].sum()),
        converged=n_converged == len(rows),
        message=f"{n_converged} of {len(rows)} paths converged",
    )
