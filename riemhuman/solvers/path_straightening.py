"""Geodesics on any manifold: paths straightened in all coordinates of all their points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray
from scipy.interpolate import make_interp_spline

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import PathEnergy
from riemhuman.solvers.energies import SegmentEnergy
from riemhuman.solvers.minimization import LocalProblem, Minimum, minimize_in_rounds
from riemhuman.solvers.preconditioner import PathPreconditioner
from riemhuman.solvers.results import PathResult, warn_unless_converged
from riemhuman.solvers.simple_paths import (
    LinearPath,
    check_end_points,
    check_initial_path,
    known_path,
    linear_path,
)
from riemhuman.solvers.spatial_factors import spatial_factor

# Coarse levels only have to find the valley; the last one goes to its floor.
_COARSE_TOLERANCE = 1e-4

# Points of the path over which the metric's matrix is averaged.
_N_NODES = 3

# Relative rounding errors within which end points are the same.
_ROUNDING = 1e-13

# Height, in units of the first energy, of the wall around the manifold in the line search.
_WALL = 2.0


@dataclass(frozen=True)
class PathStraightening:
    """Paths of least energy in all coordinates of all interior points, on any manifold.

    Coordinates are those of the arrays; `projection` brings them back to the manifold, and steps
    that leave it (`belongs`) are refused. The minimisation runs in preconditioned variables, first
    with few segments, then with all.

    Parameters
    ----------
    n_nodes : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy to minimise.
    coarse_segments : tuple of int
        Numbers of segments of the coarse levels, in rising order.
    tolerance : float
        The solver stops when a Newton step would gain at most this share of the energy, as far as
        the preconditioned gradient tells.
    max_iter : int
        Most iterations, on each level.
    remove_drift : bool
        Whether to take motions that the metric does not see, such as rigid motions of interior
        surfaces where c = 0, out of the path found; its energy stays the same.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration with all times.
    progress : bool
        Whether to show a progress bar.
    """

    n_nodes: int = 11
    energy: PathEnergy = SegmentEnergy()
    coarse_segments: tuple[int, ...] = (2, 4)
    tolerance: float = 1e-5
    max_iter: int = 1000
    remove_drift: bool = True
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        whole_number(self.n_nodes, "n_nodes", minimum=2)
        whole_number(self.max_iter, "max_iter", minimum=1)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        for segments in self.coarse_segments:
            whole_number(segments, "coarse_segments", minimum=2)

    def solve(
        self,
        metric: RiemannianMetric,
        start: ndarray,
        end: ndarray,
        initial_path: ndarray | None = None,
    ) -> PathResult:
        r"""Find a path of least energy.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on any manifold.
        start, end : array, shape (\*shape,)
            End points.
        initial_path : array, shape (n_nodes, \*shape), optional
            Path to start from, between the same ends, instead of the coarse levels.

        Returns
        -------
        PathResult
            `energies` are those of the finest level; evaluations on coarser ones are counted in.

        Raises
        ------
        ArgumentError
            If the end points do not fit the metric's space, or the initial path has other ends,
            leaves the manifold or has no finite energy.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        start, end = check_end_points(metric, start, end)
        n_segments = self.n_nodes - 1
        if initial_path is None:
            levels = [*(n for n in self.coarse_segments if n < n_segments), n_segments]
            path = linear_path(start, end, levels[0] + 1)
        else:
            levels = [n_segments]
            path = check_initial_path(metric, start, end, self.n_nodes, initial_path)
        if n_segments == 1:
            return known_path(metric, self.energy, path, "a single segment")
        if self._coincide(metric, start, end):
            straight = LinearPath(self.n_nodes, self.energy).solve(metric, start, end)
            return replace(straight, message="the end points are no distance apart")
        result = _Descent(self, metric, path).run(levels)
        warn_unless_converged(self, result)
        return result

    def _coincide(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> bool:
        """Tell whether the metric sees no more between the ends than rounding errors of them."""
        noise = np.random.default_rng(0).uniform(-_ROUNDING, _ROUNDING, start.shape)
        near = metric.space.projection(start * (1.0 + noise))
        apart, rounding = (
            self.energy.value(metric, np.stack([start, other])) for other in (end, near)
        )
        return apart <= rounding


class _Descent:
    """Minimises the energy over the interior points, on one level of times after the other."""

    def __init__(self, solver: PathStraightening, metric: RiemannianMetric, path: ndarray) -> None:
        self._solver = solver
        self._metric = metric
        self._path = path
        self._n_evaluations = 0

    def run(self, levels: list[int]) -> PathResult:
        """Descend on all levels; the path has the times of the first."""
        found: Minimum | None = None
        try:
            for n_segments in levels:
                found = None
                self._path = self._better_start(n_segments)
                found = self._descend(is_last=n_segments == levels[-1])
                if found.interrupted:
                    break
        except KeyboardInterrupt:
            found = None
        if found is None or len(self._path) < self._solver.n_nodes:
            self._path = self._better_start(self._solver.n_nodes - 1)
            value = self._energy(self._path)
            values, converged = np.array([value]), False
            message = "interrupted from the keyboard"
        else:
            value, values = found.value, found.values
            converged, message = found.converged, found.message
        remove_drift = self._metric.remove_drift if self._solver.remove_drift else np.copy
        return PathResult(
            remove_drift(self._on_manifold(self._path)),
            value,
            values,
            n_iterations=len(values) - 1,
            n_evaluations=self._n_evaluations,
            converged=converged,
            message=message,
        )

    def _descend(self, is_last: bool) -> Minimum:
        """Minimise from the path, with its times."""
        solver, metric = self._solver, self._metric
        ends, start = self._path[[0, -1]], self._path[1:-1]
        if not np.isfinite(self._energy(self._path)):
            raise ArgumentError(
                "the initial path leaves the manifold or has no finite energy; pass another "
                "initial_path"
            )

        def path_of(interior: ndarray) -> ndarray:
            return np.concatenate([ends[:1], interior, ends[1:]])

        def around(interior: ndarray) -> LocalProblem:
            path = self._on_manifold(path_of(interior))
            unit = self._energy(path) or 1.0
            nodes = path[1 : -1 : max(1, len(start) // _N_NODES)]
            change = PathPreconditioner(spatial_factor(metric, nodes, unit), len(path) - 1)

            def position(variables: ndarray) -> ndarray:
                steps = change.coefficients(variables.reshape(len(start), -1))
                return path[1:-1] + steps.reshape(start.shape)

            def objective(variables: ndarray) -> tuple[float, ndarray]:
                self._n_evaluations += 1
                moved = position(variables)
                value, slope = self._energy_and_slope(path_of(moved))
                if not np.isfinite(value):
                    return _WALL, np.zeros_like(variables)
                return value / unit, change.gradient(slope).ravel() / unit

            return LocalProblem(objective, position, unit)

        def report(iteration: int, value: float, interior: ndarray) -> None:
            self._path = path_of(interior)
            if solver.callback is not None and is_last:
                solver.callback(iteration, value, self._on_manifold(self._path))

        found = minimize_in_rounds(
            around,
            start,
            max_iter=solver.max_iter,
            expected_decrease=solver.tolerance if is_last else _COARSE_TOLERANCE,
            callback=report,
            progress=solver.progress,
            description=f"{len(self._path) - 1} segments",
        )
        self._path = path_of(found.x)
        return found

    def _energy_and_slope(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy and its slope in the coordinates of the interior points."""
        points = self._on_manifold(path)
        if not self._belongs(points):
            return np.inf, np.zeros((len(path) - 2, path[0].size))
        value, gradient = self._solver.energy.value_and_gradient(self._metric, points)
        pull_back, _ = make_vjp(self._metric.space.projection, path[1:-1])
        return value, pull_back(gradient[1:-1]).reshape(len(path) - 2, -1)

    def _better_start(self, n_segments: int) -> ndarray:
        """Return the path at other times, or the straight one where that has less energy."""
        if n_segments == len(self._path) - 1:
            return self._on_manifold(self._path)
        starts = [
            self._on_manifold(_refined(self._path, n_segments)),
            self._on_manifold(linear_path(self._path[0], self._path[-1], n_segments + 1)),
        ]
        return min(starts, key=self._energy)

    def _energy(self, path: ndarray) -> float:
        """Return the energy, infinite where the path leaves the manifold."""
        if not self._belongs(path):
            return np.inf
        value = self._solver.energy.value(self._metric, path)
        return value if np.isfinite(value) else np.inf

    def _on_manifold(self, path: ndarray) -> ndarray:
        path = path.copy()
        with np.errstate(divide="ignore", invalid="ignore"):
            path[1:-1] = self._metric.space.projection(path[1:-1])
        return path

    def _belongs(self, path: ndarray) -> bool:
        return bool(np.all(self._metric.space.belongs(path[1:-1])))


def _refined(path: ndarray, n_segments: int) -> ndarray:
    """Return a path at other times, by a spline."""
    known = np.linspace(0.0, 1.0, len(path))
    spline = make_interp_spline(known, path, k=min(3, len(path) - 1))
    refined = spline(np.linspace(0.0, 1.0, n_segments + 1))
    refined[[0, -1]] = path[[0, -1]]
    return refined
