"""The verbs ``measure`` and ``compare``: girths, lengths and volumes, and their changes."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.csv_files import write_csv
from riemhuman.cli.inputs import add_units, meshes_named, path_argument
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_force, add_json, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.measurements import MeasuredBodies, Measurements

_PICTURES = [".png", ".svg", ".pdf"]
_MOST_COLUMNS = 5


def add_verbs(verbs: Verbs) -> None:
    """Declare ``measure`` and ``compare``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "measure",
        _measure,
        "girths, lengths, heights and volumes of registered meshes",
        "Measures bodies registered to the open body model, or to another model with --model and\n"
        "--definitions, in metres, square metres, cubic metres and kilograms. A fit of the body\n"
        "model brings bodies to the standard pose first; --as-is measures them as they stand.",
        "  riemhuman measure anna.ply\n"
        "  riemhuman measure scans/ -o table.csv\n"
        "  riemhuman measure anna.ply --as-is --only stature --only volume\n"
        "  riemhuman measure anna.ply --picture tapes.png\n"
        "  riemhuman measure scans/ --model smpl.npz --definitions smpl.json -o table.csv\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    parser.add_argument(
        "-o", "--output", metavar="CSV", type=path_argument, help="table to write, one row per body"
    )
    parser.add_argument(
        "--picture",
        metavar="PICTURE",
        type=path_argument,
        help="draw every tape on the first body (.png, .svg or .pdf)",
    )
    _add_definitions(parser)
    parser.add_argument("--as-is", action="store_true", help="measure bodies as they stand")
    add_json(parser)
    add_force(parser)

    parser = add_verb(
        verbs,
        "compare",
        _compare,
        "changes of one person between two visits",
        "Brings two registered meshes of one person to the standard pose and prints how their\n"
        "measurements changed. A change is marked if it exceeds two standard deviations of a\n"
        "difference over poses of one person.",
        "  riemhuman compare visit1.ply visit2.ply\n"
        "  riemhuman compare visit1.ply visit2.ply -o changes.csv\n",
    )
    parser.add_argument("before", metavar="BEFORE", type=path_argument, help="the first visit")
    parser.add_argument("after", metavar="AFTER", type=path_argument, help="the second visit")
    parser.add_argument("-o", "--output", metavar="CSV", type=path_argument, help="table to write")
    _add_definitions(parser)
    add_json(parser)
    add_force(parser)


def _add_definitions(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--model",
        metavar="NPZ",
        type=path_argument,
        help="body model the meshes are registered to (default: the open body model)",
    )
    parser.add_argument(
        "--definitions",
        metavar="JSON",
        type=path_argument,
        help="measurements and landmarks of the model (default: those of the open body model)",
    )
    parser.add_argument(
        "--only", metavar="NAME", action="append", help="measurement to take; repeatable"
    )
    add_units(parser)


def _measure(options: argparse.Namespace) -> None:
    if options.output is not None:
        check_output_file(options.output, [".csv"], force=options.force)
    if options.picture is not None:
        check_output_file(options.picture, _PICTURES, force=options.force)
    reporter = Reporter(options.quiet)
    files = meshes_named(options.meshes)
    own, points = _read(files, options)
    straight, axes = points, "body"
    if not options.as_is:
        from riemhuman.measurements import in_standard_pose

        with reporter.task(f"Standard pose of {len(files)} meshes"):
            straight, axes = in_standard_pose(own.definitions, points), "space"
    with reporter.task(f"Measurements of {len(files)} meshes"):
        measured = own.measure(straight, axes=axes, missing="nan")
    if options.picture is not None:
        _draw(options.picture, own, straight[0], axes)
    names = [str(file) for file in files]
    if options.output is not None:
        titles = [f"{n} ({u})" for n, u in zip(measured.names, measured.units, strict=True)]
        rows = zip(names, measured.values.tolist(), strict=True)
        write_csv(options.output, [["file", *titles], *([name, *row] for name, row in rows)])
    if options.json:
        units = dict(zip(measured.names, measured.units, strict=True))
        bodies = {
            name: dict(zip(measured.names, row.tolist(), strict=True))
            for name, row in zip(names, measured.values, strict=True)
        }
        pose = "as is" if options.as_is else "standard"
        say_json({"pose": pose, "units": units, "bodies": bodies, "output": options.output})
        return
    _say_table(files, measured)
    for path in (options.output, options.picture):
        if path is not None:
            say(f"written to  {path}")


def _compare(options: argparse.Namespace) -> None:
    from riemhuman.measurements import compare_visits

    if options.output is not None:
        check_output_file(options.output, [".csv"], force=options.force)
    reporter = Reporter(options.quiet)
    own, points = _read([options.before, options.after], options)
    with reporter.task("Standard pose of 2 meshes"):
        result = compare_visits(own, *points)
    rows = zip(
        result.names,
        result.units,
        result.before,
        result.after,
        result.changes,
        result.noise,
        result.seen,
        strict=True,
    )
    columns = ["measurement", "unit", "before", "after", "change", "noise", "seen"]
    if options.output is not None:
        write_csv(options.output, [columns, *([*row[:-1], bool(row[-1])] for row in rows)])
    outward = 1000.0 * result.displacements
    if options.json:
        say_json(
            {
                "before": options.before,
                "after": options.after,
                **{column: getattr(result, column) for column in ("changes", "noise", "seen")},
                "names": result.names,
                "units": result.units,
                "outward_millimetres": {"least": outward.min(), "most": outward.max()},
                "areas_seen": float(result.areas_seen.mean()),
                "output": options.output,
            }
        )
        return
    width = max(map(len, result.names))
    say(f"{'':{width}}  {'before':>9} {'after':>9} {'change':>9} {'noise':>9}")
    for number, name in enumerate(result.names):
        values = (array[number] for array in (result.before, result.after))
        said = " ".join(f"{value:9.4f}" for value in values)
        mark = "  changed" if result.seen[number] else ""
        say(
            f"{name:{width}}  {said} {result.changes[number]:+9.4f} {result.noise[number]:9.4f} "
            f"{result.units[number]}{mark}"
        )
    say(f"surface moved outward by {outward.min():.1f} to {outward.max():.1f} mm")
    say(f"triangles whose area changed: {100 * result.areas_seen.mean():.1f} %")
    if options.output is not None:
        say(f"written to  {options.output}")


def _read(files: Sequence[Path], options: argparse.Namespace) -> tuple[Measurements, ndarray]:
    """Return the measurements, and the meshes in files."""
    from riemhuman.bodies import BodyModel
    from riemhuman.datasets import RegisteredMeshes
    from riemhuman.measurements import Measurements, open_measurements
    from riemhuman.surfaces.template import Template

    if options.definitions is not None and options.model is None:
        raise ArgumentError("--definitions JSON needs --model NPZ")
    meshes = RegisteredMeshes(files, scale=None, unit=options.unit, up=options.up)
    template = Template(meshes[0], meshes.faces)
    if options.model is not None:
        model = BodyModel.from_file(options.model)
        model.template.check_faces(meshes.faces, str(files[0]))
        own = Measurements(model, options.definitions)
    else:
        found = open_measurements(template)
        if found is None:
            raise ArgumentError(
                f"{files[0]} has {template.n_vertices} vertices and {template.n_faces} triangles, "
                "not those of the open body model; register it, or give --model and --definitions"
            )
        own = Measurements(found)
    if options.only:
        own = Measurements(own.definitions, options.only)
    return own, meshes[:]


def _draw(path: Path, own: Measurements, surface: ndarray, axes: str) -> None:
    from riemhuman.io.files import atomic_file
    from riemhuman.plots._figures import figure_style
    from riemhuman.plots.body_plots import plot_measurement_lines

    with figure_style():
        figure = plot_measurement_lines(
            surface, own.definitions.faces, own.tapes(surface, axes=axes)
        )
        with atomic_file(path) as neighbour:
            figure.savefig(neighbour, dpi=200, facecolor="white")


def _say_table(files: Sequence[Path], measured: MeasuredBodies) -> None:
    width = max(map(len, measured.names))
    shown = files[:_MOST_COLUMNS]
    columns = [max(9, len(file.stem)) for file in shown]
    titles = " ".join(f"{f.stem:>{w}}" for f, w in zip(shown, columns, strict=True))
    say(f"{'':{width}}  {titles}")
    for number, (name, unit) in enumerate(zip(measured.names, measured.units, strict=True)):
        values = measured.values[: len(shown), number]
        said = " ".join(f"{v:{w}.4f}" for v, w in zip(values, columns, strict=True))
        say(f"{name:{width}}  {said} {unit}")
    if len(files) > len(shown):
        say(f"and {len(files) - len(shown)} more bodies; -o CSV writes all")
