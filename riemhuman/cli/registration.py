"""The verb ``register``: bodies that share one triangulation, from scans."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import AXES, UNITS, path_argument
from riemhuman.cli.terminal import Reporter, note, say
from riemhuman.cli.verbs import Verbs, add_output, add_verb
from riemhuman.errors import ArgumentError, FileError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from riemhuman.registration import ScanRegistration

_ENDINGS = (".ply", ".obj", ".off")


def add_verbs(verbs: Verbs) -> None:
    """Declare ``register``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "register",
        _register,
        "registered bodies from raw scans",
        "Fits a body model to a scan (a mesh or loose points: PLY, OBJ, OFF, XYZ or NPY),\n"
        "with or without landmarks, and writes the body in the model's triangulation.\n"
        "For a folder, it registers every scan, and index.html shows the results, the\n"
        "worst first. It does not write a body that it does not trust; for a folder, such\n"
        "bodies go to untrusted/. After an interruption, the same command continues.",
        "  riemhuman register scan.ply -o body.ply\n"
        "  riemhuman register scans/ -o bodies/\n"
        "  riemhuman register scans/ -o bodies/ --sequence --up z --unit millimetres\n"
        "  riemhuman register scan.obj -o body.ply --model SMPL_NEUTRAL.npz\n"
        "  riemhuman register scan.ply -o body.ply --landmarks joints.csv\n",
    )
    parser.add_argument("scans", metavar="SCAN", type=path_argument, help="a scan or a folder")
    add_output(parser, "BODY", "mesh to write, or folder of meshes")
    parser.add_argument(
        "--model", metavar="FILE", type=path_argument, help="body model (default: the open one)"
    )
    parser.add_argument(
        "--coarse",
        action="store_true",
        help="use the open model with 1,202 vertices (faster)",
    )
    parser.add_argument("--unit", choices=UNITS, help="unit of the scans (default: by their size)")
    parser.add_argument(
        "--up", choices=AXES, help="axis that points up in the scans (default: found by the fit)"
    )
    parser.add_argument(
        "--landmarks",
        metavar="CSV",
        type=path_argument,
        help="places of joints in the scan, in its unit, where the fit alone goes wrong: lines "
        "such as left_wrist,0.62,1.31,0.05",
    )
    parser.add_argument(
        "--sequence",
        action="store_true",
        help="the scans show one person in motion; each fit starts from the previous one",
    )
    parser.add_argument(
        "--untrusted", action="store_true", help="also write a body that is not trusted"
    )


def _register(options: argparse.Namespace) -> None:
    if options.model is not None and options.coarse:
        raise ArgumentError("--coarse cannot be combined with --model; leave out one")
    if options.scans.is_dir():
        _register_folder(options)
        return
    if options.sequence:
        raise ArgumentError(f"--sequence needs a folder of scans; {options.scans} is not a folder")
    _register_file(options)


def _registration(options: argparse.Namespace) -> ScanRegistration:
    from riemhuman.bodies import BodyModel
    from riemhuman.datasets import load_open_model
    from riemhuman.registration import ScanRegistration

    if options.model is not None:
        model = BodyModel.from_file(options.model)
    else:
        model = load_open_model("coarse" if options.coarse else "full")
    return ScanRegistration(model, unit=options.unit, up=options.up)


def _register_file(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.io.meshes import save_mesh
    from riemhuman.registration import load_landmarks, load_scan

    check_output_file(options.output, _ENDINGS, force=options.force)
    reporter = Reporter(options.quiet)
    scan = load_scan(options.scans, options.unit)
    landmarks = None if options.landmarks is None else load_landmarks(options.landmarks)
    registration = _registration(options)
    with reporter.task(f"Registering {len(scan):,} points"):
        result = registration.solve(scan, landmarks=landmarks)
    if not result.trusted:
        reason = f"{options.scans} is not registered: {result.message}"
        if not options.untrusted:
            raise ArgumentError(f"{reason}; --untrusted writes the body nevertheless")
        note(reason)
    save_mesh(options.output, result.points, registration.model.faces)
    distance = 1000.0 * np.median(result.distances[~result.background])
    say(
        f"{distance:.1f} mm from the scan in the median, {100 * result.matched.mean():.0f} % of "
        f"the vertices matched; scan in {result.unit}"
    )
    say(f"written to {options.output}, in metres")


def _register_folder(options: argparse.Namespace) -> None:
    from riemhuman.registration import register_folder
    from riemhuman.report.registered_scans import scan_page

    if options.untrusted:
        raise ArgumentError(
            "--untrusted is for one scan; for a folder, see untrusted/ in the output"
        )
    if options.landmarks is not None:
        raise ArgumentError("--landmarks is for one scan; register the scans one by one")
    output: Path = options.output
    if output.resolve() == options.scans.resolve():
        raise FileError(f"{output} holds the scans; name another folder for the bodies")
    reporter = Reporter(options.quiet)
    records = register_folder(
        _registration(options),
        options.scans,
        output,
        sequence=options.sequence,
        progress=reporter.bars,
    )
    with reporter.task("Page"):
        page = scan_page(output)
    for record in records:
        if not record.trusted:
            note(f"{record.name} is not trusted: {record.message}")
    trusted = sum(record.trusted for record in records)
    say(f"{trusted} of {len(records)} scans are registered in {output}")
    say(str(page))
