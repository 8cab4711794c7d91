"""Logarithms by discrete geodesics: the initial velocity of a path of least energy."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import GeodesicSolver, was_interrupted
from riemhuman.solvers.basis_path import BasisPath
from riemhuman.solvers.discrete_exponential import basis_with
from riemhuman.solvers.middle_equation import MiddleEquation, degeneration
from riemhuman.solvers.path_straightening import PathStraightening
from riemhuman.solvers.results import (
    PathResult,
    Result,
    warn_unless_converged,
    whole_path_result,
)
from riemhuman.solvers.simple_paths import check_end_points, linear_path
from riemhuman.surfaces.deformation_basis import DeformationBasis

# How well a path must be minimised for its first step to be known to some digits.
_TOLERANCE = 1e-11


@dataclass(frozen=True, repr=False)
class LogarithmResult(Result):
    r"""The initial velocity of a geodesic between two points, and how it was found.

    Attributes
    ----------
    tangent_vec : array, shape (\*shape,)
        Initial velocity.
    path : array, shape (n_steps + 1, \*shape)
        The geodesic, both ends included.
    energy : float
        Energy of the path: the squared norm of the velocity, up to the second order of the time
        step.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of energy and gradient, for the path and the velocity.
    converged : bool
        Whether path and velocity were found within their tolerances.
    message : str
        Why it stopped.
    """

    tangent_vec: ndarray
    path: ndarray
    energy: float


@dataclass(frozen=True)
class DiscreteLogarithm:
    r"""log from the first step of a geodesic x₀, x₁, …, xₙ: v = n (x₁ − x₋₁)/2.

    The point x₋₁ continues the geodesic backwards by one step. `DiscreteExponential` with as many
    steps and the same basis is the inverse, up to the tolerances; both differ from the continuous
    maps by the second order of the time step 1/n.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations, joined by the difference of the ends, from which the geodesic is made: one
        of the surfaces that differ from the start by these. By default all coordinates are free.
    n_steps : int
        Steps in unit time.
    geodesic_solver : object, optional
        Solver for the path, with `n_steps` + 1 times. By default `BasisPath` with the basis
        or `PathStraightening` without, both with
        narrow tolerances.
    tolerance : float
        Error of the backward step's equation, as a share of the length of its two segments.
    max_iter : int
        Most iterations of the backward step.
    """

    basis: DeformationBasis | None = None
    n_steps: int = 10
    geodesic_solver: GeodesicSolver | None = None
    tolerance: float = 1e-8
    max_iter: int = 50

    def __post_init__(self) -> None:
        whole_number(self.n_steps, "n_steps", minimum=1)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)

    def solve(
        self, metric: RiemannianMetric, point: ndarray, base_point: ndarray
    ) -> LogarithmResult:
        r"""Find the initial velocity of the geodesic between two points.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        point, base_point : array, shape (\*shape,)
            End and start.

        Returns
        -------
        LogarithmResult

        Raises
        ------
        ArgumentError
            If a point or the basis does not fit the metric's space.

        Warns
        -----
        ConvergenceWarning
            If the path or the backward step was not found within its tolerance.
        """
        start, end = check_end_points(metric, base_point, point)
        basis = None if self.basis is None else basis_with(self.basis, end - start)
        equation = MiddleEquation(metric, basis, self.tolerance, self.max_iter)
        found = self._geodesic(metric, basis, start, end)
        path = found.path
        n_steps = len(path) - 1
        backward = equation.next_point(path[1], path[0])
        before = backward.points[2]
        message = found.message
        gone = degeneration(metric, path[0], before)
        if gone or not backward.converged:
            message = f"the step before the start: {gone or f'error {backward.error:.1e}'}"
        result = LogarithmResult(
            0.5 * n_steps * (path[1] - before),
            path,
            found.energy,
            n_iterations=found.n_iterations + backward.n_iterations,
            n_evaluations=found.n_evaluations + backward.n_evaluations,
            converged=found.converged and backward.converged and not gone,
            message=message,
        )
        warn_unless_converged(self, result)
        return result

    def _geodesic(
        self,
        metric: RiemannianMetric,
        basis: DeformationBasis | None,
        start: ndarray,
        end: ndarray,
    ) -> PathResult:
        n_nodes = self.n_steps + 1
        if self.geodesic_solver is not None:
            return whole_path_result(self.geodesic_solver.solve(metric, start, end))
        if basis is None:
            return PathStraightening(n_nodes, tolerance=_TOLERANCE, remove_drift=False).solve(
                metric, start, end
            )
        # A path that turns the limbs is the better start, but only what it has in the basis can
        # be followed by the exponential.
        solver = BasisPath(basis, n_nodes, remove_drift=False)
        first = solver.solve(metric, start, end)
        if was_interrupted(first):
            return first
        initial = start + basis.project(first.path - start)
        if not np.isfinite(metric.energy_and_gradient(initial)[0]):
            initial = linear_path(start, end, n_nodes)
        solver = replace(solver, tolerance=_TOLERANCE)
        return solver.solve(metric, start, end, initial_path=initial)
