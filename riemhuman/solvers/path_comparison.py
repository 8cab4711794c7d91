"""Many paths measured: comparisons of solvers (section 5.2), and tables of path lengths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Points, PointsLike
from riemhuman.checks import length_of, real_array
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import surface_space
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.representation import Record
from riemhuman.solvers.path_search import PathSearch
from riemhuman.solvers.paths import solve_pairs
from riemhuman.solvers.results import PathResult, Result, Status, complete_path
from riemhuman.surfaces.measures import edge_lengths, signed_volume, triangle_areas

# Share of an energy by which another path must be lower to count as lower: more than rounding.
_LOWER = 1e-9


class Distortion(NamedTuple):
    """A summary of the distortions of all triangles or edges; the mean is weighted."""

    largest: float
    quantile_99: float
    mean: float


@dataclass(frozen=True, repr=False)
class PathComparison(Record):
    """One of the paths compared: its energies, and how much it distorts surfaces.

    Changes are relative, and beyond those between the ends: for sizes A(τ) with ends A₀, A₁ the
    maximum over τ of A(τ)/max(A₀, A₁) − 1, min(A₀, A₁)/A(τ) − 1 and 0.

    Attributes
    ----------
    name, metric : str
        Names of the solver and of its metric.
    result : PathResult
    seconds : float
        Wall time, including compilation at first use.
    energies : dict of str to float
        Energy under each metric.
    area_change, edge_change : Distortion
        Largest change, 99 % quantile and mean of the triangles' areas, and of the edges' lengths;
        means are weighted by areas and lengths of the template.
    volume_change : float
        Change of the volume; NaN if the mesh is not closed.
    mean_deviation, max_deviation : float
        Distance of the vertices from those of the reference, millimetres; NaN without one.
    starts : tuple of str
        Names of the paths from which `compare_metrics` started and continued the search; empty for
        other paths.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metrics = {"elastic": rh.AlignedSurfaces(bodies.template).metric}
    >>> solvers = {"straight": (rh.solvers.LinearPath(n_nodes=5), "elastic")}
    >>> rh.solvers.compare_paths(metrics, bodies[0], bodies[2], solvers)[0].name
    'straight'
    """

    name: str
    metric: str
    result: PathResult
    seconds: float
    energies: dict[str, float]
    area_change: Distortion
    edge_change: Distortion
    volume_change: float
    mean_deviation: float
    max_deviation: float
    starts: tuple[str, ...] = ()

    def as_row(self) -> dict[str, str | float]:
        """Return everything but the path, by name, for a table."""
        row: dict[str, str | float] = {"name": self.name, "metric": self.metric}
        row |= {f"energy_{name}": value for name, value in self.energies.items()}
        for label, change in (("area", self.area_change), ("edge", self.edge_change)):
            row |= {f"{label}_change_{key}": value for key, value in change._asdict().items()}
        return row | {
            "volume_change": self.volume_change,
            "mean_deviation": self.mean_deviation,
            "max_deviation": self.max_deviation,
            "starts": ", then ".join(self.starts),
            "n_iterations": self.result.n_iterations,
            "converged": self.result.converged,
            "seconds": self.seconds,
        }


def compare_paths(
    metrics: Mapping[str, RiemannianMetric],
    start: Points,
    end: Points,
    solvers: Mapping[str, tuple[GeodesicSolver, str]],
    reference: Array | None = None,
) -> list[PathComparison]:
    """Find paths between two surfaces with several solvers, and measure them in the same way.

    Every solver has its own start and tolerance; to compare metrics alone, see `compare_metrics`.

    Parameters
    ----------
    metrics : mapping of str to RiemannianMetric
        Metrics on the same surfaces; every path's energy is measured under each.
    start, end : array, shape (V, 3)
    solvers : mapping of str to (solver, str)
        Each solver with the name of its metric, such as ``{"basis": (BasisPath(basis), "elastic"),
        "straight": (LinearPath(), "elastic")}``.
    reference : array, shape (n_nodes, V, 3), optional
        Path from which deviations are measured, such as the motion of the body model.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metrics = {"elastic": rh.AlignedSurfaces(bodies.template).metric}
    >>> solvers = {"straight": (rh.solvers.LinearPath(n_nodes=5), "elastic")}
    >>> rows = rh.solvers.compare_paths(metrics, bodies[0], bodies[2], solvers)
    >>> [(row.name, row.metric) for row in rows]
    [('straight', 'elastic')]
    """
    compared = []
    for name, (solver, metric_name) in solvers.items():
        began = perf_counter()
        result = complete_path(solver.solve(metrics[metric_name], start, end))
        seconds = perf_counter() - began
        compared.append(_measured(name, metric_name, result, seconds, metrics, reference))
    return compared


def compare_metrics(
    metrics: Mapping[str, RiemannianMetric],
    search: PathSearch,
    paths: Sequence[PathComparison],
    initial: str,
    reference: Array | None = None,
) -> list[PathComparison]:
    """Find a path under each metric, all with the same search and from the same path.

    In `compare_paths`, every search may start from a different path, so the results differ by their
    starts as well as by their metrics. Here, if another path has less energy under the metric of a
    search than its result, the search continues from that path, until under every metric no path
    has less energy than the metric's own path.

    Parameters
    ----------
    metrics : mapping of str to RiemannianMetric
        Metrics on the same surfaces, those of `paths`.
    search : PathSearch
        `BasisPath` or `PathStraightening`; its own `initial` is not used.
    paths : sequence of PathComparison
        Known paths between the same surfaces, from `compare_paths`.
    initial : str
        Name of the path among them from which every search starts.
    reference : array, shape (n_nodes, V, 3), optional
        As in `compare_paths`.

    Returns
    -------
    list of PathComparison
        A path for each metric, with the name of the metric. Seconds and numbers of iterations are
        sums over all runs.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metrics = {"elastic": space.metric, "SRNF": rh.SRNFMetric(space)}
    >>> solvers = {"straight": (rh.solvers.LinearPath(n_nodes=4), "elastic")}
    >>> straight = rh.solvers.compare_paths(metrics, bodies[0], bodies[2], solvers)
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=5)
    >>> search = rh.solvers.BasisPath(basis, n_nodes=4)
    >>> rows = rh.solvers.compare_metrics(metrics, search, straight, "straight")
    >>> [(row.name, row.starts) for row in rows]
    [('elastic', ('straight',)), ('SRNF', ('straight',))]
    """
    by_name = {path.name: path for path in paths}
    compared: dict[str, PathComparison] = {}
    for name in metrics:
        compared[name] = _searched(name, search, by_name[initial], metrics, reference)
    is_settled = False
    while not is_settled:
        is_settled = True
        for name in metrics:
            best = _of_least_energy([*paths, *compared.values()], name)
            if best.energies[name] < (1.0 - _LOWER) * compared[name].energies[name]:
                compared[name] = _searched(name, search, best, metrics, reference, compared[name])
                is_settled = False
    return list(compared.values())


def _of_least_energy(rows: Sequence[PathComparison], metric_name: str) -> PathComparison:
    return min(rows, key=lambda row: row.energies[metric_name])


def _searched(
    name: str,
    search: PathSearch,
    begin: PathComparison,
    metrics: Mapping[str, RiemannianMetric],
    reference: Array | None,
    earlier: PathComparison | None = None,
) -> PathComparison:
    """Return the path of a search under a metric from a known path, after an earlier search."""
    path, began = begin.result.path, perf_counter()
    result = search.solve(metrics[name], path[0], path[-1], initial_path=path)
    seconds = perf_counter() - began
    starts: tuple[str, ...] = (begin.name,)
    if earlier is not None:
        seconds += earlier.seconds
        starts = (*earlier.starts, begin.name)
        result = replace(
            result,
            n_iterations=earlier.result.n_iterations + result.n_iterations,
            n_evaluations=earlier.result.n_evaluations + result.n_evaluations,
        )
    row = _measured(name, name, result, seconds, metrics, reference)
    return replace(row, starts=starts)


def _measured(
    name: str,
    metric_name: str,
    result: PathResult,
    seconds: float,
    metrics: Mapping[str, RiemannianMetric],
    reference: Array | None,
) -> PathComparison:
    """Return the measures of a path under all metrics."""
    template = surface_space(metrics[metric_name].space).template
    path, faces, edges = template.check_points(result.path), template.faces, template.edges
    deviations = np.array(np.nan)
    if reference is not None:
        reference = real_array(reference, "reference", path.shape, batched=False)
        deviations = 1000.0 * np.linalg.norm(path - reference, axis=-1)
    lengths = edge_lengths(template.vertices, edges)
    return PathComparison(
        name=name,
        metric=metric_name,
        result=result,
        seconds=seconds,
        energies={key: float(metric.energy(path)) for key, metric in metrics.items()},
        area_change=summarize(change_along_path(triangle_areas(path, faces)), template.face_areas),
        edge_change=summarize(change_along_path(edge_lengths(path, edges)), lengths),
        volume_change=float(change_along_path(signed_volume(path, faces))),
        mean_deviation=float(deviations.mean()),
        max_deviation=float(deviations.max()),
    )


@dataclass(frozen=True, repr=False)
class PathDistances(Result):
    """Distances within a set of points by the lengths of paths between them.

    The closed-form distance of a pull-back metric is a lower bound of the geodesic distance, the
    length of a path within the surfaces an upper bound.

    Attributes
    ----------
    lengths : array, shape (n, n)
        Lengths of the paths; symmetric, with zero diagonal.
    bounds : array, shape (n, n)
        Distances in closed form, 0 where the metric has none: no path is shorter.
    gaps : array, shape (n, n)
        `PathResult.gap` of the paths, per cent of their energies.
    n_iterations, n_evaluations, status, message
        See `Result`; ``STALLED`` if a path has not converged.

    Examples
    --------
    >>> metric = rh.VectorSpace((1,)).metric
    >>> rh.solvers.path_distances(rh.solvers.LinearPath(), metric, [[0.0], [4.0]]).excess
    array([0.])
    """

    lengths: Array
    bounds: Array
    gaps: Array

    @property
    def excess(self) -> Array:
        """By how much lengths exceed the bounds, per cent, for the pairs i < j in order."""
        pairs = np.triu_indices(len(self.lengths), 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return 100.0 * (self.lengths[pairs] / self.bounds[pairs] - 1.0)


N_COLUMNS = 6
"""Numbers of `row_of_path`."""


def row_of_path(metric: RiemannianMetric, result: PathResult) -> Array:
    """Return the numbers of one path that `distances_of_rows` takes, shape (N_COLUMNS,)."""
    return np.array(
        [
            float(metric.length(result.path)),
            float(np.sqrt(result.lower_bound)),
            result.gap,
            result.n_iterations,
            result.n_evaluations,
            result.converged,
        ],
        dtype=float,
    )


def distances_of_rows(n_points: int, rows: Array) -> PathDistances:
    """Return the table of the paths between all points i < j, given the row of each pair."""
    columns = rows.reshape(-1, N_COLUMNS).T
    lengths, bounds, gaps, n_iterations, n_evaluations, converged = columns
    n_pairs, n_converged = len(converged), int(converged.sum())
    return PathDistances(
        lengths=_symmetric(n_points, lengths),
        bounds=_symmetric(n_points, bounds),
        gaps=_symmetric(n_points, gaps),
        n_iterations=int(n_iterations.sum()),
        n_evaluations=int(n_evaluations.sum()),
        status=Status.CONVERGED if n_converged == n_pairs else Status.STALLED,
        message=f"{n_converged} of {n_pairs} paths converged",
    )


def _symmetric(n_points: int, values: Array) -> Array:
    """Return the symmetric matrix with the values of the pairs i < j, and zero diagonal."""
    matrix = np.zeros((n_points, n_points))
    i, j = np.triu_indices(n_points, 1)
    matrix[i, j] = matrix[j, i] = values
    return matrix


def path_distances(
    solver: GeodesicSolver,
    metric: RiemannianMetric,
    points: PointsLike,
    *,
    n_jobs: int | None = None,
    progress: bool = False,
) -> PathDistances:
    r"""Return the lengths of paths between all points of a set, each pair in one direction.

    Parameters
    ----------
    solver : GeodesicSolver
    metric : RiemannianMetric
    points : array or sequence, shape (n, \*shape)
    n_jobs, progress
        See `LinearPath.solve_many`.

    Examples
    --------
    >>> metric = rh.VectorSpace((2,)).metric
    >>> rh.solvers.path_distances(rh.solvers.LinearPath(), metric, [[0.0, 0.0], [3.0, 4.0]]).lengths
    array([[0., 5.],
           [5., 0.]])
    """
    n_points = length_of(points, "points")
    pairs = PairsOfPoints(points)
    results = solve_pairs(
        solver, metric, pairs, n_jobs=n_jobs, progress=progress, name_of=pairs.name_of
    )
    rows = np.array([row_of_path(metric, result) for result in results])
    return distances_of_rows(n_points, rows)


class PairsOfPoints(Sequence[tuple[object, object]]):
    """The pairs i < j of a set of points, row by row."""

    def __init__(self, points: PointsLike) -> None:
        self._points = points
        self._rows, self._columns = np.triu_indices(len(points), 1)

    def __len__(self) -> int:
        return len(self._rows)

    def name_of(self, number: int) -> str:
        """Return the name of a pair in messages."""
        return f"points[{self._rows[number]}] and points[{self._columns[number]}]"

    def __getitem__(self, number: int) -> tuple[object, object]:  # type: ignore[override]  # no slices
        return self._points[int(self._rows[number])], self._points[int(self._columns[number])]


def change_along_path(sizes: Array) -> Array:
    """Return the largest relative changes of sizes along a path, see `PathComparison`."""
    # They are infinite where a size vanishes only between the ends, or only at both ends.
    sizes = np.abs(real_array(sizes, "sizes", finite=False))
    largest, smallest = np.maximum(sizes[0], sizes[-1]), np.minimum(sizes[0], sizes[-1])
    growth = _ratio(sizes.max(axis=0), largest)
    shrinkage = _ratio(smallest, sizes.min(axis=0))
    return np.maximum(np.maximum(growth, shrinkage) - 1.0, 0.0)


def summarize(distortions: Array, weights: Array) -> Distortion:
    """Return a summary of distortions, shape (m,), weighted by areas or lengths."""
    return Distortion(
        float(distortions.max()),
        float(np.quantile(distortions, 0.99)),
        float(np.average(distortions, weights=weights)),
    )


def _ratio(a: Array, b: Array) -> Array:
    """Return a/b, or 1 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a == 0) & (b == 0), 1.0, a / b)
