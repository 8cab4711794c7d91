"""The sections of the report on all bodies: retrieval, maps, measurements and the sweep."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.measurements import (
    Measurements,
    MeasurementSet,
    in_standard_pose,
    open_measurements,
    regress_shape,
)
from riemhuman.plots import (
    embed,
    plot_confusion,
    plot_embedding,
    plot_measurement_lines,
    plot_path,
    plot_precision_recall,
    plot_sweep,
    stress,
)
from riemhuman.plots.figures import new_figure
from riemhuman.report._page import Column, Section, Table, heading, paragraph, side_by_side
from riemhuman.report._report import POSE_WEIGHTS, Report, Task, readable
from riemhuman.report._storage import Computed, Step
from riemhuman.report.retrieval_benchmark import PAPER_TABLES, POSE_METRIC, SHAPE_METRIC
from riemhuman.retrieval import scores
from riemhuman.surfaces import Template

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies

_NAME = Column("representation", "Representation")
_SCORES = (
    Column("nn", "NN", ".1f", "highest"),
    Column("first_tier", "FT", ".1f", "highest"),
    Column("second_tier", "ST", ".1f", "highest"),
)
_PRECISION = Column("mean_average_precision", "mAP", ".1f", "highest")

_MOST_POSES = 3  # of a person who is measured
_FEWEST_PEOPLE = 4  # for a regression
_ALONG = "waist girth"
_REGRESSION_WEIGHTS = {"a": 1.0, "lam": 1.0, "c": 0.1}
_SHOWN_MEASUREMENTS = {
    *("stature", "chest girth", "waist girth", "hip girth", "arm length", "inside leg height"),
    "body mass",
}


def retrieval_section(report: Report) -> Section | None:
    tasks = [task for task in report.tasks if task.has_pairs]
    if not tasks:
        return None

    def both(make: Callable[[Report, Task], str]) -> str:
        return side_by_side(*(make(report, task) for task in tasks))

    problems = [
        paragraph(f"{escape(name)} cannot be computed for these bodies: {escape(problem)}")
        for name, step in report.all_distances.items()
        if (problem := step.record.get("problem"))
    ]
    parts = [
        paragraph(
            "Each body is a query, once for the other bodies of its person and once for the other "
            "bodies in its pose; all other bodies are ranked by distance."
        ),
        both(_scores),
        *problems,
        heading("Precision and recall"),
        both(_curves),
        heading("Mistakes"),
        both(_mistakes),
        heading("The tables of the paper"),
        both(_printed_scores),
    ]
    return Section("retrieval", "Who is it, and how do they stand?", "Retrieval", parts)


def _scores(report: Report, task: Task) -> str:
    rows = [
        {"representation": name, **vars(scores(step.arrays["distances"], task.labels))}
        for name, step in report.distances.items()
    ]
    table = Table(
        f"retrieval-{task.name}",
        "Per cent, every body against all others: nearest neighbour, first and second tier, mean "
        "average precision. The best of each column is marked.",
        (_NAME, *_SCORES, _PRECISION),
        rows,
    )
    opposite = POSE_METRIC if task.metric == SHAPE_METRIC else SHAPE_METRIC
    verdict = f"{_verdict(table, task.metric)} {below_chance(rows, opposite, task.labels)}"
    note = f'<p class="note">{verdict}</p>'
    return f"{heading(task.question)}{report.output.table(table)}{note}"


def _verdict(table: Table, ours: str) -> str:
    """Return a sentence on the representations that score higher than ours."""
    names = [row["representation"] for row in table.rows]
    own = table.rows[names.index(ours)]
    verdict = ""
    for column in _SCORES:
        better = [
            f"{escape(row['representation'])} ({table.number(number, column.key)})"
            for number, row in enumerate(table.rows)
            if row[column.key] > own[column.key]
        ]
        verdict += f" {column.title}: {', '.join(better)}." if better else ""
    if not verdict:
        return f"No representation scores higher than the {escape(ours)}."
    return f"These representations score higher than the {escape(ours)}.{verdict}"


def chance_of_tier(labels: ndarray) -> float:
    """Return the mean first tier of items in random order, per cent."""
    _, inverse, counts = np.unique(labels, return_inverse=True, return_counts=True)
    n_relevant = counts[inverse] - 1
    asked = n_relevant > 0
    return float(100 * (n_relevant[asked] / (len(labels) - 1)).mean()) if asked.any() else 0.0


def below_chance(rows: Sequence[Mapping[str, Any]], metric: str, labels: ndarray) -> str:
    """Return a sentence if a metric finds fewer bodies of a class than chance would."""
    first_tier = next(row["first_tier"] for row in rows if row["representation"] == metric)
    chance = chance_of_tier(labels)
    if first_tier >= chance:
        return ""
    return (
        f"Chance alone would put {chance:.1f} % into the first tier, more than the "
        f"{first_tier:.1f} % of the {metric}: it ranks bodies of another class first."
    )


def _curves(report: Report, task: Task) -> str:
    return report.output.figure(
        f"precision-recall-{task.name}",
        f"Precision against recall of {task.name}, one curve for each representation.",
        f"{task.question} Precision at each level of recall. An ideal curve runs along the top: "
        "the whole class is ranked first.",
        plot_precision_recall,
        {name: step.arrays["distances"] for name, step in report.distances.items()},
        task.labels,
        size=(3.5, 3.2),
    )


def _mistakes(report: Report, task: Task) -> str:
    return report.output.figure(
        f"confusion-{task.name}",
        f"Confusion matrix of nearest neighbours under the {task.metric}.",
        f"{task.question} Confusion of nearest neighbours under the {task.metric}: rows are "
        "bodies, columns their nearest neighbours; entries off the diagonal are mistakes.",
        plot_confusion,
        report.matrix(task.metric),
        task.labels,
        [readable(name) for name in task.names],
        size=(3.5, 3.5),
    )


def _printed_scores(report: Report, task: Task) -> str:
    keys = ("representation", "nn", "first_tier", "second_tier")
    table = Table(
        f"paper-{task.name}",
        "As printed in the paper, on the registrations of FAUST; not computed here.",
        (_NAME, *_SCORES),
        [dict(zip(keys, row, strict=True)) for row in PAPER_TABLES[task.name]],
    )
    return report.output.table(table)


def map_section(report: Report) -> Section:
    bodies, output = report.bodies, report.output
    parts = [
        paragraph(
            "Each point is a body, its colour shows the class, and one body of each class is "
            "drawn. t-SNE preserves neighbourhoods, and its positions have no unit; "
            "multidimensional scaling (MDS) preserves distances, in metres, where it can."
        )
    ]
    places = _maps(report)
    for method, title in (("t-sne", "t-SNE"), ("mds", "MDS")):
        figures = []
        for task in report.tasks:
            positions = places.arrays[f"{task.name} {method}"]
            caption = (
                f"{title}, {task.metric}. Points of one {task.kind} share a colour; the nearest "
                f"point is of the same {task.kind} for "
                f"{kept_neighbours(positions, task.labels):.0f} % of bodies."
            )
            if method == "mds":
                value = stress(report.matrix(task.metric), positions)
                caption += f" Stress: {value:.2f}; 0 would preserve all distances."
            alt = f"{title} map of the bodies by the {task.metric}, coloured by {task.kind}."
            figure = output.figure(
                f"map-{task.name}-{method}",
                alt,
                caption,
                plot_embedding,
                positions,
                task.labels,
                [readable(name) for name in task.names],
                size=(4.5, 4.8),  # on which names are large enough for a telephone
                points=bodies.points,
                faces=bodies.template.faces,
                unit="m" if method == "mds" else None,
            )
            figures.append(figure)
        parts += [heading(title), side_by_side(*figures)]
    return Section("maps", "Maps of people and of poses", "Maps", parts)


def _maps(report: Report) -> Step:
    """Place the bodies in the plane: "shape t-sne", "shape mds", "pose t-sne", "pose mds"."""
    seed = report.plan.seed

    def compute() -> Computed:
        return {
            f"{task.name} {method}": embed(report.matrix(task.metric), method, rng=seed)
            for task in report.tasks
            for method in ("t-sne", "mds")
        }, {}

    by = {task.name: report.distances[task.metric] for task in report.tasks}
    return report.step("maps", compute, "Maps", by=by, seed=seed)


def kept_neighbours(positions: ndarray, labels: ndarray) -> float:
    """Return the percentage of items whose nearest neighbour on a map shares their class."""
    gaps = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    np.fill_diagonal(gaps, np.inf)
    return float(100 * (labels[gaps.argmin(axis=1)] == labels).mean())


def sweep_section(report: Report) -> Section | None:
    tasks, plan = [task for task in report.tasks if task.has_pairs], report.plan
    if not tasks:
        return None
    rows = _sweep(report, tasks).record["rows"]
    columns = [Column("lam", "λ", "g"), Column("a", "a", "g"), Column("c", "c", "g")]
    panels = {}
    for task in tasks:
        key = f"{task.name}_mean_average_precision"
        columns += [
            Column(f"{task.name}_nn", f"NN, {task.name}", ".1f", "highest"),
            Column(key, f"mAP, {task.name}", ".1f", "highest"),
        ]
        values = np.array([row[key] for row in rows])
        grid = values[:-1].reshape(len(plan.lams), len(plan.weights))
        alone = np.full((len(plan.lams), 1), values[-1])
        panels[f"{task.question} (mAP, %)"] = np.hstack([grid, alone])
    table = Table("sweep", "Retrieval of people (shape) and of poses.", columns, rows)
    figure = report.output.figure(
        "sweep",
        "Mean average precision of shape and of pose retrieval over λ and c.",
        "Mean average precision (mAP), per cent; the deepest blue is 100 %.",
        _draw_sweep,
        panels,
        plan.lams,
        [f"{weight:g}" for weight in plan.weights] + ["a = 0"],
        wide=True,
    )
    parts = [
        paragraph(
            f"{best_weights(rows)} The last column shows the normal part alone, a = 0 and c = 1."
        ),
        figure,
        f"<details><summary>All numbers</summary>{report.output.table(table)}</details>",
    ]
    return Section("sweep", "Between shape and pose", "Weights", parts)


def _sweep(report: Report, tasks: Sequence[Task]) -> Step:
    """Score retrieval over λ and c, and by the normal part alone.

    Squared distances are sums, so both parts are computed once and then weighted.
    """
    plan, points = report.plan, report.bodies.points

    def row(squared: ndarray, **weights: float | None) -> dict[str, Any]:
        found: dict[str, Any] = dict(weights)
        for task in tasks:
            own = scores(np.sqrt(squared), task.labels)
            found[f"{task.name}_nn"] = own.nn
            found[f"{task.name}_mean_average_precision"] = own.mean_average_precision
        return found

    def compute() -> Computed:
        normal = report.metric(POSE_WEIGHTS).dist_pairwise(points, n_jobs=-1) ** 2
        metric = [
            report.metric((1.0, lam, 0.0)).dist_pairwise(points, n_jobs=-1) ** 2
            for lam in plan.lams
        ]
        rows = [
            row(part + c * normal, a=1.0, lam=lam, c=c)
            for lam, part in zip(plan.lams, metric, strict=True)
            for c in plan.weights
        ]
        rows.append(row(normal, a=0.0, lam=None, c=1.0))
        return {"metric": np.stack(metric), "normal": normal}, {"rows": rows}

    inputs = {"lams": plan.lams, "weights": plan.weights}
    return report.step("sweep", compute, "Sweep over the weights", **inputs)


def best_weights(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence on the weights that score highest on people and on poses."""
    phrases = []
    for task, classes in (("shape", "people"), ("pose", "poses")):
        key = f"{task}_mean_average_precision"
        if key not in rows[0]:
            continue
        best = max(row[key] for row in rows)
        first, *ties = (row for row in rows if row[key] == best)
        lam = "" if first["lam"] is None else f", λ = {first['lam']:g}"
        more = f" (and {len(ties)} other choice{'s'[: len(ties) > 1]})" if ties else ""
        phrases.append(
            f"{classes} with a = {first['a']:g}{lam}, c = {first['c']:g}{more}: mAP {best:.1f} %"
        )
    return f"The best are {'; '.join(phrases)}." if phrases else ""


def measurement_section(report: Report) -> Section | None:
    """Return the section with measurements of people, if the bodies are of the open model."""
    bodies, output = report.bodies, report.output
    definitions = open_measurements(bodies.template)
    if definitions is None:
        return None
    step = _measure(report, definitions)
    name = bodies.subject_names[int(step.arrays["people"][0])]
    figure = output.figure(
        "measurement-lines",
        "One person in the standard pose from three sides, with all measurement lines.",
        f"The measurement lines: {escape(name)}.",
        _draw_lines,
        step.arrays["straight"][0],
        bodies.template.faces,
        wide=True,
    )
    parts = [
        paragraph(
            "A fit of the body model brings each body to one standard pose and keeps the residual. "
            f"The first table shows means over up to {_MOST_POSES} poses of each person, the "
            "second the standard deviation over the poses of one person."
        ),
        output.table(_people_table(bodies, step)),
        figure,
        heading("One person in several poses"),
        output.table(_spread_table(step)),
    ]
    if "along" in step.arrays:
        low, middle, high = step.record["along_values"]
        caption = (
            f"Geodesic regression of shape on the {_ALONG}: {low:.2f}, {middle:.2f} and "
            f"{high:.2f} m. It explains {100 * step.record['explained']:.0f} % of the variance "
            f"between people; p = {step.record['p_value']:.3f} by "
            f"{step.record['n_permutations']} permutations."
        )
        alt = f"Mean body, and bodies of a smaller and a larger {_ALONG}."
        arguments = (step.arrays["along"], bodies.template.faces)
        name, size = "shape-along-waist", (4.0, 2.4)
        figure = output.figure(name, alt, caption, plot_path, *arguments, size=size)
        parts += [heading(f"Shape along the {_ALONG}"), figure]
    return Section("measurements", "Girths, lengths and volumes", "Measurements", parts)


def _measure(report: Report, definitions: MeasurementSet) -> Step:
    """Measure each person in the standard pose, and regress shape on the waist girth."""
    bodies, seed = report.bodies, report.plan.seed
    people = np.unique(bodies.subject)

    def compute() -> Computed:
        measurements = Measurements(definitions)
        straight = [
            in_standard_pose(definitions, bodies.points[bodies.subject == person][:_MOST_POSES])
            for person in people
        ]
        values = [measurements.measure(f, axes="space", missing="nan").values for f in straight]
        spreads = [v.std(axis=0, ddof=1) if len(v) > 1 else np.nan * v[0] for v in values]
        arrays = {
            "people": people,
            "means": np.array([value.mean(axis=0) for value in values]),
            "spreads": np.array(spreads),
            "straight": np.array([points[0] for points in straight]),
        }
        record: dict[str, Any] = {
            "names": list(measurements.names),
            "units": list(measurements.units),
        }
        if len(people) >= _FEWEST_PEOPLE:
            girths = arrays["means"][:, measurements.names.index(_ALONG)]
            space = AlignedSurfaces(bodies.template)
            space.equip_with_metric(ElasticMetric, **_REGRESSION_WEIGHTS)
            shape = regress_shape(space, girths, arrays["straight"], rng=seed, max_iter=0)
            along = np.array([girths.min(), girths.mean(), girths.max()])
            arrays["along"] = shape.regression.predict(along)
            record["along_values"] = along.tolist()
            record["explained"], record["p_value"] = shape.explained, shape.p_value
            record["n_permutations"] = shape.n_permutations
        return arrays, record

    return report.step("measurements", compute, "Measurements", poses=_MOST_POSES, seed=seed)


def _people_table(bodies: Bodies, step: Step) -> Table:
    names = step.record["names"]
    columns = [Column("person", "Person")] + [
        Column(
            name,
            f"{name}, {unit}",
            ".1f" if unit == "kg" else ".3f",
            is_shown=name in _SHOWN_MEASUREMENTS,
        )
        for name, unit in zip(names, step.record["units"], strict=True)
    ]
    rows = [
        {"person": bodies.subject_names[int(person)], **dict(zip(names, values, strict=True))}
        for person, values in zip(step.arrays["people"], step.arrays["means"].tolist(), strict=True)
    ]
    caption = (
        "Measurements in the standard pose; the file has all. Body mass is an estimate, the volume "
        "times 1000 kg/m³."
    )
    return Table("measurements", caption, columns, rows)


def _spread_table(step: Step) -> Table:
    """Return the table of standard deviations over the poses of one person."""
    spreads = 1000.0 * step.arrays["spreads"].T
    rows = [
        {"measurement": name, "median": float(np.median(own)), "worst": float(own.max())}
        for name, unit, own in zip(step.record["names"], step.record["units"], spreads, strict=True)
        if unit == "m"
    ]
    columns = (
        Column("measurement", "Measurement"),
        Column("median", "Median person, mm", ".1f"),
        Column("worst", "Worst, mm", ".1f"),
    )
    caption = "Standard deviation of one person's values over the poses measured."
    return Table("measurement-spread", caption, columns, rows)


def _draw_sweep(panels: Mapping[str, ndarray], lams: Sequence[float], weights: list[str]) -> Figure:
    figure = new_figure(8.6, 2.9)
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for (title, values), ax in zip(panels.items(), axes, strict=True):
        plot_sweep(values, lams, weights, ax=ax)
        ax.set_title(title)
    return figure


def _draw_lines(surface: ndarray, faces: ndarray) -> Figure:
    lines = Measurements(Template(surface, faces)).lines(surface, axes="space")
    return plot_measurement_lines(surface, faces, lines)
