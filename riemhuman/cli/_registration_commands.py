"""The commands that take raw scans: registration, and the places of one scan on another."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, FileError, RiemhumanError

if TYPE_CHECKING:
    from riemhuman.arrays import Array
    from riemhuman.bodies.body_model import BodyModel
    from riemhuman.registration import (
        RegisteredScan,
        ScanCorrespondence,
        ScanRecord,
        ScanRegistration,
    )

_MODEL = cli.several(
    cli.MODEL,
    cli.flag("--coarse", "use the open model with 1,202 vertices (faster)"),
    exclusive=True,
)
_UNIT = cli.option("--unit", "unit of the scans (default: by their size)", choices=cli.UNITS)
_UP = cli.option(
    "--up", "axis that points up in the scans (default: found by the fit)", choices=cli.AXES
)


@cli.command(
    "register",
    "Fits a body model to a scan (a mesh or loose points: PLY, OBJ, OFF, STL, GLB, XYZ, NPY),\n"
    "with or without landmarks, and writes the fitted body with the model's mesh. For a "
    "folder,\n"
    "it registers every scan, and index.html shows the results, the worst first. If a body is\n"
    "not trusted, it is not written, and the exit code is 1; for a folder, such bodies go to\n"
    "untrusted/, and those of incomplete scans go to partial/. After an interruption, the same\n"
    "command continues. --sheet also writes a sheet for each person (see riemhuman sheet): for\n"
    "a folder into BODY/sheets/, with the labels in labels.csv next to the scans; for one scan\n"
    "as body.html and body.pdf.",
    "  riemhuman register scan.ply -o body.ply\n"
    "  riemhuman register scans/ -o bodies/ --sheet\n"
    "  riemhuman register scans/ -o bodies/\n"
    "  riemhuman register anna/ -o bodies/ --same-person\n"
    "  riemhuman register scans/ -o bodies/ --sequence --up z --unit millimetres\n"
    "  riemhuman register scan.obj -o body.ply --model SMPL_NEUTRAL.npz\n"
    "  riemhuman register scan.ply -o body.ply --landmarks joints.csv\n",
    cli.path_option("scans", "SCAN", "a scan or a folder"),
    cli.path_option("-o --output", "BODY", "mesh to write, or folder of meshes", required=True),
    cli.FORCE,
    _MODEL,
    _UNIT,
    _UP,
    cli.path_option(
        "--landmarks",
        "CSV",
        "positions of joints in the scan, in its unit, for scans where the fit alone goes "
        "wrong: lines such as left_wrist,0.62,1.31,0.05",
    ),
    cli.flag("--clothed", "the scans show people in clothes; fits find the bodies beneath them"),
    cli.flag("--sequence", "the scans show one person in motion; fits start from previous ones"),
    cli.flag(
        "--same-person",
        "the scans show one person at one visit, who gets one shape; parts that one scan does not "
        "show follow from the others",
    ),
    cli.flag("--untrusted", "also write a body that is not trusted"),
    cli.flag("--keep-axes", "keep the scan's coordinates (default: on the ground, facing z)"),
    cli.flag("--sheet", "also write a sheet for each person: measurements, percentiles, pictures"),
    cli.option("--sex", "sex of the person, for the sheet of one scan", choices=("woman", "man")),
    cli.option("--stature", "stature by hand, metres, for the sheet of one scan", type=float),
    cli.needs("--sex --stature", "--sheet"),
    cli.OUTPUT_UNITS,
)
def _register(options: argparse.Namespace) -> cli.Answer:
    from riemhuman.io.outputs import check_output_file

    is_folder = options.scans.is_dir()
    _check_input_options(options)
    if not is_folder:
        check_output_file(options.output, cli.MESH_ENDINGS, force=options.force)
        for place in _sheet_files(options):
            check_output_file(place, (place.suffix,), force=options.force)
    elif options.output.exists() and options.output.samefile(options.scans):
        raise FileError(f"{options.output} holds the scans; name another folder for the bodies")
    options.written.append(options.output)
    registration = _chosen_registration(options, clothed=options.clothed)
    if options.sheet:
        from riemhuman.report.printing import find_browser
        from riemhuman.report.sheets import a_stature

        rh.measurements.Measurements(registration.model)  # an error before the work
        if options.stature is not None:
            a_stature(options.stature, "--stature")
        if not is_folder and find_browser() is None:
            terminal.note("no PDF is written: Chromium, Chrome and Edge are missing")
    if is_folder:
        return _register_folder(registration, options)
    return _register_file(registration, options)


def _check_input_options(options: argparse.Namespace) -> None:
    """Refuse options for one scan if there is a folder, and those for a folder if there is none."""
    flags: tuple[str, ...]
    if options.scans.is_dir():
        expected, flags = "one scan", ("untrusted", "landmarks", "sex", "stature")
    else:
        expected, flags = "a folder", ("sequence", "same_person")
    for flag in flags:
        if getattr(options, flag):
            raise ArgumentError(
                f"--{flag.replace('_', '-')} is for {expected}; {options.scans} is not"
            )


def _chosen_registration(options: argparse.Namespace, *, clothed: bool = False) -> ScanRegistration:
    if options.model is not None:
        model = rh.BodyModel.from_file(options.model)
    else:
        model = rh.datasets.load_open_model("coarse" if options.coarse else "full")
    return rh.registration.ScanRegistration(
        model, unit=options.unit, up=options.up, clothed=clothed
    )


def _register_file(registration: ScanRegistration, options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    from riemhuman.surfaces.measures import share_of_surface

    landmarks = options.landmarks and rh.registration.load_landmarks(options.landmarks)
    scan = rh.registration.load_scan(options.scans, options.unit)
    with options.task(f"Registering {len(scan):,} points"):
        result = registration.solve(scan, landmarks=landmarks)
    median = float(np.median(result.distances[~result.background]))
    share = share_of_surface(result.points, registration.model.faces, result.matched)
    names = ("trusted", "message", "unit", "likelihood")
    record = {name: getattr(result, name) for name in names}
    record |= {"scan": options.scans, "median_distance": median, "matched_share": share}
    missing = _missing_measurements(registration.model, result)
    record["missing_measurements"] = missing
    _note_message(options.scans, result, missing)
    is_written = result.trusted or options.untrusted
    sheets = {place.suffix: place for place in _sheet_files(options)}
    if is_written:
        points = result.points if options.keep_axes else result.upright_points
        faces = registration.model.faces
        rh.save_mesh(options.output, points, faces, result.trusted_vertices)
    if sheets:
        _write_sheet(registration.model, result, options, [*sheets.values()])
        printed = f", and for printing {sheets['.pdf']}" if ".pdf" in sheets else ""
        terminal.note(f"the sheet is {sheets['.html']}{printed}")
    if not is_written:
        text = "the body is not written; --untrusted writes it anyway"
        return cli.Answer(text, record, trusted=False, written=False)
    gap = rh.measurements.readable_gap(median, options.output_units)
    text = (
        f"{gap} from the scan in the median, "
        f"{100 * share:.0f} % of the body seen; scan in {result.unit}, body in metres"
    )
    return cli.Answer(text, record, trusted=result.trusted)


def _sheet_files(options: argparse.Namespace) -> list[Path]:
    """Return where the sheet of one scan is written."""
    if not options.sheet:
        return []
    from riemhuman.report.printing import find_browser

    endings = (".html", ".pdf") if find_browser() else (".html",)
    return [options.output.with_suffix(end) for end in endings]


def _write_sheet(
    model: BodyModel, result: RegisteredScan, options: argparse.Namespace, places: list[Path]
) -> None:
    """Write the page and the PDF of one scan's sheet."""
    with options.task("Sheet"):
        sheet = rh.report.sheet(
            result,
            model=model,
            name=options.scans.stem,
            sex=options.sex or "adult",
            stature=options.stature,
            units=options.output_units,
        )
        for place in places:
            sheet.save(place)


def _missing_measurements(model: BodyModel, result: RegisteredScan) -> list[str]:
    """Return the measurements that a scan does not show enough of the body for."""
    if not result.trusted or result.trusted_vertices.all():
        return []
    try:
        measurements = rh.measurements.Measurements(model)
    except RiemhumanError:
        return []  # nothing can be measured on this model
    measured = measurements.measure(
        result.points[None], missing="nan", trusted_vertices=result.trusted_vertices[None]
    )
    return [name for number, name in measured.why_missing if number == 0]


def _note_message(
    name: object, result: RegisteredScan | ScanRecord, missing: list[str] | None = None
) -> None:
    """Say in one line what is wrong with a result, or what is missing."""
    message = result.message
    if missing:
        are = "measurement is" if len(missing) == 1 else "measurements are"
        message = f"{message or 'some places were not seen'}: {len(missing)} {are} missing"
    if message:
        terminal.note(f"{name}{'' if result.trusted else ' is not trusted'}: {message}")


def _register_folder(registration: ScanRegistration, options: argparse.Namespace) -> cli.Answer:
    records = rh.registration.register_folder(
        registration,
        options.scans,
        options.output,
        sequence=options.sequence,
        same_person=options.same_person,
        keep_axes=options.keep_axes,
        progress=options.bars,
    )
    with options.task("Page"):
        page = rh.report.scan_page(options.output, units=options.output_units)
    for record in records:
        _note_message(record.name, record)
    if options.sheet:
        labels = options.scans / "labels.csv"
        sheets = rh.report.make_sheets(
            options.output,
            options.output / "sheets",
            labels=labels if labels.is_file() else None,
            measurements=rh.measurements.Measurements(registration.model),
            units=options.output_units,
            replace_output=True,
            progress=options.task,
        )
    n_trusted = sum(record.trusted for record in records)
    names = ("name", "trusted", "message", "median_distance", "matched_share")
    text = f"{n_trusted} of {len(records)} scans are registered and trusted; see {page}"
    if options.sheet:
        text += f"\nsheets of all people: {sheets}"
    return cli.Answer(
        text,
        {"scans": [{name: getattr(record, name) for name in names} for record in records]},
        trusted=n_trusted == len(records),
    )


@cli.command(
    "match",
    "Registers two scans with a body model, without landmarks, and writes, for every vertex of A, "
    "the corresponding place on B. The CSV file has a line for each vertex, numbered from 0, with "
    "the nearest vertex of B, the triangle of B and the weights of its corners, and the position "
    "in the unit of B. Fields are empty where either scan does not show the place; the fields of "
    "the triangle are empty if B is a point cloud. With --registered, scans that `riemhuman "
    "register` has registered are not registered again.",
    "  riemhuman match a.ply b.ply -o map.csv\n"
    "  riemhuman match a.ply b.ply -o map.csv --picture map.png\n"
    "  riemhuman match scans/a.ply scans/b.ply -o map.csv --registered bodies/\n",
    cli.path_option("scan_a", "A", "the scan whose vertices are matched"),
    cli.path_option("scan_b", "B", "the scan to which they are matched"),
    cli.output("CSV", ".csv"),
    cli.output(
        "PICTURE",
        *cli.FIGURE_ENDINGS,
        text="picture of both scans, with corresponding places in the same colour",
        flags="--picture",
        required=False,
    ),
    cli.path_option("--registered", "FOLDER", "output of `riemhuman register` for both scans"),
    _MODEL,
    _UNIT,
    _UP,
)
def _match(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    from riemhuman.checks import UNITS
    from riemhuman.io.files import write_text
    from riemhuman.io.text_tables import csv_text

    first, second = (_matched_result(path, options) for path in (options.scan_a, options.scan_b))
    matched = rh.registration.correspondence(first, second)
    places = matched.points * UNITS[second.scan.unit]
    write_text(options.output, csv_text([_HEADER, *_rows(matched, places)]))
    if options.picture is not None:
        from riemhuman.plots import figures

        names = options.scan_a.stem, options.scan_b.stem
        with figures.figure_style():
            figure = rh.plots.plot_match(first, second, names)
            figures.save_figure(figure, options.picture)
    share = float(np.mean(matched.seen))
    record = {"a": options.scan_a, "b": options.scan_b, "n_vertices": len(matched), "placed": share}
    record["picture"] = options.picture
    text = f"{100 * share:.0f} % of the {len(matched):,} vertices of A have a place on B"
    return cli.Answer(text, record, trusted=first.trusted and second.trusted)


_HEADER = ("vertex", "nearest", "triangle", "weight_1", "weight_2", "weight_3", "x", "y", "z")


def _matched_result(path: Path, options: argparse.Namespace) -> RegisteredScan:
    """Return the registration of a scan, from a folder of registered scans if there is one."""
    scan = rh.registration.load_scan(path, options.unit)
    if options.registered is not None:
        records = rh.registration.read_records(options.registered)
        names = [record.name for record in records]
        if path.stem not in names:
            raise FileError(
                f"{options.registered} holds no registration of {path.name}; it has those of "
                f"{', '.join(sorted(names)[:5])}"
            )
        result = records[names.index(path.stem)].result(scan)
    else:
        with options.task(f"Registering {path.name}, {len(scan):,} points"):
            result = _chosen_registration(options).solve(scan)
    _note_message(path, result)
    return result


def _rows(matched: ScanCorrespondence, places: Array) -> list[list[float | int | None]]:
    """Return a row for every vertex, empty where it has no place."""
    rows: list[list[float | int | None]] = []
    for vertex, nearest in enumerate(matched.vertices.tolist()):
        row: list[float | int | None] = [vertex, *[None] * (len(_HEADER) - 1)]
        if nearest >= 0:
            triangle: list[float | int | None] = [None, None, None, None]  # and its weights
            if matched.triangles is not None and matched.barycentric is not None:
                triangle = [int(matched.triangles[vertex]), *matched.barycentric[vertex].tolist()]
            row = [vertex, nearest, *triangle, *places[vertex].tolist()]
        rows.append(row)
    return rows
