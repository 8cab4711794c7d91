"""The sections of the report on single bodies: differences, geodesics, comparison, mean."""

from __future__ import annotations

from riemhuman.plots.body_plots import per_area
from riemhuman.plots.viewer import Viewer
from riemhuman.plots.viewer_data import ViewedBody
from riemhuman.report import drawings, findings, report_tables
from riemhuman.report.materials import Materials
from riemhuman.report.page import Section, figure, heading, paragraph, viewer_figure
from riemhuman.report.path_experiments import OURS
from riemhuman.report.plan import name_of
from riemhuman.surfaces.rendering import MEAN


def difference_section(materials: Materials) -> Section | None:
    """Return the section that shows where two bodies differ.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if the labels leave no bodies for it.
    """
    step = materials.results.differences
    if step is None:
        return None
    bodies, template = materials.bodies, materials.bodies.template
    picture = materials.picture(
        "differences",
        "Bodies coloured by how much each triangle adds to their distance.",
        drawings.draw_differences,
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
            f"ones most. {findings.shares(step.record['rows'])}"
        ),
        viewer_figure(
            viewer.fragment("differences-view"),
            "Turn the bodies. 1 % of the triangles exceed the end of each colour scale.",
        ),
        figure(picture, "The same in print, with the scales.", wide=True),
        materials.table(report_tables.difference_table(step)),
    ]
    return Section("differences", "Where do two bodies differ?", "Differences", parts)


def geodesic_section(materials: Materials) -> Section | None:
    """Return the section with the geodesics.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if the labels leave no bodies for it.
    """
    bodies, results = materials.bodies, materials.results
    every = {**results.geodesics, **results.viewed}
    if not every:
        return None
    table = report_tables.geodesic_table(bodies, every)
    energies = report_tables.energy_table(every)
    parts = [
        paragraph(
            "A geodesic is a path of least energy. The metric (1, 1, 0) measures how "
            "triangles stretch and shear along the path, the normals alone, (0, 0, 1), how they "
            "turn. "
            f"The basis: {results.basis}."
        )
    ]
    for (name, step), letter in zip(results.geodesics.items(), "ab", strict=False):
        start, end = step.record["pair"]
        slug = step.name
        picture = materials.picture(
            slug,
            f"Film strip of the geodesic from {name_of(bodies, start)} to "
            f"{name_of(bodies, end)}, with its energy at every iteration.",
            drawings.draw_geodesic,
            bodies,
            step,
        )
        weights = ", ".join(f"{weight:g}" for weight in step.record["weights"])
        caption = (
            f"As figure 4 ({letter}) of the paper, {name}: from {materials.name(start)} to "
            f"{materials.name(end)} under ({weights}). Right: the energy after "
            "every iteration, from the straight path, as in the paper, and from the path that "
            f"turns every triangle; d² is a lower bound. {materials.file(energies)}"
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
                "at the middle of the path to see how the three differ.",
            ),
        ]
    parts.append(materials.table(table))
    return Section("geodesics", "Geodesics", "Geodesics", parts)


def comparison_section(materials: Materials) -> Section | None:
    """Return the section with the paths of several methods.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if the labels leave no bodies for it.
    """
    step = materials.results.comparison
    if step is None:
        return None
    bodies = materials.bodies
    table = report_tables.comparison_table(step)
    names = [row["name"] for row in step.record["rows"]]
    picture = materials.picture(
        "comparison",
        f"Film strips of the paths {', '.join(names)} between the same two bodies.",
        drawings.draw_comparison,
        bodies,
        step,
    )
    shown = [ViewedBody(drawings.PATH_TITLES.get(n, n), step.arrays[n]) for n in names]
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
            "All paths at the same time; compare the limbs half way.",
        ),
        figure(picture, "The same as film strips.", wide=True),
        materials.table(table),
    ]
    count = {4: "Four", 5: "Five"}[len(names)]
    heading_text = f"{count} ways from one pose to another"
    return Section("comparison", heading_text, f"{count} ways", parts)


def mean_section(materials: Materials) -> Section | None:
    """Return the section with the Karcher mean.

    Parameters
    ----------
    materials : Materials
        Results, and where figures and tables go.

    Returns
    -------
    Section or None
        Nothing, if the labels leave no bodies for it.
    """
    step = materials.results.mean
    if step is None:
        return None
    bodies, group = materials.bodies, step.record["group"]
    picture = materials.picture(
        "mean",
        f"{len(group)} people in one pose and, last and in yellow, their Karcher mean.",
        drawings.draw_mean,
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
            "under the normals alone, (0, 0, 1), as in figure 6 of the paper."
        ),
        figure(picture, "People, and their mean in yellow.", wide=True),
        viewer_figure(viewer.fragment("mean-view"), "Turn the bodies; the mean is yellow."),
        materials.table(report_tables.mean_table(bodies, step)),
    ]
    return Section("mean", "The mean of several people", "Mean", parts)
