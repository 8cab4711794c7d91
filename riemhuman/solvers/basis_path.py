"""Geodesics of aligned surfaces over a basis of deformations: Algorithm 1 of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver, PathEnergy
from riemhuman.kernels.threads import combine_rows, pair_with_rows, single_threaded_libraries
from riemhuman.solvers._lbfgs import LBFGS, Minimum, Operator
from riemhuman.solvers._preconditioners import CholeskyFactor, PathPreconditioner
from riemhuman.solvers.interpolated_paths import rotating_paths
from riemhuman.solvers.paths import (
    PathSolver,
    SegmentEnergy,
    check_end_points,
    check_initial_path,
    linear_path,
    lower_bound,
    path_floor,
    percentage,
)
from riemhuman.solvers.results import PathResult, Status, finish

if TYPE_CHECKING:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

# The share of the energy that the second half of many iterations may have gained at the end, or ten
# times as much as the tolerance.
_RECENT = 1e-3


@dataclass(frozen=True)
class BasisPath(PathSolver):
    r"""Paths of least energy over a basis, without exponential map: Algorithm 1 of the paper.

    .. math:: f(t_i) = l(t_i) + \sum_j \alpha_{ij} \mathcal{D}_j

    for every interior time (corrected: α has one block for each of them). In the paper l is the
    straight path (1 − t) f₀ + t f₁ (corrected), as here with ``initial=LinearPath(n_nodes)``. By
    default l is the path that rotates every triangle (`PoissonPath`) where that has less energy, so
    that limbs bend instead of shrinking. A quasi-Newton method finds α, preconditioned by the
    metric's Gram matrix on the basis, averaged over the first and the last surface between the
    ends.

    Parameters
    ----------
    basis : DeformationBasis
        Deformations D_j.
    n_nodes : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy to minimise.
    initial : GeodesicSolver, optional
        Solver for l, with as many times. By default `PoissonPath` or `LinearPath`, whichever path
        has less energy.
    tolerance : float
        The search stops when a Newton step would gain at most this share of the energy, as far as
        the preconditioned gradient tells, and the second half of its iterations, if they are ten or
        more, has gained at most 0.1 %, or ten times this share.
    max_iter : int
        Most iterations.
    remove_drift : bool
        Whether to remove motions that leave the energy unchanged from the path found, such as rigid
        motions of interior surfaces where c = 0.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration.
    progress : bool
        Whether to show a progress bar.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> result = rh.solvers.BasisPath(basis, n_nodes=5).solve(metric, bodies[0], bodies[2])
    >>> result.path.shape, bool(result.energy >= metric.squared_dist(bodies[0], bodies[2]))
    ((5, 1202, 3), True)
    """

    basis: DeformationBasis
    n_nodes: int = 11
    energy: PathEnergy = SegmentEnergy()
    initial: GeodesicSolver | None = None
    tolerance: float = 1e-4
    max_iter: int = 1000
    remove_drift: bool = True
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        whole_number(self.n_nodes, "n_nodes", minimum=2)
        whole_number(self.max_iter, "max_iter", minimum=1)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)

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
        initial_path : array, shape (n_nodes, V, 3), optional
            Path l between the same ends, for a warm start.

        Returns
        -------
        PathResult

        Raises
        ------
        ArgumentError
            If the end points or the basis do not fit the metric's space or each other, or the
            initial path has other ends or no finite energy.
        DegenerateSurfaceError
            If a triangle of an end point has no area.
        Interrupted
            If it is interrupted from the keyboard, with the best result so far.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        start, end = check_end_points(metric, start, end)
        self.basis.check_fits(start.shape[0])
        if initial_path is None and self.initial is not None:
            initial_path = self.initial.solve(metric, start, end).path
        with single_threaded_libraries():
            if initial_path is None:
                lines = self._default_initial_paths(metric, start, end)
            else:
                lines = [check_initial_path(metric, start, end, self.n_nodes, initial_path)]
            minima: list[Minimum] = []
            for line in lines:
                minima.append(self._minimize(metric, line))
                if minima[-1].status is Status.INTERRUPTED:
                    break
        best = min(range(len(minima)), key=lambda k: minima[k].value)
        line, minimum, last = lines[best], minima[best], minima[-1]
        if last.status is Status.INTERRUPTED:
            minimum = replace(minimum, status=last.status, message=last.message)
        path = self._path(line, minimum.x)
        result = PathResult(
            metric.remove_drift(path) if self.remove_drift and self.n_nodes > 2 else path,
            minimum.value,
            minimum.values,
            lower_bound(metric, line),
            percentage(minimum.gap, minimum.value),
            n_iterations=minimum.n_iterations,
            n_evaluations=sum(each.n_evaluations for each in minima),
            status=minimum.status,
            message=minimum.message,
        )
        return finish(self, result)

    def _default_initial_paths(
        self, metric: RiemannianMetric, start: ndarray, end: ndarray
    ) -> list[ndarray]:
        straight = linear_path(start, end, self.n_nodes)
        rotating = rotating_paths(metric, self.energy, start, end, self.n_nodes)
        # Unlike `value`, this is infinite for flat surfaces, and raises no error.
        energy, _ = self.energy.value_and_gradient(metric, straight)
        # Half a rotation of the body flattens the middle of the straight path, at little cost.
        if energy <= rotating[0][1] and np.all(metric.space.belongs(straight[1:-1])):
            return [straight]
        return [path for path, _ in rotating]

    def _minimize(self, metric: RiemannianMetric, line: ndarray) -> Minimum:
        """Return the coefficients α of least energy, all in one row."""
        line_energy, line_gradient = self.energy.value_and_gradient(metric, line)
        if not np.isfinite(line_energy):
            self.energy.value(metric, line)  # names the triangle, if the metric can
            raise ArgumentError(
                "the initial path has no finite energy: a surface on it has a triangle "
                "without area; pass another initial_path"
            )
        shape = self.n_nodes - 2, len(self.basis)
        start = np.zeros(shape[0] * shape[1])
        if self.n_nodes == 2:
            values = np.array([line_energy])
            message = "a single segment"
            return Minimum(start, line_energy, values, 0.0, n_evaluations=1, message=message)

        def energy(coefficients: ndarray) -> tuple[float, ndarray]:
            if coefficients.any():
                path = self._path(line, coefficients)
                value, gradient = self.energy.value_and_gradient(metric, path)
            else:
                value, gradient = line_energy, line_gradient
            along = gradient[1:-1].reshape(len(line) - 2, -1)
            return value, pair_with_rows(along, self.basis.flat).ravel()

        def inverse_hessian_at(coefficients: ndarray) -> Operator:
            nodes = self._path(line, coefficients)[[1, -2]]
            if not np.all(metric.space.belongs(nodes)):
                # A triangle has vanished on the way, as it may at a small λ.
                nodes = line[[0, -1]]
            gram = metric.gram_matrix(self.basis.vectors, nodes)
            hessian = PathPreconditioner(CholeskyFactor(gram), len(line) - 1)
            return lambda slope: hessian.inverse(slope.reshape(shape)).ravel()

        def report(iteration: int, value: float, coefficients: ndarray) -> None:
            if self.callback is not None:
                self.callback(iteration, value, self._path(line, coefficients))

        minimizer = LBFGS(
            self.tolerance,
            self.max_iter,
            max(_RECENT, 10.0 * self.tolerance),
            callback=report,
            progress="geodesic" if self.progress else "",
        )
        floor = path_floor(metric, self.energy, line)
        return minimizer.minimize(energy, start, inverse_hessian_at, floor=floor)

    def _path(self, line: ndarray, coefficients: ndarray) -> ndarray:
        path = line.copy()
        rows = coefficients.reshape(len(line) - 2, len(self.basis))
        path[1:-1] += combine_rows(rows, self.basis.flat).reshape(path[1:-1].shape)
        return path
