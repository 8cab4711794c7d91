"""The registered mesh files that verbs read, and their template."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.datasets import RegisteredMeshes
    from riemhuman.surfaces.template import Template


# Copies from `riemhuman.units` and `riemhuman.surfaces.upright`, whose import would slow down help.
UNITS = ("metres", "centimetres", "millimetres", "inches")
AXES = ("x", "y", "z", "-x", "-y", "-z")


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Registered surfaces in files, which are read and aligned when they are accessed.

    ``surfaces[i]`` has shape (V, 3), ``surfaces[i:j]`` has shape (j - i, V, 3).

    Attributes
    ----------
    meshes : RegisteredMeshes
        The files.
    template : Template
        Template of the surfaces.
    align : bool
        Whether to remove rigid motions.
    """

    meshes: RegisteredMeshes
    template: Template
    align: bool

    def __len__(self) -> int:
        return len(self.meshes)

    @overload
    def __getitem__(self, part: int) -> ndarray: ...
    @overload
    def __getitem__(self, part: slice) -> ndarray: ...
    def __getitem__(self, part: int | slice) -> ndarray:
        from riemhuman.surfaces.procrustes import procrustes

        points = self.meshes[part]
        if not self.align:
            return points
        return procrustes(points, to=self.template.vertices, scale=None)


def add_template(
    parser: argparse.ArgumentParser,
    default: str,
    use: str = "whose triangle areas weight the metric",
) -> None:
    """Declare the options for the template and the size of meshes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    default : str
        The default template, for the help text.
    use : str
        The use of the template, for the help text.
    """
    parser.add_argument(
        "--template",
        metavar="MESH",
        type=path_argument,
        help=f"template mesh, {use} (default: {default})",
    )
    parser.add_argument(
        "--any-scale",
        action="store_true",
        help="accept meshes of any size; by default, meshes in another unit are refused",
    )
    add_units(parser)


def add_units(parser: argparse.ArgumentParser) -> None:
    """Declare the options for the unit and the upward axis of meshes.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "--unit",
        choices=UNITS,
        help="unit of the files, to convert them to metres (default: no conversion)",
    )
    parser.add_argument("--up", choices=AXES, help="axis that points up in the files (default: y)")


def path_argument(text: str) -> Path:
    """Return the path that an argument names.

    Parameters
    ----------
    text : str
        The argument; ``~`` stands for the user's home.

    Returns
    -------
    Path
    """
    from riemhuman.io.files import file_path

    return file_path(text)


def meshes_named(paths: Sequence[Path]) -> list[Path]:
    """Return the mesh files that arguments name as files or folders.

    Parameters
    ----------
    paths : sequence of Path
        Files and folders.

    Returns
    -------
    list of Path
        Files in the order of the arguments; those of a folder are in natural order.
    """
    from riemhuman.datasets import find_meshes

    files: list[Path] = []
    for path in paths:
        files += find_meshes(path) if path.is_dir() else [path]
    return files


def surfaces_in(files: Sequence[Path], options: argparse.Namespace) -> Surfaces:
    """Return the surfaces in mesh files, with the template that the options choose.

    Parameters
    ----------
    files : sequence of Path
        Mesh files.
    options : argparse.Namespace
        Parsed options: `template`, by default the first file, `any_scale`, `align`, `unit`, `up`.

    Returns
    -------
    Surfaces
    """
    from riemhuman.datasets import RegisteredMeshes
    from riemhuman.surfaces.template import Template

    scale = None if options.any_scale else "template"
    units = {"unit": options.unit, "up": options.up}
    meshes = RegisteredMeshes(files, options.template, scale, **units)
    template = Template(meshes.reference, meshes.faces)
    return Surfaces(meshes, template, options.align)


def same_file(one: Path, other: Path) -> bool:
    """Return whether two paths lead to the same file.

    Parameters
    ----------
    one, other : Path
        The paths.

    Returns
    -------
    bool
    """
    return one.exists() and other.exists() and os.path.samefile(one, other)
