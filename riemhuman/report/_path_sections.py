"""The sections of the report on single bodies: differences, geodesics, comparison and mean."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array, Integers, JSONRecord, Points, Triangles, Values
from riemhuman.bodies import BodyModel
from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, RiemannianMetric, SobolevMetric, SRNFMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.plots import (
    ViewedBody,
    Viewer,
    contributions,
    per_area,
    plot_body,
    plot_energy,
    plot_path,
    view_path,
)
from riemhuman.plots.figures import MEAN, SKIN, new_figure
from riemhuman.report._page import Section, fill, gap_format
from riemhuman.report._report import (
    PATH_WEIGHTS,
    POSE_WEIGHTS,
    SAME_PERSON,
    SAME_POSE,
    TWO_BODIES,
    Pair,
    Report,
    Weights,
    group_within,
    name_of,
)
from riemhuman.retrieval.benchmarks import POSE_METRIC
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    LinearPath,
    ModelParameters,
    ModelPath,
    PathComparison,
    PoissonPath,
    compare_metrics,
    compare_paths,
)
from riemhuman.surfaces import generalized_procrustes, procrustes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies
    from riemhuman.report._storage import Computed, Step

# Paths that the section on comparisons names.
_LINEAR = "linear"
_OURS = "ours (1, 1, 0)"
_ROTATING = "rotating start"
_KARCHER = "Karcher mean"
# Weights a0, a1, b1, c1, d1 and a2.
_SOBOLEV_WEIGHTS = (0.0, 1.0, 1.0, 1.0, 0.0, 1e-3)
_GEODESICS = {
    SAME_PERSON: ("pose-change", PATH_WEIGHTS),
    SAME_POSE: ("shape-change", POSE_WEIGHTS),
    TWO_BODIES: ("two-bodies", PATH_WEIGHTS),
}
_VIEWED_METRICS = {
    "shape (1, 1, 0)": ("shape", PATH_WEIGHTS),
    "pose (0, 0, 1)": ("pose", POSE_WEIGHTS),
    "both (1, 1, 0.1)": ("both", (1.0, 1.0, 0.1)),
}
Row = JSONRecord
_PIXELS = 720  # height of a body, which figures scale down
_MEAN_WIDTH = 8.0  # inches
_COUNTS = {4: "Four", 5: "Five"}
_DEVIATION_UNITS = {"mean_deviation": "m", "max_deviation": "m"}


def difference_section(report: Report) -> Section | None:
    if not report.pairs:
        return None
    step = _differences(report)
    bodies = report.bodies
    template = bodies.template
    choices = {}
    for name, (first, second) in step.record["pairs"].items():
        choices[name] = [ViewedBody(name_of(bodies, first), bodies.points[[first]])]
        for part in ("metric", "normal"):
            values = per_area(step.arrays[f"{name} {part}"], template.vertices, template.faces)
            label = f"{name_of(bodies, second)}: {part} part"
            body = ViewedBody(label, bodies.points[[second]], values=values, value_label="per m²")
            choices[name].append(body)
    viewer = Viewer(template.faces, choices, "Pair", "Where two bodies differ")
    html = fill(
        "differences",
        picture=report.output.figure("differences", _draw_differences, bodies, step),
        viewer=viewer.fragment("differences-view"),
        rows=report.output.table("differences", step.record["rows"]),
    )
    return Section("differences", "Where do two bodies differ?", "Differences", html)


def _differences(report: Report) -> Step:
    """Compute where pairs of bodies differ: "NAME metric" and "NAME normal", shape (F,)."""

    def compute() -> Computed:
        arrays: dict[str, Values] = {}
        rows = []
        for name, pair in report.pairs.items():
            parts = contributions(report.metric((1.0, 1.0, 1.0)), *report.bodies.points[list(pair)])
            arrays |= {f"{name} metric": parts.metric, f"{name} normal": parts.normal}
            metric = float(parts.metric.sum())
            normal = float(parts.normal.sum())
            rows.append(
                {
                    "pair": name,
                    "metric_part": metric,
                    "normal_part": normal,
                    "squared_distance": metric + normal,
                }
            )
        pairs = {name: list(pair) for name, pair in report.pairs.items()}
        return arrays, {"rows": rows, "pairs": pairs}

    return report.store.step("differences", compute, "Where bodies differ", pairs=report.pairs)


def geodesic_section(report: Report) -> Section | None:
    bodies, output = report.bodies, report.output
    drawn = {}
    for name, pair in report.pairs.items():
        slug, weights = _GEODESICS[name]
        drawn[name] = _geodesic(report, name, slug, weights, pair)
    viewed = {}
    pair_of_view = report.pair(POSE_METRIC, 0.5, person=False, pose=False)
    if pair_of_view is not None:
        for name, (slug, weights) in _VIEWED_METRICS.items():
            viewed[name] = _geodesic(report, name, slug, weights, pair_of_view)
    if not drawn and not viewed:
        return None
    fragment = ""
    if viewed:
        viewer = view_path(
            {name: step.arrays["path"] for name, step in viewed.items()},
            bodies.template.faces,
            legend="Metric",
            title="Geodesic under three metrics",
        )
        fragment = viewer.fragment("geodesics-view")
    rows = [step.record for step in [*drawn.values(), *viewed.values()]]
    html = fill(
        "geodesics",
        of_paper={SAME_PERSON: "a", SAME_POSE: "b"},
        basis=report.basis[1],
        strips=[
            (output.figure(step.name, _draw_geodesic, bodies, step), step.record)
            for step in drawn.values()
        ],
        viewer=fragment,
        ends=(rows[-1]["from"], rows[-1]["to"]),
        rows=output.table("geodesics", rows),
    )
    return Section("geodesics", "Geodesics", "Geodesics", html)


def _geodesic(report: Report, title: str, slug: str, weights: Weights, pair: Pair) -> Step:
    """Find the geodesic between two bodies from a rotating and from a straight path (figure 4)."""
    solver, bodies = report.path_solver(), report.bodies
    start, end = bodies.points[list(pair)]

    def compute() -> Computed:
        metric = report.metric(weights)
        linear = LinearPath(report.plan.n_nodes)
        with warnings.catch_warnings():
            # The record tells whether this path, as in the paper, converged.
            warnings.simplefilter("ignore", ConvergenceWarning)
            from_straight = replace(solver, initial=linear).solve(metric, start, end)
        began = time.perf_counter()
        result = solver.solve(metric, start, end)
        arrays = {
            "path": result.path,
            "energies": result.energies,
            "energies_from_straight": from_straight.energies,
        }
        return arrays, {
            "geodesic": title,
            "from": name_of(bodies, pair[0]),
            "to": name_of(bodies, pair[1]),
            "metric": f"({', '.join(f'{weight:g}' for weight in weights)})",
            "seconds": time.perf_counter() - began,
            "straight_energy": linear.solve(metric, start, end).energy,
            "energy_from_straight": from_straight.energy,
            "energy": result.energy,
            "squared_distance": float(metric.squared_dist(start, end)),
            "n_iterations": result.n_iterations,
            "converged": bool(result.converged),
        }

    inputs = {"pair": pair, "weights": weights}
    return report.path_step(f"geodesic-{slug}", compute, f"Geodesic, {title}", **inputs)


def comparison_section(report: Report) -> Section | None:
    bodies = report.bodies
    pair = report.pair(POSE_METRIC, 0.9, person=True, pose=False)
    if pair is None:
        return None
    step = _comparison(report, pair)
    rows = [_in_metres(row) for row in step.record["rows"]]
    from_straight = [_in_metres(row) for row in step.record["rows_from_straight"]]
    names = _names_drawn(step)
    count = _COUNTS[len(names)]
    viewer = view_path(
        {name: step.arrays[name] for name in names},
        bodies.template.faces,
        side_by_side=True,
        title=f"{len(names)} paths between the same two bodies",
    )
    html = fill(
        "comparison",
        picture=report.output.figure("comparison", _draw_comparison, bodies, step),
        names=names,
        viewer=viewer.fragment("comparison-view"),
        ends=[name_of(bodies, number) for number in pair],
        gap=gap_format(report.units),
        rows=report.output.table("comparison", rows, _DEVIATION_UNITS),
        from_straight=report.output.table(
            "comparison-from-straight", from_straight, _DEVIATION_UNITS
        ),
        basis=report.basis[1],
        plan=report.plan,
        searched=[row["name"] for row in rows if row["starts"]],
    )
    return Section("comparison", f"{count} paths from one pose to another", f"{count} paths", html)


def _in_metres(row: Row) -> Row:
    """Return the row of a path with its deviations in metres, as tables hold lengths."""
    return row | {key: 1e-3 * row[key] for key in _DEVIATION_UNITS}


def _names_drawn(step: Step) -> list[str]:
    """Return the names of the paths that are drawn: all but a start that resembles ours."""
    return [row["name"] for row in step.record["rows"] if row["name"] != _ROTATING]


def _comparison(report: Report, pair: Pair) -> Step:
    """Compare paths of several metrics, found alike from each of two starts (figure 5)."""
    start, end = report.bodies.points[list(pair)]
    n_nodes = report.plan.n_nodes
    search: BasisPath = report.path_solver()

    def compute() -> Computed:
        space = AlignedSurfaces(report.bodies.template, equip=False)
        metrics: dict[str, RiemannianMetric] = {
            "srnf": SRNFMetric(space),
            "sobolev": SobolevMetric(space, *_SOBOLEV_WEIGHTS),
            "ours": report.metric(PATH_WEIGHTS),
        }
        solvers: dict[str, tuple[GeodesicSolver, str]] = {
            _LINEAR: (LinearPath(n_nodes), "ours"),
            _ROTATING: (PoissonPath(n_nodes), "ours"),
        }
        reference = None
        model = report.bodies.model
        if model is not None:
            path = ModelPath(model, n_nodes, parameters=partial(_parameters, model))
            solvers["body model"] = (path, "ours")
            reference = path.solve(metrics["ours"], start, end).path
        starts = compare_paths(metrics, start, end, solvers, reference)
        searched = compare_metrics(metrics, search, starts, _ROTATING, reference)
        straight = [path for path in starts if path.name == _LINEAR]
        searched_from_straight = compare_metrics(metrics, search, straight, _LINEAR, reference)
        rows = _named([*starts, *searched])
        rows_from_straight = _named([*straight, *searched_from_straight])
        paths = {path.name: path.result.path for path in rows}
        return paths, {
            "pair": list(pair),
            "rows": [path.as_row() for path in rows],
            "rows_from_straight": [path.as_row() for path in rows_from_straight],
        }

    inputs = {"pair": pair, "sobolev": _SOBOLEV_WEIGHTS}
    return report.path_step("comparison", compute, "Paths compared", **inputs)


def _named(paths: list[PathComparison]) -> list[PathComparison]:
    """Return paths by the names that the page gives to their metrics."""
    names = {"srnf": "SRNF", "sobolev": f"Sobolev, a2 = {_SOBOLEV_WEIGHTS[-1]:g}", "ours": _OURS}
    return [
        replace(
            path,
            name=names.get(path.name, path.name),
            starts=tuple(names.get(start, start) for start in path.starts),
        )
        for path in paths
    ]


def mean_section(report: Report) -> Section | None:
    bodies, faces = report.bodies, report.bodies.template.faces
    group = group_within(bodies.pose, bodies.subject, report.plan.n_averaged)
    if len(group) < 2:
        return None
    step = _mean(report, group)
    mean = step.arrays["mean"][np.newaxis]
    figure = report.output.figure(
        "mean", _draw_mean, np.concatenate([bodies.points[group], mean]), faces
    )
    viewed = [ViewedBody(name_of(bodies, index), bodies.points[[index]]) for index in group]
    viewed.append(ViewedBody(_KARCHER, mean, MEAN))
    title = "Bodies and their Karcher mean"
    viewer = Viewer(faces, {title: viewed}, "Bodies", title)
    rows = [
        {"body": name_of(bodies, index), "distance": distance, "squared_distance": distance**2}
        for index, distance in zip(group, step.record["distances"], strict=True)
    ]
    variances = {row["body"]: row["normal_part"] for row in step.record["variances"]}
    nearer = [name for name, value in variances.items() if value < variances[_KARCHER]]
    html = fill(
        "mean",
        picture=figure,
        viewer=viewer.fragment("mean-view"),
        rows=report.output.table("mean", rows),
        variances=report.output.table("mean-variances", step.record["variances"]),
        nearer=nearer,
        basis=report.basis[1],
    )
    return Section("mean", "The mean of several people", "Mean", html)


def _mean(report: Report, group: Integers) -> Step:
    """Find the Karcher mean of bodies by the normal part alone (figure 6 of the paper)."""
    points = report.bodies.points[group]

    def compute() -> Computed:
        metric, solver = report.metric(POSE_WEIGHTS), BasisMean(report.basis[0])
        minimised = metric.with_stretching(solver.companion_weight)
        result = solver.solve(metric, points)
        distances = metric.dist(points, result.point).tolist()
        average = points.mean(axis=0)
        _, aligned_average = generalized_procrustes(points)
        centers = {
            _KARCHER: result.point,
            "average of the vertices": average,
            "Procrustes average": procrustes(aligned_average, to=average),
        }
        variances = [
            {
                "body": name,
                "minimised": float(np.mean(minimised.squared_dist(points, center))),
                "normal_part": float(np.mean(metric.squared_dist(points, center))),
            }
            for name, center in centers.items()
        ]
        record = {"group": group.tolist(), "distances": distances, "variances": variances}
        return {"mean": result.point}, record

    return report.path_step("mean", compute, "Karcher mean", group=group.tolist())


def _draw_differences(bodies: Bodies, step: Step) -> Figure:
    template = bodies.template
    pairs = step.record["pairs"]
    figure = new_figure(9.6, 3.4 * len(pairs))
    rows = figure.subplots(len(pairs), 3, squeeze=False)
    for (name, (first, second)), axes in zip(pairs.items(), rows, strict=True):
        plot_body(bodies.points[first], template.faces, ax=axes[0], height=_PIXELS)
        axes[0].set_title(name_of(bodies, first))
        for ax, part in zip(axes[1:], ("metric", "normal"), strict=True):
            values = per_area(step.arrays[f"{name} {part}"], template.vertices, template.faces)
            label = f"{part} part, per unit of area"
            second_body = bodies.points[second]
            plot_body(second_body, template.faces, values, label=label, ax=ax, height=_PIXELS)
            ax.set_title(name_of(bodies, second))
    return figure


def _draw_geodesic(bodies: Bodies, step: Step) -> Figure:
    """Draw a geodesic as a film strip, with its energy beside it (figure 4 of the paper)."""
    figure = new_figure(10.0, 2.4)
    strip, curve = figure.subplots(1, 2, width_ratios=[0.77, 0.23])
    plot_path(step.arrays["path"], bodies.template.faces, n_shown=6, ax=strip, height=_PIXELS)
    strip.set_anchor("W")
    lines = {
        "straight path": step.record["straight_energy"],
        "d² of the ends": step.record["squared_distance"],
    }
    curves = {
        "from the straight path": step.arrays["energies_from_straight"],
        "from the rotating path": step.arrays["energies"],
    }
    plot_energy(curves, lines=lines, ax=curve)
    return figure


def _draw_mean(surfaces: Points, faces: Triangles) -> Figure:
    """Draw people and, last, their mean, in a figure as high as they are."""
    figure = new_figure(_MEAN_WIDTH, _MEAN_WIDTH)
    ax = figure.subplots()
    colors = [SKIN] * (len(surfaces) - 1) + [MEAN]
    plot_path(surfaces, faces, colors=colors, ax=ax, height=_PIXELS)
    _, right = ax.get_xlim()
    _, top = ax.get_ylim()
    figure.set_size_inches(_MEAN_WIDTH, _MEAN_WIDTH * top / right + 0.1)
    return figure


def _draw_comparison(bodies: Bodies, step: Step) -> Figure:
    """Draw several paths between two bodies below each other (figure 5 of the paper)."""
    names = _names_drawn(step)
    figure = new_figure(8.0, 1.75 * len(names))
    axes = figure.subplots(len(names), 1, squeeze=False)[:, 0]
    for name, ax in zip(names, axes, strict=True):
        plot_path(step.arrays[name], bodies.template.faces, n_shown=7, ax=ax, height=_PIXELS)
        ax.set_anchor("W")
        ax.annotate(
            name, (0.0, 0.5), xycoords="axes fraction", xytext=(-6, 0),
            textcoords="offset points", ha="right", va="center",
        )  # fmt: skip
    return figure


def _parameters(model: BodyModel, surface: Array) -> ModelParameters:
    """Return the shape, the pose and the translation of a body."""
    fit = model.fit(surface)
    return ModelParameters(fit.betas, fit.pose, fit.trans)
