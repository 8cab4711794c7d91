"""The sections of the report on all bodies: retrieval, maps, measurements and the sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from riemhuman.arrays import Array, JSONRecord, JSONValue, Points, Triangles
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.measurements import (
    Measurements,
    MeasurementSet,
    in_standard_pose,
    open_measurements,
    readable_unit,
)
from riemhuman.plots import (
    describe_stress,
    embed,
    plot_confusion,
    plot_embedding,
    plot_measurements,
    plot_path,
    plot_precision_recall,
    plot_sweep,
    stress,
    view_map,
)
from riemhuman.plots.figures import new_figure
from riemhuman.plots.maps import LARGEST_STRESS
from riemhuman.plots.result_plots import FEWEST_CLASSES
from riemhuman.report._everyday_names import everyday_name
from riemhuman.report._page import Section, fill, gap_format
from riemhuman.report._report import POSE_WEIGHTS, Report, Task, name_of, readable
from riemhuman.report._storage import Computed, Step
from riemhuman.retrieval import scores
from riemhuman.retrieval.benchmarks import POSE_METRIC, SHAPE_METRIC
from riemhuman.statistics import regress_shape
from riemhuman.surfaces import Template

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_METHODS = {"t-SNE": "t-sne", "MDS": "mds"}
_TITLES = {method: title for title, method in _METHODS.items()}
_NEAR = "nearby points are similar bodies; distances on the map have no unit"
_FEWEST_PEOPLE = 4  # for a regression
_FEWEST_ON_MAP = 6  # with fewer, there are no neighbourhoods to see
_PAPER_CLASSES = 10  # of people and of poses of FAUST, of which the paper prints tables
_MOST_COORDINATES = 15_000_000  # of the bodies on the page of a map, two bytes each at most
_ALONG = "waist girth"
_REGRESSION_WEIGHTS = {"a": 1.0, "lam": 1.0, "c": 0.1}
_SHOWN_MEASUREMENTS = {
    "stature",
    "chest girth",
    "waist girth",
    "hip girth",
    "arm length",
    "inside leg height",
    "body mass",
}


def retrieval_section(report: Report) -> Section | None:
    tasks = [_retrieval(report, task) for task in report.tasks if task.is_retrieval]
    if not tasks:
        return None
    steps = report.all_distances.items()
    problems = {name: step.record["problem"] for name, step in steps if "problem" in step.record}
    like_faust = all(task.n_classes >= _PAPER_CLASSES for task in report.tasks)
    html = fill("retrieval", tasks=tasks, problems=problems, has_paper=like_faust)
    return Section("retrieval", "Who is it, and how do they stand?", "Retrieval", html)


def _retrieval(report: Report, task: Task) -> JSONRecord:
    """Return what the page says about one task."""
    distances = {name: step.arrays["distances"] for name, step in report.distances.items()}
    rows: dict[str, JSONRecord] = {
        name: {"representation": name, **vars(scores(matrix, task.labels))}
        for name, matrix in distances.items()
    }
    task_scores = rows[task.metric]
    better = {
        key: [number for number, row in enumerate(rows.values()) if row[key] > task_scores[key]]
        for key in ("nn", "first_tier", "second_tier")
    }
    matrix = distances[task.metric]
    has_figures = task.n_classes >= FEWEST_CLASSES
    return {
        "task": task,
        "table": report.output.table(f"retrieval-{task.name}", list(rows.values())),
        "better": {key: numbers for key, numbers in better.items() if numbers},
        "opposite": rows[POSE_METRIC if task.metric == SHAPE_METRIC else SHAPE_METRIC],
        # For equal distances, scores are expectations over all orders.
        "chance": scores(np.ones_like(matrix), task.labels).first_tier,
        **(_retrieval_figures(report, task, distances) if has_figures else {}),
    }


def _retrieval_figures(report: Report, task: Task, distances: Mapping[str, Array]) -> JSONRecord:
    names = [readable(name) for name in task.names]
    return {
        "curves": report.output.figure(
            f"precision-recall-{task.name}",
            plot_precision_recall,
            distances,
            task.labels,
            size=(3.5, 3.2),
        ),
        "mistakes": report.output.figure(
            f"confusion-{task.name}",
            plot_confusion,
            distances[task.metric],
            task.labels,
            names,
            size=(3.5, 3.5),
        ),
    }


def map_section(report: Report) -> Section | None:
    if len(report.bodies) < _FEWEST_ON_MAP:
        return None
    places = _maps(report).arrays
    tasks = report.tasks if report.has_poses else report.tasks[:1]
    maps = {
        title: [_map(report, task, method, places[f"{task.name} {method}"]) for task in tasks]
        for title, method in _METHODS.items()
    }
    has_classes = not all(task.is_named_by_item for task in tasks)
    html = fill("maps", methods=maps, has_classes=has_classes)
    return Section("maps", "Maps of people and of poses", "Maps", html)


def _map(report: Report, task: Task, method: str, positions: Array) -> JSONRecord:
    shares_class = (
        scores(cdist(positions, positions), task.labels).nn if task.is_retrieval else None
    )
    lost = stress(report.matrix(task.metric), positions) if method == "mds" else None
    about: JSONRecord = {"task": task, "neighbours": shares_class}
    about["loss"] = None if lost is None else describe_stress(lost)
    if lost is not None and lost > LARGEST_STRESS:
        return about
    bodies = report.bodies
    classes = [readable(name) for name in task.names]
    items = [name_of(bodies, number) for number in range(len(bodies))]
    shown: JSONRecord = {
        "size": (4.5, 4.8),  # on which names are large enough for a phone
        "unit": "m" if method == "mds" else None,
    }
    if task.is_named_by_item:
        labels, names = np.zeros(len(bodies), dtype=np.int64), None
        shown["item_names"] = items
    else:
        labels, names = task.labels, classes
        shown |= {"points": bodies.points, "faces": bodies.template.faces}
    name = f"map-{task.name}-{method}"
    image = report.output.figure(name, plot_embedding, positions, labels, names, **shown)
    page = ""
    if bodies.points.size <= _MOST_COORDINATES:
        note = about["loss"] or _NEAR
        title = f"{_TITLES[method]} map by the {task.metric}"
        viewer = view_map(
            positions,
            labels,
            names,
            points=bodies.points,
            faces=bodies.template.faces,
            item_names=items,
            note=f"{note[:1].upper()}{note[1:]}.",
            title=title,
        )
        page = report.output.view(name, viewer)
    return about | {"image": image, "page": page}


def _maps(report: Report) -> Step:
    """Place the bodies in the plane: "shape t-sne", "shape mds", "pose t-sne", "pose mds"."""
    seed = report.plan.seed

    def compute() -> Computed:
        return {
            f"{task.name} {method}": embed(report.matrix(task.metric), method=method, rng=seed)
            for task in report.tasks
            for method in _METHODS.values()
        }, {}

    by = {task.name: report.distances[task.metric].fingerprint for task in report.tasks}
    return report.store.step("maps", compute, "Maps", by=by, seed=seed)


def sweep_section(report: Report) -> Section | None:
    plan = report.plan
    tasks = [task for task in report.tasks if task.is_retrieval]
    # With only two classes, most weights are equally good.
    if max((task.n_classes for task in tasks), default=0) < FEWEST_CLASSES:
        return None
    rows = _sweep(report, tasks).record["rows"]
    panels = {}
    for task in tasks:
        values = np.array([row[f"{task.name}_mean_average_precision"] for row in rows])
        grid = values[:-1].reshape(len(plan.lams), len(plan.weights))
        alone = np.full((len(plan.lams), 1), values[-1])
        panels[f"{task.question} (mAP, %)"] = np.hstack([grid, alone])
    weights = [f"{weight:g}" for weight in plan.weights] + ["a = 0"]
    html = fill(
        "sweep",
        best=best_weights(rows, tasks),
        picture=report.output.figure("sweep", _draw_sweep, panels, plan.lams, weights),
        rows=report.output.table("sweep", rows),
    )
    return Section("sweep", "Between shape and pose", "Weights", html)


def _sweep(report: Report, tasks: Sequence[Task]) -> Step:
    """Score retrieval over λ and c, and by the normal part alone."""
    # Squared distances are sums, so both parts are computed once and then weighted.
    plan, points = report.plan, report.bodies.points

    def row(squared: Array, **weights: float | None) -> JSONRecord:
        weight_scores: JSONRecord = dict(weights)
        for task in tasks:
            task_scores = scores(np.sqrt(squared), task.labels)
            weight_scores[f"{task.name}_nn"] = task_scores.nn
            weight_scores[f"{task.name}_mean_average_precision"] = (
                task_scores.mean_average_precision
            )
        return weight_scores

    def compute() -> Computed:
        normal = report.metric(POSE_WEIGHTS).dist_pairwise(points, n_jobs=-1) ** 2
        metric = [
            report.metric((1.0, lam, 0.0)).dist_pairwise(points, n_jobs=-1) ** 2
            for lam in plan.lams
        ]
        rows = [
            row(part + c * normal, lam=lam, a=1.0, c=c)
            for lam, part in zip(plan.lams, metric, strict=True)
            for c in plan.weights
        ]
        rows.append(row(normal, lam=None, a=0.0, c=1.0))
        return {"metric": np.stack(metric), "normal": normal}, {"rows": rows}

    inputs = {"lams": plan.lams, "weights": plan.weights}
    return report.store.step("sweep", compute, "Sweep over the weights", **inputs)


def best_weights(
    rows: Sequence[Mapping[str, JSONValue]], tasks: Sequence[Task]
) -> list[JSONRecord]:
    """Return the row that scores highest on each task, and how many others score the same."""
    best = []
    for task in tasks:
        values = [row[f"{task.name}_mean_average_precision"] for row in rows]
        value = max(values)
        best.append(
            {
                "classes": "people" if task.kind == "person" else "poses",
                "value": value,
                "row": rows[values.index(value)],
                "n_ties": values.count(value) - 1,
            }
        )
    return best


def measurement_section(report: Report) -> Section | None:
    """Return the section with measurements of people, if the bodies are of the open model."""
    bodies, output = report.bodies, report.output
    definitions = open_measurements(bodies.template)
    if definitions is None:
        return None
    step = _measure(report, definitions)
    faces = bodies.template.faces
    means = step.record["means"]
    si_units = step.record["units"]
    system = report.units
    columns: list[tuple[str | float, ...]] = [("person", "Person" if report.has_poses else "Body")]
    for name, si_unit in si_units.items():
        if name in _SHOWN_MEASUREMENTS:
            unit = readable_unit(si_unit, system)
            columns.append((name, f"{everyday_name(name)}, {unit.name}", ".1f", "", unit.scale))
    strip = None
    values_along = ""
    along = step.arrays.get("along")
    if along is not None:
        strip = output.figure(
            "shape-along-waist", plot_path, along, faces, size=(4.0, 2.4), height=720
        )
        length = readable_unit("m", system)
        low, middle, high = [f"{length.scale * v:.1f}" for v in step.record["along_values"]]
        values_along = f"{low}, {middle} and {high} {length.name}"
    spread = None
    if len(bodies) > len(means):
        spread = output.table(
            "measurement-spread",
            [
                {**row, "everyday_name": everyday_name(row["measurement"])}
                for row in step.record["spreads"]
            ],
            {"median": "m", "worst": "m"},
        )
    html = fill(
        "measurements",
        gap=gap_format(system),
        most_poses=report.plan.most_poses,
        people=output.table("measurements", means, si_units),
        columns=columns,
        lines=output.figure(
            "measurement-lines",
            draw_measurement_lines,
            step.arrays["straight"][0],
            faces,
            system=system,
        ),
        person=means[0]["person"],
        spread=spread,
        along=_ALONG,
        values_along=values_along,
        strip=strip,
        regression=step.record,
    )
    return Section("measurements", "Girths, lengths and volumes", "Measurements", html)


def _measure(report: Report, definitions: MeasurementSet) -> Step:
    """Measure each person in the standard pose, and regress shape on the waist girth."""
    bodies = report.bodies
    seed = report.plan.seed
    most_poses = report.plan.most_poses
    people = np.unique(bodies.subject)

    def compute() -> Computed:
        measurements = Measurements(definitions)
        straight = [
            in_standard_pose(definitions, bodies.points[bodies.subject == person][:most_poses])
            for person in people
        ]
        values = [
            measurements.measure(poses, axes="space", missing="nan").values for poses in straight
        ]
        means = np.array([value.mean(axis=0) for value in values])
        arrays = {"straight": np.array([points[0] for points in straight])}
        names = measurements.names
        record: JSONRecord = {
            "units": dict(zip(names, measurements.units, strict=True)),
            "means": [
                {"person": bodies.subject_names[person], **dict(zip(names, sizes, strict=True))}
                for person, sizes in zip(people, means.tolist(), strict=True)
            ],
            "spreads": _spreads(measurements, values),
        }
        # Without labels, several bodies may be of one person, which would invalidate permutations.
        if len(people) >= _FEWEST_PEOPLE and report.has_poses:
            girths = means[:, names.index(_ALONG)]
            space = AlignedSurfaces(bodies.template)
            space.equip_with_metric(ElasticMetric, **_REGRESSION_WEIGHTS)
            shape = regress_shape(space, girths, arrays["straight"], rng=seed, max_iter=0)
            along = np.array([girths.min(), girths.mean(), girths.max()])
            arrays["along"] = shape.regression.predict(along)
            record["along_values"] = along.tolist()
            record["explained"], record["p_value"] = shape.explained, shape.p_value
            record["n_permutations"] = shape.n_permutations
        return arrays, record

    return report.store.step("measurements", compute, "Measurements", poses=most_poses, seed=seed)


def _spreads(measurements: Measurements, values: Sequence[Array]) -> list[JSONRecord]:
    """Return how much lengths of one person vary with the pose, over people with several."""
    several = [of_person for of_person in values if len(of_person) > 1]
    rows: list[JSONRecord] = []
    if not several:
        return rows
    deviations = np.array([of_person.std(axis=0, ddof=1) for of_person in several])
    for k, (name, unit) in enumerate(zip(measurements.names, measurements.units, strict=True)):
        if unit == "m" and np.isfinite(deviations[:, k]).any():
            median = float(np.nanmedian(deviations[:, k]))
            worst = float(np.nanmax(deviations[:, k]))
            rows.append({"measurement": name, "median": median, "worst": worst})
    return rows


def _draw_sweep(panels: Mapping[str, Array], lams: Sequence[float], weights: list[str]) -> Figure:
    figure = new_figure(8.6, 2.9)
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for (title, values), ax in zip(panels.items(), axes, strict=True):
        plot_sweep(values, lams, weights, ax=ax)
        ax.set_title(title)
    return figure


def draw_measurement_lines(surface: Points, faces: Triangles, *, system: str) -> Figure:
    measurements = Measurements(Template(surface, faces))
    names = {name: everyday_name(name) for name in measurements.names}
    return plot_measurements(measurements, surface, pose="as is", system=system, names=names)
