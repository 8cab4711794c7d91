"""The section of the report on measurements of people, and shape along the waist girth."""

from __future__ import annotations

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
from riemhuman.plots._figures import new_figure
from riemhuman.plots.body_plots import plot_measurement_lines, plot_path
from riemhuman.report._result_store import Computed, Step
from riemhuman.report.materials import Materials
from riemhuman.report.page import Section, figure, heading, paragraph
from riemhuman.report.tables import Column, Table
from riemhuman.surfaces.template import Template

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_POSES = 3
_FEWEST_PEOPLE = 4
_ALONG = "waist girth"
# Weights of the metric of the regression.
_WEIGHTS = {"a": 1.0, "lam": 1.0, "c": 0.1}
_SHOWN = {
    "stature",
    "chest girth",
    "waist girth",
    "hip girth",
    "arm length",
    "inside leg height",
    "body mass",
}


def measurement_section(materials: Materials) -> Section | None:
    """Return the section with measurements of people.

    Parameters
    ----------
    materials : Materials
        Results of the report.

    Returns
    -------
    Section or None
        None if the bodies are not registered to the open body model.
    """
    description = open_measurements(materials.bodies.template)
    if description is None:
        return None
    step = _measured(materials, description)
    picture = materials.picture(
        "tapes",
        "One person in the standard pose from three sides, with all tapes.",
        _draw_tapes,
        step.arrays["straight"][0],
        materials.bodies.template.faces,
    )
    name = materials.bodies.subject_names[int(step.arrays["people"][0])]
    parts = [
        paragraph(
            "A fit of the body model brings each body to one standard pose and keeps the residual. "
            f"The first table shows means over up to {_MOST_POSES} poses of each person, the "
            "second the standard deviation over the poses of one person."
        ),
        materials.table(_people_table(materials, step)),
        figure(picture, f"The measuring tapes: {escape(name)}.", wide=True),
        heading("One person in several poses"),
        materials.table(_spread_table(step)),
    ]
    if "along" in step.arrays:
        picture = materials.picture(
            "shape-along-waist",
            f"Mean body, and bodies of a smaller and a larger {_ALONG}.",
            _draw_along,
            step.arrays["along"],
            materials.bodies.template.faces,
        )
        low, middle, high = step.record["along_values"]
        parts += [
            heading(f"Shape along the {_ALONG}"),
            figure(
                picture,
                f"Geodesic regression of shape on the {_ALONG}: {low:.2f}, {middle:.2f} and "
                f"{high:.2f} m. It explains {100 * step.record['explained']:.0f} % of the variance "
                f"between people; p = {step.record['p_value']:.3f} by "
                f"{step.record['n_permutations']} permutations.",
            ),
        ]
    return Section("measurements", "Girths, lengths and volumes", "Measurements", parts)


def _measured(materials: Materials, description: MeasurementSet) -> Step:
    bodies = materials.bodies
    people = np.unique(bodies.subject)
    chosen = [np.flatnonzero(bodies.subject == k)[:_MOST_POSES] for k in people]

    def compute() -> Computed:
        own = Measurements(description)
        arrays: dict[str, ndarray] = {"people": people}
        record: dict[str, Any] = {"names": list(own.names), "units": list(own.units)}
        straight = [in_standard_pose(description, bodies.points[numbers]) for numbers in chosen]
        values = [own.measure(points, axes="space", missing="nan").values for points in straight]
        arrays["means"] = np.array([value.mean(axis=0) for value in values])
        arrays["spreads"] = np.array(
            [value.std(axis=0, ddof=1) if len(value) > 1 else np.nan * value[0] for value in values]
        )
        arrays["straight"] = np.array([points[0] for points in straight])
        if len(people) >= _FEWEST_PEOPLE:
            numbers = arrays["means"][:, own.names.index(_ALONG)]
            space = AlignedSurfaces(bodies.template)
            space.equip_with_metric(ElasticMetric, **_WEIGHTS)
            found = regress_shape(
                space, numbers, arrays["straight"], rng=materials.plan.seed, max_iter=0
            )
            along = np.array([numbers.min(), numbers.mean(), numbers.max()])
            arrays["along"] = found.regression.predict(along)
            record["along_values"] = [float(value) for value in along]
            record["explained"], record["p_value"] = found.explained, found.p_value
            record["n_permutations"] = found.n_permutations
        return arrays, record

    inputs = {"bodies": materials.digest, "poses": _MOST_POSES, "seed": materials.plan.seed}
    return materials.store.step("measurements", inputs, compute, "Measurements")


def _people_table(materials: Materials, step: Step) -> Table:
    """Return the table of the measurements of people."""
    names, units = step.record["names"], step.record["units"]
    columns = [Column("person", "Person")] + [
        Column(name, f"{name}, {unit}", ".1f" if unit == "kg" else ".3f", shown=name in _SHOWN)
        for name, unit in zip(names, units, strict=True)
    ]
    rows = [
        {"person": materials.bodies.subject_names[int(person)]}
        | dict(zip(names, values.tolist(), strict=True))
        for person, values in zip(step.arrays["people"], step.arrays["means"], strict=True)
    ]
    return Table(
        "measurements",
        "Measurements in the standard pose; the file has all. Body mass is an estimate, the volume "
        "times 1000 kg/m³.",
        columns,
        rows,
    )


def _spread_table(step: Step) -> Table:
    """Return the table of standard deviations over the poses of one person."""
    rows = []
    for number, (name, unit) in enumerate(
        zip(step.record["names"], step.record["units"], strict=True)
    ):
        if unit == "m":
            spreads = 1000.0 * step.arrays["spreads"][:, number]
            row = {"median": float(np.median(spreads)), "worst": float(spreads.max())}
            rows.append({"measurement": name} | row)
    columns = (
        Column("measurement", "Measurement"),
        Column("median", "Median person, mm", ".1f"),
        Column("worst", "Worst, mm", ".1f"),
    )
    return Table(
        "measurement-spread",
        "Standard deviation of one person's values over the poses measured.",
        columns,
        rows,
    )


def _draw_tapes(surface: ndarray, faces: ndarray) -> Figure:
    """Draw a body in the standard pose with all tapes."""
    tapes = Measurements(Template(surface, faces)).lines(surface, axes="space")
    return plot_measurement_lines(surface, faces, tapes)


def _draw_along(path: ndarray, faces: ndarray) -> Figure:
    """Draw bodies side by side."""
    drawn = new_figure(4.0, 2.4)
    plot_path(path, faces, ax=drawn.subplots())
    return drawn
