"""Paths of least energy: over a basis of deformations, and over all coordinates."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from riemhuman.arrays import Array, Callback, Points
from riemhuman.checks import (
    a_basis,
    a_function,
    a_solver,
    checked,
    flag,
    having,
    positive,
    whole,
)
from riemhuman.errors import ArgumentError, ReparametrizationInvarianceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces
from riemhuman.geometry.strategies import GeodesicSolver, PathEnergy
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.solvers._alignment import AlignedEnds, align_ends, turn_from_template
from riemhuman.solvers._lbfgs import Operator, minimize_from
from riemhuman.solvers._preconditioners import CholeskyFactor, PathPreconditioner, metric_factor
from riemhuman.solvers.interpolated_paths import rotating_paths
from riemhuman.solvers.paths import (
    PathSolver,
    SegmentEnergy,
    check_end_points,
    check_initial_path,
    known_path,
    linear_path,
    lower_bound,
    rounding_energy,
)
from riemhuman.solvers.results import PathResult, Status, finish
from riemhuman.surfaces.deformation_basis import DeformationBasis

# Tolerance of the first runs from several starts, of which the best goes on to the end.
_FIRST_TOLERANCE = 1e-3

# Weight of the Dirichlet energy in the preconditioner of surfaces: fewest iterations on the open
# bodies, under metrics with and without a and c; a third or three times as much costs some more.
_STIFFNESS = 0.2

# Steps over all vertices, as shares of a full one, so short that the slope no longer predicts the
# energy, as where a triangle loses its area and its normal jumps.
_SHORT = 1e-3

# Least and largest ridge; the tolerance lies between. A ridge hides how softly whole limbs move,
# increasingly so on finer meshes. What such motions still gain matters only to narrow tolerances.
_LEAST_RIDGE, _LARGEST_RIDGE = 1e-6, 1e-4


@checked(
    n_nodes=whole(minimum=2),
    energy=having("an energy such as SegmentEnergy()", "value", "value_and_gradient"),
    initial=a_solver,
    tolerance=positive,
    max_iter=whole(minimum=1),
    remove_drift=flag,
    callback=a_function,
    progress=flag,
)
@dataclass(frozen=True)
class PathSearch(PathSolver):
    """What searches for paths of least energy have in common."""

    n_nodes: int = 11
    energy: PathEnergy = SegmentEnergy()
    initial: GeodesicSolver | None = None
    tolerance: float = 1e-4
    max_iter: int = 1000
    remove_drift: bool = True
    callback: Callback | None = None
    progress: bool = False

    # The share of the energy that the second half of many iterations may have gained at the end,
    # and the least such share in units of the tolerance.
    _recent_decrease: ClassVar[float]
    _recent_tolerances: ClassVar[float]

    def solve(
        self,
        metric: RiemannianMetric,
        start: Points,
        end: Points,
        initial_path: Points | None = None,
    ) -> PathResult:
        r"""Find a path of least energy.

        Parameters
        ----------
        metric : RiemannianMetric
        start, end : array, shape (\*shape,)
        initial_path : array, shape (n_nodes, \*shape), optional
            Path to start from, between the same ends.
        """
        start, end = check_end_points(metric, start, end)
        ends = align_ends(metric, start, end)
        return self._turned_like(metric, ends)._between(metric, ends, initial_path)

    def _turned_like(self, metric: RiemannianMetric, ends: AlignedEnds) -> Self:
        """Return the search among deformations that stand as the ends do."""
        return self

    def _between(
        self, metric: RiemannianMetric, ends: AlignedEnds, initial_path: Points | None = None
    ) -> PathResult:
        """Find a path between ends that are aligned, or that are used as given."""
        start, end = ends.start, ends.given_end
        self._check_search(metric, start, end)
        search = self._reporting(ends)
        with single_threaded_libraries():
            if self.n_nodes == 2:
                path = linear_path(start, end, 2)
                return known_path(metric, path, "a single segment", 0.0, self.energy)
            if initial_path is None:
                result = search._best_of(metric, self._starts(metric, start, ends.end))
            else:
                path = check_initial_path(metric, start, end, self.n_nodes, initial_path)
                result = search._descend(metric, ends.aligned(path))
            path = ends.turned_back(result.path)
            result = replace(result, path=path, lower_bound=lower_bound(metric, path))
        return finish(self, result)

    def _reporting(self, ends: AlignedEnds) -> Self:
        """Return the search with a callback that receives paths between the ends as given."""
        callback = self.callback
        if callback is None or not ends.are_moved:
            return self

        def report(iteration: int, energy: float, path: Points) -> None:
            callback(iteration, energy, ends.turned_back(path))

        return replace(self, callback=report)

    @property
    @abstractmethod
    def _directions(self) -> Array | None:
        """Deformations that interior points may move along, shape (K, n); None frees all."""

    @abstractmethod
    def _check_search(self, metric: RiemannianMetric, start: Points, end: Points) -> None:
        """Raise an error or warn if a search makes no sense."""

    @abstractmethod
    def _factor(self, metric: RiemannianMetric, path: Points) -> CholeskyFactor:
        """Return a factor of the metric's matrix in the coordinates of the interior points."""

    def _starts(self, metric: RiemannianMetric, start: Points, end: Points) -> list[Array]:
        """Return the start of least energy, and starts in which a limb rotates the other way."""
        starts = [linear_path(start, end, self.n_nodes)]
        alternatives: list[Array] = []
        if metric.space.is_surface_space and np.all(metric.space.belongs(np.stack([start, end]))):
            rotating = rotating_paths(metric, self.energy, start, end, self.n_nodes)
            starts.append(rotating[0].path)
            alternatives = [rival.path for rival in rotating[1:]]
        if self.initial is not None:
            starts.append(self._initial_path(self.initial, metric, start, end))
            alternatives = []
        starts = [_on_manifold(metric, path) for path in starts]
        best = min(starts, key=lambda path: _energy(metric, self.energy, path))
        return [best, *alternatives]

    def _initial_path(
        self, solver: GeodesicSolver, metric: RiemannianMetric, start: Points, end: Points
    ) -> Array:
        path = solver.solve(metric, start, end).path
        return check_initial_path(metric, start, end, self.n_nodes, path)

    def _best_of(self, metric: RiemannianMetric, paths: list[Array]) -> PathResult:
        """Search from the start that reaches the least energy in a short run."""
        if len(paths) == 1:
            return self._descend(metric, paths[0])
        tolerance = max(_FIRST_TOLERANCE, self.tolerance)
        short = replace(self, tolerance=tolerance, callback=None)
        results: list[PathResult] = []
        for path in paths:
            results.append(short._descend(metric, path))
            if results[-1].status is Status.INTERRUPTED:
                break
        best = min(results, key=lambda result: result.energy)
        if results[-1].status is Status.INTERRUPTED:
            return replace(best, status=results[-1].status, message=results[-1].message)
        result = self._descend(metric, best.path, best.energies[:-1])
        n_evaluations = result.n_evaluations + sum(candidate.n_evaluations for candidate in results)
        return replace(result, n_evaluations=n_evaluations)

    def _descend(
        self, metric: RiemannianMetric, path: Points, earlier: Array | tuple[()] = ()
    ) -> PathResult:
        """Minimise over the interior points of a path."""
        path = _on_manifold(metric, path)
        directions = self._directions
        over_all = directions is None

        def energy(nodes: Array) -> tuple[float, Array]:
            if over_all and not np.all(metric.space.belongs(nodes)):
                return np.inf, np.zeros_like(nodes)
            value, gradient = self.energy.value_and_gradient(metric, _with_interior(path, nodes))
            return value, gradient[1:-1]

        def inverse_hessian_at(nodes: Array) -> Operator:
            factor = self._factor(metric, _with_interior(path, nodes))
            return PathPreconditioner(factor, len(nodes) + 1)

        def report(iteration: int, value: float, nodes: Array) -> None:
            if self.callback is not None:
                self.callback(iteration, value, _with_interior(path, nodes))

        # The energy of a constant path with rounding errors.
        rounding = max(rounding_energy(metric, point, self.energy) for point in path[[0, -1]])
        minimum = minimize_from(
            path[1:-1],
            metric.space,
            directions,
            energy,
            inverse_hessian_at,
            report if self.callback else None,
            tolerance=self.tolerance,
            max_iter=self.max_iter,
            recent_decrease=max(self._recent_decrease, self._recent_tolerances * self.tolerance),
            shortest=_SHORT if over_all and metric.space.is_surface_space else 0.0,
            floor=(len(path) - 1) ** 2 * rounding,
            earlier=earlier,
            progress="geodesic" if self.progress else "",
        )
        if not np.isfinite(minimum.value):
            if holds_surfaces(metric.space):
                metric.space.check_immersed(path, "the initial path")
            raise ArgumentError(
                "the initial path leaves the manifold or has no finite energy; pass another "
                "initial_path"
            )
        minimal_path = _with_interior(path, minimum.x)
        if self.remove_drift:
            still = metric.remove_drift(minimal_path)
            # A triangle that is nearly flat may become flat by the rounding of a rotation.
            minimal_path = still if np.all(metric.space.belongs(still)) else minimal_path
        gap = 100.0 * minimum.gap / minimum.value if minimum.value > 0 else 0.0
        return PathResult(minimal_path, minimum.value, minimum.values, gap=gap, **minimum.outcome)


@dataclass(frozen=True)
class _OverBasis:
    """The basis of a search: its first parameter, as fields of the last base come first."""

    basis: DeformationBasis


@checked(basis=a_basis)
@dataclass(frozen=True)
class BasisPath(PathSearch, _OverBasis):
    r"""Paths of least energy over a basis, without exponential map: Algorithm 1 of the paper.

    .. math:: f(t_i) = l(t_i) + \sum_j \alpha_{ij} \mathcal{D}_j

    for every interior time (corrected: α has one block for each of them). In the paper, l is the
    straight path (1 − t) f₀ + t f₁ (corrected), which you get with ``initial=LinearPath(n_nodes)``.
    By default, l is the path that rotates every triangle (`PoissonPath`) if that has less energy,
    so that limbs bend instead of shrinking. A quasi-Newton method, preconditioned by the metric's
    Gram matrix on the basis, finds α.

    If the metric ignores rotations and translations (`is_rotation_invariant`), the end is first
    aligned with the start, and the deformations are turned as both stand against the template. The
    resulting path is turned back uniformly to the given end, which does not change its energy, the
    sum of the squared distances between its points: energies do not depend on how ends are turned.

    Parameters
    ----------
    basis : DeformationBasis
        Deformations D_j.
    n_nodes : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy to minimise.
    initial : GeodesicSolver, optional
        Solver for l, with the same number of times. By default `PoissonPath` or `LinearPath`,
        whichever path has less energy.
    tolerance : float
        The search stops when a Newton step would gain at most this share of the energy, estimated
        from the preconditioned gradient. After ten iterations or more, the second half of them must
        also have gained at most 0.1 %, or ten times this share.
    max_iter : int
    remove_drift : bool
        Whether to remove motions that leave the energy unchanged from the result, such as rigid
        motions of interior surfaces if c = 0.
    callback : callable, optional
        Called with (iteration, energy, path) after each iteration.
    progress : bool

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.AlignedSurfaces(bodies.template).metric
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> rh.solvers.BasisPath(basis, n_nodes=5).solve(metric, bodies[0], bodies[2]).path.shape
    (5, 1202, 3)
    """

    _recent_decrease = 1e-3
    _recent_tolerances = 10.0

    @property
    def _directions(self) -> Array:
        return self.basis.flat

    def _turned_like(self, metric: RiemannianMetric, ends: AlignedEnds) -> Self:
        # Deformations lie in space as the template does.
        turn = turn_from_template(metric, ends)
        if np.array_equal(turn, np.eye(3)):
            return self
        return replace(self, basis=DeformationBasis(self.basis.vectors @ turn))

    def _check_search(self, metric: RiemannianMetric, start: Points, end: Points) -> None:
        self.basis.check_fits(start.shape[0])

    def _starts(self, metric: RiemannianMetric, start: Points, end: Points) -> list[Array]:
        if self.initial is not None:
            return [self._initial_path(self.initial, metric, start, end)]
        return super()._starts(metric, start, end)

    def _factor(self, metric: RiemannianMetric, path: Points) -> CholeskyFactor:
        nodes = path[[1, -2]]
        if not np.all(metric.space.belongs(nodes)):
            # A triangle has vanished on the way, which can happen if λ is small.
            nodes = path[[0, -1]]
        return metric_factor(metric, nodes, directions=self.basis.flat)


@checked()
@dataclass(frozen=True)
class PathStraightening(PathSearch):
    """Paths of least energy in all coordinates of all interior points, on any manifold.

    Coordinates are the entries of the arrays; `projection` maps them back to the manifold, and
    steps that leave it (`belongs`) are rejected. Ends are aligned as by `BasisPath`. The
    minimisation is L-BFGS with the inverse of the metric's matrix, averaged over the path, as its
    first inverse Hessian; it starts as `BasisPath` does, and tries both directions if a limb may
    rotate in either. Its energies are never higher than those of `BasisPath` with
    ``initial=BasisPath(...)``.

    If surfaces can slide along themselves at no cost, their meshes crumple; a
    `ReparametrizationInvarianceWarning` says so.

    Parameters
    ----------
    n_nodes, energy
        See `BasisPath`.
    initial : GeodesicSolver, optional
        Solver whose path, with the same number of nodes, is used as another start.
    tolerance : float
        See `BasisPath`; the second half of the iterations must have gained at most 0.2 %, or twenty
        times this share.
    max_iter, remove_drift, callback, progress
        See `BasisPath`.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> result = rh.solvers.PathStraightening(n_nodes=5).solve(metric, [0.0, 0.0], [1.0, 1.0])
    >>> round(result.energy, 6)
    2.0
    """

    _recent_decrease = 2e-3
    _recent_tolerances = 20.0

    @property
    def _directions(self) -> None:
        return None

    def _check_search(self, metric: RiemannianMetric, start: Points, end: Points) -> None:
        if metric.is_reparametrization_invariant and not np.array_equal(start, end):
            warn(
                f"under {metric!r}, surfaces can slide along themselves at no cost. If all "
                "vertices are free, the meshes of a path crumple, and its energy keeps falling. "
                "Search over smooth deformations, as "
                "BasisPath(DeformationBasis.from_laplacian(template)) does",
                ReparametrizationInvarianceWarning,
            )

    def _factor(self, metric: RiemannianMetric, path: Points) -> CholeskyFactor:
        ridge = float(np.clip(self.tolerance, _LEAST_RIDGE, _LARGEST_RIDGE))
        nodes = path[1:-1]
        return metric_factor(metric, nodes, stiffness=_STIFFNESS, ridge=ridge, single=True)


def refine_path(path: Points, n_segments: int) -> Array:
    """Return a path at other times, by a spline."""
    from scipy.interpolate import make_interp_spline  # takes long to import

    known = np.linspace(0.0, 1.0, len(path))
    spline = make_interp_spline(known, path, k=min(3, len(path) - 1))
    refined: Points = spline(np.linspace(0.0, 1.0, n_segments + 1))
    refined[[0, -1]] = path[[0, -1]]
    return refined


def _with_interior(path: Points, nodes: Array) -> Array:
    moved = path.copy()
    moved[1:-1] = nodes
    return moved


def _on_manifold(metric: RiemannianMetric, path: Points) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return _with_interior(path, metric.space.projection(path[1:-1]))


def _energy(metric: RiemannianMetric, energy: PathEnergy, path: Points) -> float:
    """Return the energy, infinite where the path leaves the manifold."""
    if not np.all(metric.space.belongs(path[1:-1])):
        return np.inf
    value = energy.value(metric, path)
    return value if np.isfinite(value) else np.inf
