"""Geodesics of aligned surfaces over a basis of deformations: Algorithm 1 of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy.interpolate import make_interp_spline

from riemhuman.checks import one_of, real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.solvers.energies import PathEnergy, SegmentEnergy
from riemhuman.solvers.minimization import Minimum, minimize
from riemhuman.solvers.preconditioner import CholeskyFactor, PathPreconditioner
from riemhuman.solvers.results import PathResult, warn_unless_converged
from riemhuman.solvers.simple_paths import check_end_points, linear_path

if TYPE_CHECKING:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

METHODS = ("preconditioned", "l-bfgs-b", "bfgs")

# Coarse levels only have to find the valley; the last one goes to its floor.
_COARSE_TOLERANCE = 1e-4

# The energy has several valleys where the straight path is far from a geodesic. Where the best
# path has less than this share of the straight path's energy, both starts are followed.
_FAR_FROM_STRAIGHT = 0.9

# Surfaces of the path over which the Gram matrix is averaged.
_N_NODES = 3


@dataclass(frozen=True)
class BasisPath:
    r"""Paths f(t_i) = (1 − t_i) f₀ + t_i f₁ + Σ_j α_ij D_j of least energy, without exponential map.

    Algorithm 1 of the paper, corrected: α has one block for every interior time.

    The default method minimises in variables preconditioned by the metric's Gram matrix on the
    basis. It finds a path of two segments first, where few variables follow a bend that the
    straight path cuts short, refines it in time, and forms the Gram matrix anew along it. Where
    the result is far from the straight path, it descends from that one, too, and keeps the better.

    Parameters
    ----------
    basis : DeformationBasis
        Deformations D_j.
    n_times : int
        Number of points of the path, both ends included.
    method : str
        "preconditioned", or "l-bfgs-b" and "bfgs", which minimise in α from the straight path with
        SciPy's stopping tests, as in the paper.
    energy : PathEnergy
        Energy to minimise.
    coarse_segments : tuple of int
        Numbers of segments of the coarse levels of the preconditioned method, in rising order.
    tolerance : float
        The preconditioned method stops when a Newton step would gain at most this share of the
        energy, as far as the preconditioned gradient tells.
    max_iterations : int
        Most iterations, on each level.
    options : mapping
        Options of SciPy's minimiser.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration with all times.
    progress : bool
        Whether to show a progress bar.
    """

    basis: DeformationBasis
    n_times: int = 11
    method: str = "preconditioned"
    energy: PathEnergy = SegmentEnergy()
    coarse_segments: tuple[int, ...] = (2,)
    tolerance: float = 1e-5
    max_iterations: int = 1000
    options: Mapping[str, Any] = field(default_factory=dict)
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        whole_number(self.n_times, "n_times", minimum=2)
        whole_number(self.max_iterations, "max_iterations", minimum=1)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        one_of(self.method, "method", METHODS)
        for segments in self.coarse_segments:
            whole_number(segments, "coarse_segments", minimum=2)

    def solve(
        self,
        metric: RiemannianMetric,
        start: ndarray,
        end: ndarray,
        initial_path: ndarray | None = None,
    ) -> PathResult:
        """Find a path of least energy.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on surfaces.
        start, end : array, shape (V, 3)
            Surfaces f₀ and f₁.
        initial_path : array, shape (n_times, V, 3), optional
            Path to start from, between the same ends, instead of the coarse levels; deformations
            are added to it.

        Returns
        -------
        PathResult
            `energies` are those of the finest level; evaluations on coarser ones are counted in.

        Raises
        ------
        ArgumentError
            If the end points or the basis do not fit the metric's space or each other, or the
            initial path has other ends or no finite energy.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        start, end = check_end_points(metric, start, end)
        self.basis.check_fits(start.shape[0])
        line = linear_path(start, end, self.n_times)
        if initial_path is not None:
            line = self._check_initial_path(metric, line, initial_path)

        if self.n_times == 2:
            value = self.energy.value(metric, line)
            return PathResult(line, value, np.array([value]), 0, 1, True, "a single segment")

        descent = _Descent(self, metric)
        straight = np.zeros((self.n_times - 2, len(self.basis)))
        start_coefficients = straight
        coarse_levels = self._coarse_levels() if initial_path is None else []
        for n_segments in coarse_levels:
            level = linear_path(start, end, n_segments + 1)
            known = interpolate_in_time(start_coefficients, n_segments)
            found = descent.run(level, known, _COARSE_TOLERANCE)
            start_coefficients = interpolate_in_time(found.coefficients, self.n_times - 1)
        best = descent.run(line, start_coefficients, self.tolerance, report=True)
        if coarse_levels and best.minimum.value < _FAR_FROM_STRAIGHT * best.line_energy:
            other = descent.run(line, straight, self.tolerance, report=True)
            best = min(best, other, key=lambda found: found.minimum.value)

        minimum = best.minimum
        result = PathResult(
            self._path(line, best.coefficients),
            minimum.value,
            minimum.values,
            minimum.n_iterations,
            descent.n_evaluations,
            minimum.converged and not descent.interrupted,
            "interrupted from the keyboard" if descent.interrupted else minimum.message,
        )
        warn_unless_converged(self, result)
        return result

    def _coarse_levels(self) -> list[int]:
        if self.method != "preconditioned":
            return []
        return [level for level in self.coarse_segments if level < self.n_times - 1]

    def _path(self, line: ndarray, coefficients: ndarray) -> ndarray:
        path = line.copy()
        path[1:-1] += self.basis.combine(coefficients)
        return path

    def _check_initial_path(
        self, metric: RiemannianMetric, line: ndarray, initial_path: ndarray
    ) -> ndarray:
        path = metric.check_points(initial_path, "initial_path")
        if len(path) != self.n_times:
            raise ArgumentError(
                f"initial_path must have n_times = {self.n_times} times; found {len(path)}"
            )
        gap = max(np.abs(path[0] - line[0]).max(), np.abs(path[-1] - line[-1]).max())
        if gap > 1e-9 * np.abs(line).max():
            raise ArgumentError(
                f"initial_path must run from start to end; its ends are off by up to {gap:.3g}"
            )
        return path


@dataclass(frozen=True)
class _Found:
    """Where a descent on one level has arrived."""

    minimum: Minimum
    coefficients: ndarray
    line_energy: float


class _Descent:
    """Minimises the energy over the coefficients, on one level of times after the other."""

    def __init__(self, solver: BasisPath, metric: RiemannianMetric) -> None:
        self._solver = solver
        self._metric = metric
        self.n_evaluations = 0
        self.interrupted = False

    def run(
        self, line: ndarray, start: ndarray, tolerance: float, report: bool = False
    ) -> _Found:
        """Descend from the path `line` plus deformations with coefficients `start`."""
        solver, metric = self._solver, self._metric
        line_energy = solver.energy.value(metric, line)
        first_path = solver._path(line, start)
        first_energy = solver.energy.value(metric, first_path) if start.any() else line_energy
        if not np.isfinite(first_energy):
            raise ArgumentError(
                "the initial path has no finite energy: a surface on it has a triangle without "
                "area; pass another initial_path"
            )
        if self.interrupted:
            nothing = Minimum(start, first_energy, np.array([first_energy]), 0, 0, False, True, "")
            return _Found(nothing, start, line_energy)

        preconditioned = solver.method == "preconditioned"
        change = self._preconditioner(first_path, first_energy) if preconditioned else None
        # In units of the first energy SciPy's first step is neither too short nor too long.
        scale = first_energy if preconditioned and first_energy > 0 else 1.0

        def coefficients(variables: ndarray) -> ndarray:
            steps = variables.reshape(start.shape)
            return start + (steps if change is None else change.coefficients(steps))

        def objective(variables: ndarray) -> tuple[float, ndarray]:
            path = solver._path(line, coefficients(variables))
            energy, gradient = solver.energy.value_and_gradient(metric, path)
            slope = gradient[1:-1].reshape(len(start), -1) @ solver.basis.flat.T
            slope = slope if change is None else change.gradient(slope)
            return energy / scale, slope.ravel() / scale

        def after_iteration(iteration: int, value: float, variables: ndarray) -> None:
            if solver.callback is not None and report:
                path = solver._path(line, coefficients(variables))
                solver.callback(iteration, value * scale, path)

        minimum = minimize(
            objective,
            np.zeros(start.size),
            method="BFGS" if solver.method == "bfgs" else "L-BFGS-B",
            max_iterations=solver.max_iterations,
            expected_decrease=tolerance if preconditioned else None,
            options=solver.options,
            callback=after_iteration,
            progress=solver.progress,
            description=f"{len(line) - 1} segments",
        )
        self.n_evaluations += minimum.n_evaluations
        self.interrupted = minimum.interrupted
        in_units = replace(minimum, value=minimum.value * scale, values=minimum.values * scale)
        return _Found(in_units, coefficients(minimum.x), line_energy)

    def _preconditioner(self, path: ndarray, energy: float) -> PathPreconditioner:
        nodes = path[1 : -1 : max(1, (len(path) - 2) // _N_NODES)]
        gram = self._metric.gram_matrix(self._solver.basis.vectors, nodes)
        scale = energy if energy > 0 else 1.0
        return PathPreconditioner(CholeskyFactor(gram / scale), len(path) - 1)


def interpolate_in_time(coefficients: ndarray, n_segments: int) -> ndarray:
    """Return coefficients of the interior times at another number of segments, by a spline.

    Parameters
    ----------
    coefficients : array, shape (n − 1, K)
        Coefficients at the interior times of n segments; they vanish at both ends.
    n_segments : int
        New number of segments.

    Returns
    -------
    array, shape (n_segments − 1, K)
    """
    if not coefficients.any():
        return np.zeros((n_segments - 1, coefficients.shape[1]))
    known = np.pad(coefficients, ((1, 1), (0, 0)))
    spline = make_interp_spline(np.linspace(0, 1, len(known)), known, k=min(3, len(known) - 1))
    return spline(np.linspace(0, 1, n_segments + 1)[1:-1])
