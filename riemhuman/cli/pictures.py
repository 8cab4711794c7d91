"""Pictures of the bodies that verbs write: a PNG file or an interactive page."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import path_argument
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from numpy import ndarray

_ENDINGS = (".png", ".html")
_HEIGHT = 400


def add_picture(parser: argparse.ArgumentParser) -> None:
    """Declare the option for a picture of the result.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "--picture",
        metavar="FILE",
        type=path_argument,
        help="picture to write: .png, or .html for an interactive page",
    )


def check_picture(options: argparse.Namespace) -> None:
    """Refuse a picture before the work if it could not be written after it.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    """
    if options.picture is not None:
        check_output_file(options.picture, _ENDINGS, force=options.force)


def write_picture(
    path: Path | None, surfaces: Sequence[ndarray], faces: ndarray, names: Sequence[str], title: str
) -> None:
    """Write a picture of bodies side by side.

    Parameters
    ----------
    path : Path or None
        The file, with the ending .png or .html; if None, nothing is written.
    surfaces : sequence of array, each of shape (V, 3)
        Bodies; a PNG shows at most eight.
    faces : array of int, shape (F, 3)
        Triangles.
    names : sequence of str
        Labels of the bodies on a page.
    title : str
        Title of a page.
    """
    from riemhuman.io.files import atomic_file
    from riemhuman.plots._colors import SKIN
    from riemhuman.plots.rendering import View, png_bytes, strip_picture
    from riemhuman.plots.viewer import view_bodies

    if path is None:
        return
    if path.suffix.lower() == ".html":
        view_bodies(surfaces, faces, names, title=title).save(path)
        return
    picture = strip_picture(surfaces, faces, [SKIN] * len(surfaces), View(), _HEIGHT)
    with atomic_file(path) as neighbour:
        neighbour.write_bytes(png_bytes(picture))
