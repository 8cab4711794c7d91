"""The verb ``geodesic``: a path between two bodies, as meshes, pictures, animation and page."""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from riemhuman.cli.bases import add_basis_options, chosen_basis
from riemhuman.cli.inputs import add_template, path_argument, surfaces_in
from riemhuman.cli.metrics import (
    PATH_METRIC,
    add_align,
    add_metric_options,
    check_metric_options,
    chosen_metric,
    metric_name,
    metric_record,
)
from riemhuman.cli.outputs import add_folder_or_file, checked_output
from riemhuman.cli.terminal import (
    Reporter,
    as_json,
    convergence,
    say,
    say_json,
)
from riemhuman.cli.verbs import Verbs, add_json, add_verb
from riemhuman.io.outputs import atomic_folder

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.geometry import SurfaceMetric
    from riemhuman.solvers import PathResult

_SUMMARY = "summary.json"
_DPI = 200

Write: TypeAlias = "Callable[[Path, ndarray, ndarray, str], None]"


def add_verbs(verbs: Verbs) -> None:
    """Declare ``geodesic``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "geodesic",
        _geodesic,
        "a path of least energy between two registered meshes",
        "Finds a path of least energy between two meshes over a basis of deformations.\n"
        "Writes a folder with the meshes time_00.ply, time_01.ply, ..., path.glb (an animation\n"
        "with morph targets, for Blender and web viewers), path.png (a filmstrip), path.html\n"
        "(an interactive page) and summary.json. If the output ends in .glb, .png, .html or\n"
        ".npz (the array path), writes only that file.",
        "  riemhuman geodesic sit.ply stand.ply -o path/\n"
        "  riemhuman geodesic sit.ply stand.ply -o path.glb --n-nodes 21\n"
        "  riemhuman geodesic a.ply b.ply -o path/ --basis basis.npz -a 1 -l 1 -c 0 --json\n",
    )
    parser.add_argument("a_file", metavar="A", type=path_argument, help="mesh to start from")
    parser.add_argument("b_file", metavar="B", type=path_argument, help="mesh to end at")
    add_folder_or_file(parser)
    parser.add_argument(
        "--n-nodes",
        type=int,
        default=11,
        metavar="N",
        help="surfaces of the path (default: 11)",
    )
    add_basis_options(parser)
    add_template(parser, "A")
    add_align(parser)
    add_metric_options(parser, PATH_METRIC)
    add_json(parser)


def _geodesic(options: argparse.Namespace) -> None:
    from riemhuman.protocols import uninterrupted
    from riemhuman.solvers import BasisPath

    check_metric_options(options)
    writers = _writers()
    output, single = checked_output(options, tuple(writers), _is_ours)
    for ending in [single] if single else writers:
        _check_dependency(ending)

    reporter = Reporter(options.quiet)
    surfaces = surfaces_in([options.a_file, options.b_file], options)
    metric = chosen_metric(options, surfaces.template)
    basis = chosen_basis(options, surfaces.template, reporter)
    solver = BasisPath(basis, n_nodes=options.n_nodes, progress=reporter.bars)
    start = time.perf_counter()
    with reporter.task(f"Geodesic, {metric_name(metric)}"):
        result = solver.solve(metric, *surfaces[:])
    uninterrupted(result)
    seconds = time.perf_counter() - start

    record = _record(options, metric, result, seconds)
    faces = surfaces.template.faces
    if single:
        writers[single](output, result.path, faces, _described(record, result))
    else:
        with atomic_folder(output, _is_ours) as folder:
            said = _described(record, result)
            _fill(folder, writers, result.path, faces, said, reporter)
            (folder / _SUMMARY).write_text(as_json(record) + "\n", encoding="utf-8")
    if options.json:
        say_json(record | {"output": output})
        return
    say(f"energy      {result.energy:.8g}")
    say(f"length      {record['length']:.8g}")
    say(f"distance    {record['distance']:.8g}  (a lower bound of the length)")
    say(f"converged   {convergence(result)}")
    say(f"written to  {output}")


def _record(
    options: argparse.Namespace, metric: SurfaceMetric, result: PathResult, seconds: float
) -> dict[str, Any]:
    return {
        "from": options.a_file,
        "to": options.b_file,
        "metric": metric_record(metric),
        "n_nodes": len(result.path),
        "energy": result.energy,
        "length": float(metric.length(result.path)),
        "distance": float(metric.dist(result.path[0], result.path[-1])),
        "energies": result.energies,
        "n_iterations": result.n_iterations,
        "converged": result.converged,
        "message": result.message,
        "seconds": seconds,
    }


def _described(record: dict[str, Any], result: PathResult) -> str:
    """Return the description of the path for its page."""
    weights = record["metric"]
    named = {"elastic": "(a, λ, c) = ({a:g}, {lam:g}, {c:g})"}.get(weights["name"], "{name}")
    return (
        f"From {record['from'].name} to {record['to'].name} in {record['n_nodes']} surfaces: "
        f"a path of least energy under the metric {named.format(**weights)}. Energy "
        f"{record['energy']:.4g}, length {record['length']:.4g}\u00a0m; no path is shorter than "
        f"{record['distance']:.4g}\u00a0m. Converged: {convergence(result)}."
    )


def _fill(
    folder: Path,
    writers: dict[str, Write],
    path: ndarray,
    faces: ndarray,
    said: str,
    reporter: Reporter,
) -> None:
    from riemhuman.io.meshes import save_mesh

    digits = max(2, len(str(len(path) - 1)))
    with reporter.task("Meshes"):
        for time_index, surface in enumerate(path):
            save_mesh(folder / f"time_{time_index:0{digits}d}.ply", surface, faces)
    for ending, name in ((".glb", "Animation"), (".png", "Filmstrip"), (".html", "Page")):
        with reporter.task(name):
            writers[ending](folder / f"path{ending}", path, faces, said)


def _writers() -> dict[str, Write]:
    return {".glb": _write_glb, ".png": _write_png, ".html": _write_html, ".npz": _write_npz}


def _write_glb(file: Path, path: ndarray, faces: ndarray, said: str) -> None:
    from riemhuman.io.gltf import save_glb

    save_glb(file, path, faces)


def _write_png(file: Path, path: ndarray, faces: ndarray, said: str) -> None:
    from riemhuman.io.files import atomic_file
    from riemhuman.plots import plot_path

    with atomic_file(file) as neighbour:
        plot_path(path, faces).figure.savefig(neighbour, dpi=_DPI)


def _write_html(file: Path, path: ndarray, faces: ndarray, said: str) -> None:
    from riemhuman.plots import view_path

    view_path(path, faces, title="Geodesic between two bodies", description=said).save(file)


def _write_npz(file: Path, path: ndarray, faces: ndarray, said: str) -> None:
    from riemhuman.io.arrays import save_arrays

    save_arrays(file, {"path": path, "faces": faces})


def _check_dependency(ending: str) -> None:
    """Refuse a picture before the work if it could not be drawn after it."""
    from riemhuman.optional import import_optional

    if ending == ".png":
        import_optional("matplotlib", "plot")


def _is_ours(name: str) -> bool:
    return bool(re.fullmatch(r"time_\d+\.ply|path\.(glb|png|html)", name)) or name == _SUMMARY
