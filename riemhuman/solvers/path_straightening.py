"""Geodesics on any manifold: paths straightened in all coordinates of all their points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.solvers.refinement import interpolate_in_time
from riemhuman.solvers.energies import PathEnergy, SegmentEnergy
from riemhuman.solvers.minimization import Minimum, minimize
from riemhuman.solvers.preconditioner import PathPreconditioner
from riemhuman.solvers.results import PathResult, warn_unless_converged
from riemhuman.solvers.simple_paths import check_end_points, check_initial_path, linear_path
from riemhuman.solvers.spatial_factors import spatial_factor

# Coarse levels only have to find the valley; the last one goes to its floor.
_COARSE_TOLERANCE = 1e-4

# Points of the path over which the metric's matrix is averaged.
_N_NODES = 3

# Height, in units of the first energy, of the wall around the manifold in the line search.
_WALL = 2.0


@dataclass(frozen=True)
class PathStraightening:
    """Paths of least energy in all coordinates of all interior points, on any manifold.

    Coordinates are those of the arrays; `regularize` brings them back to the manifold, and steps
    that leave it (`belongs`) are refused. The minimisation runs in preconditioned variables, first
    with few segments, then with all.

    Parameters
    ----------
    n_times : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy to minimise.
    coarse_segments : tuple of int
        Numbers of segments of the coarse levels, in rising order.
    tolerance : float
        The solver stops when a Newton step would gain at most this share of the energy, as far as
        the preconditioned gradient tells.
    max_iterations : int
        Most iterations, on each level.
    remove_drift : bool
        Whether to take motions that the metric does not see, such as rigid motions of interior
        surfaces where c = 0, out of the path found; its energy stays the same.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration with all times.
    progress : bool
        Whether to show a progress bar.
    """

    n_times: int = 11
    energy: PathEnergy = SegmentEnergy()
    coarse_segments: tuple[int, ...] = (2, 4)
    tolerance: float = 1e-5
    max_iterations: int = 1000
    remove_drift: bool = True
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        whole_number(self.n_times, "n_times", minimum=2)
        whole_number(self.max_iterations, "max_iterations", minimum=1)
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
        initial_path : array, shape (n_times, \*shape), optional
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
        n_segments = self.n_times - 1
        if initial_path is None:
            levels = [*(n for n in self.coarse_segments if n < n_segments), n_segments]
            path = linear_path(start, end, levels[0] + 1)
        else:
            levels = [n_segments]
            path = check_initial_path(metric, start, end, self.n_times, initial_path)
        if n_segments == 1:
            value = self.energy.value(metric, path)
            return PathResult(path, value, np.array([value]), 0, 1, True, "a single segment")
        result = _Descent(self, metric).run(path, levels)
        warn_unless_converged(self, result)
        return result


class _Descent:
    """Minimises the energy over the interior points, on one level of times after the other."""

    def __init__(self, solver: PathStraightening, metric: RiemannianMetric) -> None:
        self._solver = solver
        self._metric = metric
        self._n_evaluations = 0

    def run(self, path: ndarray, levels: list[int]) -> PathResult:
        """Descend from a path with the times of the first level."""
        n_times = self._solver.n_times
        reached: Minimum | None = None
        try:
            for n_segments in levels:
                path, reached = self._better_start(path, n_segments), None
                path, reached = self._level(path)
                if reached.interrupted:
                    break
        except KeyboardInterrupt:
            reached = None
        if reached is None or len(path) < n_times:
            path = self._better_start(path, n_times - 1)
            value = self._solver.energy.value(self._metric, path)
            return PathResult(
                path,
                value,
                np.array([value]),
                0,
                self._n_evaluations,
                False,
                "interrupted from the keyboard",
            )
        return PathResult(
            self._metric.remove_drift(path) if self._solver.remove_drift else path,
            reached.value,
            reached.values,
            reached.n_iterations,
            self._n_evaluations,
            reached.converged,
            reached.message,
        )

    def _level(self, path: ndarray) -> tuple[ndarray, Minimum]:
        """Descend from a path, and anew from where a line search has got stuck."""
        limit = self._solver.max_iterations
        path, reached = self._descend(path, limit)
        values = reached.values
        while not (reached.converged or reached.interrupted or len(values) > limit):
            path, reached = self._descend(path, limit - len(values) + 1)
            values = np.concatenate([values, reached.values[1:]])
            if reached.value >= reached.values[0] * (1.0 - self._solver.tolerance):
                break
        return path, replace(reached, values=values, n_iterations=len(values) - 1)

    def _descend(self, path: ndarray, max_iterations: int) -> tuple[ndarray, Minimum]:
        """Minimise from a path, with its times, preconditioned by the metric along it."""
        solver, metric = self._solver, self._metric
        is_last = len(path) == solver.n_times
        first_energy = self._energy(path)
        if not np.isfinite(first_energy):
            raise ArgumentError(
                "the initial path leaves the manifold or has no finite energy; pass another "
                "initial_path"
            )
        # In units of the first energy SciPy's first step is neither too short nor too long.
        scale = first_energy if first_energy > 0 else 1.0
        n_interior = len(path) - 2
        nodes = path[1 : -1 : max(1, n_interior // _N_NODES)]
        change = PathPreconditioner(spatial_factor(metric, nodes, scale), len(path) - 1)

        def coordinates(variables: ndarray) -> ndarray:
            steps = change.coefficients(variables.reshape(n_interior, -1))
            moved = path.copy()
            moved[1:-1] += steps.reshape(n_interior, *metric.space.shape)
            return moved

        def objective(variables: ndarray) -> tuple[float, ndarray]:
            moved = coordinates(variables)
            points = self._on_manifold(moved)
            if not self._belongs(points):
                return _WALL, np.zeros_like(variables)
            energy, gradient = solver.energy.value_and_gradient(metric, points)
            if not np.isfinite(energy):
                return _WALL, np.zeros_like(variables)
            pull_back, _ = make_vjp(metric.space.regularize, moved[1:-1])
            slope = pull_back(gradient[1:-1]).reshape(n_interior, -1)
            return energy / scale, change.gradient(slope).ravel() / scale

        def after_iteration(iteration: int, value: float, variables: ndarray) -> None:
            if solver.callback is not None and is_last:
                solver.callback(iteration, value * scale, self._on_manifold(coordinates(variables)))

        minimum = minimize(
            objective,
            np.zeros(path[1:-1].size),
            max_iterations=max_iterations,
            expected_decrease=solver.tolerance if is_last else _COARSE_TOLERANCE,
            callback=after_iteration,
            progress=solver.progress,
            description=f"{len(path) - 1} segments",
        )
        self._n_evaluations += minimum.n_evaluations
        in_units = replace(minimum, value=minimum.value * scale, values=minimum.values * scale)
        return self._on_manifold(coordinates(minimum.x)), in_units

    def _better_start(self, path: ndarray, n_segments: int) -> ndarray:
        """Return a path at other times, or the straight one where that has less energy."""
        if n_segments == len(path) - 1:
            return self._on_manifold(path)
        straight = linear_path(path[0], path[-1], n_segments + 1)
        deviation = path - linear_path(path[0], path[-1], len(path))
        spline = interpolate_in_time(deviation[1:-1].reshape(len(path) - 2, -1), n_segments)
        smooth = straight.copy()
        smooth[1:-1] += spline.reshape(smooth[1:-1].shape)
        starts = [self._on_manifold(start) for start in (smooth, straight)]
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
            path[1:-1] = self._metric.space.regularize(path[1:-1])
        return path

    def _belongs(self, path: ndarray) -> bool:
        return bool(np.all(self._metric.space.belongs(path[1:-1])))
