"""The sections of the report on all bodies: retrieval, maps, sweep."""

from __future__ import annotations

from html import escape

import numpy as np

from riemhuman.plots.embedding import stress
from riemhuman.report import drawings, findings, report_tables
from riemhuman.report.materials import Materials, Task
from riemhuman.report.page import Section, figure, heading, paragraph, side_by_side
from riemhuman.report.plan import POSE, SHAPE
from riemhuman.report.tables import Table


def retrieval_section(materials: Materials) -> Section | None:
    """Return the section with the retrieval tables, the curves and the mistakes.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if no two bodies share a class.
    """
    tasks, results = materials.tasks(), materials.results
    if not tasks:
        return None
    parts = [
        paragraph(
            "Every body is a query, once for the other bodies of its person and once for those in "
            "its pose; all other bodies are ranked by distance."
        ),
        side_by_side(*(_scores(materials, task) for task in tasks)),
    ]
    parts += [
        paragraph(f"{escape(name)} refuses these bodies: {escape(problem)}")
        for name, problem in results.problems.items()
    ]
    parts += [
        heading("Precision and recall"),
        side_by_side(*(_curves(materials, task) for task in tasks)),
        heading("Mistakes"),
        side_by_side(*(_mistakes(materials, task) for task in tasks)),
        heading("The tables of the paper"),
        side_by_side(*(materials.table(report_tables.paper_table(task.name)) for task in tasks)),
        heading("Times"),
        materials.table(report_tables.cost_table(results.distances)),
    ]
    return Section("retrieval", "Who is it, and how do they stand?", "Retrieval", parts)


def _scores(materials: Materials, task: Task) -> str:
    table = report_tables.score_table(task.name, materials.results.distances, task.labels)
    rival = POSE if task.metric == SHAPE else SHAPE
    said = f"{verdict(table, task.metric)} {findings.below_chance(table.rows, rival, task.labels)}"
    return f'{heading(task.question)}{materials.table(table)}<p class="note">{said}</p>'


def _curves(materials: Materials, task: Task) -> str:
    distances = materials.results.distances
    points = report_tables.precision_recall_table(task.name, distances, task.labels)
    picture = materials.picture(
        f"precision-recall-{task.name}",
        f"Precision against recall of {task.name}, one curve for every representation.",
        drawings.draw_precision_recall,
        distances,
        task.labels,
    )
    caption = (
        f"{task.question} Precision at every level of recall; an ideal curve runs along the top: "
        f"it ranks the whole class first. {materials.file(points)}"
    )
    return figure(picture, caption)


def _mistakes(materials: Materials, task: Task) -> str:
    matrix = materials.results.distances[task.metric].arrays["distances"]
    counts = report_tables.confusion_table(task.name, matrix, task.labels, task.names)
    picture = materials.picture(
        f"confusion-{task.name}",
        f"Matrix of the classes of nearest neighbours under the {task.metric}.",
        drawings.draw_confusion,
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


def map_section(materials: Materials) -> Section:
    """Return the section with the maps.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section
    """
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
                drawings.draw_map,
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
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if the labels leave no bodies for it.
    """
    step, plan = materials.results.sweep, materials.plan
    if not materials.tasks():
        return None
    table = report_tables.sweep_table(step)
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
        drawings.draw_sweep,
        panels,
        plan.lams,
        weights,
    )
    parts = [
        paragraph(
            f"{findings.best_weights(step.record['rows'])} The last column shows the normals "
            "alone, a = 0 and c = 1."
        ),
        figure(
            picture, "Mean average precision (mAP), per cent; the deepest blue is 100 %.", wide=True
        ),
        "<details><summary>All numbers</summary>" + materials.table(table) + "</details>",
    ]
    return Section("sweep", "Between shape and pose", "Weights", parts)


def verdict(table: Table, ours: str) -> str:
    """Name the representations that score higher than ours.

    Parameters
    ----------
    table : Table
        Retrieval table.
    ours : str
        Representation to compare the others with.

    Returns
    -------
    str
        HTML.
    """
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
