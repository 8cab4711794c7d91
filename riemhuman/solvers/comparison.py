"""Paths of several solvers between the same surfaces, with common measures (section 5.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.protocols import was_interrupted
from riemhuman.representation import Record
from riemhuman.solvers.results import PathResult, whole_path_result
from riemhuman.surfaces.distortion import (
    Distortion,
    change_along_path,
    edge_lengths,
    signed_volume,
    summarize,
    triangle_areas,
)


@dataclass(frozen=True, repr=False)
class PathMeasures(Record):
    """Energies of a path of surfaces, and how much it distorts them.

    Changes are relative, the largest along the path beyond those between its ends, see
    `riemhuman.surfaces.distortion.change_along_path`.

    Attributes
    ----------
    energies : dict of str to float
        Energy under each metric.
    area_change : Distortion
        Changes of the triangles' areas; the mean is weighted by the template's areas.
    edge_change : Distortion
        Changes of the edges' lengths; the mean is weighted by the template's lengths.
    volume_change : float
        Change of the volume; NaN if the mesh is not closed.
    mean_deviation, max_deviation : float
        Distance of the vertices from those of the reference, mean and largest over all vertices
        and times, millimetres; NaN without a reference.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> result = rh.solvers.LinearPath(n_nodes=5).solve(space.metric, bodies[0], bodies[2])
    >>> measures = rh.solvers.measure_path({"shape": space.metric}, result.path)
    >>> sorted(measures.energies)
    ['shape']
    """

    energies: dict[str, float]
    area_change: Distortion
    edge_change: Distortion
    volume_change: float
    mean_deviation: float
    max_deviation: float


@dataclass(frozen=True, repr=False)
class PathComparison(Record):
    """One of the paths compared.

    Attributes
    ----------
    name : str
        Name of the solver.
    metric : str
        Name of its metric.
    result : PathResult
        Result of the solver.
    measures : PathMeasures
        Measures of its path.
    seconds : float
        Wall time, including compilation at first use.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metrics = {"elastic": rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)}
    >>> solvers = {"straight": (rh.solvers.LinearPath(n_nodes=5), "elastic")}
    >>> rows = rh.solvers.compare_paths(metrics, bodies[0], bodies[2], solvers)
    >>> [(row.name, row.metric) for row in rows]
    [('straight', 'elastic')]
    """

    name: str
    metric: str
    result: PathResult
    measures: PathMeasures
    seconds: float

    def as_row(self) -> dict[str, Any]:
        """Return everything but the path, by name, for a table.

        Returns
        -------
        dict of str to str, float, int or bool
        """
        measures = self.measures
        row: dict[str, Any] = {"name": self.name, "metric": self.metric}
        row |= {f"energy_{name}": value for name, value in measures.energies.items()}
        for label, change in (("area", measures.area_change), ("edge", measures.edge_change)):
            row |= {f"{label}_change_{key}": value for key, value in change._asdict().items()}
        return row | {
            "volume_change": measures.volume_change,
            "mean_deviation": measures.mean_deviation,
            "max_deviation": measures.max_deviation,
            "n_iterations": self.result.n_iterations,
            "converged": self.result.converged,
            "seconds": self.seconds,
        }


def compare_paths(
    metrics: Mapping[str, RiemannianMetric],
    start: ndarray,
    end: ndarray,
    solvers: Mapping[str, tuple[GeodesicSolver, str]],
    reference: ndarray | None = None,
) -> list[PathComparison]:
    """Find paths between two surfaces with several solvers, and measure them in the same way.

    Parameters
    ----------
    metrics : mapping of str to RiemannianMetric
        Metrics on the same surfaces; every path's energy is measured under each.
    start, end : array, shape (V, 3)
        Surfaces.
    solvers : mapping of str to (solver, str)
        Each solver with the name of its metric, such as ``{"ours": (BasisPath(basis), "elastic"),
        "SRNF": (BasisPath(basis), "srnf")}``.
    reference : array, shape (n_nodes, V, 3), optional
        Path to measure deviations from, such as the body model's own motion.

    Returns
    -------
    list of PathComparison
        One for each solver, in the same order; if interrupted from the keyboard, those finished.

    Raises
    ------
    ArgumentError
        If there is no metric, a solver names an unknown metric, the surfaces do not fit, or the
        reference has other times or vertices than a path.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metrics = {"elastic": rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)}
    >>> solvers = {"straight": (rh.solvers.LinearPath(n_nodes=5), "elastic")}
    >>> rows = rh.solvers.compare_paths(metrics, bodies[0], bodies[2], solvers)
    >>> [(row.name, row.metric) for row in rows]
    [('straight', 'elastic')]
    """
    for name, (_, metric_name) in solvers.items():
        if metric_name not in metrics:
            raise ArgumentError(
                f"solvers[{name!r}] names the metric {metric_name!r}; metrics holds "
                f"{', '.join(map(repr, metrics)) or 'none'}"
            )
    compared = []
    for name, (solver, metric_name) in solvers.items():
        began = perf_counter()
        result = whole_path_result(solver.solve(metrics[metric_name], start, end))
        seconds = perf_counter() - began
        measures = measure_path(metrics, result.path, reference)
        compared.append(PathComparison(name, metric_name, result, measures, seconds))
        if was_interrupted(result):
            break
    return compared


def measure_path(
    metrics: Mapping[str, RiemannianMetric], path: ndarray, reference: ndarray | None = None
) -> PathMeasures:
    """Measure a path of surfaces.

    Parameters
    ----------
    metrics : mapping of str to RiemannianMetric
        Metrics on the same surfaces.
    path : array, shape (n_nodes, V, 3)
        Path.
    reference : array, shape (n_nodes, V, 3), optional
        Path to measure deviations from.

    Returns
    -------
    PathMeasures

    Raises
    ------
    ArgumentError
        If there is no metric, or the path or the reference does not fit.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> result = rh.solvers.LinearPath(n_nodes=5).solve(space.metric, bodies[0], bodies[2])
    >>> measures = rh.solvers.measure_path({"shape": space.metric}, result.path)
    >>> sorted(measures.energies)
    ['shape']
    """
    if not metrics:
        raise ArgumentError("metrics is empty; at least one metric on surfaces is needed")
    space = next(iter(metrics.values())).space
    if not space.is_surface_space:
        raise ArgumentError("metrics must be metrics on surfaces over a template")
    template = space.template
    path = template.check_points(path, "path")
    faces, edges = template.faces, template.edges
    deviations = np.array(np.nan)
    if reference is not None:
        reference = real_array(reference, "reference", path.shape, batched=False)
        deviations = 1000.0 * np.linalg.norm(path - reference, axis=-1)
    return PathMeasures(
        {name: float(metric.energy(path)) for name, metric in metrics.items()},
        summarize(change_along_path(triangle_areas(path, faces)), template.face_areas),
        summarize(
            change_along_path(edge_lengths(path, edges)), edge_lengths(template.vertices, edges)
        ),
        float(change_along_path(signed_volume(path, faces))),
        float(deviations.mean()),
        float(deviations.max()),
    )
