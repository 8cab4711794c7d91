"""The options for labelled bodies: the open bodies, MPI FAUST, or a folder."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import add_units, path_argument
from riemhuman.errors import ArgumentError
from riemhuman.extensions import extension

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies


def add_body_sets(parser: argparse.ArgumentParser) -> None:
    """Declare the options that choose labelled bodies.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The verb's parser.
    """
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--open",
        choices=("plain", "natural"),
        help="open bodies of the body model alone (plain, the default), or with individual poses, "
        "self-contact and soft tissue (natural)",
    )
    source.add_argument(
        "--faust",
        metavar="FOLDER",
        help="use the registrations of MPI FAUST (tr_reg_000.ply ... tr_reg_099.ply) instead",
    )
    source.add_argument(
        "--bodies",
        metavar="FOLDER",
        help="use the registered meshes of a folder instead; see --labels",
    )
    source.add_argument(
        "--reader",
        nargs=2,
        metavar=("NAME", "PATH"),
        help="use the bodies that another package's reader loads, see riemhuman.extensions",
    )
    parser.add_argument(
        "--people",
        metavar="SEED",
        type=int,
        help="open bodies of ten other people, drawn at random with this seed",
    )
    parser.add_argument(
        "--labels",
        metavar="CSV",
        help="with --bodies: a table with the columns file, subject and pose "
        "(default: labels.csv in the folder)",
    )
    parser.add_argument(
        "--template",
        metavar="MESH",
        type=path_argument,
        help="with --faust or --bodies: template mesh (default: the first mesh)",
    )
    parser.add_argument(
        "--allow-missing",
        action="store_true",
        help="with --faust or --bodies: leave out bodies without a file or a label",
    )
    add_units(parser)


def check_body_sets(options: argparse.Namespace) -> None:
    """Refuse options that cannot be combined.

    Parameters
    ----------
    options : argparse.Namespace
        The command line.

    Raises
    ------
    ArgumentError
        If an option does not apply to the chosen bodies, or no package has the named reader.
    """
    if options.labels is not None and options.bodies is None:
        raise ArgumentError("--labels needs --bodies FOLDER")
    if options.faust is None and options.bodies is None:
        given = [name for name in ("template", "allow_missing") if getattr(options, name)]
        if given:
            raise ArgumentError(f"--{given[0].replace('_', '-')} needs --faust or --bodies FOLDER")
    if options.bodies is None and (options.unit or options.up):
        raise ArgumentError("--unit and --up need --bodies FOLDER")
    others = (options.bodies, options.faust, options.reader)
    if options.people is not None and any(other is not None for other in others):
        raise ArgumentError("--people SEED is for the open bodies")
    if options.reader is not None:
        extension("readers", options.reader[0])


def read_body_set(options: argparse.Namespace, resolution: str, *, bars: bool = False) -> Bodies:
    """Return the bodies that the options choose.

    Parameters
    ----------
    options : argparse.Namespace
        The command line.
    resolution : {"full", "coarse"}
        Resolution of the open bodies.
    bars : bool
        Whether to show progress bars.

    Returns
    -------
    bodies : Bodies
    """
    from riemhuman import datasets

    if options.faust is not None:
        return datasets.load_faust(
            options.faust, options.template, allow_missing=options.allow_missing
        )
    if options.bodies is not None:
        return datasets.load_bodies(
            options.bodies,
            options.labels,
            options.template,
            unit=options.unit,
            up=options.up,
            allow_missing=options.allow_missing,
            progress=bars,
        )
    if options.reader is not None:
        name, path = options.reader
        bodies = extension("readers", name)(path)
        report = datasets.check_dataset(bodies)
        if not report.passed:
            raise ArgumentError(f"--reader {name} returns unusable bodies. {report}")
        return bodies
    return datasets.load_open_bodies(resolution, options.open or "plain", options.people)
