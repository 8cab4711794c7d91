"""The verb ``align``: Procrustes alignment of meshes."""

from __future__ import annotations

import argparse
from pathlib import Path

from riemhuman.cli.inputs import add_template, meshes_named, path_argument, surfaces_in
from riemhuman.cli.pictures import write_picture
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import atomic_folder, check_output_folder

_PICTURE = "aligned.html"
_MESHES = (".ply", ".obj", ".off")


def add_verbs(verbs: Verbs) -> None:
    """Declare ``align``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "align",
        _align,
        "registered meshes aligned with a template",
        "Rotates and translates meshes onto the template by Procrustes alignment, without\n"
        "scaling, and writes them under their names into a folder with a page that shows them.\n"
        "--unit and --up convert meshes to metres with y up.",
        "  riemhuman align scans/ -o aligned/\n"
        "  riemhuman align scans/ -o aligned/ --template anna.ply\n"
        "  riemhuman align scans/ -o aligned/ --unit millimetres --up z\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="mesh files, or folders"
    )
    add_output(parser, "FOLDER", "folder to write")
    add_template(parser, "the first mesh", "to align with")
    add_json(parser)
    parser.set_defaults(align=True)


def _align(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.io.meshes import save_mesh

    files = meshes_named(options.meshes)
    names = [file.name for file in files]
    if len(set(names)) < len(names):
        raise ArgumentError(
            "two meshes have the same name and would overwrite each other in the folder"
        )
    check_output_folder(options.output, _is_ours, force=options.force)
    reporter = Reporter(options.quiet)
    surfaces = surfaces_in(files, options)
    with reporter.task(f"Alignment of {len(files)} meshes"):
        points = surfaces[:]
    gaps = np.linalg.norm(points - surfaces.template.vertices, axis=-1)
    distances = np.sqrt((gaps**2).mean(axis=-1))
    with atomic_folder(options.output, _is_ours) as folder:
        for name, surface in zip(names, points, strict=True):
            save_mesh(folder / name, surface, surfaces.template.faces)
        titles = [file.stem for file in files]
        write_picture(
            folder / _PICTURE, list(points), surfaces.template.faces, titles, "Aligned meshes"
        )
    if options.json:
        say_json({"files": files, "root_mean_square": distances, "output": options.output})
        return
    for name, distance in zip(names, distances, strict=True):
        say(f"{distance:.6f}  {name}")
    say(f"written to {options.output}; root mean square distances from the template, in metres")


def _is_ours(name: str) -> bool:
    return name == _PICTURE or Path(name).suffix.lower() in _MESHES
