"""Exponential maps by discrete geodesics: initial value problems without Christoffel symbols."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from riemhuman.arrays import Array, Points, TangentVectors
from riemhuman.checks import (
    a_basis,
    checked,
    positive,
    values_of,
    whole,
)
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.strategies import ExpSolver
from riemhuman.kernels.threads import check_interrupt
from riemhuman.solvers._geodesic_equation import (
    GeodesicEquation,
    Triple,
    degeneration,
    has_long_step,
)
from riemhuman.solvers.paths import vector_of
from riemhuman.solvers.results import Result, Status, finish
from riemhuman.surfaces.deformation_basis import DeformationBasis

# A step whose equation is off by more than this share of its length has lost the geodesic.
_LOST = 1e-3


@dataclass(frozen=True, repr=False)
class ExponentialResult(Result):
    r"""A geodesic followed from its start, and how it was found.

    Attributes
    ----------
    path : array, shape (n_nodes, \*shape)
        Points reached, the base point first.
    energies : array, shape (n_nodes - 1,)
        Squared speed on each segment, which is constant on the continuous geodesic.
    n_steps : int
        Number of steps per unit time.
    complete : bool
        Whether all steps were possible.
    n_iterations, n_evaluations, status, message
        See `Result`.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.DiscreteExponential(n_steps=4).solve(metric, [2.0, 0.0], [0.0, 0.0]).n_steps
    4
    """

    path: Points
    energies: Array
    n_steps: int
    complete: bool

    def points_to_draw(self) -> Points:
        return self.path

    @property
    def end(self) -> Array:
        """The last point reached."""
        last: Points = self.path[-1]
        return last

    @property
    def energy(self) -> float:
        """The energy of the path per unit time, the mean of the squared speeds."""
        return float(self.energies.mean()) if len(self.energies) else 0.0


@checked(
    basis=a_basis,
    n_steps=whole(minimum=1),
    tolerance=positive,
    max_iter=whole(minimum=1),
    n_doublings=whole(minimum=0),
)
@dataclass(frozen=True)
class DiscreteExponential(ExpSolver):
    """exp in n steps, by the discrete geodesic equation.

    The first step is symmetric: x₀ is the midpoint of the points x₀ ± v/n + w. Every following
    point solves the discrete geodesic equation. The error of the end point is of second order in
    the time step 1/n, and the squared speed along the path is constant up to that order.

    Parameters
    ----------
    basis : DeformationBasis, optional
        The surfaces of the geodesic differ from the base point only by these deformations and the
        velocity. By default all coordinates are free.
    n_steps : int
        Steps in unit time.
    tolerance : float
        Largest error of each step's equation, as a share of the length of its two segments.
    max_iter : int
        Largest number of iterations of each step.
    n_doublings : int
        How often `solve` may start again with steps half as long, if a step fails, is longer than
        the distance between its ends (small λ) or, with all coordinates free, rotates a triangle by
        more than 60 degrees.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.DiscreteExponential().solve(metric, [2.0, 0.0], [0.0, 0.0]).end.round(6)
    array([2., 0.])
    """

    basis: DeformationBasis | None = None
    n_steps: int = 10
    tolerance: float = 1e-8
    max_iter: int = 50
    n_doublings: int = 2

    def solve(
        self, metric: RiemannianMetric, tangent_vec: TangentVectors, base_point: Points
    ) -> ExponentialResult:
        check_metric(metric)
        base_point = metric.check_points(values_of(base_point, "base_point")[None], "base_point")[0]
        velocity = vector_of(tangent_vec, "tangent_vec", metric)
        return finish(self, self._follow(metric, velocity, base_point))

    def _follow(
        self,
        metric: RiemannianMetric,
        velocity: TangentVectors,
        base_point: Points,
    ) -> ExponentialResult:
        """Return the geodesic with the fewest steps that suffice, without a warning."""
        n_iterations = n_evaluations = 0
        for doubling in range(self.n_doublings + 1):
            n_steps = self.n_steps * 2**doubling
            may_double = doubling < self.n_doublings
            result, is_fine = self._walk(metric, velocity, base_point, n_steps, may_double)
            n_iterations += result.n_iterations
            n_evaluations += result.n_evaluations
            if is_fine:
                break
        return replace(result, n_iterations=n_iterations, n_evaluations=n_evaluations)

    def _walk(
        self,
        metric: RiemannianMetric,
        velocity: TangentVectors,
        base_point: Points,
        n_steps: int,
        stop_early: bool,
    ) -> tuple[ExponentialResult, bool]:
        """Return the geodesic of so many steps.

        Also whether all steps were possible and, if the walk may stop early, short enough.
        """
        points, displacement = [base_point], velocity / n_steps
        basis = None if self.basis is None else self.basis.extend(displacement[None])
        equation = GeodesicEquation(metric, basis, self.tolerance, self.max_iter)
        n_iterations = n_evaluations = 0
        status, message = Status.CONVERGED, "all steps were completed"
        obstacle, is_too_long = "", False
        for step in range(1, n_steps + 1):
            check_interrupt()
            if step == 1:
                triple = equation.both_sides(base_point, displacement)
            else:
                triple = equation.next_point(points[-2], points[-1])
            n_iterations += triple.n_iterations
            n_evaluations += triple.n_evaluations
            obstacle = _obstacle(metric, points, triple)
            if obstacle:
                status = Status.OUTSIDE_MANIFOLD
                message = f"step {step} of {n_steps}: {obstacle}"
                break
            if not triple.error <= self.tolerance:
                status = Status.STALLED
                solved_to = f"the equation is solved to {triple.error:.1e} only"
                message = f"step {step} of {n_steps}: {solved_to}"
            points.append(triple.points[2])
            if stop_early and has_long_step(metric, triple.points[1:], self.basis is None):
                is_too_long = True
                break
        path = np.stack(points)
        squared = [float(metric.energy(np.stack(pair))) for pair in pairwise(path)]
        result = ExponentialResult(
            path,
            n_steps**2 * np.array(squared),
            n_steps,
            complete=not obstacle,
            n_iterations=n_iterations,
            n_evaluations=n_evaluations,
            status=status,
            message=message,
        )
        return result, not obstacle and not is_too_long


def _obstacle(metric: RiemannianMetric, points: list[Array], triple: Triple) -> str:
    """Return why a geodesic cannot go on to the last point of a triple, or "" if it can."""
    degenerate = degeneration(metric, points[-1], triple.points[2])
    if degenerate or not triple.error > _LOST:
        return degenerate
    return "no next point solves the geodesic equation; use more steps"
