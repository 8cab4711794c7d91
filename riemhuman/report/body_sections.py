"""The sections of the report on all bodies: retrieval, maps and sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.plots._figures import new_figure
from riemhuman.plots.maps import plot_embedding, stress
from riemhuman.plots.result_plots import (
    plot_confusion,
    plot_precision_recall,
    plot_sweep,
)
from riemhuman.report import findings
from riemhuman.report.experiments import retrieval_rows
from riemhuman.report.materials import Materials, Task
from riemhuman.report.page import Section, figure, heading, paragraph, side_by_side
from riemhuman.report.paper import PAPER_TABLES
from riemhuman.report.plan import POSE, SHAPE, spoken
from riemhuman.report.tables import Column, Table
from riemhuman.retrieval.rankings import confusion, precision_recall

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies
    from riemhuman.report._result_store import Step

_SCORES = (
    Column("nn", "NN", ".1f", "highest"),
    Column("first_tier", "FT", ".1f", "highest"),
    Column("second_tier", "ST", ".1f", "highest"),
)


def _retrieval_section(materials: Materials) -> Section | None:
    """Return the section with retrieval tables, precision–recall curves and mistakes."""
    tasks, results = materials.tasks(), materials.results
    if not tasks:
        return None
    parts = [
        paragraph(
            "Each body is a query, once for the other bodies of its person and once for the other "
            "bodies in its pose; all other bodies are ranked by distance."
        ),
        side_by_side(*(_scores(materials, task) for task in tasks)),
    ]
    parts += [
        paragraph(f"{escape(name)} cannot be computed for these bodies: {escape(problem)}")
        for name, problem in results.problems.items()
    ]
    parts += [
        heading("Precision and recall"),
        side_by_side(*(_curves(materials, task) for task in tasks)),
        heading("Mistakes"),
        side_by_side(*(_mistakes(materials, task) for task in tasks)),
        heading("The tables of the paper"),
        side_by_side(*(materials.table(_paper_table(task.name)) for task in tasks)),
        heading("Times"),
        materials.table(_cost_table(results.distances)),
    ]
    return Section("retrieval", "Who is it, and how do they stand?", "Retrieval", parts)


def _scores(materials: Materials, task: Task) -> str:
    table = _score_table(task.name, materials.results.distances, task.labels)
    rival = POSE if task.metric == SHAPE else SHAPE
    said = f"{_verdict(table, task.metric)} {findings.below_chance(table.rows, rival, task.labels)}"
    return f'{heading(task.question)}{materials.table(table)}<p class="note">{said}</p>'


def _curves(materials: Materials, task: Task) -> str:
    distances = materials.results.distances
    points = _precision_recall_table(task.name, distances, task.labels)
    picture = materials.picture(
        f"precision-recall-{task.name}",
        f"Precision against recall of {task.name}, one curve for each representation.",
        _draw_precision_recall,
        distances,
        task.labels,
    )
    caption = (
        f"{task.question} Precision at each level of recall. An ideal curve runs along the top: "
        f"the whole class is ranked first. {materials.file(points)}"
    )
    return figure(picture, caption)


def _mistakes(materials: Materials, task: Task) -> str:
    matrix = materials.results.distances[task.metric].arrays["distances"]
    counts = _confusion_table(task.name, matrix, task.labels, task.names)
    picture = materials.picture(
        f"confusion-{task.name}",
        f"Confusion matrix of nearest neighbours under the {task.metric}.",
        _draw_confusion,
        matrix,
        task.labels,
        task.names,
    )
    caption = (
        f"{task.question} Confusion of nearest neighbours under the {task.metric}: rows are "
        "bodies, columns their nearest neighbours; entries off the diagonal are mistakes. "
        f"{materials.file(counts)}"
    )
    return figure(picture, caption)


def _map_section(materials: Materials) -> Section:
    """Return the section with the maps."""
    bodies, positions = materials.bodies, materials.results.maps.arrays
    parts = [
        paragraph(
            "Each point is a body, its colour shows the class, and one body of each class is "
            "drawn. t-SNE preserves neighbourhoods, and its positions have no unit; "
            "multidimensional scaling (MDS) preserves distances, in metres, where it can."
        )
    ]
    for method, title in (("t-sne", "t-SNE"), ("mds", "MDS")):
        figures = []
        for task, name, labels, names in (
            ("shape", SHAPE, bodies.subject, bodies.subject_names),
            ("pose", POSE, bodies.pose, bodies.pose_names),
        ):
            placed = positions[f"{task} {method}"]
            kind = "person" if task == "shape" else "pose"
            picture = materials.picture(
                f"map-{task}-{method}",
                f"{title} map of the bodies by the {name}, coloured by {kind}.",
                _draw_map,
                bodies,
                placed,
                labels,
                names,
                "m" if method == "mds" else None,
            )
            said = (
                f"{title}, {name}. Points of one {kind} share a colour; the nearest point is of "
                f"the same {kind} for {findings.neighbours_kept(placed, labels):.0f} % of bodies."
            )
            if method == "mds":
                distances = materials.results.distances[name].arrays["distances"]
                said += f" Stress: {stress(distances, placed):.2f}; 0 would preserve all distances."
            figures.append(figure(picture, said))
        parts += [heading(title), side_by_side(*figures)]
    return Section("maps", "Maps of people and of poses", "Maps", parts)


def sweep_section(materials: Materials) -> Section | None:
    """Return the section with the sweep over the weights.

    Parameters
    ----------
    materials : Materials
        Results of the report.

    Returns
    -------
    Section or None
        None if the labels do not give suitable bodies.
    """
    step, plan = materials.results.sweep, materials.plan
    if not materials.tasks():
        return None
    table = _sweep_table(step)
    shape = (len(plan.lams), len(plan.weights))
    panels = {}
    for task in materials.tasks():
        key = f"{task.name}_mean_average_precision"
        values = np.array([row[key] for row in step.record["rows"]])
        alone = np.full((shape[0], 1), values[-1])
        panels[f"{task.question} (mAP, %)"] = np.hstack([values[:-1].reshape(shape), alone])
    weights = [f"{weight:g}" for weight in plan.weights] + ["a = 0"]
    picture = materials.picture(
        "sweep",
        "Mean average precision of shape and of pose retrieval over λ and c.",
        _draw_sweep,
        panels,
        plan.lams,
        weights,
    )
    parts = [
        paragraph(
            f"{findings.best_weights(step.record['rows'])} The last column shows the normal part "
            "alone, a = 0 and c = 1."
        ),
        figure(
            picture, "Mean average precision (mAP), per cent; the deepest blue is 100 %.", wide=True
        ),
        "<details><summary>All numbers</summary>" + materials.table(table) + "</details>",
    ]
    return Section("sweep", "Between shape and pose", "Weights", parts)


def _verdict(table: Table, ours: str) -> str:
    """Return a sentence on the representations that score higher than ours."""
    names = [row["representation"] for row in table.rows]
    own = names.index(ours)
    said = []
    for key, title in (("nn", "NN"), ("first_tier", "FT"), ("second_tier", "ST")):
        better = [row for row in range(len(names)) if table.rows[row][key] > table.rows[own][key]]
        if better:
            listed = ", ".join(f"{escape(names[row])} ({table.number(row, key)})" for row in better)
            said.append(f"{title}: {listed}.")
    if not said:
        return f"No representation scores higher than the {escape(ours)}."
    return f"These representations score higher than the {escape(ours)}. {' '.join(said)}"


def _score_table(task: str, distances: Mapping[str, Step], labels: ndarray) -> Table:
    columns = (
        Column("representation", "Representation"),
        *_SCORES,
        Column("mean_average_precision", "mAP", ".1f", "highest"),
    )
    return Table(
        f"retrieval-{task}",
        "Per cent, every body against all others: nearest neighbour, first and second tier, mean "
        "average precision. The best of each column is marked.",
        columns,
        retrieval_rows(distances, labels),
    )


def _cost_table(distances: Mapping[str, Step]) -> Table:
    rows = [
        {
            "representation": name,
            # All the work of a metric is in the pairs.
            "milliseconds_a_body": 1000 * step.record["seconds_per_body"] or None,
            "microseconds_a_pair": 1e6 * step.record["seconds_per_pair"],
        }
        for name, step in distances.items()
    ]
    columns = (
        Column("representation", "Representation"),
        Column("milliseconds_a_body", "ms a body", ".1f"),
        Column("microseconds_a_pair", "μs a pair", ".2f"),
    )
    return Table(
        "costs",
        "Wall time to describe a body, and of a distance, on all cores of this machine.",
        columns,
        rows,
    )


def _paper_table(task: str) -> Table:
    keys = ("representation", "nn", "first_tier", "second_tier")
    return Table(
        f"paper-{task}",
        "As printed in the paper, on the registrations of FAUST; not computed here.",
        (Column("representation", "Representation"), *_SCORES),
        [dict(zip(keys, row, strict=True)) for row in PAPER_TABLES[task]],
    )


def _precision_recall_table(task: str, distances: Mapping[str, Step], labels: ndarray) -> Table:
    rows = []
    for name, step in distances.items():
        recall, precision = precision_recall(step.arrays["distances"], labels)
        rows += [
            {"representation": name, "recall": float(r), "precision": float(p)}
            for r, p in zip(recall, precision, strict=True)
        ]
    columns = (
        Column("representation", "Representation"),
        Column("recall", "recall", ".2f"),
        Column("precision", "precision", ".3f"),
    )
    return Table(f"precision-recall-{task}", "Precision at every level of recall.", columns, rows)


def _confusion_table(task: str, distances: ndarray, labels: ndarray, names: Sequence[str]) -> Table:
    classes = [names[label] for label in np.unique(labels)]
    counts = confusion(distances, labels)
    rows: list[dict[str, Any]] = [
        {"class": name, **dict(zip(classes, row.tolist(), strict=True))}
        for name, row in zip(classes, counts, strict=True)
    ]
    columns = (Column("class", "body"), *(Column(name, name, "d") for name in classes))
    return Table(f"confusion-{task}", "Classes of the nearest neighbours.", columns, rows)


def _sweep_table(step: Step) -> Table:
    columns = [Column("lam", "λ", "g"), Column("a", "a", "g"), Column("c", "c", "g")]
    for task in ("shape", "pose"):
        if f"{task}_nn" in step.record["rows"][0]:
            columns += [
                Column(f"{task}_nn", f"NN, {task}", ".1f", "highest"),
                Column(f"{task}_mean_average_precision", f"mAP, {task}", ".1f", "highest"),
            ]
    return Table("sweep", "Retrieval of people (shape) and of poses.", columns, step.record["rows"])


def _draw_map(
    bodies: Bodies,
    positions: ndarray,
    labels: ndarray,
    names: Sequence[str],
    unit: str | None = None,
) -> Figure:
    figure = new_figure(4.5, 4.8)  # on which names are large enough for a telephone
    plot_embedding(
        positions,
        labels,
        [spoken(name) for name in names],
        points=bodies.points,
        faces=bodies.template.faces,
        unit=unit,
        ax=figure.subplots(),
    )
    return figure


def _draw_precision_recall(distances: Mapping[str, Step], labels: ndarray) -> Figure:
    figure = new_figure(3.5, 3.2)
    matrices = {name: step.arrays["distances"] for name, step in distances.items()}
    plot_precision_recall(matrices, labels, ax=figure.subplots())
    return figure


def _draw_confusion(distances: ndarray, labels: ndarray, names: Sequence[str]) -> Figure:
    figure = new_figure(3.5, 3.5)
    plot_confusion(distances, labels, [spoken(name) for name in names], ax=figure.subplots())
    return figure


def _draw_sweep(scores: Mapping[str, ndarray], lams: Sequence[float], weights: list[str]) -> Figure:
    figure = new_figure(8.6, 2.9)
    axes = figure.subplots(1, len(scores), squeeze=False)[0]
    for (title, values), ax in zip(scores.items(), axes, strict=True):
        plot_sweep(values, lams, weights, ax=ax)
        ax.set_title(title)
    return figure


SECTIONS = (_retrieval_section, _map_section)
"""Functions that make the first sections from the results; None if the labels do not allow one."""
