"""The commands ``measure`` and ``compare``: girths, lengths and volumes, and their changes."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, FileError, counted

if TYPE_CHECKING:
    from riemhuman.arrays import Array, JSONRecord
    from riemhuman.measurements import (
        BodySizes,
        Measurements,
        MeasurementSet,
        PersonDistance,
        VisitComparison,
    )
    from riemhuman.readable_units import ReadableUnit

_MOST_COLUMNS = 5

_DEFINITIONS = cli.several(
    inputs.MEASURED_MODEL,
    cli.option("--only", "measurement to take; repeatable", metavar="NAME", action="append"),
    cli.UNIT,
    cli.OUTPUT_UNITS,
)


@cli.command(
    "measure",
    "Measures bodies registered to the open body model, or to another model with --model and\n"
    "--definitions. Bodies are first re-posed to a standard pose; --as-is measures them as they\n"
    "stand. The table is printed in centimetres, litres and kilograms; CSV and JSON are in metres\n"
    "and kilograms. Measurements on vertices that riemhuman register did not trust are left out.",
    "  riemhuman measure anna.ply\n"
    "  riemhuman measure bodies/ -o table.csv\n"
    "  riemhuman measure anna.ply --as-is --only stature --only volume\n"
    "  riemhuman measure anna.ply --picture lines.png\n"
    "  riemhuman measure anna/ --same-person    # several scans of one visit\n"
    "  riemhuman measure bodies/ --model smpl.npz --definitions smpl.json -o table.csv\n",
    cli.FILES,
    cli.output("CSV", ".csv", text="table to write, one row per body", required=False),
    cli.output(
        "PICTURE",
        *cli.FIGURE_ENDINGS,
        text="draw every measurement line on the first body (.png, .svg or .pdf)",
        flags="--picture",
        required=False,
    ),
    _DEFINITIONS,
    cli.flag("--as-is", "measure bodies in their own pose"),
    cli.flag(
        "--same-person",
        "the meshes are scans of one person at one visit: measure their mean in the standard pose",
    ),
    cli.flag("--seated", "take seated measurements, such as sitting height"),
)
def _measure(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    files = inputs.list_meshes(options.meshes)
    visits = [files] if options.same_person else [[file] for file in files]
    if options.seated and options.model is not None:
        raise ArgumentError("--seated is for the open body model; leave out --model")
    pose = "seated" if options.seated else "standing"
    measurements, points, trusted = _read(files, options, pose)
    axes, definitions = "body", measurements.definitions
    if options.as_is and options.same_person:
        raise ArgumentError("--same-person needs the standard pose; leave out --as-is")
    if options.same_person:
        _doubt_one_person(files, points, measurements, options)
    if not options.as_is:
        with options.task(f"Standard pose of {counted(len(files), 'mesh', 'meshes')}"):
            if options.same_person:
                points = rh.measurements.person_in_standard_pose(
                    definitions, points, trusted_vertices=trusted
                )[np.newaxis]
                files, trusted = [Path("person")], trusted.max(axis=0, keepdims=True)
            else:
                points = rh.measurements.in_standard_pose(definitions, points)
        axes = "space"
    with options.task(f"Measurements of {counted(len(files), 'mesh', 'meshes')}"):
        measured = measurements.measure(points, axes=axes, missing="nan", trusted_vertices=trusted)
        measured = _without_hidden(measured, visits, definitions)
    if options.picture is not None:
        from riemhuman.plots import figures

        drawn = [name for name in measured.names if (0, name) not in measured.why_missing]
        with figures.figure_style():
            figure = rh.plots.plot_measurements(
                rh.measurements.Measurements(definitions, drawn or measured.names),
                points[0],
                pose="as is",
                axes=axes,
                system=options.output_units,
                trusted_vertices=trusted[0],
            )
            figures.save_figure(figure, options.picture)
    names, units = measured.names, dict(zip(measured.names, measured.units, strict=True))
    rows = [[str(f), *v] for f, v in zip(files, measured.values.tolist(), strict=True)]
    if options.output is not None:
        titles = [f"{name} ({unit})" for name, unit in units.items()]
        _write_table(options.output, [["file", *titles], *rows])
    if options.as_is:
        pose = "as is"
    elif not options.seated:
        pose = "standard"
    bodies = {file: dict(zip(names, values, strict=True)) for file, *values in rows}
    missing, reasons = _missing(files, measured)
    record = {"pose": pose, "units": units, "bodies": bodies, "missing": missing}
    lines = [*_measured_table(files, measured, options.output_units), *reasons]
    return cli.Answer("\n".join(lines), record)


def _without_hidden(
    measured: BodySizes, visits: Sequence[Sequence[Path]], definitions: MeasurementSet
) -> BodySizes:
    """Return measurements without those at a crotch that the registered scans do not show."""
    from riemhuman.report.sheet_values import (
        CROTCH,
        SheetSubject,
        is_crotch_hidden,
        record_beside,
    )

    values, why_missing = measured.values.copy(), dict(measured.why_missing)
    records_of_folders: dict[Path, dict[str, rh.registration.ScanRecord]] = {}
    for number, files in enumerate(visits):
        try:
            records = [record_beside(file, records_of_folders) for file in files]
        except FileError:  # of bodies that were changed after they were registered
            continue
        scans = [SheetSubject.of_record(record) for record in records if record is not None]
        if len(scans) < len(files):
            continue
        if is_crotch_hidden(SheetSubject.of_visit(scans), definitions):
            for name in CROTCH.measurements:
                if name in measured.names:
                    values[number, measured.names.index(name)] = float("nan")
                    why_missing.setdefault((number, name), CROTCH.reason)
    return dataclasses.replace(measured, values=values, why_missing=why_missing)


def _missing(
    files: Sequence[Path], result: BodySizes | VisitComparison
) -> tuple[list[JSONRecord], list[str]]:
    """Return what was not measured and why, as records and in words."""
    records, lines = [], []
    for (number, name), reason in result.why_missing.items():
        records.append({"file": files[number], "measurement": name, "why": reason})
        lines.append(f"no {name} of {files[number].name}: {reason}")
    return records, lines


def _measured_table(files: Sequence[Path], measured: BodySizes, system: str) -> list[str]:
    width = max(map(len, measured.names))
    shown = files[:_MOST_COLUMNS]
    columns = [max(9, len(file.stem)) for file in shown]
    titles = " ".join(f"{file.stem:>{w}}" for file, w in zip(shown, columns, strict=True))
    lines = [f"{'':{width}}  {titles}"]
    for number, (name, unit) in enumerate(zip(measured.names, measured.units, strict=True)):
        values = zip(measured.values[: len(shown), number], columns, strict=True)
        shown_unit = _shown_unit(unit, system)
        numbers = " ".join(shown_unit.text(value, w) for value, w in values)
        lines.append(f"{name:{width}}  {numbers} {shown_unit.name}")
    if len(files) > len(shown):
        others = counted(len(files) - len(shown), "more body", "more bodies")
        lines.append(f"and {others}; -o CSV writes all")
    return lines


@cli.command(
    "compare",
    "Brings two registered meshes of one person into the standard pose and prints how their "
    "measurements changed. A folder holds several scans of one visit, whose mean counts: in "
    "different poses, they show smaller changes than one scan. A change is marked if it exceeds "
    "its threshold: two standard deviations of a difference between scans of one unchanged "
    "person, which grow with the difference of their poses. Scan people in the same pose, or in "
    "the same few poses at each visit. Measurements the scan did not cover are NaN. Warns if the "
    "two bodies are probably different people. With --view, a page shows both side by side, where "
    "the second lies outside or inside the first, and the line of each measurement.",
    "  riemhuman compare visit1.ply visit2.ply\n"
    "  riemhuman compare anna.ply ben.ply --view differences.html\n"
    "  riemhuman compare visit1.ply visit2.ply -o changes.csv\n"
    "  riemhuman compare visit1/ visit2/\n",
    cli.path_option("before", "BEFORE", "the first visit, a mesh or a folder of meshes"),
    cli.path_option("after", "AFTER", "the second visit"),
    cli.output("CSV", ".csv", text="table to write", required=False),
    cli.output(
        "PAGE",
        ".html",
        ".png",
        text="page of both bodies, coloured by millimetres, with their measurements (or .png)",
        flags="--view",
        required=False,
    ),
    _DEFINITIONS,
)
def _compare(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    visits = [options.before, options.after]
    first, second = (inputs.list_meshes([visit]) for visit in visits)
    measurements, points, trusted = _read([*first, *second], options)
    before, after = np.split(points, [len(first)])
    with options.task(f"Standard pose of {len(points)} meshes"):
        result = rh.measurements.compare_visits(
            measurements, before, after, trusted_vertices=np.split(trusted, [len(first)])
        )
    if options.view is not None:
        _view_differences(visits, measurements, result, options)
    people = _doubt_one_person([*first, *second], points, measurements, options)[len(first) - 1]
    advice = result.pose_advice(options.output_units)
    if options.output is not None:
        titles = ["measurement", "unit", "before", "after", "change", "threshold"]
        _write_table(options.output, [[*titles, "exceeds threshold"], *_changes(result)])
    missing, reasons = _missing(visits, result)
    millimetres = 1000.0 * result.displacements
    if np.isfinite(millimetres).any():  # the others were not seen
        millimetres = millimetres[np.isfinite(millimetres)]
    least, most = float(millimetres.min()), float(millimetres.max())
    record = {
        "before": options.before,
        "after": options.after,
        "scans": [len(first), len(second)],
        "names": result.names,
        "units": result.units,
        "missing": missing,
        "changes": result.changes,
        "thresholds": result.thresholds,
        "exceeds_threshold": result.is_significant,
        "expected_beyond_threshold_by_chance": result.expected_by_chance,
        "pose_distance": result.pose_distance,
        "outward_millimetres": {"least": least, "most": most},
        "area_distance": people.distance,
        "usual_area_distances": vars(people.usual),
    }
    count = len(result.names)
    ends = (max(-least, 0.0), max(most, 0.0))
    gaps = [rh.measurements.readable_gap(1e-3 * end, options.output_units) for end in ends]
    lines = [
        *_table_of_changes(result, options.output_units),
        *reasons,
        (
            f"{result.is_significant.sum()} of {count} exceed their thresholds; "
            f"expect about {result.expected_by_chance:.1f} false alarms among {count}"
        ),
        *([advice] if advice else []),
        f"surface change: {gaps[0]} inward to {gaps[1]} outward",
    ]
    return cli.Answer("\n".join(lines), record)


_Change = tuple[str, str, float, float, float, float, bool]


def _changes(result: VisitComparison) -> list[_Change]:
    """Return a row for each measurement: name, unit, before, after, change, threshold, verdict."""
    numbers = (result.before, result.after, result.changes, result.thresholds)
    columns = [column.tolist() for column in (*numbers, result.is_significant)]
    return list(zip(result.names, result.units, *columns, strict=True))


def _shown_unit(unit: str, system: str) -> ReadableUnit:
    """Return a unit for readers; centimetres have one decimal, since noise is larger than that."""
    readable = rh.measurements.readable_unit(unit, system)
    if readable.name != "cm":
        return readable
    return dataclasses.replace(readable, digits=1)


def _table_of_changes(result: VisitComparison, system: str) -> list[str]:
    """Return the printed table of two visits, in everyday units."""
    width = max(map(len, result.names))
    lines = [f"{'':{width}}  {'before':>9} {'after':>9} {'change':>9} {'threshold':>9}"]
    for name, si_unit, before, after, change, threshold, is_significant in _changes(result):
        unit = _shown_unit(si_unit, system)
        texts = (unit.text(before, 9), unit.text(after, 9), unit.text(change, 9, "+"))
        numbers = " ".join([*texts, unit.text(threshold, 9)])
        mark = "  changed" if is_significant else ""
        lines.append(f"{name:{width}}  {numbers} {unit.name}{mark}")
    return lines


def _doubt_one_person(
    files: Sequence[Path], points: Array, measurements: Measurements, options: argparse.Namespace
) -> list[PersonDistance]:
    """Return how far each further body is from the first, and warn of other people."""
    faces = measurements.definitions.faces
    with options.task("Checking that all show the same person"):
        distances = [rh.measurements.person_distance(points[0], body, faces) for body in points[1:]]
    for file, people in zip(files[1:], distances, strict=True):
        if people.is_hardly_one_person:
            terminal.note(f"warning: {files[0].name} and {file.name} are {people.text}")
    return distances


def _view_differences(
    files: Sequence[Path],
    measurements: Measurements,
    result: VisitComparison,
    options: argparse.Namespace,
) -> None:
    """Write the page, or a picture, of where two bodies differ."""
    from riemhuman.plots import figures

    settings: JSONRecord = {"names": (files[0].stem, files[1].stem), "measurements": measurements}
    settings["system"] = options.output_units
    with options.task("Page"):
        if options.view.suffix.lower() == ".html":
            rh.plots.view_difference(result, **settings).save(options.view)
            return
        with figures.figure_style():
            figure = rh.plots.plot_difference(result, **settings)
            figures.save_figure(figure, options.view)


@cli.command(
    "sheet",
    "Writes a page and a two-page PDF for each registered body: the scan and the body from\n"
    "three sides, whether and where to trust it, measurements with uncertainties and\n"
    "percentiles among adults of the same sex and stature, the silhouette over that of the\n"
    "average body, posture, and changes since the previous visit. index.html lists all people,\n"
    "and a CSV table and a workbook hold all numbers. A table of labels gives each file's\n"
    "person, sex (woman or man), visit, date and stature; files with the same person, visit and\n"
    "date are scans of one visit, whose mean is measured. PDF files are printed by Chromium,\n"
    "Chrome or Edge; workbooks need openpyxl.",
    "  riemhuman sheet bodies/ -o sheets/    # the output of riemhuman register scans/ -o bodies/\n"
    "  riemhuman sheet visit1.ply visit2.ply -o sheets/ --labels labels.csv\n"
    "  riemhuman sheet bodies/ -o sheets/ --output-units in\n",
    cli.FILES,
    cli.path_option("-o --output", "SHEETS", "folder to write", required=True),
    cli.FORCE,
    cli.path_option(
        "--labels",
        "CSV",
        "table of file, person, sex, visit, date, stature (default: labels.csv next to the files)",
    ),
    cli.option("--stature", "stature of the one body, measured by hand, metres", type=float),
    cli.path_option("--logo", "PNG", "picture for the top of each sheet"),
    inputs.MEASURED_MODEL,
    cli.UNIT,
    cli.OUTPUT_UNITS,
)
def _sheet(options: argparse.Namespace) -> cli.Answer:
    options.written.append(options.output)
    measurements = None
    if options.model is not None:
        model = rh.BodyModel.from_file(options.model)
        measurements = rh.measurements.Measurements(model, options.definitions)
    page = rh.report.make_sheets(
        options.meshes,
        options.output,
        labels=options.labels,
        measurements=measurements,
        stature=options.stature,
        logo=options.logo,
        units=options.output_units,
        unit=options.unit,
        up=options.up,
        replace_output=options.force,
        progress=options.task,
    )
    return cli.Answer(f"open {page}", {"page": page, "files": sorted(options.output.iterdir())})


def _read(
    files: Sequence[Path], options: argparse.Namespace, pose: str = "standing"
) -> tuple[Measurements, Array, Array]:
    """Return the measurements, meshes, and which vertices their files say to trust, or all."""
    import numpy as np

    from riemhuman.surfaces.template import check_body_sizes

    meshes = rh.datasets.RegisteredMeshes(files, scale=None, unit=options.unit, up=options.up)
    template = rh.Template(meshes[0], meshes.faces)
    measurements = inputs.measurements_of(options, template, files[0], pose)
    if options.only:
        measurements = rh.measurements.Measurements(measurements.definitions, options.only)
    points, body = meshes[:], measurements.definitions
    for file, surface in zip(files, points, strict=True):
        check_body_sizes(surface, body.surface, str(file))
    trusted = np.ones((len(files), template.n_vertices), dtype=bool)
    for row, file in zip(trusted, files, strict=True):
        known = rh.io.load_trusted(file)
        row[:] = True if known is None else known
    return measurements, points, trusted


def _write_table(file: Path, rows: Sequence[Sequence[object]]) -> None:
    from riemhuman.io.files import write_text
    from riemhuman.io.text_tables import csv_text

    write_text(file, csv_text(rows))
