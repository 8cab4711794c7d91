"""Path energies, what all solvers for paths share, the straight path, and closed-form geodesics."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import autograd.numpy as anp
import numpy as np
from autograd import value_and_grad
from tqdm import tqdm

from riemhuman.arrays import Array, ArrayLike, PairsLike, Points
from riemhuman.checks import (
    a_solver,
    checked,
    flag,
    length_of,
    path_array,
    real_array,
    values_of,
    whole,
)
from riemhuman.errors import (
    ArgumentError,
    ConvergenceWarning,
    NotDefinedError,
    RiemhumanError,
    warn,
)
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import GeodesicSolver, PathEnergy
from riemhuman.kernels.threads import mapped, single_threaded_libraries, thread_count
from riemhuman.solvers.results import PathResult, complete_path

# Relative rounding errors of a point's entries.
_ROUNDING = 1e-13

# The ends of a path may differ from given points by this share of their largest entry.
_SAME_POINT = 1e-9


@dataclass(frozen=True)
class SegmentEnergy(PathEnergy):
    """n Σ d²(x_i, x_{i+1}) over n segments, in closed form if the metric has one.

    It is never below d²(x_0, x_n), needs no exponential map, and does not decrease when a path
    is refined in time.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.SegmentEnergy().value(metric, [[0.0, 0.0], [1.0, 1.0], [2.0, 0.0]])
    8.0
    """

    def value(self, metric: RiemannianMetric, path: Points) -> float:
        return float(metric.energy(path))

    def value_and_gradient(self, metric: RiemannianMetric, path: Points) -> tuple[float, Array]:
        return metric.energy_and_gradient(path)


@dataclass(frozen=True)
class FiniteDifferenceEnergy(PathEnergy):
    """n Σ ‖x_{i+1} − x_i‖² over n segments, by the inner product at their midpoints.

    The paper's form of the energy (equation 7), which is accurate to second order in the time step.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.FiniteDifferenceEnergy().value(metric, [[0.0], [1.0], [2.0]])
    4.0
    """

    def value(self, metric: RiemannianMetric, path: Points) -> float:
        return float(self._energy(metric, metric.check_points(path, "path")))

    def value_and_gradient(self, metric: RiemannianMetric, path: Points) -> tuple[float, Array]:
        energy = value_and_grad(lambda points: self._energy(metric, points))
        value, gradient = energy(metric.check_points(path, "path"))
        return float(value), gradient

    def _energy(self, metric: RiemannianMetric, path: Points) -> Array:
        start, end = path[:-1], path[1:]
        middle = metric.space.projection(0.5 * (start + end))
        return (len(path) - 1) * anp.sum(metric.squared_norm(end - start, middle))


class PathSolver(GeodesicSolver, ABC):
    """A base of geodesic solvers, for one pair of points or many."""

    @abstractmethod
    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> PathResult:
        r"""Return a path between two points.

        Parameters
        ----------
        metric : RiemannianMetric
        start, end : array, shape (\*shape,)
        """

    def solve_many(
        self,
        metric: RiemannianMetric,
        pairs: PairsLike,
        *,
        n_jobs: int | None = None,
        progress: bool = False,
    ) -> list[PathResult]:
        r"""Find a path between the points of every pair, see `rh.path_job` for very many.

        Parameters
        ----------
        metric : RiemannianMetric
        pairs : array or sequence, shape (n_pairs, 2, \*shape)
            Pairs of end points: an array, or anything with a length whose items are two points.
        n_jobs : int, optional
            Number of threads, -1 for one per core; by default one. Paths do not depend on it.
        progress : bool
        """
        return solve_pairs(self, metric, pairs, n_jobs=n_jobs, progress=progress)


@checked(solver=a_solver, progress=flag)
def solve_pairs(
    solver: GeodesicSolver,
    metric: RiemannianMetric,
    pairs: PairsLike,
    *,
    n_jobs: int | None = None,
    progress: bool = False,
    name_of: Callable[[int], str] = "pairs[{}]".format,
) -> list[PathResult]:
    """Return paths of any solver between many pairs of points, see `PathSolver.solve_many`.

    `name_of` names the pair of a number in messages.
    """
    check_metric(metric)
    length_of(pairs, "pairs")
    bar = tqdm(total=len(pairs), desc="Geodesics", disable=not progress, unit=" paths")
    results: list[PathResult] = []
    with warnings.catch_warnings(), single_threaded_libraries(), bar:
        warnings.simplefilter("ignore", ConvergenceWarning)
        for result in mapped(
            lambda number: _solve_pair(solver, metric, pairs[number], name_of(number)),
            range(len(pairs)),
            thread_count(n_jobs),
        ):
            results.append(result)
            bar.update()
    n_unfinished = sum(not result.converged for result in results)
    if n_unfinished:
        warn(
            f"{type(solver).__name__} stopped without converging on {n_unfinished} of "
            f"{len(pairs)} pairs; `converged` of their results is False",
            ConvergenceWarning,
        )
    return results


def _solve_pair(
    solver: GeodesicSolver, metric: RiemannianMetric, pair: object, name: str
) -> PathResult:
    if not hasattr(pair, "__len__") or not hasattr(pair, "__getitem__") or len(pair) != 2:
        raise ArgumentError(f"{name} must be two points; found {type(pair).__name__}")
    start = values_of(pair[0], f"start of {name}")
    end = values_of(pair[1], f"end of {name}")
    try:
        return complete_path(solver.solve(metric, start, end))
    except RiemhumanError as error:
        raise type(error)(f"{name}: {error}") from error


@checked(n_nodes=whole(minimum=2))
@dataclass(frozen=True)
class LinearPath(PathSolver):
    """The straight path (1 − t) x₀ + t x₁, projected to the manifold: the simplest of all.

    Parameters
    ----------
    n_nodes : int
        Number of points of the path, both ends included.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.LinearPath(n_nodes=3).solve(metric, [0.0, 0.0], [2.0, 0.0]).energy
    4.0
    """

    n_nodes: int = 11

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> PathResult:
        start, end = check_end_points(metric, start, end)
        path = linear_path(start, end, self.n_nodes)
        path[1:-1] = metric.space.projection(path[1:-1])
        return known_path(metric, path, "the straight path")


@checked(n_nodes=whole(minimum=2))
@dataclass(frozen=True)
class ClosedFormGeodesic(PathSolver):
    """The geodesic of a metric that has it in closed form; others raise a NotDefinedError.

    Parameters
    ----------
    n_nodes : int
        See `LinearPath`.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.ClosedFormGeodesic(n_nodes=3).solve(metric, [0.0, 0.0], [2.0, 0.0]).energy
    4.0
    """

    n_nodes: int = 11

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> PathResult:
        start, end = check_end_points(metric, start, end)
        if not metric.has_closed_form_geodesic:
            raise NotDefinedError(
                f"{type(metric).__name__} has no closed-form geodesics; use BasisPath or "
                "PathStraightening"
            )
        path = metric.geodesic(start, end_point=end)(np.linspace(0.0, 1.0, self.n_nodes))
        return known_path(metric, path, "closed form", gap=0.0)


def check_end_points(metric: RiemannianMetric, start: Points, end: Points) -> tuple[Array, Array]:
    """Return two single points as float64 arrays after checking them."""
    check_metric(metric)
    return _end_point(metric, start, "start"), _end_point(metric, end, "end")


def _end_point(metric: RiemannianMetric, point: Points, name: str) -> Array:
    space = metric.space
    checked = real_array(point, name, space.shape, batched=False, rows=True)
    metric.space.check_scale(checked, name)
    return checked


def vector_of(vector: object, name: str, metric: RiemannianMetric) -> Array:
    """Return a single tangent vector as a float64 array after checking it."""
    return real_array(vector, name, metric.space.shape, batched=False)


def check_initial_path(
    metric: RiemannianMetric, start: Points, end: Points, n_nodes: int, initial_path: Points
) -> Array:
    """Return an initial path of `n_nodes` times, whose ends may be off by rounding."""
    path = metric.check_points(initial_path, "initial_path")
    if len(path) != n_nodes:
        raise ArgumentError(f"initial_path must have n_nodes = {n_nodes} times; found {len(path)}")
    gap = max(np.abs(path[0] - start).max(), np.abs(path[-1] - end).max())
    if gap > _SAME_POINT * max(np.abs(start).max(), np.abs(end).max()):
        raise ArgumentError(
            f"initial_path must run from start to end; its ends are off by up to {gap:.3g}"
        )
    return path


def check_path_from(metric: RiemannianMetric, path: ArrayLike, base_point: Points) -> Array:
    """Return a path whose start may be off a base point by rounding."""
    path = path_array(path, metric.space, batched=False)
    base_point = _end_point(metric, base_point, "base_point")
    gap = np.abs(path[0] - base_point).max()
    if gap > _SAME_POINT * np.abs(base_point).max():
        raise ArgumentError(f"path must start at base_point; it is off by {gap:.3g}")
    return path


def linear_path(start: Points, end: Points, n_nodes: int) -> Array:
    """Return (1 − t) x₀ + t x₁ at equally spaced times (step 4 of Algorithm 1, corrected)."""
    t = np.linspace(0.0, 1.0, n_nodes)
    return np.multiply.outer(1.0 - t, start) + np.multiply.outer(t, end)


def known_path(
    metric: RiemannianMetric,
    path: Points,
    message: str,
    gap: float = np.nan,
    energy: PathEnergy | None = None,
) -> PathResult:
    """Return the result of a solver that does not search; `gap` in per cent of the energy."""
    value = (energy or SegmentEnergy()).value(metric, path)
    bound = lower_bound(metric, path)
    return PathResult(path, value, np.array([value]), bound, gap, n_evaluations=1, message=message)


def lower_bound(metric: RiemannianMetric, path: Points) -> float:
    """Return the squared distance of the ends of a path, if it is in closed form, else 0."""
    return float(metric.squared_dist(path[0], path[-1])) if metric.has_closed_form_dist else 0.0


def rounding_energy(
    metric: RiemannianMetric,
    point: Points,
    energy: PathEnergy | None = None,
    size: float = _ROUNDING,
) -> float:
    """Return the squared distance of a point from itself with relative errors of this size."""
    near = metric.space.projection(rounded(point, size))
    return (energy or SegmentEnergy()).value(metric, np.stack([point, near]))


def rounded(point: Points, size: float) -> Array:
    """Return a point with rounding errors up to a relative size, the same ones at every call."""
    return point * (1.0 + np.random.default_rng(0).uniform(-size, size, point.shape))
