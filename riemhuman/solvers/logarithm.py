"""Logarithms by discrete geodesics: the initial velocity of a path of least energy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from warnings import catch_warnings, simplefilter

import numpy as np

from riemhuman.arrays import Points, TangentVectors
from riemhuman.checks import a_basis, a_solver, checked, positive, whole
from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import surface_space
from riemhuman.geometry.strategies import GeodesicSolver, LogSolver
from riemhuman.kernels.drift import steady_path
from riemhuman.solvers._alignment import end_of_logarithm, ends_as_given
from riemhuman.solvers._geodesic_equation import (
    GeodesicEquation,
    Triple,
    degeneration,
    has_long_step,
)
from riemhuman.solvers.exponential import DiscreteExponential
from riemhuman.solvers.path_search import BasisPath, PathSearch, PathStraightening, refine_path
from riemhuman.solvers.paths import check_end_points, linear_path
from riemhuman.solvers.results import (
    PathResult,
    Result,
    Status,
    complete_path,
    finish,
)
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.procrustes import procrustes

# Tolerance of a path whose first step must be accurate to some digits.
_TOLERANCE = 1e-11

# Tolerance of a path before it is known whether its steps are short enough.
_LOOSE_TOLERANCE = 1e-4

# Energy of a path in the basis, as a share of that of a path that also rotates limbs, up to which
# the exponential need not know more than the basis.
_WORTH_JOINING = 1.01


@dataclass(frozen=True, repr=False)
class LogarithmResult(Result):
    r"""The initial velocity of a geodesic between two points, and how it was found.

    Attributes
    ----------
    tangent_vec : array, shape (\*shape,)
        Initial velocity.
    path : array, shape (n_nodes, \*shape)
        The geodesic, both ends included: one point more than the number of steps. If the metric
        ignores rotations and translations, a point that is turned by more than 30 degrees is first
        aligned with the base point; the path then ends at the aligned point, and the velocity
        contains no rotation.
    energy : float
        Energy of the path: about the squared norm of the velocity.
    end_error : float
        Largest difference between the exponential of the velocity and the point, in units of the
        points, after a rigid alignment if the metric ignores rotations; infinite if the exponential
        ends early.
    n_iterations, n_evaluations, status, message
        See `Result`, for path, velocity and exponential.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.DiscreteLogarithm(n_steps=4).solve(metric, [2.0, 0.0], [0.0, 0.0]).converged
    True
    """

    tangent_vec: TangentVectors
    path: Points
    energy: float
    end_error: float = np.nan

    def points_to_draw(self) -> Points:
        return self.path


@checked(
    basis=a_basis,
    n_steps=whole(minimum=1),
    geodesic_solver=a_solver,
    tolerance=positive,
    max_iter=whole(minimum=1),
    n_doublings=whole(minimum=0),
    end_tolerance=positive,
)
@dataclass(frozen=True)
class DiscreteLogarithm(LogSolver):
    """log from the first step of a geodesic x₀, x₁, …, xₙ: v = n (x₁ − x₋₁)/2.

    The point x₋₁ continues the geodesic backwards by one step. The logarithm has converged if its
    inverse, the `DiscreteExponential` with the same number of steps, returns to the point.
    Otherwise, or if a step is too long for the equations, the steps are halved. Both maps differ
    from the continuous ones by a term of second order in the time step 1/n. Metrics of normals
    alone (a = 0) may not determine a logarithm between very different poses; with a small a, they
    do.

    Parameters
    ----------
    basis : DeformationBasis, optional
        The surfaces of the geodesic differ from the start only by these deformations and the
        difference of the ends. If a path that rotates limbs has at least 1 % less energy, its
        displacements are added (see `inverse`). By default all coordinates are free.
    n_steps : int
        Steps in unit time.
    geodesic_solver : object, optional
        Solver for the path, whose steps are not halved. By default it is `BasisPath` if there is a
        basis and otherwise `PathStraightening`, both with narrow tolerances.
    tolerance, max_iter
        See `DiscreteExponential`.
    n_doublings : int
        How often the steps may be halved.
    end_tolerance : float
        Largest `end_error` of a logarithm that has converged: 0.1 mm for bodies in metres.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.DiscreteLogarithm().solve(metric, [2.0, 0.0], [0.0, 0.0]).tangent_vec.round(6)
    array([2., 0.])
    """

    basis: DeformationBasis | None = None
    n_steps: int = 10
    geodesic_solver: GeodesicSolver | None = None
    tolerance: float = 1e-8
    max_iter: int = 50
    n_doublings: int = 2
    end_tolerance: float = 1e-4

    def solve(self, metric: RiemannianMetric, point: Points, base_point: Points) -> LogarithmResult:
        start, end = check_end_points(metric, base_point, point)
        end = end_of_logarithm(metric, start, end)
        if self.geodesic_solver is not None:
            path = complete_path(self.geodesic_solver.solve(metric, start, end))
            return finish(self, self._logarithm(metric, path, end))
        with catch_warnings():
            # The exponential decides whether a path is good enough.
            simplefilter("ignore", ConvergenceWarning)
            result = self._by_doubling(metric, start, end)
        return finish(self, result)

    def inverse(self, result: LogarithmResult) -> DiscreteExponential:
        """Return the exponential that takes the velocity back to the point.

        It has the same number of steps as the path. If there is a basis, the displacements of the
        path are added to it.

        Parameters
        ----------
        result : LogarithmResult
        """
        n_steps = len(result.path) - 1
        return DiscreteExponential(
            self._joined_basis(result.path), n_steps, self.tolerance, self.max_iter, n_doublings=0
        )

    def _joined_basis(self, path: Points) -> DeformationBasis | None:
        return None if self.basis is None else self.basis.extend(path[1:] - path[0])

    def _step_before(self, metric: RiemannianMetric, path: Points) -> Triple:
        basis = self._joined_basis(path)
        equation = GeodesicEquation(metric, basis, self.tolerance, self.max_iter)
        return equation.next_point(path[1], path[0])

    def _by_doubling(
        self,
        metric: RiemannianMetric,
        start: Points,
        end: Points,
    ) -> LogarithmResult:
        """Return the logarithm with the fewest steps that suffice."""
        n_evaluations, initial_path = 0, None
        for doubling in range(self.n_doublings + 1):
            n_steps = self.n_steps * 2**doubling
            is_last = doubling == self.n_doublings
            path, exact = self._search(metric, start, end, n_steps, initial_path)
            n_evaluations += path.n_evaluations
            if is_last or not self._has_long_steps(metric, path.path):
                path = exact._between(metric, ends_as_given(start, end), path.path)
                result = self._logarithm(metric, path, end)
                n_evaluations += result.n_evaluations
                if is_last or result.converged:
                    break
            initial_path = refine_path(path.path, 2 * n_steps)
        return replace(result, n_evaluations=n_evaluations)

    def _has_long_steps(self, metric: RiemannianMetric, path: Points) -> bool:
        """Return whether a step is too long, or no step before the start exists."""
        # Over a basis, only the exponential decides: it often recovers from long steps.
        if self.basis is None and has_long_step(metric, path, all_coordinates=True):
            return True
        backward = self._step_before(metric, path)
        exists = backward.error <= self.tolerance
        return not exists or bool(degeneration(metric, path[0], backward.points[2]))

    def _logarithm(
        self,
        metric: RiemannianMetric,
        path_result: PathResult,
        end: Points,
        inverse: DiscreteExponential | None = None,
    ) -> LogarithmResult:
        """Return the initial velocity of a path, tried by its exponential or a given one."""
        path = path_result.path
        if self.basis is None and metric.is_translation_invariant:
            # As the exponential moves surfaces along translations, which the metric ignores.
            path = steady_path(path, surface_space(metric.space).template.vertex_areas)
        backward = self._step_before(metric, path)
        tangent_vec = 0.5 * (len(path) - 1) * (path[1] - backward.points[2])
        result = LogarithmResult(tangent_vec, path, path_result.energy)
        forward = (inverse or self.inverse(result))._follow(metric, tangent_vec, path[0])
        reached = forward.end
        if metric.is_rotation_invariant and metric.space.is_surface_space:
            # Neither map determines rotations that the metric ignores.
            reached = procrustes(reached, end)
        end_error = float(np.abs(reached - end).max()) if forward.complete else np.inf
        if end_error <= self.end_tolerance:
            message = f"the exponential returns to the target within {end_error:.1e}"
        else:
            remedy = "use more steps"
            if metric.is_stretch_invariant:
                remedy = "the metric does not measure the sizes of triangles: add a small a"
            message = (
                f"the exponential ends {end_error:.1e} from the point in {forward.n_steps} steps; "
                f"{remedy}"
            )
        return replace(
            result,
            end_error=end_error,
            n_iterations=path_result.n_iterations + backward.n_iterations + forward.n_iterations,
            n_evaluations=path_result.n_evaluations
            + backward.n_evaluations
            + forward.n_evaluations,
            status=Status.CONVERGED if end_error <= self.end_tolerance else Status.STALLED,
            message=message,
        )

    def _search(
        self,
        metric: RiemannianMetric,
        start: Points,
        end: Points,
        n_steps: int,
        initial_path: Points | None,
    ) -> tuple[PathResult, PathSearch]:
        """Return a path with this many steps, and the solver that minimises it to the end."""
        if self.basis is None:
            loose = PathStraightening(n_steps + 1, tolerance=_LOOSE_TOLERANCE, remove_drift=False)
            path = loose._between(metric, ends_as_given(start, end), initial_path)
            return path, replace(loose, tolerance=_TOLERANCE)
        basis = self.basis.extend((end - start)[None])
        solver = BasisPath(basis, n_steps + 1, remove_drift=False)
        ends = ends_as_given(start, end)
        free = solver._between(metric, ends)
        # The exponential can follow only the part of the path in the basis.
        initial = start + basis.project(free.path - start)
        if not np.isfinite(metric.energy_and_gradient(initial)[0]):
            initial = linear_path(start, end, n_steps + 1)
        within = solver._between(metric, ends, initial)
        path = within if within.energy <= _WORTH_JOINING * free.energy else free
        joined = self.basis.extend(path.path[1:] - start)
        return path, replace(solver, basis=joined, tolerance=_TOLERANCE)
