"""The verb ``report``: a page with the paper's experiments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.body_sets import add_body_sets, check_body_sets, read_body_set
from riemhuman.cli.inputs import path_argument
from riemhuman.cli.terminal import Reporter, say
from riemhuman.cli.verbs import Verbs, add_verb

if TYPE_CHECKING:
    from riemhuman.surfaces.deformation_basis import DeformationBasis

_N_COMPONENTS = 100


def add_verbs(verbs: Verbs) -> None:
    """Declare ``report``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "report",
        _report,
        "a page with the paper's experiments",
        "Repeats the paper's experiments and writes a report into a folder: index.html, which\n"
        "needs no network connection, figures, tables, matrices and their provenance. The default\n"
        "data are the open bodies that ship with the package. Results of an earlier run are\n"
        "reused.",
        "  riemhuman report\n"
        "  riemhuman report --quick -o quick-report\n"
        "  riemhuman report --open natural -o natural-report\n"
        "  riemhuman report --faust ~/MPI-FAUST --dfaust registrations_m.hdf5 -o faust-report\n"
        "  riemhuman report --bodies scans/ --labels scans/labels.csv -o scans-report\n",
    )
    add_body_sets(parser)
    parser.add_argument(
        "--dfaust", metavar="FILE", help="motions of Dynamic FAUST for the basis of geodesics"
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        type=path_argument,
        default=Path("riemhuman-report"),
        help="folder to write (default: riemhuman-report)",
    )
    parser.add_argument(
        "--scans",
        metavar="FOLDER",
        type=path_argument,
        help="also show the scans that riemhuman register has registered into this folder",
    )
    parser.add_argument("--quick", action="store_true", help="a smaller report, in half a minute")


def _report(options: argparse.Namespace) -> None:
    from riemhuman.report import make_report

    check_body_sets(options)
    reporter = Reporter(options.quiet)
    with reporter.task("Loading the bodies"):
        resolution = "coarse" if options.quick else "full"
        bodies = read_body_set(options, resolution, bars=reporter.bars)
    basis = _basis(options, reporter)
    page = make_report(
        options.output,
        bodies=bodies,
        basis=basis,
        quick=options.quick,
        scans=options.scans,
        progress=reporter.task,
        bars=reporter.bars,
    )
    say(str(page))


def _basis(options: argparse.Namespace, reporter: Reporter) -> DeformationBasis | None:
    from riemhuman import datasets
    from riemhuman.surfaces.deformation_basis import DeformationBasis

    if options.dfaust is None:
        return None
    with reporter.task("Basis of Dynamic FAUST"):
        motions = datasets.load_dfaust(options.dfaust)
        return DeformationBasis.from_motions(motions, _N_COMPONENTS, progress=reporter.bars)
