"""The figures of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.plots.body_plots import per_area, plot_body, plot_path
from riemhuman.plots.figures import new_figure
from riemhuman.plots.result_plots import (
    plot_confusion,
    plot_embedding,
    plot_energy,
    plot_precision_recall,
    plot_sweep,
)
from riemhuman.report.path_experiments import LINEAR, MODEL, OURS, SOBOLEV, SRNF_PATH
from riemhuman.report.plan import name_of, spoken
from riemhuman.surfaces.rendering import MEAN, SKIN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies
    from riemhuman.storage.result_store import Step

PATH_TITLES = {
    LINEAR: "linear",
    SRNF_PATH: "SRNF",
    SOBOLEV: "Sobolev, a2 = 0.001",
    MODEL: "body model",
    OURS: "ours (1, 1, 0)",
}


def draw_map(
    bodies: Bodies,
    positions: ndarray,
    labels: ndarray,
    names: Sequence[str],
    unit: str | None = None,
) -> Figure:
    """Draw a map of the bodies, with a body of each class.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    positions : array, shape (n, 2)
        Positions of the bodies.
    labels : array of int, shape (n,)
        Class of each item.
    names : sequence of str
        Names of the classes.
    unit : str, optional
        Unit of the positions, if they have any.

    Returns
    -------
    matplotlib.figure.Figure
    """
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


def draw_precision_recall(distances: Mapping[str, Step], labels: ndarray) -> Figure:
    """Draw precision against recall for each representation.

    Parameters
    ----------
    distances : mapping of str to Step
        Distances of each representation.
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(4.0, 3.2)
    matrices = {name: step.arrays["distances"] for name, step in distances.items()}
    plot_precision_recall(matrices, labels, ax=figure.subplots())
    return figure


def draw_confusion(distances: ndarray, labels: ndarray, names: Sequence[str]) -> Figure:
    """Draw the confusion matrix of nearest neighbours.

    Parameters
    ----------
    distances : array, shape (n, n)
        Distances.
    labels : array, shape (n,)
        Class of each item.
    names : sequence of str
        Names of the classes.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(3.9, 3.7)
    plot_confusion(distances, labels, [spoken(name) for name in names], ax=figure.subplots())
    return figure


def draw_geodesic(bodies: Bodies, step: Step) -> Figure:
    """Draw a geodesic as a film strip, with its energy beside it (figure 4 of the paper).

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    step : Step
        The geodesic.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(10.0, 2.1)
    strip, curve = figure.subplots(1, 2, width_ratios=[0.77, 0.23])
    plot_path(step.arrays["path"], bodies.template.faces, n_shown=6, ax=strip)
    strip.set_anchor("W")
    lines = {
        "straight path": step.record["straight_energy"],
        "d² of the ends": step.record["squared_distance"],
    }
    curves = {
        "from the straight path": step.arrays["energies_from_straight"],
        "from the turning path": step.arrays["energies"],
    }
    plot_energy(curves, lines=lines, ax=curve)
    return figure


def draw_comparison(bodies: Bodies, step: Step) -> Figure:
    """Draw several paths between two bodies below each other (figure 5 of the paper).

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    step : Step
        The comparison.

    Returns
    -------
    matplotlib.figure.Figure
    """
    names = [row["name"] for row in step.record["rows"]]
    figure = new_figure(8.0, 1.75 * len(names))
    axes = figure.subplots(len(names), 1, squeeze=False)[:, 0]
    for name, ax in zip(names, axes, strict=True):
        plot_path(step.arrays[name], bodies.template.faces, n_shown=7, ax=ax)
        ax.set_anchor("W")
        ax.annotate(
            PATH_TITLES.get(name, name), (0.0, 0.5), xycoords="axes fraction", xytext=(-6, 0),
            textcoords="offset points", ha="right", va="center",
        )  # fmt: skip
    return figure


def draw_mean(bodies: Bodies, step: Step) -> Figure:
    """Draw bodies and, last and in yellow, their Karcher mean (figure 6 of the paper).

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    step : Step
        The mean.

    Returns
    -------
    matplotlib.figure.Figure
    """
    group = step.record["group"]
    figure = new_figure(8.0, 2.6)
    ax = figure.subplots()
    shown = np.concatenate([bodies.points[group], step.arrays["mean"][None]])
    colors = [SKIN] * len(group) + [MEAN]
    plot_path(shown, bodies.template.faces, colors=colors, ax=ax)
    return figure


def draw_differences(bodies: Bodies, step: Step) -> Figure:
    """Draw where pairs of bodies differ, in the metric part and in the normal part.

    Parameters
    ----------
    bodies : Bodies
        The bodies.
    step : Step
        Contributions of the triangles.

    Returns
    -------
    matplotlib.figure.Figure
    """
    template, pairs = bodies.template, step.record["pairs"]
    figure = new_figure(9.6, 3.4 * len(pairs))
    rows = figure.subplots(len(pairs), 3, squeeze=False)
    for (name, (one, other)), axes in zip(pairs.items(), rows, strict=True):
        plot_body(bodies.points[one], template.faces, ax=axes[0])
        axes[0].set_title(name_of(bodies, one))
        for ax, part in zip(axes[1:], ("metric", "normal"), strict=True):
            values = per_area(step.arrays[f"{name} {part}"], template.vertices, template.faces)
            label = f"{part} part, per unit of area"
            plot_body(bodies.points[other], template.faces, values, label=label, ax=ax)
            ax.set_title(name_of(bodies, other))
    return figure


def draw_sweep(scores: Mapping[str, ndarray], lams: Sequence[float], weights: list[str]) -> Figure:
    """Draw the retrieval scores of people and of poses over λ and c.

    Parameters
    ----------
    scores : mapping of str to array, shape (n_lams, n_weights)
        Mean average precision by task.
    lams : sequence of float
        Value of λ of each row.
    weights : list of str
        Label of c of each column.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(8.6, 2.9)
    axes = figure.subplots(1, len(scores), squeeze=False)[0]
    for (title, values), ax in zip(scores.items(), axes, strict=True):
        plot_sweep(values, lams, weights, ax=ax)
        ax.set_title(title)
    return figure
