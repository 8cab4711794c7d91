"""Default strategies of metrics.

On surfaces they search over smooth deformations of the template: over all vertices, metrics that
measure no bending crumple a mesh. `exp` and `log` make as many steps over the same deformations and
the velocity, so that each undoes the other: ten, or up to eighty where λ is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from warnings import catch_warnings, simplefilter

from riemhuman.arrays import Points
from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces
from riemhuman.geometry.strategies import LogSolver
from riemhuman.solvers._alignment import end_of_logarithm, ends_as_given
from riemhuman.solvers._geodesic_equation import has_long_step
from riemhuman.solvers.exponential import DiscreteExponential
from riemhuman.solvers.logarithm import DiscreteLogarithm, LogarithmResult
from riemhuman.solvers.parallel_transport import PoleLadder
from riemhuman.solvers.path_search import BasisPath, PathStraightening
from riemhuman.solvers.paths import LinearPath, linear_path
from riemhuman.solvers.results import finish
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.template import Template

__all__ = ["exp_solver", "geodesic_solver", "log_solver", "transport_solver"]

# Deformations of a body: with more, `exp` of metrics without bending stops on the way.
_N_DEFORMATIONS = 60

# Smaller meshes hardly have more deformations.
_FEWEST_VERTICES = 200

_N_STEPS = 10

# At λ = 1e-4 two people in one pose need 20 or 40 steps, two poses 80.
_N_DOUBLINGS = 3

# Of paths whose first step is a velocity.
_TOLERANCE = 1e-10


def basis_of(metric: RiemannianMetric) -> DeformationBasis | None:
    """Return smooth deformations of surfaces; None where all coordinates are free."""
    space = metric.space
    if not holds_surfaces(space) or space.template.n_vertices < _FEWEST_VERTICES:
        return None
    return _harmonics(space.template)


@lru_cache(maxsize=4)
def _harmonics(template: Template) -> DeformationBasis:
    return DeformationBasis.from_laplacian(template, _N_DEFORMATIONS)


def geodesic_solver(metric: RiemannianMetric) -> BasisPath | PathStraightening:
    """Return a search over smooth deformations, or over all coordinates of small meshes."""
    basis = basis_of(metric)
    return BasisPath(basis) if basis is not None else PathStraightening()


def exp_solver(metric: RiemannianMetric) -> DiscreteExponential:
    """Return discrete steps over the same deformations."""
    return DiscreteExponential(basis_of(metric), _N_STEPS, n_doublings=_N_DOUBLINGS)


@dataclass(frozen=True)
class _Logarithm(LogSolver):
    """The logarithm over some deformations and the difference of the ends, that `exp` undoes."""

    basis: DeformationBasis

    def solve(self, metric: RiemannianMetric, point: Points, base_point: Points) -> LogarithmResult:
        point = end_of_logarithm(metric, base_point, point)
        basis = self.basis.extend((point - base_point)[None])
        for doubling in range(_N_DOUBLINGS + 1):
            n_nodes = _N_STEPS * 2**doubling + 1
            is_last = doubling == _N_DOUBLINGS
            path = linear_path(base_point, point, n_nodes)
            if not is_last and has_long_step(metric, path, all_coordinates=False):
                continue
            # From paths that rotate limbs it would leave the deformations that the exponential
            # knows.
            straight = LinearPath(n_nodes)
            search = BasisPath(
                basis, n_nodes, initial=straight, tolerance=_TOLERANCE, remove_drift=False
            )
            solver = DiscreteLogarithm(basis, n_nodes - 1)
            with catch_warnings():
                simplefilter("ignore", ConvergenceWarning)
                path_between = search._between(metric, ends_as_given(base_point, point))
            result = solver._logarithm(metric, path_between, point, exp_solver(metric))
            if result.converged:
                break
        return finish(solver, result)


def log_solver(metric: RiemannianMetric) -> LogSolver:
    """Return the logarithm that `exp_solver` undoes."""
    basis = basis_of(metric)
    if basis is None:
        return DiscreteLogarithm(None, _N_STEPS, n_doublings=_N_DOUBLINGS)
    return _Logarithm(basis)


def transport_solver(metric: RiemannianMetric) -> PoleLadder:
    """Return pole ladders along paths of `geodesic_solver`."""
    return PoleLadder(basis=basis_of(metric), geodesic_solver=geodesic_solver(metric))
