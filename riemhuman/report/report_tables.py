"""The tables of the report, from the results of the experiments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.report.experiments import retrieval_rows
from riemhuman.report.paper import PAPER_TABLES
from riemhuman.report.plan import name_of
from riemhuman.report.tables import Column, Table
from riemhuman.retrieval.rankings import confusion, precision_recall

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies
    from riemhuman.storage.result_store import Step

_SCORES = (
    Column("nn", "NN", ".1f", "highest"),
    Column("first_tier", "FT", ".1f", "highest"),
    Column("second_tier", "ST", ".1f", "highest"),
)


def score_table(task: str, distances: Mapping[str, Step], labels: ndarray) -> Table:
    """Return how well every representation finds bodies of the same class.

    Parameters
    ----------
    task : {"shape", "pose"}
        What the classes are.
    distances : mapping of str to Step
        Distances by representation.
    labels : array, shape (n,)
        Classes.

    Returns
    -------
    Table
    """
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


def cost_table(distances: Mapping[str, Step]) -> Table:
    """Return what every representation costs.

    Parameters
    ----------
    distances : mapping of str to Step
        Distances by representation.

    Returns
    -------
    Table
    """
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


def paper_table(task: str) -> Table:
    """Return the paper's own table, on FAUST.

    Parameters
    ----------
    task : {"shape", "pose"}
        What the classes are.

    Returns
    -------
    Table
    """
    keys = ("representation", "nn", "first_tier", "second_tier")
    return Table(
        f"paper-{task}",
        "As printed in the paper, on the registrations of FAUST; not computed here.",
        (Column("representation", "Representation"), *_SCORES),
        [dict(zip(keys, row, strict=True)) for row in PAPER_TABLES[task]],
    )


def precision_recall_table(task: str, distances: Mapping[str, Step], labels: ndarray) -> Table:
    """Return the points of the precision–recall curves.

    Parameters
    ----------
    task : {"shape", "pose"}
        What the classes are.
    distances : mapping of str to Step
        Distances by representation.
    labels : array, shape (n,)
        Classes.

    Returns
    -------
    Table
    """
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


def confusion_table(task: str, distances: ndarray, labels: ndarray, names: Sequence[str]) -> Table:
    """Return the confusion matrix of nearest neighbours.

    Parameters
    ----------
    task : {"shape", "pose"}
        What the classes are.
    distances : array, shape (n, n)
        Distances.
    labels : array of int, shape (n,)
        Classes.
    names : sequence of str
        Names of the classes.

    Returns
    -------
    Table
    """
    classes = [names[label] for label in np.unique(labels)]
    counts = confusion(distances, labels)
    rows: list[dict[str, Any]] = [
        {"class": name, **dict(zip(classes, row.tolist(), strict=True))}
        for name, row in zip(classes, counts, strict=True)
    ]
    columns = (Column("class", "body"), *(Column(name, name, "d") for name in classes))
    return Table(f"confusion-{task}", "Classes of the nearest neighbours.", columns, rows)


def geodesic_table(bodies: Bodies, steps: Mapping[str, Step]) -> Table:
    """Return energies, iterations and times of geodesics.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    steps : mapping of str to Step
        Geodesics by name.

    Returns
    -------
    Table
    """
    rows = []
    for name, step in steps.items():
        start, end = step.record["pair"]
        weights = ", ".join(f"{weight:g}" for weight in step.record["weights"])
        rows.append(
            {
                "geodesic": name,
                "from": name_of(bodies, start),
                "to": name_of(bodies, end),
                "metric": f"({weights})",
                **{key: step.record[key] for key in _GEODESIC_KEYS},
            }
        )
    columns = (
        Column("geodesic", "Geodesic"),
        Column("from", "From"),
        Column("to", "To"),
        Column("metric", "(a, λ, c)", whole=True),
        Column("straight_energy", "Straight path", ".4f"),
        Column("energy_from_straight", "Found from it", ".4f"),
        Column("energy", "Geodesic", ".4f"),
        Column("squared_distance", "d²", ".4f"),
        Column("n_iterations", "Iterations", "d"),
        Column("seconds", "Seconds", ".2f"),
        Column("converged", "Converged", shown=False),
    )
    return Table(
        "geodesics",
        "Energy of the straight path, of the path that the search finds from it, as in the paper, "
        "and of the one found from the path that turns every triangle. The squared closed-form "
        "distance d² bounds all of them from below.",
        columns,
        rows,
    )


_GEODESIC_KEYS = (
    "straight_energy",
    "energy_from_straight",
    "energy",
    "squared_distance",
    "n_iterations",
    "seconds",
    "converged",
)


def energy_table(steps: Mapping[str, Step]) -> Table:
    """Return the energy of geodesics after every iteration.

    Parameters
    ----------
    steps : mapping of str to Step
        Geodesics by name.

    Returns
    -------
    Table
    """
    starts = {"straight path": "energies_from_straight", "turning path": "energies"}
    rows = [
        {"geodesic": name, "start": start, "iteration": iteration, "energy": float(energy)}
        for name, step in steps.items()
        for start, key in starts.items()
        for iteration, energy in enumerate(step.arrays[key])
    ]
    columns = (
        Column("geodesic", "Geodesic"),
        Column("start", "start"),
        Column("iteration", "iteration", "d"),
        Column("energy", "energy", ".4f"),
    )
    return Table("energies", "Energy after every iteration.", columns, rows)


def comparison_table(step: Step) -> Table:
    """Return the measures of the paths compared.

    Parameters
    ----------
    step : Step
        The comparison.

    Returns
    -------
    Table
    """
    shown = {
        "energy_ours": ("Energy (1, 1, 0)", ".4f", "lowest"),
        "area_change_mean": ("Areas, mean", ".1%", "lowest"),
        "area_change_quantile_99": ("Areas, 99 %", ".1%", "lowest"),
        "edge_change_mean": ("Lengths, mean", ".1%", "lowest"),
        "volume_change": ("Volume", ".2%", "lowest"),
        "mean_deviation": ("mm from the model", ".1f", ""),
        "n_iterations": ("Iterations", "d", ""),
        "seconds": ("Seconds", ".2f", ""),
    }
    columns = [Column("name", "Path")]
    columns += [Column(key, *about) for key, about in shown.items()]
    columns += [
        Column(key, key, shown=False)
        for key in step.record["rows"][0]
        if key != "name" and key not in shown
    ]
    return Table(
        "comparison",
        "Changes of the triangles' areas, the edges' lengths and the volume along the path, beyond "
        "the change between the ends.",
        columns,
        step.record["rows"],
    )


def mean_table(bodies: Bodies, step: Step) -> Table:
    """Return the distances of bodies from their mean.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    step : Step
        The mean.

    Returns
    -------
    Table
    """
    rows = [
        {"body": name_of(bodies, index), "distance": distance, "squared_distance": distance**2}
        for index, distance in zip(step.record["group"], step.record["distances"], strict=True)
    ]
    columns = (
        Column("body", "Body"),
        Column("distance", "Distance from the mean", ".4f"),
        Column("squared_distance", "Squared", ".4f"),
    )
    return Table("mean", "Distances of the bodies from their Karcher mean.", columns, rows)


def difference_table(step: Step) -> Table:
    """Return the metric and the normal part of the squared distance of pairs.

    Parameters
    ----------
    step : Step
        Contributions of the triangles.

    Returns
    -------
    Table
    """
    columns = (
        Column("pair", "Pair"),
        Column("metric_part", "Metric part", ".4f"),
        Column("normal_part", "Normal part", ".4f"),
        Column("squared_distance", "d²", ".4f"),
    )
    return Table(
        "differences",
        "The two parts of the squared distance under (1, 1, 1), summed over all triangles.",
        columns,
        step.record["rows"],
    )


def sweep_table(step: Step) -> Table:
    """Return the scores over λ and c.

    Parameters
    ----------
    step : Step
        The sweep.

    Returns
    -------
    Table
    """
    columns = [Column("lam", "λ", "g"), Column("a", "a", "g"), Column("c", "c", "g")]
    for task in ("shape", "pose"):
        if f"{task}_nn" in step.record["rows"][0]:
            columns += [
                Column(f"{task}_nn", f"NN, {task}", ".1f", "highest"),
                Column(f"{task}_mean_average_precision", f"mAP, {task}", ".1f", "highest"),
            ]
    return Table("sweep", "Retrieval of people (shape) and of poses.", columns, step.record["rows"])


def step_table(steps: Sequence[Step]) -> Table:
    """Return how long every step took when it was computed.

    Parameters
    ----------
    steps : sequence of Step
        Steps.

    Returns
    -------
    Table
    """
    rows = [{"title": step.title, "step": step.name, "seconds": step.seconds} for step in steps]
    return Table(
        "steps",
        "Wall time of every step when it was computed.",
        (
            Column("title", "Step"),
            Column("step", "step", shown=False),
            Column("seconds", "Seconds", ".2f"),
        ),
        rows,
    )
