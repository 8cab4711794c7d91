"""The verbs ``dist``, ``matrix`` and ``retrieve``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.cli.bases import add_basis_options, chosen_basis
from riemhuman.cli.csv_files import csv_text
from riemhuman.cli.inputs import (
    add_template,
    path_argument,
    same_file,
    surfaces_in,
)
from riemhuman.cli.metrics import (
    add_align,
    add_metric_options,
    check_metric_options,
    chosen_metric,
    metric_name,
    metric_record,
)
from riemhuman.cli.terminal import Reporter, note, say, say_json
from riemhuman.cli.verbs import Verbs, add_force, add_json, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.io.outputs import check_output_file

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.geometry import SurfaceMetric
    from riemhuman.solvers import PathDistances

_N_NODES = 11  # surfaces of a path


def add_verbs(verbs: Verbs) -> None:
    """Declare ``dist``, ``matrix`` and ``retrieve``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    _add_dist(verbs)
    _add_matrix(verbs)
    _add_retrieve(verbs)


def _add_dist(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "dist",
        _dist,
        "distance between two registered meshes",
        "Prints the distance between two meshes that share one triangulation (PLY, OBJ, OFF).",
        "  riemhuman dist anna_1.ply ben_1.ply             # who it is\n"
        "  riemhuman dist anna_1.ply anna_2.ply --pose     # how they stand\n"
        "  riemhuman dist a.obj b.obj -a 1 -l 0.01 -c 0.5 --align --json\n",
    )
    parser.add_argument("a_file", metavar="A", type=path_argument, help="mesh file")
    parser.add_argument("b_file", metavar="B", type=path_argument, help="mesh file")
    add_template(parser, "A")
    add_align(parser)
    add_metric_options(parser)
    add_json(parser)


def _add_matrix(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "matrix",
        _matrix,
        "all distances within a folder of registered meshes",
        "Writes all distances between the meshes of a folder, with their names: an .npz file with\n"
        "the arrays distances (n, n), names (n,) and metric, a table (.csv), or both. With\n"
        "--paths, it also finds a path of least energy over a basis for every pair; the file\n"
        "then also has the array lengths (n, n), and the table shows lengths. The geodesic\n"
        "distance lies between the distance and the length.",
        "  riemhuman matrix scans/ -o D.npz\n"
        "  riemhuman matrix scans/ -o D.npz --csv D.csv --pose --align\n"
        "  riemhuman matrix thousands/ -o D.npz --resume work/     # run it again to go on\n"
        "  riemhuman matrix scans/ -o D.npz --paths --basis basis.npz -a 1 -l 1 -c 0.1\n"
        "  riemhuman matrix scans/ --csv - --quiet | column -s, -t\n",
    )
    parser.add_argument("folder", metavar="FOLDER", type=path_argument, help="folder of meshes")
    parser.add_argument("-o", "--output", metavar="NPZ", type=path_argument, help="file to write")
    parser.add_argument("--csv", metavar="CSV", help="table to write; - is standard output")
    parser.add_argument(
        "--jobs", metavar="N", type=int, default=-1, help="threads (default: one per core)"
    )
    parser.add_argument(
        "--precision",
        choices=("double", "single"),
        default="double",
        help="single is faster, with relative errors below 1e-5 (default: double)",
    )
    parser.add_argument(
        "--resume",
        metavar="FOLDER",
        type=path_argument,
        help="folder that keeps the work, to resume it after an interruption",
    )
    parser.add_argument("--paths", action="store_true", help="also find paths and their lengths")
    parser.add_argument(
        "--n-nodes",
        type=int,
        metavar="N",
        help=f"number of surfaces of a path (default: {_N_NODES})",
    )
    add_basis_options(parser)
    add_template(parser, "the first mesh")
    add_align(parser)
    add_metric_options(parser)
    add_json(parser)
    add_force(parser)


def _add_retrieve(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "retrieve",
        _retrieve,
        "the meshes of a folder nearest to a query",
        "Prints the meshes of a folder that are nearest to a query, nearest first: rank,\n"
        "distance and file. If the query is in the folder, it is skipped.",
        "  riemhuman retrieve anna_1.ply scans/            # the same person\n"
        "  riemhuman retrieve anna_1.ply scans/ --pose -k 10\n"
        "  riemhuman retrieve anna_1.ply scans/ -k 1 --json\n",
    )
    parser.add_argument("query", metavar="QUERY", type=path_argument, help="mesh file")
    parser.add_argument("folder", metavar="FOLDER", type=path_argument, help="folder of meshes")
    parser.add_argument(
        "-k", type=int, default=5, metavar="K", help="number of meshes to print (default: 5)"
    )
    add_template(parser, "QUERY")
    add_align(parser)
    add_metric_options(parser)
    add_json(parser)


def _dist(options: argparse.Namespace) -> None:
    check_metric_options(options)
    surfaces = surfaces_in([options.a_file, options.b_file], options)
    metric = chosen_metric(options, surfaces.template)
    distance = float(metric.dist(*surfaces[:]))
    if options.json:
        say_json(
            {
                "distance": distance,
                "metric": metric_record(metric),
                "files": [options.a_file, options.b_file],
                "template": options.template or options.a_file,
                "aligned": options.align,
            }
        )
    else:
        say(f"{distance:.10g}")


def _matrix(options: argparse.Namespace) -> None:
    from riemhuman.datasets import find_meshes
    from riemhuman.io.files import write_text

    check_metric_options(options)
    if options.output is None and options.csv is None:
        raise ArgumentError("nothing to write; give -o NPZ, --csv CSV, or both")
    if options.json and options.csv == "-":
        raise ArgumentError("--json and --csv - both write to standard output; leave one out")
    _check_paths(options)
    table = None if options.csv in (None, "-") else path_argument(options.csv)
    if options.output is not None:
        check_output_file(options.output, [".npz"], force=options.force)
    if table is not None:
        check_output_file(table, [".csv", ".tsv", ".txt"], force=options.force)

    reporter = Reporter(options.quiet)
    files = find_meshes(options.folder)
    surfaces = surfaces_in(files, options)
    metric = chosen_metric(options, surfaces.template)
    n_pairs = len(files) * (len(files) - 1) // 2
    found = _path_distances(metric, surfaces, options, reporter) if options.paths else None
    if found is None:
        with reporter.task(f"{n_pairs:,} distances, {metric_name(metric)}"):
            matrices = {"distances": _distances(metric, surfaces, options, reporter)}
    else:
        matrices = {"distances": found.bounds, "lengths": found.lengths}

    names = [file.name for file in files]
    shown = matrices["lengths" if options.paths else "distances"]
    if options.output is not None:
        _save_matrix(options.output, matrices, names, metric_name(metric))
    if table is not None:
        write_text(table, _as_table(shown, names))
    if options.csv == "-":
        say(_as_table(shown, names).rstrip("\n"))
    elif options.json:
        say_json({"names": names, **matrices, "metric": metric_record(metric)})
    else:
        say(f"{len(names)} meshes, {n_pairs:,} distances, {metric_name(metric)}")
        if found is not None:
            say(f"  {_excess(found)}; {found.message}")
        for path in filter(None, (options.output, table)):
            say(f"  {path}")


def _check_paths(options: argparse.Namespace) -> None:
    """Refuse options without effect."""
    of_paths = {"n_nodes": "--n-nodes", "basis": "--basis", "n_components": "--n-components"}
    for name, option in of_paths.items():
        if getattr(options, name) is not None and not options.paths:
            raise ArgumentError(f"{option} needs --paths; add that, or leave it out")
    if options.paths and options.precision != "double":
        raise ArgumentError(
            f"--precision {options.precision} cannot be combined with --paths; leave out one"
        )


def _distances(
    metric: SurfaceMetric, surfaces: Any, options: argparse.Namespace, reporter: Reporter
) -> ndarray:
    settings = {"precision": options.precision, "progress": reporter.bars}
    if options.resume is None:
        return metric.dist_pairwise(surfaces, options.jobs, **settings)
    from riemhuman.retrieval import pairwise_job

    try:
        return pairwise_job(metric, surfaces, options.resume, n_jobs=options.jobs, **settings)
    except KeyboardInterrupt:
        _note_kept(options)
        raise


def _path_distances(
    metric: SurfaceMetric, surfaces: Any, options: argparse.Namespace, reporter: Reporter
) -> PathDistances:
    from riemhuman.retrieval import path_job
    from riemhuman.solvers import BasisPath, path_distances

    if len(surfaces) < 2:
        raise ArgumentError(f"{options.folder} holds one mesh; paths need two")
    basis = chosen_basis(options, surfaces.template, reporter)
    n_nodes = _N_NODES if options.n_nodes is None else options.n_nodes
    solver, points = BasisPath(basis, n_nodes=n_nodes), surfaces[:]
    settings = {"n_jobs": options.jobs, "progress": reporter.bars}
    with reporter.task(f"Paths, {metric_name(metric)}"):
        if options.resume is None:
            return path_distances(solver, metric, points, **settings)
        try:
            return path_job(solver, metric, points, options.resume, **settings)
        except KeyboardInterrupt:
            _note_kept(options)
            raise


def _note_kept(options: argparse.Namespace) -> None:
    note(f"finished work is kept in {options.resume}; the same command continues it")


def _excess(found: PathDistances) -> str:
    """Return a sentence on how much longer paths are than distances."""
    import numpy as np

    excess = found.excess[np.isfinite(found.excess)]
    if not len(excess):
        return "all distances are zero under this metric"
    return (
        f"paths are longer than distances by {np.median(excess):.2f} % in the median, "
        f"{excess.max():.2f} % at most"
    )


def _save_matrix(path: Path, matrices: dict[str, ndarray], names: list[str], metric: str) -> None:
    import numpy as np

    from riemhuman.io.arrays import save_arrays

    arrays = {**matrices, "names": np.array(names), "metric": np.array(metric)}
    save_arrays(path, arrays)


def _as_table(distances: ndarray, names: list[str]) -> str:
    rows = zip(names, distances.tolist(), strict=True)
    return csv_text([["file", *names], *([name, *row] for name, row in rows)])


def _retrieve(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.datasets import find_meshes

    check_metric_options(options)
    if options.k < 1:
        raise ArgumentError(f"-k must be at least 1; found {options.k}")
    reporter = Reporter(options.quiet)
    files = [file for file in find_meshes(options.folder) if not same_file(file, options.query)]
    if not files:
        raise ArgumentError(f"{options.folder} holds no mesh other than the query")
    options.template = options.template or options.query
    query = surfaces_in([options.query], options)
    others: Any = surfaces_in(files, options)
    metric = chosen_metric(options, query.template)
    with reporter.task(f"{len(files):,} distances, {metric_name(metric)}"):
        (distances,) = metric.cdist(
            query[:], others, -1, precision="double", progress=reporter.bars
        )

    nearest = np.argsort(distances, kind="stable")[: options.k]
    if options.json:
        results = [{"file": files[i], "distance": distances[i]} for i in nearest]
        say_json({"query": options.query, "metric": metric_record(metric), "results": results})
        return
    for rank, i in enumerate(nearest, start=1):
        say(f"{rank:>3}  {distances[i]:.6f}  {files[i]}")
