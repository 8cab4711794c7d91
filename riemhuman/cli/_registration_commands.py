"""The command ``register``."""

from __future__ import annotations

import argparse
from typing import Any

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, FileError


def _check_options(options: argparse.Namespace) -> None:
    """Raise an error if options do not fit each other, or the output could not be written."""
    from riemhuman.io.outputs import check_output_file

    if options.model is not None and options.coarse:
        raise ArgumentError("--coarse cannot be combined with --model; leave out one")
    if not options.scans.is_dir():
        if options.sequence:
            raise ArgumentError(
                f"--sequence needs a folder of scans; {options.scans} is not a folder"
            )
        check_output_file(options.output, cli.MESH_ENDINGS, force=options.force)
    elif options.untrusted:
        raise ArgumentError(
            "--untrusted is for one scan; for a folder, see untrusted/ in the output"
        )
    elif options.landmarks is not None:
        raise ArgumentError("--landmarks is for one scan; register the scans one by one")
    elif options.output.resolve() == options.scans.resolve():
        raise FileError(f"{options.output} holds the scans; name another folder for the bodies")
    options.written.append(options.output)


@cli.command(
    "register",
    "registered bodies from raw scans",
    "Fits a body model to a scan (a mesh or loose points: PLY, OBJ, OFF, STL, GLB, XYZ, NPY),\n"
    "with or without landmarks, and writes the body in the model's triangulation.\n"
    "For a folder, it registers every scan, and index.html shows the results, the\n"
    "worst first. It does not write a body that it does not trust, and the exit code is 1;\n"
    "for a folder, such bodies go to untrusted/, and those of scans that do not show all of the\n"
    "body to partial/. After an interruption, the same command continues.",
    "  riemhuman register scan.ply -o body.ply\n"
    "  riemhuman register scans/ -o bodies/\n"
    "  riemhuman register scans/ -o bodies/ --sequence --up z --unit millimetres\n"
    "  riemhuman register scan.obj -o body.ply --model SMPL_NEUTRAL.npz\n"
    "  riemhuman register scan.ply -o body.ply --landmarks joints.csv\n",
    cli.path_option("scans", "SCAN", "a scan or a folder"),
    cli.several(
        cli.path_option("-o --output", "BODY", "mesh to write, or folder of meshes", required=True),
        cli.FORCE,
        check=_check_options,
    ),
    cli.MODEL,
    cli.flag("--coarse", "use the open model with 1,202 vertices (faster)"),
    cli.option("--unit", "unit of the scans (default: by their size)", choices=cli.UNITS),
    cli.option(
        "--up", "axis that points up in the scans (default: found by the fit)", choices=cli.AXES
    ),
    cli.path_option(
        "--landmarks",
        "CSV",
        "places of joints in the scan, in its unit, where the fit alone goes wrong: lines such as"
        " left_wrist,0.62,1.31,0.05",
    ),
    cli.flag("--sequence", "the scans show one person in motion; fits start from previous ones"),
    cli.flag("--untrusted", "also write a body that is not trusted"),
    cli.flag("--keep-axes", "leave bodies where the scans are (default: on the ground, facing z)"),
)
def _register(options: argparse.Namespace) -> cli.Answer:
    if options.model is not None:
        model = rh.BodyModel.from_file(options.model)
    else:
        model = rh.datasets.load_open_model("coarse" if options.coarse else "full")
    registration = rh.registration.ScanRegistration(model, unit=options.unit, up=options.up)
    register = _register_folder if options.scans.is_dir() else _register_file
    return register(registration, options)


def _register_file(registration: Any, options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    landmarks = options.landmarks and rh.registration.load_landmarks(options.landmarks)
    scan = rh.registration.load_scan(options.scans, options.unit)
    with options.task(f"Registering {len(scan):,} points"):
        result = registration.solve(scan, landmarks=landmarks)
    record = {
        "scan": options.scans,
        "trusted": bool(result.trusted),
        "message": result.message,
        "median_distance": float(np.median(result.distances[~result.background])),
        "matched_share": float(result.matched.mean()),
        "unit": result.unit,
    }
    text = (
        f"{1000 * record['median_distance']:.1f} mm from the scan in the median, "
        f"{100 * record['matched_share']:.0f} % of the vertices matched; scan in {result.unit}, "
        "body in metres"
    )
    if not result.trusted:
        terminal.note(f"{options.scans} is not trusted: {result.message}")
        if not options.untrusted:
            text = "no body is written; --untrusted writes it nevertheless"
            return cli.Answer(text, record, trusted=False, written=False)
    elif result.message:
        terminal.note(f"{options.scans}: {result.message}")
    points = result.points if options.keep_axes else result.upright_points
    rh.save_mesh(options.output, points, registration.model.faces, result.trusted_vertices)
    return cli.Answer(text, record, trusted=bool(result.trusted))


def _register_folder(registration: Any, options: argparse.Namespace) -> cli.Answer:
    records = rh.registration.register_folder(
        registration,
        options.scans,
        options.output,
        sequence=options.sequence,
        keep_axes=options.keep_axes,
        progress=options.bars,
    )
    with options.task("Page"):
        page = rh.report.scan_page(options.output)
    for record in records:
        if record.message:
            terminal.note(
                f"{record.name}{'' if record.trusted else ' is not trusted'}: {record.message}"
            )
    n_trusted = sum(record.trusted for record in records)
    names = ("name", "trusted", "message", "median_distance", "matched_share")
    return cli.Answer(
        f"{n_trusted} of {len(records)} scans are registered and trusted; see {page}",
        {"scans": [{name: getattr(record, name) for name in names} for record in records]},
        trusted=n_trusted == len(records),
    )
