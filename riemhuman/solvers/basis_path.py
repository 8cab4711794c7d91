"""Geodesics of aligned surfaces over a basis of deformations: Algorithm 1 of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_number, whole_number
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver, PathEnergy
from riemhuman.kernels.threads import combine_rows, pair_with_rows, single_threaded_libraries
from riemhuman.solvers.energies import SegmentEnergy
from riemhuman.solvers.many_paths import ManyPaths
from riemhuman.solvers.minimization import Minimum, minimize
from riemhuman.solvers.poisson_path import turned_paths
from riemhuman.solvers.preconditioner import CholeskyFactor, PathPreconditioner
from riemhuman.solvers.quasi_newton import Operator, descend_in_rounds, estimated_gap
from riemhuman.solvers.results import PathResult, warn_unless_converged
from riemhuman.solvers.rounding import path_floor
from riemhuman.solvers.simple_paths import (
    check_end_points,
    check_initial_path,
    linear_path,
    lower_bound,
    percentage,
)

if TYPE_CHECKING:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

METHODS = ("preconditioned", "l-bfgs-b", "bfgs")

# The share of the energy that the second half of many iterations may have gained at the end, or ten
# times as much as the tolerance.
_RECENT = 1e-3


@dataclass(frozen=True)
class BasisPath(ManyPaths):
    r"""Paths of least energy over a basis, without exponential map: Algorithm 1 of the paper.

    .. math:: f(t_i) = l(t_i) + \sum_j \alpha_{ij} \mathcal{D}_j

    for every interior time (corrected: α has one block for each of them). In the paper l is the
    straight path (1 − t) f₀ + t f₁ (corrected) and a quasi-Newton method finds α, as here with
    ``method="l-bfgs-b"`` or ``"bfgs"``. The default method differs in two ways: l is the path that
    turns every triangle (`PoissonPath`) where that has less energy, so that limbs bend instead of
    shrinking, and α is preconditioned by the metric's Gram matrix on the basis, averaged over the
    first and the last surface between the ends.

    Parameters
    ----------
    basis : DeformationBasis
        Deformations D_j.
    n_nodes : int
        Number of points of the path, both ends included.
    method : str
        "preconditioned", or "l-bfgs-b" and "bfgs", which minimise in α with SciPy's stopping tests,
        as in the paper.
    energy : PathEnergy
        Energy to minimise.
    initial : object, optional
        Solver for l, with as many times. By default `PoissonPath` or `LinearPath`, whichever path
        has less energy; `LinearPath` for SciPy's methods.
    tolerance : float
        The preconditioned method stops when a Newton step would gain at most this share of the
        energy, as far as the preconditioned gradient tells, and the second half of its iterations,
        if they are ten or more, has gained at most 0.1 %, or ten times this share.
    max_iter : int
        Most iterations.
    remove_drift : bool
        Whether to remove motions that the metric does not see from the path found, such as rigid
        motions of interior surfaces where c = 0; its energy stays the same.
    options : mapping
        More options of SciPy's minimiser, for its methods.
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
    method: str = "preconditioned"
    energy: PathEnergy = SegmentEnergy()
    initial: GeodesicSolver | None = None
    tolerance: float = 1e-4
    max_iter: int = 1000
    remove_drift: bool = True
    options: Mapping[str, Any] = field(default_factory=dict, hash=False)
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        whole_number(self.n_nodes, "n_nodes", minimum=2)
        whole_number(self.max_iter, "max_iter", minimum=1)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        one_of(self.method, "method", METHODS)

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
        start, end : array, shape (V, 3)
            Surfaces f₀ and f₁.
        initial_path : array, shape (n_nodes, V, 3), optional
            Path l between the same ends, for a warm start.

        Raises
        ------
        ArgumentError
            If the end points or the basis do not fit the metric's space or each other, or the
            initial path has other ends or no finite energy.
        DegenerateSurfaceError
            If a triangle of an end point, or of the path that another method starts on, has no
            area.

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
            found = []
            for line in lines:
                found.append((line, self._descend(metric, line)))
                if found[-1][1].interrupted:
                    break
        line, minimum = min(found, key=lambda pair: pair[1].value)
        path = self._path(line, minimum.x.reshape(self.n_nodes - 2, len(self.basis)))
        last = found[-1][1]
        result = PathResult(
            metric.remove_drift(path) if self.remove_drift and self.n_nodes > 2 else path,
            minimum.value,
            minimum.values,
            lower_bound(metric, line),
            percentage(minimum.gap, minimum.value),
            n_iterations=minimum.n_iterations,
            n_evaluations=sum(other.n_evaluations for _, other in found),
            converged=minimum.converged and not last.interrupted,
            message=last.message if last.interrupted else minimum.message,
        )
        warn_unless_converged(self, result)
        return result

    def _default_initial_paths(
        self, metric: RiemannianMetric, start: ndarray, end: ndarray
    ) -> list[ndarray]:
        straight = linear_path(start, end, self.n_nodes)
        if self.method != "preconditioned":
            if not np.all(metric.space.belongs(straight[1:-1])):
                raise DegenerateSurfaceError(
                    f"method={self.method!r} starts on the straight path, on which a surface has a "
                    "triangle without area, as where a body turns by half a turn; pass "
                    f"initial=PoissonPath({self.n_nodes}), or leave the method at 'preconditioned'"
                )
            return [straight]
        turned = turned_paths(metric, self.energy, start, end, self.n_nodes)
        # The gradient is not needed, but found where surfaces that are flat have no energy.
        energy, _ = self.energy.value_and_gradient(metric, straight)
        # Half a turn of the body flattens the middle of the straight path, at little cost.
        if energy <= turned[0][1] and np.all(metric.space.belongs(straight[1:-1])):
            return [straight]
        return [path for path, _ in turned]

    def _descend(self, metric: RiemannianMetric, line: ndarray) -> Minimum:
        """Minimise the energy from a path."""
        energy, gradient = self.energy.value_and_gradient(metric, line)
        if not np.isfinite(energy):
            self.energy.value(metric, line)  # names the triangle, if the metric can
            raise ArgumentError(
                "the initial path has no finite energy: a surface on it has a triangle "
                "without area; pass another initial_path"
            )
        if self.n_nodes == 2:
            nothing = np.zeros(0)
            message = "a single segment"
            return Minimum(
                nothing, energy, np.array([energy]), n_evaluations=1, message=message, gap=0.0
            )
        return self._minimize(metric, line, energy, gradient)

    def _minimize(
        self, metric: RiemannianMetric, line: ndarray, line_energy: float, line_gradient: ndarray
    ) -> Minimum:
        """Return the coefficients α of least energy, all in one row."""
        shape = self.n_nodes - 2, len(self.basis)
        start = np.zeros(shape[0] * shape[1])

        def energy(coefficients: ndarray) -> tuple[float, ndarray]:
            if coefficients.any():
                path = self._path(line, coefficients.reshape(shape))
                value, gradient = self.energy.value_and_gradient(metric, path)
            else:
                value, gradient = line_energy, line_gradient
            along = gradient[1:-1].reshape(len(line) - 2, -1)
            return value, pair_with_rows(along, self.basis.flat).ravel()

        def inverse_hessian_at(coefficients: ndarray) -> Operator:
            nodes = self._path(line, coefficients.reshape(shape))[[1, -2]]
            if not np.all(metric.space.belongs(nodes)):
                # A triangle has vanished on the way, as it may at a small λ.
                nodes = line[[0, -1]]
            gram = metric.gram_matrix(self.basis.vectors, nodes)
            hessian = PathPreconditioner(CholeskyFactor(gram), len(line) - 1)
            return lambda slope: hessian.inverse(slope.reshape(shape)).ravel()

        def report(iteration: int, value: float, coefficients: ndarray) -> None:
            if self.callback is not None:
                self.callback(iteration, value, self._path(line, coefficients.reshape(shape)))

        settings: dict[str, Any] = {
            "max_iter": self.max_iter,
            "floor": path_floor(metric, self.energy, line),
            "callback": report,
            "progress": self.progress,
            "description": "geodesic",
        }
        if self.method == "preconditioned":
            return descend_in_rounds(
                energy,
                start,
                inverse_hessian_at,
                expected_decrease=self.tolerance,
                recent_decrease=max(_RECENT, 10.0 * self.tolerance),
                **settings,
            )
        method = self.method.upper()
        found = minimize(energy, start, method=method, options=self.options, **settings)
        _, slope = energy(found.x)
        newton = 0.5 * float(slope @ inverse_hessian_at(found.x)(slope))
        return replace(
            found,
            gap=estimated_gap(newton, found.values),
            n_evaluations=found.n_evaluations + bool(found.x.any()),
        )

    def _path(self, line: ndarray, coefficients: ndarray) -> ndarray:
        path = line.copy()
        path[1:-1] += combine_rows(coefficients, self.basis.flat).reshape(path[1:-1].shape)
        return path
