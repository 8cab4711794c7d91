"""The verbs ``view``, ``plot`` and ``scores``."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from riemhuman.cli.inputs import add_units, meshes_named, path_argument, surfaces_in
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from pathlib import Path

    from numpy import ndarray

_PICTURES = (".png", ".svg", ".pdf")
_QUESTIONS = {"subject": "Who is it?", "pose": "How do they stand?"}


def add_verbs(verbs: Verbs) -> None:
    """Declare ``view``, ``plot`` and ``scores``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "view",
        _view,
        "an interactive page of bodies or of a path",
        "Writes a page for any browser, without a network connection: registered meshes side by\n"
        "side, or one after the other with --motion, or the path in an .npz file.",
        "  riemhuman view anna.ply ben.ply -o both.html\n"
        "  riemhuman view walk/ --motion -o walk.html\n"
        "  riemhuman view path.npz -o path.html --open\n",
    )
    parser.add_argument(
        "meshes", metavar="FILES", nargs="+", type=path_argument, help="meshes, folders, or an .npz"
    )
    add_output(parser, "HTML")
    parser.add_argument(
        "--motion", action="store_true", help="the meshes are the frames of one motion"
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
    parser.add_argument(
        "--any-scale",
        action="store_true",
        help="accept meshes of any size; by default, meshes in another unit are refused",
    )
    add_units(parser)
    parser.set_defaults(template=None, align=False)

    parser = add_verb(
        verbs,
        "plot",
        _plot,
        "a map of a distance matrix",
        "Draws the meshes of a distance matrix, see riemhuman matrix, as points in the plane by\n"
        "multidimensional scaling, or by t-SNE, which preserves neighbourhoods.",
        "  riemhuman plot D.npz -o map.png\n"
        "  riemhuman plot D.npz --labels labels.csv -o people.svg\n"
        "  riemhuman plot D.npz --labels labels.csv --by pose --method t-sne -o poses.pdf\n",
    )
    _add_matrix(parser, required=False)
    add_output(parser, "FILE", "picture to write: .png, .svg or .pdf")
    parser.add_argument(
        "--by",
        choices=tuple(_QUESTIONS),
        default="subject",
        help="label that the colours show (default: subject)",
    )
    parser.add_argument(
        "--method",
        choices=("mds", "t-sne"),
        default="mds",
        help="method that places the points (default: mds)",
    )

    parser = add_verb(
        verbs,
        "scores",
        _scores,
        "how well a distance matrix finds people and poses",
        "Prints how many of the nearest meshes share the person, and how many share the pose:\n"
        "nearest neighbour (NN), first and second tier (FT, ST) and mean average precision\n"
        "(mAP), per cent.",
        "  riemhuman scores D.npz --labels labels.csv\n"
        "  riemhuman scores D.npz --labels labels.csv --json\n",
    )
    _add_matrix(parser, required=True)
    add_json(parser)


def _add_matrix(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument(
        "matrix", metavar="NPZ", type=path_argument, help="distance matrix, see riemhuman matrix"
    )
    parser.add_argument(
        "--labels",
        metavar="CSV",
        required=required,
        type=path_argument,
        help="table with the columns file, subject and pose",
    )
    parser.add_argument(
        "--allow-missing",
        action="store_true",
        help="leave out meshes without labels, and labels without a mesh",
    )


def _view(options: argparse.Namespace) -> None:
    import webbrowser

    from riemhuman.io.arrays import load_arrays
    from riemhuman.plots.viewer import view_bodies, view_path

    check_output_file(options.output, [".html"], force=options.force)
    reporter = Reporter(options.quiet)
    first = options.meshes[0]
    with reporter.task("Page"):
        if first.suffix.lower() == ".npz":
            if len(options.meshes) > 1:
                raise ArgumentError("give either one .npz file with a path, or meshes")
            arrays = load_arrays(first, ["path", "faces"])
            title = f"Path in {first.name}"
            viewer = view_path(arrays["path"], arrays["faces"], title=title)
        else:
            files = meshes_named(options.meshes)
            surfaces = surfaces_in(files, options)
            faces = surfaces.template.faces
            if options.motion:
                title = f"{files[0].name} to {files[-1].name}"
                viewer = view_path(surfaces[:], faces, title=title)
            else:
                names = [file.stem for file in files]
                title = ", ".join(names[:3]) + (" …" if len(names) > 3 else "")
                viewer = view_bodies(surfaces[:], faces, names, title=title)
        viewer.save(options.output)
    if options.open:
        webbrowser.open(options.output.resolve().as_uri())
    say(str(options.output))


def _plot(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.io.files import atomic_file
    from riemhuman.optional import import_optional
    from riemhuman.plots._figures import figure_style, new_figure
    from riemhuman.plots.maps import embed, plot_embedding, stress

    check_output_file(options.output, _PICTURES, force=options.force)
    import_optional("matplotlib", "plot")
    if options.labels is None:
        distances, names = _matrix(options.matrix)
        labels = ["meshes"] * len(names)
    else:
        distances, both = _labelled_matrix(options)
        labels = both[options.by]
    classes, items = np.unique(labels, return_inverse=True)
    positions = embed(distances, options.method)
    is_scaled = options.method == "mds"
    with figure_style():
        figure = new_figure(6.0, 4.6)
        plot_embedding(
            positions,
            items,
            [str(name) for name in classes],
            unit="m" if is_scaled else None,
            ax=figure.subplots(),
        )
        with atomic_file(options.output) as neighbour:
            figure.savefig(
                neighbour, dpi=200, facecolor="white", format=options.output.suffix[1:].lower()
            )
    say(f"{len(labels)} meshes, {options.method}")
    if is_scaled:
        say(f"stress      {stress(distances, positions):.3f}  (0 would preserve all distances)")
    say(f"written to  {options.output}")


def _scores(options: argparse.Namespace) -> None:
    from riemhuman.retrieval import scores

    distances, both = _labelled_matrix(options)
    found = {
        name: scores(distances, labels)
        for name, labels in both.items()
        if len(set(labels)) < len(labels)
    }
    if not found:
        raise ArgumentError(f"{options.labels}: no two meshes share a subject or a pose")
    if options.json:
        say_json({name: asdict(each) for name, each in found.items()})
        return
    say(f"{'':<20}{'NN':>8}{'FT':>8}{'ST':>8}{'mAP':>8}")
    for name, each in found.items():
        values = (each.nn, each.first_tier, each.second_tier, each.mean_average_precision)
        say(f"{_QUESTIONS[name]:<20}{''.join(f'{value:8.1f}' for value in values)}")


def _matrix(path: Path) -> tuple[ndarray, list[str]]:
    from riemhuman.io.arrays import load_arrays

    arrays: dict[str, Any] = load_arrays(path, ["distances", "names"])
    distances, names = arrays["distances"], [str(name) for name in arrays["names"]]
    if distances.shape != (len(names), len(names)):
        raise FileFormatError(
            f"{path}: distances must be a matrix with a row and a column for each of its "
            f"{len(names)} names; found shape {distances.shape}"
        )
    return distances, names


def _labelled_matrix(options: argparse.Namespace) -> tuple[ndarray, dict[str, list[str]]]:
    """Return the distances between the meshes with labels, and their labels."""
    from riemhuman.datasets import read_labels

    distances, names = _matrix(options.matrix)
    kept, labels = read_labels(options.labels, names, allow_missing=options.allow_missing)
    return distances[kept][:, kept], labels
