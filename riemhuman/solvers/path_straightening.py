"""Geodesics on any manifold: paths straightened in all coordinates of all their points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray
from scipy.interpolate import make_interp_spline

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError, ReparametrizationInvarianceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver, PathEnergy
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.protocols import INTERRUPTED, uninterrupted, was_interrupted
from riemhuman.solvers.energies import SegmentEnergy
from riemhuman.solvers.held_triangles import holding, raised
from riemhuman.solvers.many_paths import ManyPaths
from riemhuman.solvers.minimization import Minimum
from riemhuman.solvers.poisson_path import turned_paths
from riemhuman.solvers.preconditioner import PathPreconditioner
from riemhuman.solvers.quasi_newton import Operator, descend_in_rounds
from riemhuman.solvers.results import PathResult, warn_unless_converged
from riemhuman.solvers.rounding import path_floor
from riemhuman.solvers.simple_paths import (
    check_end_points,
    check_initial_path,
    known_path,
    linear_path,
    lower_bound,
    percentage,
)
from riemhuman.solvers.spatial_factors import spatial_factor

# Coarse levels only have to find the valley; the last one goes to its floor.
_COARSE_TOLERANCE = 1e-4

# Where limbs may turn either way, both paths run this far, and the better one to the end.
_HEAT = 1e-3

# The share of the energy that the second half of many iterations may have gained at the end, or
# twenty times as much as the tolerance.
_RECENT = 2e-3

# Weight of the Dirichlet energy in the preconditioner of surfaces: fewest iterations on the open
# bodies, under metrics with and without a and c; a third or three times as much costs some more.
_STIFFNESS = 0.2

# Least and largest ridge, in between the tolerance: a ridge hides how softly limbs as a whole move,
# the more the finer the mesh, and what such motions still gain matters to narrow tolerances alone.
_RIDGES = 1e-6, 1e-4


@dataclass(frozen=True)
class PathStraightening(ManyPaths):
    """Paths of least energy in all coordinates of all interior points, on any manifold.

    Coordinates are the entries of the arrays; `projection` maps them back to the manifold, and
    steps that leave it (`belongs`) are rejected. The minimisation is L-BFGS with the inverse of the
    metric's matrix, averaged over the path, as its first inverse Hessian; it starts from the
    straight path, or on surfaces from the path that turns every triangle (`PoissonPath`) if that
    has less energy, first with few segments if `coarse_segments` are given, then with all. Where a
    limb may turn either way, both ways are tried, as in `BasisPath`. Triangles that have all but
    vanished, where normals jump and no slope leads on, are held as flat as they are while others
    move. Its energies were lower than those of `BasisPath` for all pairs tried, and are never
    higher with ``initial=BasisPath(...)``.

    Parameters
    ----------
    n_nodes : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy to minimise.
    initial : object, optional
        Solver whose path, with as many nodes, is another start: if it has less energy than the
        result of the coarse levels, the last level starts from it.
    coarse_segments : tuple of int
        Numbers of segments of the coarse levels, increasing.
    tolerance : float
        The solver stops when a Newton step would gain at most this share of the energy, as far as
        the preconditioned gradient tells, and the second half of its iterations, if they are ten or
        more, has gained at most 0.2 %, or twenty times this share.
    max_iter : int
        Largest number of iterations on each level.
    remove_drift : bool
        Whether to take motions that the metric does not see, such as rigid motions of interior
        surfaces where c = 0, out of the path found; its energy stays the same.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration with all times.
    progress : bool
        Whether to show a progress bar.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> plane = rh.VectorSpace((2,))
    >>> solver = rh.solvers.PathStraightening(n_nodes=5)
    >>> result = solver.solve(plane.metric, np.zeros(2), np.ones(2))
    >>> round(result.energy, 6)
    2.0
    """

    n_nodes: int = 11
    energy: PathEnergy = SegmentEnergy()
    initial: GeodesicSolver | None = None
    coarse_segments: tuple[int, ...] = ()
    tolerance: float = 1e-4
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
        initial_path : array, shape (n_nodes, \*shape), optional
            Path to start from, between the same ends, instead of the coarse levels.

        Returns
        -------
        PathResult
            `energies` are those of the finest level; `n_evaluations` includes coarser levels.

        Raises
        ------
        ArgumentError
            If the end points do not fit the metric's space, or the initial path has other ends,
            leaves the manifold or has no finite energy.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        ReparametrizationInvarianceWarning
            If the metric does not see surfaces slide along themselves: their meshes crumple.
        """
        start, end = check_end_points(metric, start, end)
        n_segments = self.n_nodes - 1
        if n_segments == 1:
            single = linear_path(start, end, 2)
            return known_path(metric, self.energy, single, "a single segment", gap=0.0)
        unchanged = metric.is_reparametrization_invariant
        if unchanged and not np.array_equal(start, end):
            warn(
                f"{metric!r} does not see surfaces slide along themselves: over all vertices the "
                "meshes of a path crumple, and its energy falls on and on. Search over smooth "
                "deformations, as BasisPath(DeformationBasis.from_laplacian(template)) does",
                ReparametrizationInvarianceWarning,
            )
        levels = [n_segments]
        if initial_path is None:
            levels = [*(n for n in self.coarse_segments if n < n_segments), n_segments]
            paths = self._starts(metric, start, end, self.n_nodes)
        else:
            paths = [check_initial_path(metric, start, end, self.n_nodes, initial_path)]
        with single_threaded_libraries():
            result = self._best_of(metric, paths, levels)
        warn_unless_converged(self, result)
        return result

    def _best_of(
        self, metric: RiemannianMetric, paths: list[ndarray], levels: list[int]
    ) -> PathResult:
        """Descend from the start that leads to the least energy, as far as a short run tells."""
        if len(paths) == 1:
            return _Descent(self, metric, paths[0]).run(levels)
        heat, heats = replace(self, tolerance=_HEAT, callback=None), []
        for path in paths:
            heats.append(_Descent(heat, metric, path).run(levels[-1:]))
            if was_interrupted(heats[-1]):
                break
        result = min(heats, key=attrgetter("energy"))
        if was_interrupted(heats[-1]):
            return replace(result, converged=False, message=INTERRUPTED)
        result = _Descent(self, metric, result.path, result.energies[:-1]).run(levels)
        n_evaluations = result.n_evaluations + sum(other.n_evaluations for other in heats)
        return replace(result, n_evaluations=n_evaluations)

    def _starts(
        self, metric: RiemannianMetric, start: ndarray, end: ndarray, n_nodes: int
    ) -> list[ndarray]:
        """Return the start of least energy, and those with a limb that turns the other way."""
        starts, rivals = [linear_path(start, end, n_nodes)], []
        is_immersed = np.all(metric.space.belongs(np.stack([start, end])))
        if metric.space.is_surface_space and is_immersed:
            turned = turned_paths(metric, self.energy, start, end, n_nodes)
            (best, _), *rivals = turned
            starts.append(best)
        if self.initial is not None and n_nodes == self.n_nodes:
            starts.append(uninterrupted(self.initial.solve(metric, start, end)).path)
            rivals = []
        return [_least(metric, self.energy, starts), *(path for path, _ in rivals)]


class _Descent:
    """Minimises the energy over the interior points, on one level of nodes after the other."""

    def __init__(
        self,
        solver: PathStraightening,
        metric: RiemannianMetric,
        path: ndarray,
        earlier: ndarray | tuple[()] = (),
    ) -> None:
        self._solver, self._metric, self._earlier = solver, metric, earlier
        self._whole = self._path = path
        self._n_evaluations = 0

    def run(self, levels: list[int]) -> PathResult:
        """Minimise on all levels."""
        solver, metric = self._solver, self._metric
        floor = path_floor(metric, solver.energy, self._whole)
        if _energy(metric, solver.energy, self._whole) <= floor:
            message = "the end points are no distance apart"
            return known_path(metric, solver.energy, self._whole, message, gap=0.0)
        found: Minimum | None = None
        try:
            for n_segments in levels:
                found = None
                self._path = self._better_start(n_segments, is_first=n_segments == levels[0])
                found = self._descend(is_last=n_segments == levels[-1])
                if found.interrupted:
                    break
        except KeyboardInterrupt:
            found = None
        if found is None or len(self._path) < solver.n_nodes:
            self._path = self._better_start(solver.n_nodes - 1, is_first=False)
            value = _energy(metric, solver.energy, self._path)
            values, converged, gap = np.array([value]), False, np.nan
            message = INTERRUPTED
        else:
            value, values = found.value, found.values
            converged, message, gap = found.converged, found.message, found.gap
        return PathResult(
            self._without_drift(_on_manifold(metric, self._path)),
            value,
            values,
            lower_bound(metric, self._path),
            percentage(gap, value),
            n_iterations=len(values) - 1,
            n_evaluations=self._n_evaluations,
            converged=converged,
            message=message,
        )

    def _without_drift(self, path: ndarray) -> ndarray:
        """Return a path without drift, if asked for.

        Turned, a triangle that is all but flat may round to one that is.
        """
        space = self._metric.space
        if not self._solver.remove_drift:
            return path
        path = self._metric.remove_drift(path)
        if space.is_surface_space and not np.all(space.belongs(path)):
            path[1:-1] = raised(path[1:-1], space.template)
        return path

    def _better_start(self, n_segments: int, is_first: bool) -> ndarray:
        """Return the path so far at other times, or another start of less energy."""
        solver, metric = self._solver, self._metric
        if n_segments == len(self._path) - 1:
            return _on_manifold(metric, self._path)
        if n_segments == solver.n_nodes - 1:
            starts = [self._whole]
        else:
            starts = solver._starts(metric, self._whole[0], self._whole[-1], n_segments + 1)
        if not is_first:
            starts.append(refined_path(self._path, n_segments))
        return _least(metric, solver.energy, starts)

    def _descend(self, is_last: bool) -> Minimum:
        """Minimise from the path, with its times."""
        solver, metric = self._solver, self._metric
        path = self._path
        if not np.isfinite(_energy(metric, solver.energy, path)):
            raise ArgumentError(
                "the initial path leaves the manifold or has no finite energy; pass another "
                "initial_path"
            )

        def path_of(interior: ndarray) -> ndarray:
            moved = path.copy()
            moved[1:-1] = interior.reshape(path[1:-1].shape)
            return moved

        def objective(interior: ndarray) -> tuple[float, ndarray]:
            self._n_evaluations += 1
            return self._energy_and_slope(path_of(interior))

        def inverse_hessian_at(interior: ndarray) -> Operator:
            nodes = _on_manifold(metric, path_of(interior))[1:-1]
            ridge = float(np.clip(solver.tolerance, *_RIDGES))
            factor = spatial_factor(metric, nodes, 1.0, stiffness=_STIFFNESS, ridge=ridge)
            hessian = PathPreconditioner(factor, len(nodes) + 1)
            return lambda slope: hessian.inverse(slope.reshape(len(nodes), -1)).ravel()

        space: Any = metric.space

        def holding_at(interior: ndarray) -> Operator:
            nodes, faces = path_of(interior)[1:-1], space.template.faces
            return holding(inverse_hessian_at(interior), nodes, faces)

        def report(iteration: int, value: float, interior: ndarray) -> None:
            if solver.callback is not None and is_last:
                solver.callback(iteration, value, _on_manifold(metric, path_of(interior)))

        found = descend_in_rounds(
            objective,
            path[1:-1].ravel(),
            inverse_hessian_at,
            max_iter=solver.max_iter,
            holding_at=holding_at if space.is_surface_space else None,
            earlier=self._earlier if is_last else (),
            expected_decrease=solver.tolerance if is_last else _COARSE_TOLERANCE,
            recent_decrease=max(_RECENT, 20.0 * solver.tolerance) if is_last else np.inf,
            floor=path_floor(metric, solver.energy, path),
            callback=report,
            progress=solver.progress,
            description=f"{len(path) - 1} segments",
        )
        self._path = path_of(found.x)
        return found

    def _energy_and_slope(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy and its slope in the coordinates of the interior points."""
        points = _on_manifold(self._metric, path)
        if not np.all(self._metric.space.belongs(points[1:-1])):
            return np.inf, np.zeros(path[1:-1].size)
        value, gradient = self._solver.energy.value_and_gradient(self._metric, points)
        pull_back, _ = make_vjp(self._metric.space.projection, path[1:-1])
        return value if np.isfinite(value) else np.inf, np.ravel(pull_back(gradient[1:-1]))


def _energy(metric: RiemannianMetric, energy: PathEnergy, path: ndarray) -> float:
    """Return the energy, infinite where the path leaves the manifold."""
    if not np.all(metric.space.belongs(path[1:-1])):
        return np.inf
    value = energy.value(metric, path)
    return value if np.isfinite(value) else np.inf


def _on_manifold(metric: RiemannianMetric, path: ndarray) -> ndarray:
    path = path.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        path[1:-1] = metric.space.projection(path[1:-1])
    return path


def _least(metric: RiemannianMetric, energy: PathEnergy, paths: list[ndarray]) -> ndarray:
    """Return the path of least energy, the first of several, on the manifold."""
    paths = [_on_manifold(metric, path) for path in paths]
    return min(paths, key=lambda path: _energy(metric, energy, path))


def refined_path(path: ndarray, n_segments: int) -> ndarray:
    r"""Return a path at other times, by a spline.

    Parameters
    ----------
    path : array, shape (n_nodes, \*shape)
        A path.
    n_segments : int
        Its new number of segments.

    Returns
    -------
    array, shape (n_segments + 1, \*shape)
    """
    known = np.linspace(0.0, 1.0, len(path))
    spline = make_interp_spline(known, path, k=min(3, len(path) - 1))
    refined = spline(np.linspace(0.0, 1.0, n_segments + 1))
    refined[[0, -1]] = path[[0, -1]]
    return refined
