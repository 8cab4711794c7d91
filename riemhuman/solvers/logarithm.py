"""Logarithms by discrete geodesics: the initial velocity of a path of least energy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.kernels.drift import steady_path
from riemhuman.solvers._geodesic_equation import MiddleEquation, degeneration, turns_far
from riemhuman.solvers.basis_path import BasisPath
from riemhuman.solvers.path_straightening import PathStraightening, refine_path
from riemhuman.solvers.paths import check_end_points, linear_path, rounding_energy
from riemhuman.solvers.results import (
    PathResult,
    Result,
    Status,
    complete_path_result,
    finish,
)
from riemhuman.surfaces.deformation_basis import DeformationBasis

# How well a path must be minimised for its first step to be known to some digits.
_TOLERANCE = 1e-11

# Energy of a path in the basis, as a share of that of a path that also turns limbs, up to which
# the exponential need not know more than the basis.
_WORTH_JOINING = 1.01

# Shares of the length of the path by which the norm of the velocity may differ from it.
_SAME_SPEED = 0.1


@dataclass(frozen=True, repr=False)
class LogarithmResult(Result):
    r"""The initial velocity of a geodesic between two points, and how it was found.

    Attributes
    ----------
    tangent_vec : array, shape (\*shape,)
        Initial velocity.
    path : array, shape (n_nodes, \*shape)
        The geodesic, both ends included: one point more than steps were made.
    energy : float
        Energy of the path: the squared norm of the velocity, up to the second order of the time
        step.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of energy and gradient, for the path and the velocity.
    converged : bool
        Whether path and velocity were found within their tolerances, and the norm of the velocity
        is about the length of the path.
    message : str
        Why it stopped.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> end = bodies[0] + 0.02 * basis.vectors[8]
    >>> result = rh.solvers.DiscreteLogarithm(basis, n_steps=4).solve(metric, end, bodies[0])
    >>> result.tangent_vec.shape
    (1202, 3)
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
        Deformations that span the geodesic together with the difference of the ends: its surfaces
        differ from the start by these alone. If a path that turns limbs has at least 1 % less
        energy, its displacements are added; the inverse is then
        ``DiscreteExponential(basis.extend(result.path - base_point))``. By default all coordinates
        are free.
    n_steps : int
        Steps in unit time.
    geodesic_solver : object, optional
        Solver for the path, with `n_steps` + 1 times. By default `BasisPath` with the basis
        or `PathStraightening` without, both with
        narrow tolerances.
    tolerance : float
        Largest error of the backward step's equation, as a share of the length of its two segments.
    max_iter : int
        Largest number of iterations of the backward step.
    n_doublings : int
        How often the steps may be halved where a triangle turns by more than 60 degrees within
        one, over all coordinates and without another `geodesic_solver`: a fold of skin that snaps
        within one step takes its path of least energy to a place that the exponential does not
        reach. The inverse is then ``DiscreteExponential(n_steps=len(result.path) - 1)``.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> end = bodies[0] + 0.02 * basis.vectors[8]
    >>> result = rh.solvers.DiscreteLogarithm(basis, n_steps=4).solve(metric, end, bodies[0])
    >>> result.tangent_vec.shape
    (1202, 3)
    """

    basis: DeformationBasis | None = None
    n_steps: int = 10
    geodesic_solver: GeodesicSolver | None = None
    tolerance: float = 1e-8
    max_iter: int = 50
    n_doublings: int = 1

    def __post_init__(self) -> None:
        whole_number(self.n_steps, "n_steps", minimum=1)
        whole_number(self.n_doublings, "n_doublings", minimum=0)
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
        found = self._geodesic(metric, start, end)
        path = found.path
        basis = None if self.basis is None else self.basis.extend(path[1:] - start)
        equation = MiddleEquation(metric, basis, self.tolerance, self.max_iter)
        n_steps = len(path) - 1
        backward = equation.next_point(path[1], path[0])
        before = backward.points[2]
        message = found.message
        gone = degeneration(metric, path[0], before)
        if gone or not backward.converged:
            message = f"the step before the start: {gone or f'error {backward.error:.1e}'}"
        tangent_vec = 0.5 * n_steps * (path[1] - before)
        speed, length = float(metric.norm(tangent_vec, start)), np.sqrt(found.energy)
        rounding = np.sqrt(rounding_energy(metric, start))
        agree = abs(speed - length) <= max(_SAME_SPEED * length, n_steps * rounding)
        if not agree:
            message = f"the velocity has norm {speed:.4g}, the path length {length:.4g}; {message}"
        if self.basis is None and self.geodesic_solver is None and turns_far(metric, path):
            message += "; a triangle turns far within one step: the exponential may end elsewhere"
        result = LogarithmResult(
            tangent_vec,
            path,
            found.energy,
            n_iterations=found.n_iterations + backward.n_iterations,
            n_evaluations=found.n_evaluations + backward.n_evaluations,
            status=Status.of(found.converged and backward.converged and not gone and agree),
            message=message,
        )
        finish(self, result)
        return result

    def _geodesic(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        n_nodes = self.n_steps + 1
        if self.geodesic_solver is not None:
            return complete_path_result(self.geodesic_solver.solve(metric, start, end))
        if self.basis is None:
            found = self._over_all(metric, start, end)
            if metric.is_translation_invariant:
                # As the exponential moves surfaces where the metric does not say.
                space: Any = metric.space
                found = replace(found, path=steady_path(found.path, space.template.vertex_areas))
            return found
        basis = self.basis.extend((end - start)[None])
        solver = BasisPath(basis, n_nodes, remove_drift=False)
        first = solver.solve(metric, start, end)
        # The exponential can follow what the path has in the basis.
        initial = start + basis.project(first.path - start)
        if not np.isfinite(metric.energy_and_gradient(initial)[0]):
            initial = linear_path(start, end, n_nodes)
        within = solver.solve(metric, start, end, initial_path=initial)
        least = within if within.energy <= _WORTH_JOINING * first.energy else first
        joined = self.basis.extend(least.path[1:] - start)
        solver = replace(solver, basis=joined, tolerance=_TOLERANCE)
        return solver.solve(metric, start, end, initial_path=least.path)

    def _over_all(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        """Return the path over all vertices, with twice the steps where triangles turn too far."""
        solver = PathStraightening(self.n_steps + 1, remove_drift=False)
        exact = replace(solver, tolerance=_TOLERANCE)
        if self.n_doublings == 0 or self.n_steps == 1:
            return exact.solve(metric, start, end)
        found = solver.solve(metric, start, end)
        path = found.path
        for _ in range(self.n_doublings):
            if not turns_far(metric, path):
                break
            n_segments = 2 * (len(path) - 1)
            exact = replace(exact, n_nodes=n_segments + 1)
            path = refine_path(path, n_segments)
        ending = exact.solve(metric, start, end, initial_path=path)
        return replace(ending, n_evaluations=found.n_evaluations + ending.n_evaluations)
