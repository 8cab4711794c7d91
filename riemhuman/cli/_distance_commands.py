"""The commands ``dist``, ``matrix`` and ``retrieve``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import riemhuman as rh
from riemhuman.cli._commands import (
    ALIGN,
    FOLDER,
    FORCE,
    JSON,
    Answer,
    command,
    flag,
    mesh,
    option,
    path,
    path_option,
    template,
)
from riemhuman.cli._inputs import Surfaces, check_file, list_folder, read_surfaces, same_file
from riemhuman.cli._metric_options import (
    BASIS,
    check_metric,
    chosen_basis,
    chosen_metric,
    metric_name,
    metric_options,
    metric_record,
)
from riemhuman.cli._terminal import csv_text, matrix_rows, note
from riemhuman.errors import ArgumentError, RiemhumanError

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.solvers import PathDistances

_N_NODES = 11  # surfaces of a path
# Open bodies to which a distance is compared: some people in some poses.
_N_TYPICAL_PEOPLE, _N_TYPICAL_POSES = 5, 5


@command(
    "dist",
    "distance between two registered meshes",
    "Prints the distance between two meshes that share one triangulation (PLY, OBJ, OFF), and on\n"
    "standard error what distances are usual under the metric.",
    "  riemhuman dist anna_1.ply ben_1.ply             # who it is\n"
    "  riemhuman dist anna_1.ply anna_2.ply --pose     # how they stand\n"
    "  riemhuman dist a.obj b.obj -a 1 -l 0.01 -c 0.5 --align --json\n",
    mesh("a_file", "A"),
    mesh("b_file", "B"),
    template("A"),
    ALIGN,
    metric_options(),
    JSON,
)
def _dist(options: argparse.Namespace) -> Answer:
    check_metric(options)
    files = [options.a_file, options.b_file]
    surfaces = read_surfaces(files, options)
    metric = chosen_metric(options, surfaces.template)
    distance = float(metric.dist(*surfaces[:]))
    record = {
        "distance": distance,
        "metric": metric_record(metric),
        "files": files,
        "template": options.template or options.a_file,
        "aligned": options.align,
    }
    if not (options.quiet or options.json or options.any_scale):
        _note_typical_distances(options)
    return Answer(f"{distance:.10g}", record)


def _note_typical_distances(options: argparse.Namespace) -> None:
    """Say how far the open bodies are from each other under the metric."""
    import numpy as np

    bodies = rh.datasets.load_open_bodies("coarse")
    some = (bodies.subject < _N_TYPICAL_PEOPLE) & (bodies.pose < _N_TYPICAL_POSES)
    person, pose = bodies.subject[some], bodies.pose[some]
    try:
        distances = chosen_metric(options, bodies.template).dist_pairwise(bodies.points[some])
    except RiemhumanError:  # a metric of another package may not apply to them
        return
    same_person = person[:, None] == person
    same_pose = pose[:, None] == pose
    one_person = np.median(distances[same_person & ~same_pose])
    one_pose = np.median(distances[same_pose & ~same_person])
    note(
        f"among the open bodies, the same person in another pose is at about {one_person:.2g}, "
        f"another person in the same pose at about {one_pose:.2g}"
    )


@command(
    "matrix",
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
    FOLDER,
    path_option("-o --output", "NPZ", "file to write"),
    option("--csv", "table to write; - is standard output", metavar="CSV"),
    option("--jobs", "threads (default: one per core)", metavar="N", type=int, default=-1),
    option(
        "--precision",
        "single is faster, with relative errors below 1e-5",
        choices=("double", "single"),
        default="double",
    ),
    path_option(
        "--resume", "FOLDER", "folder that keeps the work, to resume it after an interruption"
    ),
    flag("--paths", "also find paths and their lengths"),
    option(
        "--n-nodes", f"number of surfaces of a path (default: {_N_NODES})", type=int, metavar="N"
    ),
    BASIS,
    template("the first mesh"),
    ALIGN,
    metric_options(),
    JSON,
    FORCE,
)
def _matrix(options: argparse.Namespace) -> Answer:
    import numpy as np

    from riemhuman.io.files import write_text

    check_metric(options)
    _check_matrix_options(options)
    table = None if options.csv in (None, "-") else path(options.csv)
    check_file(options.output, [".npz"], options)
    check_file(table, [".csv", ".tsv", ".txt"], options)
    surfaces = read_surfaces(list_folder(options.folder), options)
    metric = chosen_metric(options, surfaces.template)
    name = metric_name(metric)
    n_pairs = len(surfaces) * (len(surfaces) - 1) // 2
    paths = None
    try:
        if options.paths:
            paths = _path_distances(metric, surfaces, options)
            matrices = {"distances": paths.bounds, "lengths": paths.lengths}
        else:
            with options.reporter.task(f"{n_pairs:,} distances, {name}"):
                matrices = {"distances": _distances(metric, surfaces, options)}
    except KeyboardInterrupt:
        if options.resume is not None:
            note(f"finished work is kept in {options.resume}; the same command continues it")
        raise

    names = [file.name for file in surfaces.meshes.files]
    text = csv_text(matrix_rows(names, matrices["lengths" if options.paths else "distances"]))
    if options.output is not None:
        arrays = {**matrices, "names": np.array(names), "metric": np.array(name)}
        rh.io.save_arrays(options.output, arrays)
    if table is not None:
        write_text(table, text)
    record = {"names": names, **matrices, "metric": metric_record(metric)}
    if options.csv == "-":
        return Answer(text.rstrip("\n"), record)
    said = [f"{len(names)} meshes, {n_pairs:,} distances, {name}"]
    said += [] if paths is None else [f"  {_excess(paths)}; {paths.message}"]
    said += [f"  {file}" for file in (options.output, table) if file is not None]
    return Answer("\n".join(said), record)


def _check_matrix_options(options: argparse.Namespace) -> None:
    if options.output is None and options.csv is None:
        raise ArgumentError("nothing to write; give -o NPZ, --csv CSV, or both")
    if options.json and options.csv == "-":
        raise ArgumentError("--json and --csv - both write to standard output; leave one out")
    for name in ("n_nodes", "basis", "n_components"):
        if getattr(options, name) is not None and not options.paths:
            flag = name.replace("_", "-")
            raise ArgumentError(f"--{flag} needs --paths; add that, or leave it out")
    if options.paths and options.precision != "double":
        raise ArgumentError(
            f"--precision {options.precision} cannot be combined with --paths; leave out one"
        )


def _distances(metric: Any, surfaces: Surfaces, options: argparse.Namespace) -> ndarray:
    settings = {"precision": options.precision, "progress": options.reporter.bars}
    matrix: ndarray
    if options.resume is None:
        matrix = metric.dist_pairwise(surfaces, options.jobs, **settings)
    else:
        matrix = rh.retrieval.pairwise_job(
            metric, surfaces, options.resume, n_jobs=options.jobs, **settings
        )
    return matrix


def _path_distances(metric: Any, surfaces: Surfaces, options: argparse.Namespace) -> PathDistances:
    if len(surfaces) < 2:
        raise ArgumentError(f"{options.folder} holds one mesh; paths need two")
    basis = chosen_basis(options, surfaces.template)
    n_nodes = _N_NODES if options.n_nodes is None else options.n_nodes
    solver, points = rh.solvers.BasisPath(basis, n_nodes=n_nodes), surfaces[:]
    settings = {"n_jobs": options.jobs, "progress": options.reporter.bars}
    paths: PathDistances
    with options.reporter.task(f"Paths, {metric_name(metric)}"):
        if options.resume is None:
            paths = rh.solvers.path_distances(solver, metric, points, **settings)
        else:
            paths = rh.retrieval.path_job(solver, metric, points, options.resume, **settings)
    return paths


def _excess(paths: PathDistances) -> str:
    """Return a sentence on how much longer paths are than distances."""
    import numpy as np

    excess = paths.excess[np.isfinite(paths.excess)]
    if not len(excess):
        return "all distances are zero under this metric"
    return (
        f"paths are longer than distances by {np.median(excess):.2f} % in the median, "
        f"{excess.max():.2f} % at most"
    )


@command(
    "retrieve",
    "the meshes of a folder nearest to a query",
    "Prints the meshes of a folder that are nearest to a query, nearest first: rank,\n"
    "distance and file. If the query is in the folder, it is skipped.",
    "  riemhuman retrieve anna_1.ply scans/            # the same person\n"
    "  riemhuman retrieve anna_1.ply scans/ --pose -k 10\n"
    "  riemhuman retrieve anna_1.ply scans/ -k 1 --json\n",
    mesh("query", "QUERY"),
    FOLDER,
    option("-k", "number of meshes to print", default=5, metavar="K"),
    template("QUERY"),
    ALIGN,
    metric_options(),
    JSON,
)
def _retrieve(options: argparse.Namespace) -> Answer:
    import numpy as np

    check_metric(options)
    if options.k < 1:
        raise ArgumentError(f"-k must be at least 1; found {options.k}")
    files = [f for f in list_folder(options.folder) if not same_file(f, options.query)]
    if not files:
        raise ArgumentError(f"{options.folder} holds no mesh other than the query")
    options.template = options.template or options.query
    query = read_surfaces([options.query], options)
    meshes: Any = read_surfaces(files, options)
    metric = chosen_metric(options, query.template)
    with options.reporter.task(f"{len(files):,} distances, {metric_name(metric)}"):
        (distances,) = metric.cdist(
            query[:], meshes, -1, precision="double", progress=options.reporter.bars
        )
    nearest = np.argsort(distances, kind="stable")[: options.k]
    results = [{"file": files[i], "distance": distances[i]} for i in nearest]
    said = [f"{rank:>3}  {distances[i]:.6f}  {files[i]}" for rank, i in enumerate(nearest, start=1)]
    record = {"query": options.query, "metric": metric_record(metric), "results": results}
    return Answer("\n".join(said), record)
