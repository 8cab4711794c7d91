"""The command ``register``."""

from __future__ import annotations

import argparse
from typing import Any

import riemhuman as rh
from riemhuman.cli._commands import (
    AXES,
    MODEL,
    UNITS,
    Answer,
    command,
    flag,
    option,
    output,
    path_option,
)
from riemhuman.cli._inputs import MESH_ENDINGS, check_file
from riemhuman.cli._terminal import note
from riemhuman.errors import ArgumentError, FileError


@command(
    "register",
    "registered bodies from raw scans",
    "Fits a body model to a scan (a mesh or loose points: PLY, OBJ, OFF, STL, GLB, XYZ, NPY),\n"
    "with or without landmarks, and writes the body in the model's triangulation.\n"
    "For a folder, it registers every scan, and index.html shows the results, the\n"
    "worst first. It does not write a body that it does not trust, and the exit code is 1;\n"
    "for a folder, such bodies go to untrusted/. After an interruption, the same command\n"
    "continues.",
    "  riemhuman register scan.ply -o body.ply\n"
    "  riemhuman register scans/ -o bodies/\n"
    "  riemhuman register scans/ -o bodies/ --sequence --up z --unit millimetres\n"
    "  riemhuman register scan.obj -o body.ply --model SMPL_NEUTRAL.npz\n"
    "  riemhuman register scan.ply -o body.ply --landmarks joints.csv\n",
    path_option("scans", "SCAN", "a scan or a folder"),
    output("BODY", "mesh to write, or folder of meshes"),
    MODEL,
    flag("--coarse", "use the open model with 1,202 vertices (faster)"),
    option("--unit", "unit of the scans (default: by their size)", choices=UNITS),
    option("--up", "axis that points up in the scans (default: found by the fit)", choices=AXES),
    path_option(
        "--landmarks",
        "CSV",
        "places of joints in the scan, in its unit, where the fit alone goes wrong: lines such as"
        " left_wrist,0.62,1.31,0.05",
    ),
    flag(
        "--sequence", "the scans show one person in motion; each fit starts from the previous one"
    ),
    flag("--untrusted", "also write a body that is not trusted"),
    flag(
        "--keep-axes",
        "write bodies at the positions of the scans (default: on the ground, y up, facing z)",
    ),
)
def _register(options: argparse.Namespace) -> Answer:
    if options.model is not None and options.coarse:
        raise ArgumentError("--coarse cannot be combined with --model; leave out one")
    if options.scans.is_dir():
        return _register_folder(options)
    if options.sequence:
        raise ArgumentError(f"--sequence needs a folder of scans; {options.scans} is not a folder")
    return _register_file(options)


def _registration(options: argparse.Namespace) -> Any:
    if options.model is not None:
        model = rh.BodyModel.from_file(options.model)
    else:
        model = rh.datasets.load_open_model("coarse" if options.coarse else "full")
    return rh.registration.ScanRegistration(model, unit=options.unit, up=options.up)


def _register_file(options: argparse.Namespace) -> Answer:
    import numpy as np

    check_file(options.output, MESH_ENDINGS, options)
    scan = rh.registration.load_scan(options.scans, options.unit)
    landmarks = options.landmarks and rh.registration.load_landmarks(options.landmarks)
    registration = _registration(options)
    with options.reporter.task(f"Registering {len(scan):,} points"):
        result = registration.solve(scan, landmarks=landmarks)
    if not result.trusted:
        note(f"{options.scans} is not trusted: {result.message}")
        if not options.untrusted:
            return Answer("no body is written; --untrusted writes it nevertheless", trusted=False)
    points = result.points if options.keep_axes else result.upright_points
    rh.save_mesh(options.output, points, registration.model.faces)
    distance = 1000.0 * np.median(result.distances[~result.background])
    return Answer(
        f"{distance:.1f} mm from the scan in the median, {100 * result.matched.mean():.0f} % of "
        f"the vertices matched; scan in {result.unit}\n"
        f"written to {options.output}, in metres",
        trusted=bool(result.trusted),
    )


def _register_folder(options: argparse.Namespace) -> Answer:
    if options.untrusted:
        raise ArgumentError(
            "--untrusted is for one scan; for a folder, see untrusted/ in the output"
        )
    if options.landmarks is not None:
        raise ArgumentError("--landmarks is for one scan; register the scans one by one")
    if options.output.resolve() == options.scans.resolve():
        raise FileError(f"{options.output} holds the scans; name another folder for the bodies")
    records = rh.registration.register_folder(
        _registration(options),
        options.scans,
        options.output,
        sequence=options.sequence,
        keep_axes=options.keep_axes,
        progress=options.reporter.bars,
    )
    with options.reporter.task("Page"):
        page = rh.report.scan_page(options.output)
    for record in records:
        if not record.trusted:
            note(f"{record.name} is not trusted: {record.message}")
    n_trusted = sum(record.trusted for record in records)
    return Answer(
        f"{n_trusted} of {len(records)} scans are registered in {options.output}\n{page}",
        trusted=n_trusted == len(records),
    )
