"""The sections of the report on single bodies: differences, geodesics, comparison and mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.plots._colors import MEAN, SKIN
from riemhuman.plots._figures import new_figure
from riemhuman.plots._viewer_data import ViewedBody
from riemhuman.plots.body_plots import per_area, plot_body, plot_path
from riemhuman.plots.result_plots import plot_energy
from riemhuman.plots.viewer import Viewer
from riemhuman.report import findings
from riemhuman.report.materials import Materials
from riemhuman.report.page import Section, figure, heading, paragraph, viewer_figure
from riemhuman.report.path_experiments import LINEAR, MODEL, OURS, SOBOLEV, SRNF_PATH
from riemhuman.report.plan import name_of
from riemhuman.report.tables import Column, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.datasets import Bodies
    from riemhuman.report._result_store import Step

_PATH_TITLES = {
    LINEAR: "linear",
    SRNF_PATH: "SRNF",
    SOBOLEV: "Sobolev, a2 = 0.001",
    MODEL: "body model",
    OURS: "ours (1, 1, 0)",
}
_GEODESIC_KEYS = (
    "straight_energy",
    "energy_from_straight",
    "energy",
    "squared_distance",
    "n_iterations",
    "seconds",
    "converged",
)


def _difference_section(materials: Materials) -> Section | None:
    """Return the section that shows where two bodies differ."""
    step = materials.results.differences
    if step is None:
        return None
    bodies, template = materials.bodies, materials.bodies.template
    picture = materials.picture(
        "differences",
        "Bodies coloured by the contribution of each triangle to their distance.",
        _draw_differences,
        bodies,
        step,
    )
    choices = {}
    for name, (one, other) in step.record["pairs"].items():
        shown = [ViewedBody(name_of(bodies, one), bodies.points[[one]])]
        for part in ("metric", "normal"):
            values = per_area(step.arrays[f"{name} {part}"], template.vertices, template.faces)
            label = f"{name_of(bodies, other)}: {part} part"
            shown.append(
                ViewedBody(label, bodies.points[[other]], values=values, value_label="per m²")
            )
        choices[name] = shown
    viewer = Viewer(template.faces, choices, "Pair", "Where two bodies differ")
    parts = [
        paragraph(
            "The squared distance is a sum over triangles of a metric part (stretching and "
            "shearing) and a normal part (turning). Pale triangles contribute nothing, dark red "
            f"ones the most. {findings.shares(step.record['rows'])}"
        ),
        viewer_figure(
            viewer.fragment("differences-view"),
            "Turn the bodies. 1 % of the triangles exceed the end of each colour scale.",
        ),
        figure(picture, "The same as a figure, with colour scales.", wide=True),
        materials.table(_difference_table(step)),
    ]
    return Section("differences", "Where do two bodies differ?", "Differences", parts)


def _geodesic_section(materials: Materials) -> Section | None:
    """Return the section with the geodesics."""
    bodies, results = materials.bodies, materials.results
    every = {**results.geodesics, **results.viewed}
    if not every:
        return None
    table = _geodesic_table(bodies, every)
    energies = _energy_table(every)
    parts = [
        paragraph(
            "A geodesic is a path of least energy. The metric (1, 1, 0) measures how triangles "
            "stretch and shear along the path; the normal part alone, (0, 0, 1), measures how they "
            f"turn. Basis: {results.basis}."
        )
    ]
    for (name, step), letter in zip(results.geodesics.items(), "ab", strict=False):
        start, end = step.record["pair"]
        slug = step.name
        picture = materials.picture(
            slug,
            f"Film strip of the geodesic from {name_of(bodies, start)} to "
            f"{name_of(bodies, end)}, with its energy at each iteration.",
            _draw_geodesic,
            bodies,
            step,
        )
        weights = ", ".join(f"{weight:g}" for weight in step.record["weights"])
        caption = (
            f"As figure 4 ({letter}) of the paper, {name}: from {materials.name(start)} to "
            f"{materials.name(end)} under ({weights}). Right: the energy after each iteration, "
            "from the straight path, as in the paper, and from the path that turns each triangle; "
            f"d² is a lower bound. {materials.file(energies)}"
        )
        parts.append(figure(picture, caption, wide=True))
    if results.viewed:
        choices = {
            name: [ViewedBody("", step.arrays["path"])] for name, step in results.viewed.items()
        }
        start, end = next(iter(results.viewed.values())).record["pair"]
        viewer = Viewer(bodies.template.faces, choices, "Metric", "Geodesic under three metrics")
        parts += [
            heading("One pair, three metrics"),
            viewer_figure(
                viewer.fragment("geodesics-view"),
                f"From {materials.name(start)} to {materials.name(end)}. Switch the metric "
                "at the middle of the path to see the differences.",
            ),
        ]
    parts.append(materials.table(table))
    return Section("geodesics", "Geodesics", "Geodesics", parts)


def _comparison_section(materials: Materials) -> Section | None:
    """Return the section that compares the paths of several methods."""
    step = materials.results.comparison
    if step is None:
        return None
    bodies = materials.bodies
    table = _comparison_table(step)
    names = [row["name"] for row in step.record["rows"]]
    picture = materials.picture(
        "comparison",
        f"Film strips of the paths {', '.join(names)} between the same two bodies.",
        _draw_comparison,
        bodies,
        step,
    )
    shown = [ViewedBody(_PATH_TITLES.get(n, n), step.arrays[n]) for n in names]
    title = f"{len(names)} paths between the same two bodies"
    viewer = Viewer(bodies.template.faces, {title: shown}, "Paths", title)
    start, end = step.record["pair"]
    ours = table.number(names.index(OURS), "area_change_mean")
    linear = table.number(0, "area_change_mean")
    parts = [
        paragraph(
            f"From {materials.name(start)} to {materials.name(end)}, as in figure 5 of the "
            "paper. Beyond the change between the ends, the areas of triangles change "
            f"by {linear} on average along the straight path, and by {ours} along ours."
        ),
        viewer_figure(
            viewer.fragment("comparison-view"),
            "All paths at the same time; compare the limbs in the middle.",
        ),
        figure(picture, "The same as film strips.", wide=True),
        materials.table(table),
    ]
    count = {4: "Four", 5: "Five"}[len(names)]
    heading_text = f"{count} paths from one pose to another"
    return Section("comparison", heading_text, f"{count} paths", parts)


def _mean_section(materials: Materials) -> Section | None:
    """Return the section with the Karcher mean."""
    step = materials.results.mean
    if step is None:
        return None
    bodies, group = materials.bodies, step.record["group"]
    picture = materials.picture(
        "mean",
        f"{len(group)} people in one pose and, last and in yellow, their Karcher mean.",
        _draw_mean,
        bodies,
        step,
    )
    shown = [ViewedBody(name_of(bodies, index), bodies.points[[index]]) for index in group]
    shown.append(ViewedBody("Karcher mean", step.arrays["mean"][None], MEAN))
    title = "Bodies and their Karcher mean"
    viewer = Viewer(bodies.template.faces, {title: shown}, "Bodies", title)
    parts = [
        paragraph(
            f"The body with the least mean squared distance from {len(group)} people in one pose, "
            "under the normal part alone, (0, 0, 1), as in figure 6 of the paper."
        ),
        figure(picture, "People, and their mean in yellow.", wide=True),
        viewer_figure(viewer.fragment("mean-view"), "Turn the bodies; the mean is yellow."),
        materials.table(_mean_table(bodies, step)),
    ]
    return Section("mean", "The mean of several people", "Mean", parts)


def _difference_table(step: Step) -> Table:
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


def _geodesic_table(bodies: Bodies, steps: Mapping[str, Step]) -> Table:
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


def _energy_table(steps: Mapping[str, Step]) -> Table:
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


def _comparison_table(step: Step) -> Table:
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


def _mean_table(bodies: Bodies, step: Step) -> Table:
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


def _draw_differences(bodies: Bodies, step: Step) -> Figure:
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


def _draw_geodesic(bodies: Bodies, step: Step) -> Figure:
    """Draw a geodesic as a film strip, with its energy beside it (figure 4 of the paper)."""
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


def _draw_comparison(bodies: Bodies, step: Step) -> Figure:
    """Draw several paths between two bodies below each other (figure 5 of the paper)."""
    names = [row["name"] for row in step.record["rows"]]
    figure = new_figure(8.0, 1.75 * len(names))
    axes = figure.subplots(len(names), 1, squeeze=False)[:, 0]
    for name, ax in zip(names, axes, strict=True):
        plot_path(step.arrays[name], bodies.template.faces, n_shown=7, ax=ax)
        ax.set_anchor("W")
        ax.annotate(
            _PATH_TITLES.get(name, name), (0.0, 0.5), xycoords="axes fraction", xytext=(-6, 0),
            textcoords="offset points", ha="right", va="center",
        )  # fmt: skip
    return figure


def _draw_mean(bodies: Bodies, step: Step) -> Figure:
    """Draw bodies and, last and in yellow, their Karcher mean (figure 6 of the paper)."""
    group = step.record["group"]
    figure = new_figure(8.0, 2.6)
    ax = figure.subplots()
    shown = np.concatenate([bodies.points[group], step.arrays["mean"][None]])
    colors = [SKIN] * len(group) + [MEAN]
    plot_path(shown, bodies.template.faces, colors=colors, ax=ax)
    return figure


SECTIONS = (_difference_section, _geodesic_section, _comparison_section, _mean_section)
"""Functions that make the sections from the results; None if the labels do not allow one."""
